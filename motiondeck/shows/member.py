"""A deck's part in a show: reports its health, keeps the conductor's time, and carries out cues at their times.

It is a client of the deck in another process, like the prompt: the deck's loop never waits for a network. Phases
are kept in step by the deck's own lock to another deck (`controller/deck/locks`): the member answers its questions with
the phase of the show.
"""

import math
import os
import random
import select
import time
from collections.abc import Callable

import msgspec

from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages import commands
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.replies import Accepted, Event, PhaseNow, Refused, State
from motiondeck.shows import messages
from motiondeck.shows.clock_estimate import ClockEstimate, RoundTrip
from motiondeck.shows.known_stops import MOST_SENT, KnownStops, StopMemory
from motiondeck.shows.link import Link, StopRepeater
from motiondeck.shows.membership import CONDUCTOR
from motiondeck_base.mailbox import Mailbox

ASKS_EVERY = 0.25  # the mean period of requests for the conductor's time and the deck's state, s; shorter at first
LATEST = 0.25  # a cue that comes later than this is not carried out, s; the conductor then sends the sum of all cues
ALONE_AFTER = 10.0  # time without a conductor after which that is reported, and a deck that starts plays, s
_ASKS_FIRST, _FIRST = 0.05, 40  # so often, s, for the first questions; after them the time counts as known
_IRREGULAR = 0.6, 1.4
_PATIENCE = 1.0  # s for an answer
_WAITS_SILENTLY = 1.5  # s
_LISTENS = 0.4  # s after a conductor's first answer before the deck moves, for stops that it does not know yet
_REMEMBERED = 64  # emergency stops that were passed on

_THEN: dict[messages.Lost, str] = {
    "go on": "the deck plays on",
    "hold": "the deck pauses until it is back",
    "stop": "emergency stop of this deck",
}


