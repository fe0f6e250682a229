"""Subscriptions and heartbeats of clients."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from controller.loop.commands.client import Client
from controller.loop.commands.commanded_run import Playback
from controller.wire.command_socket import Address
from controller.wire.messages.commands import DeckCommand, Heartbeat, Subscribe
from controller.wire.messages.events import Event, EventKind

_MOST_LISTENERS = 64
_FORGOTTEN_AFTER = 60.0  # s that a subscriber over a network may be silent


@dataclass
class _Listener:
    """A client with a subscription or a heartbeat.

    Attributes:
        heard: time of its last command, s.
        within: s of silence after which the deck pauses; 0 for never.
    """

    client: Client
    heard: float
    subscribed: bool = False
    within: float = 0.0


class Listeners:
    """All listening clients of a deck.

    Args:
        deck: its source of events; it pauses when a heartbeat is missed.
    """

    def __init__(self, deck: Playback, now: Callable[[], float]) -> None:
        self._deck, self._now = deck, now
        self.known: dict[Address, _Listener] = {}
        self._number = 0

    def note(self, message: DeckCommand, client: Client) -> None:
        """Records a sign of life of a client, and its subscription or heartbeat."""
        listener = self.known.get(client.sender)
        if listener is None:
            if not isinstance(message, Subscribe | Heartbeat) or len(self.known) >= _MOST_LISTENERS:
                return
            listener = self.known[client.sender] = _Listener(client, 0.0)
        listener.client, listener.heard = client, self._now()
        if isinstance(message, Subscribe):
            listener.subscribed = True
        elif isinstance(message, Heartbeat):
            listener.within = message.within

    def tell(self, kind: EventKind, text: str, motion: str = "") -> None:
        """Sends an event of now to all subscribers."""
        self.send(Event(kind, text, motion, self._deck.time))

    def send(self, event: Event) -> None:
        """Sends an event to all subscribers, with the next number."""
        self._number += 1
        event = msgspec.structs.replace(event, number=self._number)
        for listener in self.known.values():
            if listener.subscribed:
                listener.client.reply(event)

    def check_heartbeats(self) -> None:
        """Pauses the deck when a heartbeat is missed, and forgets clients that are gone."""
        now = self._now()
        for sender, listener in [*self.known.items()]:
            gone = not listener.client.connected
            silent = now - listener.heard
            if listener.within and (gone or silent > listener.within):
                self._deck.pause()
                del self.known[sender]
                self.tell("lost", f"paused: a client has {'gone' if gone else f'been silent for {silent:.2f} s'}")
            elif gone or (listener.client.server.remote and silent > _FORGOTTEN_AFTER):
                del self.known[sender]
