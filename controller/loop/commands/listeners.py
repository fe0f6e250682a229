"""Listeners: clients that are told what happens on a deck, or that have to be heard from."""

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
    """One of them.

    Attributes:
        client: how to reach it.
        heard: when it was last heard from, s.
        subscribed: whether it gets events.
        within: s of silence after which the deck pauses; 0 for never.
    """

    client: Client
    heard: float
    subscribed: bool = False
    within: float = 0.0


class Listeners:
    """All listeners of a deck.

    Args:
        deck: whose events they are, and what pauses when one is missed.
        now: a steady clock, s.

    Attributes:
        known: each by its address.
    """

    def __init__(self, deck: Playback, now: Callable[[], float]) -> None:
        self._deck, self._now = deck, now
        self.known: dict[Address, _Listener] = {}
        self._number = 0

    def hear(self, message: DeckCommand, client: Client) -> None:
        """Notes that a client was heard from, and what it wants to be told or not to be missed for."""
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
        """Tells all subscribers that something has happened now."""
        self.send(Event(kind, text, motion, self._deck.time))

    def send(self, event: Event) -> None:
        """Sends an event to all subscribers, with the next number."""
        self._number += 1
        event = msgspec.structs.replace(event, number=self._number)
        for listener in self.known.values():
            if listener.subscribed:
                listener.client.reply(event)

    def miss(self) -> None:
        """Pauses the deck if somebody is gone who had promised to be heard from, and forgets who is gone."""
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