class Member:
    """Serves one deck, which asks a leader for the phase of the show; `notify` receives lines for its user.

    The memory has the emergency stops that the deck was not reset from.
    """

    def __init__(
        self,
        name: str,
        about: messages.About,
        link: Link,
        deck: CommandClient,
        leader: CommandServer,
        notify: Callable[[str], None],
        now: Callable[[], float] = time.monotonic,
        memory: StopMemory | None = None,
    ) -> None:
        self._early = 0.5 / about.rate  # s before its time at which the deck may carry out a cue, in its nearest tick
        self._name, self._link, self._deck, self._leader = name, link, deck, leader
        self._notify, self._now, self._memory = notify, now, memory
        self._arrived = Mailbox[tuple[str, bytes]]()
        self._answers = Mailbox[tuple[float, float, bytes]]()
        self._clock, self._time = ClockEstimate(), messages.Time("", 0.0, "go on", 0.0)
        self._asked, self._ask_at, self._answered_at = 0, now(), now()
        self._lost = self._holds = self._reported_wait = self._reported_alone = False
        self._cues: list[messages.TimedCue] = []
        self._done = ("", 0)
        self._step: messages.CommonRound | None = None
        self._state: State | None = None
        self._problem, self._problems = "", 0
        self._stops = KnownStops()
        self._held: list[messages.EmergencyStopAll] = []  # those that the deck has carried out and was not reset from
        self._stopping: dict[int, messages.EmergencyStopAll | None] = {}  # what the deck has not accepted yet
        self._own_presses = self._passed_on = 0  # of the deck: those of this member, and the others as far as handled
        self._joined_at = now() + ALONE_AFTER  # until then a link opens even where a fifth of all packets is lost
        self._resumes_at = -math.inf
        self._stop_repeater = StopRepeater(link)
        self._commands: dict[int, str] = {}
        deck.post(commands.Subscribe())
        for key in ("cue", "stop"):
            link.subscribe(key, lambda key, data: self._arrived.put((key, data)))
        link.answer(f"deck/{name}", lambda: messages.encode(about))
        link.announce(f"deck/{name}")
        for stop in memory.read() if memory is not None else ():
            self._take_stop(stop)

    def step(self, longest: float) -> bool:
        """Handles messages for at most `longest` seconds; False when the deck has ended, SocketError if it is gone."""
        due = [self._ask_at, *(self._due(cue) for cue in self._cues), self._stop_repeater.due]
        wait = min(max(min(due) - self._now(), 0.0), longest)
        select.select([self._arrived, self._answers, self._leader, self._deck], [], [], wait)
        self._carry_out()
        for sent, received, data in self._answers.take():
            self._take_time(sent, received, data)
        for key, data in self._arrived.take():
            if key == "stop" and (stop := messages.read(data, messages.EmergencyStopAll)) is not None:
                self._take_stop(stop)
            cue = messages.read(data, messages.TimedCue) if key == "cue" else None
            if cue is not None and self._name in cue.decks and cue.run == self._time.run:
                self._take_cue(cue)
        self._carry_out()
        for message, sender in self._leader.poll():
            self._leader.reply(sender, self._reply(message))
        running = self._receive_from_deck()
        now = self._now()
        self._stop_repeater.step(now)
        if now >= self._ask_at:
            self._ask(now)
        self._check_conductor(now)
        return running

    def _reply(self, message: commands.DeckCommand) -> PhaseNow | Refused:
        """The first phase tells the deck that no standing stop is known, or that it was stopped."""
        if not isinstance(message, commands.GetPhase):
            return Refused("this is a show, not a deck", message.id)
        now = self._now()
        if now < self._joined_at:
            return Refused("the deck is still joining the show", message.id)
        if self._step is None or not self._clock.known:
            return PhaseNow("", None, None, message.id)
        return PhaseNow("", self._step.phase(self._clock.remote(now)), 1.0 / self._step.seconds, message.id, now)

    def close(self) -> None:
        """Leaves the show; the deck plays on."""
        self._link.close()
        self._arrived.close()
        self._answers.close()

    # The conductor's time.

    def _ask(self, now: float) -> None:
        self._asked += 1
        # Ticks of decks keep cores busy at the same times of every period. Questions at regular times could meet them
        # again and again on the way there and never on the way back, which looks like another clock.
        self._ask_at = now + (_ASKS_FIRST if self._asked < _FIRST else ASKS_EVERY) * random.uniform(*_IRREGULAR)
        sent = self._now()
        for stop in self._held:
            self._link.publish("stop", messages.encode(stop))
        self._link.ask("clock", lambda _, data: self._answers.put((sent, self._now(), data)), _PATIENCE)
        if self._asked % 5 == 0 or self._asked >= _FIRST:
            self._deck.post(commands.GetStatus())
            if self._clock.known:
                self._deck.post(commands.AlignTicks(now, self._clock.remote(now)))

    def _take_time(self, sent: float, received: float, data: bytes) -> None:
        answer = messages.read(data, messages.Time)
        if answer is None:
            return
        if not self._time.run:
            self._joined_at = min(self._joined_at, received + _LISTENS)
        for stop in answer.stops:
            if stop in self._stops or (stop.over and not self._time.run):  # it was over before this deck took part
                self._stops.add(stop)
            else:  # also one that is over stops a deck that was cut meanwhile
                self._take_stop(msgspec.structs.replace(stop, over=False))
        if answer.run != self._time.run:
            self._resumes_at = received + _LISTENS
            self._notify(f"the show has {'another' if self._time.run else 'a'} conductor")
            self._clock, self._cues, self._asked = ClockEstimate(), [], 0
            self._deck.post(commands.Heartbeat(answer.after if answer.lost != "go on" else 0.0))
        self._time = answer
        self._clock.take(RoundTrip(sent, answer.seconds, received))
        self._answered_at = received
        if self._lost:
            self._lost = False
            self._notify("the conductor is back")
        if self._holds and received >= self._resumes_at:
            self._holds = False
            self._deck.post(commands.Resume())

    def _check_conductor(self, now: float) -> None:
        time_now = self._time
        alone = 0.0 if time_now.run else now - self._answered_at
        if alone > _WAITS_SILENTLY and not self._reported_wait and now < self._joined_at:
            self._reported_wait = True
            self._notify(f"no conductor is heard yet; the deck waits for one up to {ALONE_AFTER:g} s before it moves")
        if alone > ALONE_AFTER and not self._reported_alone:
            self._reported_alone = True
            self._notify(
                f"no conductor has answered for {ALONE_AFTER:g} s: does it run, with certificates of one authority?"
            )
        if self._lost or not time_now.run or now - self._answered_at <= time_now.after:
            return
        self._lost = True
        self._notify(f"the conductor has not answered for {time_now.after:g} s; {_THEN[time_now.lost]}")
        plays = self._state is not None and self._state.mode == "playing" and not self._state.paused
        if time_now.lost == "hold" and plays:
            self._holds = True
            self._deck.post(commands.Pause())
        elif time_now.lost == "stop":
            self._stop_deck(None)

    # Cues.

    def _take_cue(self, cue: messages.TimedCue) -> None:
        """Gives the deck a cue ahead of its time: its loop is punctual, and this process may not get a core then."""
        late = self._now() - self._due(cue)
        if late > LATEST:
            self._note_problem(f"{cue.name} came {late:.1f} s late")
            return
        try:
            for command in cue.say:
                command.row.check_use("cue")
                command.check()
            self._give(cue)
        except CommandError as error:
            self._note_problem(f"{cue.name}: {error}")
            cue = msgspec.structs.replace(cue, say=[], step=None)
        self._cues.append(cue)

    def _carry_out(self) -> None:
        """Marks due cues as done; the phase that the deck is answered changes with them."""
        now = self._now()
        for cue in [cue for cue in self._cues if self._due(cue) <= now]:
            self._cues.remove(cue)
            self._step = _step_after(self._step, cue)
            self._done = max(self._done, (cue.run, cue.number)) if self._done[0] == cue.run else (cue.run, cue.number)

    def _due(self, cue: messages.TimedCue) -> float:
        """When a cue is carried out at the earliest, local time, s: half a tick before its time."""
        return self._clock.local(cue.at) - self._early

    def _give(self, cue: messages.TimedCue) -> None:
        step = self._step
        for earlier in self._cues:
            step = _step_after(step, earlier)
        if step is not None and cue.step is None and _plays(cue):
            self._post(commands.Unlock(), cue)
        for command in cue.say:
            self._post(command, cue)
        if cue.step is not None:
            self._post(commands.LockPhase("deck"), cue)

    def _post(self, command: commands.DeckCommand, cue: messages.TimedCue) -> None:
        timed = commands.AtTime(self._clock.local(cue.at), command)
        self._commands[self._deck.post(timed)] = cue.name
        if len(self._commands) > _REMEMBERED:
            del self._commands[next(iter(self._commands))]

    # The deck.

    def _receive_from_deck(self) -> bool:
        """Handles replies and events of the deck; False when it has ended."""
        happened = False
        while (reply := self._deck.receive(0.0)) is not None:
            if isinstance(reply, State):
                self._state = reply
                self._note_mode(reply.mode)
                self._publish_health(reply)
            elif isinstance(reply, Refused):
                whose = self._commands.pop(reply.id, "")
                self._note_problem(f"{whose}: {reply.reason}" if whose else reply.reason)
            elif isinstance(reply, Accepted):
                if reply.id in self._stopping:
                    self._own_presses += 1  # the next event counts it too
                    if (stop := self._stopping.pop(reply.id)) is not None:
                        self._hold([*self._held, stop])
            elif isinstance(reply, Event):
                if reply.kind == "ended":
                    return False
                if reply.kind == "mode":
                    self._note_mode(reply.text)
                    self._pass_on_stop(reply.presses)
                happened = True
        if happened:
            self._deck.post(commands.GetStatus())
        return True

    def _publish_health(self, state: State) -> None:
        now, clock, known = self._now(), self._clock, None
        if clock.known and self._asked >= _FIRST and not self._lost:
            known = messages.ClockHealth(1e3 * clock.uncertainty(now), 1e6 * clock.drift, clock.offset(now))
        health = messages.DeckHealth(
            run=self._done[0],
            cue=self._done[1],
            motion=state.motion,
            mode=state.mode,
            phase=state.phase,
            paused=state.paused,
            switching=state.switching,
            lock=str(state.lock) if state.lock is not None else "",
            clock=known,
            problem=self._problem,
            problems=self._problems,
            stops=[stop for stop in self._stops.latest if stop not in self._stopping.values()],
        )
        self._link.publish(f"health/{self._name}", messages.encode(health))

    def _note_problem(self, problem: str) -> None:
        self._problem, self._problems = problem, self._problems + 1
        self._notify(problem)

    # Emergency stops. One stands at the deck until it is reset there; meanwhile it is repeated for members and a
    # conductor that have not heard it.

    def _take_stop(self, stop: messages.EmergencyStopAll) -> None:
        """Stops the deck, and passes the stop on once: other members may have no link to its sender."""
        if not self._stops.add(stop):
            return
        self._stop_deck(stop)
        self._joined_at = self._now()
        self._notify(f"emergency stop by {'the conductor' if stop.by == CONDUCTOR else stop.by}")
        self._link.publish("stop", messages.encode(stop))

    def _note_mode(self, mode: str) -> None:
        if mode != "emergency stop" and self._held:
            self._hold([])

    def _hold(self, stops: list[messages.EmergencyStopAll]) -> None:
        self._held = stops[-MOST_SENT:]
        if self._memory is not None:
            self._memory.write(self._held)

    def _pass_on_stop(self, presses: int) -> None:
        """Makes an emergency stop that was commanded at the deck one of the show, a second one too."""
        others = presses - self._own_presses
        if others <= self._passed_on:
            return
        self._passed_on = others
        stop = messages.EmergencyStopAll(self._name, os.urandom(8).hex())
        self._stops.add(stop)
        self._hold([*self._held, stop])
        self._holds = False
        self._cues.clear()
        self._stop_repeater.start(stop, self._now())

    def _stop_deck(self, stop: messages.EmergencyStopAll | None) -> None:
        self._holds = False
        self._cues.clear()
        self._stopping[self._deck.post(commands.EmergencyStop())] = stop


def _plays(cue: messages.TimedCue) -> bool:
    return any(command.motions for command in cue.say)


def _step_after(step: messages.CommonRound | None, cue: messages.TimedCue) -> messages.CommonRound | None:
    """What loops keep step with after a cue; a tempo and an unlocking end the deck's lock."""
    if cue.step is not None:
        return cue.step
    ends = _plays(cue) or any(isinstance(command, commands.SetTempo | commands.Unlock) for command in cue.say)
    return None if ends else step
