"""The bridge: sends the commands of signals to a deck when they are due, and the deck's events to OSC."""

import heapq
import itertools
import select
import time
from collections.abc import Callable, Sequence

import msgspec

from controller.wire.command_socket import CommandClient
from controller.wire.local_transport import PeerGoneError, SocketError
from controller.wire.messages.arguments import AGO
from controller.wire.messages.commands import DeckCommand, EmergencyStop, GetStatus, GiveBeat, Subscribe
from controller.wire.messages.replies import Event, Reply, State
from motiondeck.stage.command_pattern import Notify, Signal
from motiondeck.stage.midi import MidiInput
from motiondeck.stage.osc import OscInput, OscOutput
from motiondeck.stage.tracker import TrackerInput

STATE_EVERY = 0.1  # the period of status requests, s
_SUBSCRIBED_FOR = 15.0  # s after which a subscription is renewed
_POLL = 0.01  # s between reads of the deck's replies
_MOST_WAITING = 256  # signals that are due later
_MOST_AT_ONCE = 32  # signals given before replies are read; a deck takes bursts of 40

Input = OscInput | MidiInput | TrackerInput
Answered = Callable[[str, DeckCommand, Reply], None]
"""Called with the source of a command, the command, and a reply to it."""


class Bridge:
    """Commands a deck by signals until the deck has ended; an output receives events and states.

    What is refused here, and changes of the lock, are passed to `notify` as lines of text. SocketError without a deck.
    """

    def __init__(
        self,
        client: CommandClient,
        inputs: Sequence[Input],
        output: OscOutput | None,
        answered: Answered,
        notify: Notify,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._client, self._inputs, self._output = client, inputs, output
        self._answered, self._notify, self._now = answered, notify, now
        self._waiting: list[tuple[float, int, Signal]] = []
        self._order = itertools.count()
        self._asked: dict[int, Signal] = {}
        self._ask_at, self._subscribe_at = now(), now() + _SUBSCRIBED_FOR
        self._lock = "none"
        client.post(Subscribe())

    def run(self) -> None:
        """Goes on until the deck has ended; SocketError if it is gone without a word, MidiGoneError if a device is."""
        while self.step(_POLL):
            pass

    def step(self, longest: float) -> bool:
        """Waits at most `longest` seconds for a signal and passes signals on; False when the deck has ended."""
        due = self._waiting[0][0] - self._now() if self._waiting else longest
        ready, _, _ = select.select(self._inputs, [], [], min(max(due, 0.0), longest))
        for signals in ready:
            for signal in signals.read(self._now()):
                self._take(signal)
        now = self._now()
        for _ in range(_MOST_AT_ONCE):
            if not (self._waiting and self._waiting[0][0] <= now):
                break
            self._give(heapq.heappop(self._waiting)[2], now)
        if not self._receive():
            return False
        if now >= self._subscribe_at:
            self._subscribe_at = now + _SUBSCRIBED_FOR
            self._post(Subscribe())
        if now >= self._ask_at:
            self._ask_at = now + STATE_EVERY
            self._post(GetStatus())
        return True

    def _take(self, signal: Signal) -> None:
        if isinstance(signal.command, EmergencyStop):
            self._give(signal, signal.due)
        elif len(self._waiting) < _MOST_WAITING:
            heapq.heappush(self._waiting, (signal.due, next(self._order), signal))
        else:
            self._notify(f"{signal.source}: too many commands at once, so it was left out")

    def _give(self, signal: Signal, now: float) -> None:
        command = signal.command
        if isinstance(command, GiveBeat):
            late = command.ago + now - signal.due
            if late > AGO.highest:
                return
            command = msgspec.structs.replace(command, ago=late)
        number = self._post(command)
        if number is None:
            return
        self._asked[number] = signal
        if len(self._asked) > _MOST_WAITING:
            del self._asked[next(iter(self._asked))]  # its reply was lost

    def _post(self, message: DeckCommand) -> int | None:
        """Sends a message; None, and what waits is left out, where the deck is held up."""
        try:
            return self._client.post(message)
        except PeerGoneError:
            raise
        except SocketError as error:
            self._notify(f"{error}, so what came meanwhile was left out")
            self._waiting.clear()
            return None

    def _receive(self) -> bool:
        """Passes on replies and events of the deck; False when it has ended."""
        while (reply := self._client.receive(0.0)) is not None:
            signal = self._asked.pop(reply.id, None)
            if signal is not None:
                self._answered(signal.source, signal.command, reply)
            elif isinstance(reply, State):
                lock = reply.lock.state if reply.lock is not None else "none"
                if lock != self._lock:
                    self._lock = lock
                    self._notify(str(reply.lock) if reply.lock is not None else "locked to nothing")
                if self._output is not None:
                    self._output.state(reply)
            elif isinstance(reply, Event):
                if self._output is not None:
                    self._output.event(reply)
                if reply.kind == "ended":
                    return False
        return True
