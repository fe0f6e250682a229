"""Carries out the commands that arrive at sockets, replies, and sends events to subscribers."""

import time
from collections import deque
from collections.abc import Callable, Sequence

from controller.loop.commands.commanded_run import CommandedRun, mode_events
from controller.loop.commands.interfaces import Client
from controller.loop.commands.listeners import Listeners, SecondReplies
from controller.loop.stop_requests import StopRequest
from controller.wire.command_socket import Address, CommandServer
from controller.wire.messages.commands import AtTime, DeckCommand, EmergencyStop
from controller.wire.messages.deck_snapshot import Mode
from controller.wire.messages.replies import Accepted, Event, EventKind, Refused, Reply

_REMEMBERED = 16  # emergency stops


class CommandHandler:
    """Carries out what has arrived, once a tick; it never waits or raises.

    `note` gets each command and its reply, and `tell` each event.
    """

    def __init__(
        self,
        run: CommandedRun,
        servers: Sequence[CommandServer],
        note: Callable[[DeckCommand, Reply], None] | None = None,
        now: Callable[[], float] = time.monotonic,
        tell: Callable[[Event], None] | None = None,
    ) -> None:
        self._run, self._deck, self._body, self._timed = run, run.deck, run.body, run.timed
        self._servers, self._note = servers, note
        self._listeners = Listeners(run.deck, now, tell)
        self._second = SecondReplies(now)
        self._sent_mode: tuple[Mode, bool] = ("playing", run.deck.paused)
        self._presses = 0  # those of which events were sent
        self._repeated = 0  # those of a stop that came again, which counts as one
        self._seen = 0  # by the last call
        self._stops: deque[tuple[Address, int]] = deque(maxlen=_REMEMBERED)  # senders and numbers of the latest
        self._fallen = False

    def __call__(self, stop: StopRequest) -> None:
        """Carries out new commands, and sends what has happened since the last call."""
        if stop.state.total != self._seen:  # by presses that came by no command
            self._run.halt()
            if self._note is not None:
                self._note(EmergencyStop(), Accepted(0))
        for server in self._servers:
            for message, sender in server.poll():
                client = Client(server, sender)
                self._listeners.note(message, client)
                was_on = stop.emergency
                reply = self.carry_out(message, stop, client, remote=server.remote)
                if isinstance(message, EmergencyStop):
                    self._note_press(message, sender, was_on=was_on)
                if isinstance(message, AtTime) and isinstance(reply, Accepted):
                    self._timed.waiting.append((client, message))
                client.reply(reply)
        self._seen = stop.state.total
        if self._timed.waiting:
            self._carry_out_timed(stop)
        if self._second.switches or self._second.looks:
            self._second.reply()
        if self._listeners.known:
            self._listeners.check_heartbeats()
        events = self._deck.events
        while events:
            self._listeners.send(events.popleft())
        if self._body is not None and self._body.fallen != self._fallen:
            self._fallen = self._body.fallen
            kind, text = ("fell", "the robot has fallen") if self._fallen else ("stands", "the robot stands again")
            self.notify(kind, text, self._deck.motion)
        mode: tuple[Mode, bool] = stop.mode, self._deck.paused
        presses = stop.state.total - self._repeated
        if presses != self._presses or mode != self._sent_mode:
            pressed = presses != self._presses
            for event in mode_events(self._deck, stop.mode, self._sent_mode, presses, pressed=pressed):
                self._listeners.send(event)
            self._sent_mode, self._presses = mode, presses

    def _note_press(self, message: EmergencyStop, sender: Address, *, was_on: bool) -> None:
        """Tells a stop that comes again, as its reply was lost, from a second press; both were carried out."""
        press = sender, message.id
        if message.id and press in self._stops and was_on:
            self._repeated += 1
        else:
            self._stops.append(press)

    def notify(self, kind: EventKind, text: str, motion: str = "") -> None:
        """Sends an event to all subscribers."""
        self._listeners.send(Event(kind, text, motion, self._deck.time))

    def carry_out(
        self, message: DeckCommand, stop: StopRequest, client: Client | None = None, *, remote: bool = False
    ) -> Reply:
        """Carries out one command, of a client or of the run itself; its reply."""
        outcome = self._run.carry_out(message, stop, remote=remote)
        if self._note is not None:
            self._note(message, outcome.reply)
        if client is not None:
            self._second.expect(client, message, outcome)
        return outcome.reply

    def _carry_out_timed(self, stop: StopRequest) -> None:
        if stop.emergency:
            self._timed.waiting.clear()
        for client, message in self._timed.take_due():
            reply = self.carry_out(message, stop, client)
            if isinstance(reply, Refused):
                client.reply(reply)
