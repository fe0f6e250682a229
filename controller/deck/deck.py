"""The deck: plays a library's motions, switches them on command, and turns them into joint targets.

Each update follows the data: generator -> channels -> posture -> fade of the last switch -> root path -> pose ->
joints. The loop calls `update` once a tick, and commands in between. The deck decides what is played when; the
`performance` decides how it is played and how motions are joined.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence

from controller.deck.inputs import Inputs
from controller.deck.interfaces import Retargeter
from controller.deck.joins.joining import Joining
from controller.deck.lockable import Lockable
from controller.deck.locks.lock import LoopPlace
from controller.deck.performance import Performance
from controller.deck.routes import Routes
from controller.deck.switch import CommandedSwitch
from controller.library.motion_library import MotionLibrary
from controller.mocap.posture import Pose, Posture
from controller.networks.base import Activation
from controller.rotations import Array
from controller.wire.messages.arguments import PHASE, TEMPO
from controller.wire.messages.blends import MOST_BLENDED, blend_weights, described
from controller.wire.messages.events import Event, EventKind
from motiondeck_base.errors import MotiondeckError, UnknownNameError

__all__ = ["MOST_QUEUED", "REMEMBERED_SWITCHES", "CommandedSwitch", "Deck"]

REMEMBERED_SWITCHES = 1_000
REMEMBERED_EVENTS = 64
MOST_QUEUED = 32
_NO_WEIGHT = 1e-9


class Deck(Lockable):
    """Plays one library on one robot.

    Args:
        library: the motions.
        retarget: from the skeleton's poses to the robot's joints.
        motion: the motion to begin with.
        direct: whether every switch goes straight to its motion, at once.
        joining: how motions are joined; by default, what suits the network.
        phase: where in the motion to begin, in [0, 1).

    Attributes:
        motions: the names of all motions.
        direct: as given.
        time: s since the start, summed over updates.
        switches: the latest REMEMBERED_SWITCHES commanded switches.
        events: what has happened, at most REMEMBERED_EVENTS; whoever tells it takes it out.
        pose: the pose that is shown.
    """

    def __init__(
        self,
        library: MotionLibrary,
        retarget: Retargeter,
        motion: str,
        *,
        direct: bool = False,
        joining: Joining | None = None,
        phase: float = 0.0,
    ) -> None:
        self.motions = library.network.motions
        self._check(motion)
        self._retarget = retarget
        self._show = Performance(library, motion, joining, phase)
        routes = Routes.of(library)
        self._routes = routes.direct if direct else routes
        self.direct = direct
        self._current: CommandedSwitch | None = None  # the switch that is under way
        self._fading: CommandedSwitch | None = None  # the switch whose fade is under way
        self._blending: CommandedSwitch | None = None  # the switch whose blend weight is changing
        self._blended: CommandedSwitch | None = None  # the switch of the latest blend
        self._ahead: deque[str] = deque()  # the motions that the current switch has still to begin
        self._queued: deque[CommandedSwitch] = deque()
        self._waits = False  # whether the next of them waits for the end of the present motion
        usual = {motion.input.name: motion.input.usual for motion in library.info.motions if motion.input}
        self._inputs = Inputs(self._show.inputs, usual)
        for name, value in usual.items():
            self._show.set_input(name, value)  # motions that share an input begin alike
        self._jump: float | None = None  # the phase to go to in the next update
        self.time = 0.0
        self.switches: deque[CommandedSwitch] = deque(maxlen=REMEMBERED_SWITCHES)
        self.events: deque[Event] = deque(maxlen=REMEMBERED_EVENTS)
        super().__init__()
        self.pose = self._show.pose

    @property
    def motion(self) -> str:
        """The motion that is played or being switched to."""
        return self._current.to if self._current else self.playing

    @property
    def playing(self) -> str:
        """The motion that is played now, perhaps on the way to `motion`."""
        return self._show.here.name

    @property
    def posture(self) -> Posture:
        """The posture that is shown, in its own heading frame."""
        return self._show.posture

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        return self._current is None and not self._show.fading

    @property
    def activation(self) -> Activation | None:
        """The activation of the neurons of the network that plays, shape (N,); None if it has none to look at."""
        return self._show.activation

    @property
    def phase(self) -> float | None:
        """How far the motion is: [0, 1) in a loop, 0 to 1 in a one-shot; None if the network runs by itself."""
        return self._show.phase

    @property
    def inputs(self) -> dict[str, float]:
        """The present values of the inputs that motions have besides the phase."""
        return dict(self._inputs.present)

    @property
    def phase_rate(self) -> float | None:
        """How fast a loop turns, rounds a second, negative backwards; None for a one-shot or without a phase."""
        here = self._show.here
        return self.tempo / here.seconds if here.loop and self.phase is not None else None

    @property
    def blend(self) -> tuple[tuple[str, float], ...]:
        """The motions that are blended into the one that is played, each with its present weight."""
        return self._show.blend

    @property
    def fell_back(self) -> str:
        """Why the last blend was given up and what was played instead, or ""."""
        return self._blended.fell_back if self._blended else ""

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        return self._show.restarts

    @property
    def way(self) -> list[str]:
        """The motions that the switch under way has still to begin."""
        return [*self._ahead]

    @property
    def queue(self) -> list[str]:
        """The motions that are played after the present one."""
        return [switch.to for switch in self._queued]

    def switch(self, to: str, *, direct: bool = False) -> CommandedSwitch:
        """Starts a switch at the next update, or when the present one-shot has ended; the queue is cleared.

        A switch to the loop that is playing settles at once; a repeated command leaves the switch under way as it is.
        Where the motion is too far away, the switch goes by way of others.

        Args:
            to: the motion.
            direct: whether to go straight there at the next update, whatever is played.

        Raises:
            UnknownNameError: if there is no such motion; it names the nearest.
        """
        self._check(to)
        direct = direct or self.direct
        loop = self._show.motions[to].loop
        current = self._current
        if current is not None and (current.to, current.blend) == (to, ()) and loop and not (direct and self._ahead):
            self._mark_overtaken(self._queued)
            self._queued.clear()
            return current
        return self._command(CommandedSwitch(to, self.time), direct)

    def blend_in(
        self, first: str, second: str, weight: float, also: Sequence[tuple[str, float]] = ()
    ) -> CommandedSwitch:
        """Plays a blend of loops, which run side by side.

        The first is switched to if it is not playing, then the others are blended in; a motion whose weight comes to 0
        is dropped. From one blend to another that has a motion in common only the weights change, if there are no more
        than MOST_BLENDED motions in both.

        Args:
            first, second: motions.
            weight: the blend weight of the second, in [-0.3, 1.3]; beyond 0 and 1 one motion is exaggerated.
            also: further motions with their weights; then each weight is in [0, 1], and the first has the rest.

        Raises:
            UnknownNameError: if there is no such motion; it names the nearest.
            MotiondeckError: if they cannot be blended, and why.
        """
        for name in (first, second, *(name for name, _ in also)):
            self._check(name)
        weights = blend_weights(first, second, weight, also)
        if why := self._routes.why_not_blended([*weights]):
            raise MotiondeckError(why)
        if self.blend and self.playing in weights:
            first = self.playing
        blend = tuple((name, part) for name, part in weights.items() if name != first)
        return self._command(CommandedSwitch(first, self.time, blend=blend), self.direct)

    def enqueue(self, to: str) -> CommandedSwitch:
        """Plays a motion after what is played and queued.

        Raises:
            UnknownNameError: if there is no such motion; it names the nearest.
            MotiondeckError: if MOST_QUEUED are waiting.
        """
        self._check(to)
        if len(self._queued) >= MOST_QUEUED:
            raise MotiondeckError(
                f"the queue is full: {MOST_QUEUED} motions are waiting; wait until one of them begins"
            )
        switch = CommandedSwitch(to, self.time)
        self.switches.append(switch)
        self._queued.append(switch)
        self._show.finish_round()
        return switch

    def require_phase(self) -> None:
        """Checks that the network has a phase.

        Raises:
            MotiondeckError: if it runs by itself.
        """
        self._show.require_phase()

    def set_tempo(self, factor: float, over: float = 0.0) -> None:
        """Plays at another tempo, reached within `over` seconds; see `Tempo.command`.

        Raises:
            CommandError: if the tempo or the time is out of its range.
            MotiondeckError: if it is negative and the network runs by itself.
        """
        TEMPO.check(factor)
        if factor < 0.0:
            self._show.require_phase()
        super().set_tempo(factor, over)

    def set_input(self, name: str, value: float) -> None:
        """Gives an input of the motions, such as speed, another value; it is reached within a second.

        Raises:
            UnknownNameError: if no motion has such an input.
            MotiondeckError: if the value lies outside of what was learned.
        """
        self._inputs.command(name, value)

    def jump(self, phase: float) -> None:
        """Goes to a phase of the motion that is played at the next update, and fades to it from what is shown.

        Args:
            phase: in [0, 1]; in a loop 1 is 0.

        Raises:
            CommandError: if the phase is out of its range.
            MotiondeckError: if the network runs by itself, or motions are blended.
        """
        PHASE.check(phase)
        self._show.require_phase()
        if self.blend:
            raise MotiondeckError("motions are blended; a jump is possible when one of them plays alone")
        self._jump = phase

    def update(self, dt: float) -> tuple[Array, Pose]:
        """Advances by dt seconds; the joint targets (J,), rad, and the pose they come from."""
        tempo, jump = self._steer(dt)
        if jump is not None:
            self._jump = jump
        self.time += dt
        show = self._show
        if self._inputs.present:
            for name, value in self._inputs.advance(dt).items():
                show.set_input(name, value)
        if show.step(dt, tempo):
            self._finish_fade()
        if show.blend_problem and not self._ahead:
            self._give_up_blend(show.blend_problem)
        if self._fading is not None and self._fading.first_change_s is None:
            self._fading.first_change_s = self.time
        if self._blending is not None:
            self._update_blend(self._blending)
        if (self._ahead or self._queued) and self._next_is_due():
            motion = self._ahead.popleft()
            if self._ahead:
                self._tell("via", f"{motion}, on the way to {self._ahead[-1]}", motion)
            show.switch_to(motion)
            self._blending = None
            self._waits = True  # the motions on a way are one-shots, and those are finished
            self._fading = self._current
            self._jump = None
        elif self._jump is not None:
            show.jump(self._jump)
            self._jump = None
        self.pose = show.show()
        targets = self._retarget(self.pose)
        if self._lock is not None:
            self._note(targets)
        return targets, self.pose

    def _playhead(self, time: float) -> LoopPlace | None:
        """Where it is, for a lock; None if the network runs by itself."""
        here, phase = self._show.here, self.phase
        if phase is None:
            return None
        alone = self.settled and not self.blend and not self.paused
        return LoopPlace(time, here.name, phase, here.seconds, here.loop, self.commanded_tempo, alone)

    def _command(self, switch: CommandedSwitch, direct: bool) -> CommandedSwitch:
        """Starts a switch; earlier commands are overtaken."""
        self._mark_overtaken(self._queued)
        self._queued.clear()
        if self._current is not None:
            self._mark_overtaken([self._current])
        self._ahead.clear()
        self.switches.append(switch)
        self._start(switch, direct)
        return switch

    def _mark_overtaken(self, switches: Iterable[CommandedSwitch]) -> None:
        for switch in switches:
            switch.overtaken = True
            self._tell("overtaken", f"another command has overtaken {switch.destination}", switch.to)

    def _start(self, switch: CommandedSwitch, direct: bool) -> None:
        """Makes a switch the current one and finds its way."""
        show, here = self._show, self._show.here
        self._tell("motion", switch.destination, switch.to)
        if here.loop and self._goes_on(switch):
            self._current = switch
            if not switch.blend:
                switch.first_change_s = self.time
                self._settle(switch)
            elif show.fading:
                self._fading = switch  # its blend begins when the fade has ended
            else:
                self._blend(switch)
            return
        if not direct:
            switch.via = self._routes.by_way_of(here.name, switch.to)
            switch.after = "" if here.loop or show.at_end else here.name
        self._current = switch
        self._ahead.extend((*switch.via, switch.to))
        self._waits = bool(switch.after)

    def _goes_on(self, switch: CommandedSwitch) -> bool:
        """Whether what is shown, or faded to, plays on in what is commanded, so that only weights change."""
        show = self._show
        if not show.blend:
            return switch.to == show.here.name
        present = {show.here.name, *(name for name, _ in show.blend)}
        wanted = {switch.to, *(name for name, _ in switch.blend)}
        if not switch.blend or not present & wanted or len(present | wanted) > MOST_BLENDED:
            return False
        new = [(one, other) for one in wanted - present for other in (present | wanted) - {one}]
        return not any(self._routes.between_blended(*pair) for pair in new)

    def _next_is_due(self) -> bool:
        """Whether the next motion begins in this tick."""
        over = self._show.ended
        if self._current is None and self._queued and over:
            self._start(self._queued.popleft(), self.direct)
        return bool(self._ahead) and (over or not self._waits)

    def _blend(self, switch: CommandedSwitch) -> None:
        """Begins the blend of a switch of which something is playing."""
        blend = dict(switch.blend)
        rest = 1.0 - sum(blend.values())
        # Weights such as 0.1, 0.2 and 0.7 do not sum to 1 exactly.
        self._show.blend_in({switch.to: rest if abs(rest) > _NO_WEIGHT else 0.0} | blend)
        self._blending = self._blended = switch

    def _settle(self, switch: CommandedSwitch) -> None:
        switch.settled_s = self.time
        self._current = None
        self._tell("settled", f"{switch.destination} after {self.time - switch.commanded_s:.2f} s", switch.to)

    def _finish_fade(self) -> None:
        """Notes that a fade has ended; the switch then settles, or begins its blend."""
        switch = self._fading
        if switch is None:
            return
        if switch.first_change_s is None:
            switch.first_change_s = self.time
        if switch is self._current and not self._ahead:
            if switch.blend:
                self._blend(switch)
            else:
                self._settle(switch)
        self._fading = None

    def _give_up_blend(self, problem: str) -> None:
        """Gives a blend up and switches to the motion that has more weight in it."""
        show, blended = self._show, self._blended
        if not show.blend or blended is None:
            return
        weights = {self.playing: 1.0 - sum(weight for _, weight in show.blend)} | dict(show.blend)
        nearer = max(weights, key=weights.__getitem__)
        blended.fell_back = f"{described(self.playing, show.blend)} {problem}, fell back to {nearer}"
        self._tell("gave up", blended.fell_back, nearer)
        if self._current is not None:
            self._mark_overtaken([self._current])
        switch = CommandedSwitch(nearer, self.time)
        self.switches.append(switch)
        self._current, self._waits = switch, False
        self._ahead.append(nearer)

    def _update_blend(self, switch: CommandedSwitch) -> None:
        """Notes the progress of a switch's blend, and drops the motions whose weight has become 0."""
        show = self._show
        if switch.first_change_s is None:
            switch.first_change_s = self.time
        if show.crossing:
            return
        self._blending = None
        show.finish_blend(switch.to)
        if switch is self._current and not self._ahead:
            self._settle(switch)

    def _tell(self, kind: EventKind, text: str, motion: str) -> None:
        self.events.append(Event(kind, text, motion, self.time))

    def _check(self, motion: str) -> None:
        if motion not in self.motions:
            raise UnknownNameError.among("motion", motion, self.motions)
