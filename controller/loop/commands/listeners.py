"""What clients wait for: events, heartbeats, and second replies when a switch has settled or servos have replied."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import msgspec

from controller.deck.switch import CommandedSwitch
from controller.loop.commands.commanded_run import Outcome, refusal
from controller.loop.commands.interfaces import Client, Look, PlayableDeck
from controller.wire.command_socket import Address
from controller.wire.messages.commands import DeckCommand, Heartbeat, Subscribe
from controller.wire.messages.replies import Event, Refused, SecondReply, Settled

_MOST_LISTENERS = 64
_FORGOTTEN_AFTER = 60.0  # s that a subscriber over a network may be silent


@dataclass
class _Listener:
    """A client with a subscription or a heartbeat."""

    client: Client
    heard: float  # time of its last command, s
    subscribed: bool = False
    within: float = 0.0  # s of silence after which the deck pauses; 0 for never
    missed: bool = False  # whether the deck has paused for its silence; it may have been held up, and listens again


class Listeners:
    """All listening clients of a deck, its source of events, which pauses when a heartbeat is missed."""

    def __init__(self, deck: PlayableDeck, now: Callable[[], float], tell: Callable[[Event], None] | None) -> None:
        """`tell` gets every event."""
        self._deck, self._now, self._tell = deck, now, tell
        self.known: dict[Address, _Listener] = {}
        self._number = 0

    def note(self, message: DeckCommand, client: Client) -> None:
        """Records a sign of life of a client, and its subscription or heartbeat."""
        listener = self.known.get(client.sender)
        if listener is None:
            if not isinstance(message, Subscribe | Heartbeat) or len(self.known) >= _MOST_LISTENERS:
                return
            listener = self.known[client.sender] = _Listener(client, 0.0)
        listener.client, listener.heard, listener.missed = client, self._now(), False
        if isinstance(message, Subscribe):
            listener.subscribed = True
        elif isinstance(message, Heartbeat):
            listener.within = message.within

    def send(self, event: Event) -> None:
        """Sends an event to all subscribers, with the next number."""
        self._number += 1
        event = msgspec.structs.replace(event, number=self._number)
        if self._tell is not None:
            self._tell(event)
        for listener in self.known.values():
            if listener.subscribed:
                listener.client.reply(event)

    def check_heartbeats(self) -> None:
        """Pauses the deck when a heartbeat is missed, and forgets clients that are gone."""
        now = self._now()
        for sender, listener in [*self.known.items()]:
            gone = not listener.client.connected
            silent = now - listener.heard
            if listener.within and not listener.missed and (gone or silent > listener.within):
                self._deck.pause()
                listener.missed = True
                why = f"paused: a client has {'gone' if gone else f'been silent for {silent:.2f} s'}"
                self.send(Event("lost", why, at=self._deck.time))
            if gone or (listener.client.server.remote and silent > _FORGOTTEN_AFTER):
                del self.known[sender]


_LOOKED_WITHIN = 15.0  # s, for a look at servos
_MOST_AWAITED = 256  # switches, or looks, whose second reply is still to come


class SecondReplies:
    """Second replies that are pending."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        # Those under way, with client, number, motions and progress.
        self.switches: deque[tuple[Client, int, str, CommandedSwitch]] = deque(maxlen=_MOST_AWAITED)
        # Requests to servos, with client, number and start, s.
        self.looks: deque[tuple[Client, int, Look, float]] = deque(maxlen=_MOST_AWAITED)

    def expect(self, client: Client, message: DeckCommand, outcome: Outcome) -> None:
        """Replies once more when servos have replied, or a switch, a queued motion or a blend has settled."""
        if outcome.look is not None:
            self.looks.append((client, message.id, outcome.look, self._now()))
        if outcome.progress is not None:
            self.switches.append((client, message.id, " + ".join(message.motions), outcome.progress))

    def reply(self) -> None:
        """Replies for switches that have settled, were given up or overtaken, and with what servos have replied."""
        for _ in range(len(self.switches)):
            client, number, to, progress = waiting = self.switches.popleft()
            if progress.settled_s is not None:
                client.reply(Settled(to, progress.settled_s - progress.commanded_s, number))
            elif progress.fell_back:
                client.reply(Refused(progress.fell_back, number))
            elif progress.overtaken:
                client.reply(Refused(f"another command has overtaken {to}", number))
            else:
                self.switches.append(waiting)
        for _ in range(len(self.looks)):
            client, number, look, began = waiting = self.looks.popleft()
            answer: SecondReply | None
            try:
                answer = look()
            except Exception as error:
                answer = refusal(error, number)
            if answer is None and self._now() - began > _LOOKED_WITHIN:
                answer = Refused("the rig has not answered")
            if answer is None:
                self.looks.append(waiting)
            else:
                client.reply(msgspec.structs.replace(answer, id=number))
