"""The deck: plays a library's motions, switches them on command, and turns them into joint targets.

Each update follows the data: generator -> channels -> posture -> fade of the last switch -> root path -> pose ->
joints. The loop calls `update` once a tick, and commands in between. The `switch_plan` decides what is played when; the
`performance` decides how it is played and how motions are joined.
"""

import math
from collections.abc import Mapping, Sequence

from controller.deck.interfaces import Retargeter
from controller.deck.layers import OFF, Layers
from controller.deck.lockable import Lockable
from controller.deck.locks.led_body import LedBody
from controller.deck.locks.phase_lock import LoopPlace, Person
from controller.deck.performance import Joining, Performance
from controller.deck.routes import Routes
from controller.deck.switch import CommandedSwitch
from controller.deck.switch_plan import SwitchPlan
from controller.library.motion_library import MotionLibrary
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose, Posture
from controller.networks.base import Activation
from controller.wire.messages.arguments import AGO, HELD, PHASE, TEMPO, blend_weights
from controller.wire.messages.replies import Event
from motiondeck_base.errors import MotiondeckError, UnknownNameError

MOST_QUEUED = 32


class Deck(Lockable):
    """Plays one library on one robot.

    Args:
        retarget: from the skeleton's poses to the robot's joints.
        direct: whether every switch goes straight to its motion, at once.
        joining: how motions are joined; the default suits the network.
        phase: where in the motion to begin, in [0, 1).
    """

    _performs, _plans = Performance, SwitchPlan

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
        self.performance = self._performs(library, motion, joining, phase)
        routes = Routes.of(library)
        self._routes = routes.direct if direct else routes
        self.plan = self._plans(self.performance, self._routes, direct=direct)
        self.switches = self.plan.commanded  # the latest REMEMBERED_SWITCHES
        self.events = self.plan.events  # the latest, at most REMEMBERED_EVENTS; their reader removes them
        self.direct = direct
        usual = {motion.input.name: motion.input.usual for motion in library.info.motions if motion.input}
        self._inputs = Inputs(self.performance.tracks.leading.player.inputs, usual)
        for name, value in usual.items():
            self.performance.tracks.set_input(name, value)  # motions that share an input begin alike
        self.layers: Layers | None = None  # over what it plays, where the run names groups of joints
        self._jump: float | None = None  # the phase to go to in the next update
        self._entry: float | None = None  # the phase at which a switch begins in it, where a person is
        # What is shown beside the motions, once a person's body leads.
        self._led = LedBody(
            library.encoding.skeleton, max(one.acceleration for one in self.performance.motions.values())
        )
        self.time = 0.0  # s since the start, summed over updates
        super().__init__()
        self.pose = self.performance.pose

    @property
    def motion(self) -> str:
        """The motion that is played or being switched to."""
        current = self.plan.current
        return current.to if current is not None else self.playing

    @property
    def playing(self) -> str:
        """The motion that plays now, perhaps on the way to `motion`."""
        return self.performance.motion.name

    @property
    def posture(self) -> Posture:
        """The posture that is shown, in its own heading frame."""
        return self.performance.posture

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        return self.plan.current is None and not self.performance.fading

    @property
    def activation(self) -> Activation | None:
        """The activation of the neurons of the network that plays, shape (N,); None for a network without neurons."""
        return self.performance.tracks.leading.activation

    @property
    def phase(self) -> float | None:
        """The phase: [0, 1) in a loop, 0 to 1 in a one-shot; None for an autonomous network."""
        return self.performance.tracks.leading.phase

    @property
    def inputs(self) -> dict[str, float]:
        """The present values of the inputs besides the phase."""
        return dict(self._inputs.present)

    @property
    def layered(self) -> dict[str, str]:
        """The motion of each group of joints that has a layer, and `live` for joints that follow live values."""
        return self.layers.playing if self.layers is not None else {}

    @property
    def phase_rate(self) -> float | None:
        """Rounds of a loop per second, negative backwards; None for a one-shot or without a phase."""
        here = self.performance.motion
        return self.tempo / here.seconds if here.loop and self.phase is not None else None

    @property
    def blend(self) -> tuple[tuple[str, float], ...]:
        """The motions that are blended into the one that is played, each with its present weight."""
        return self.performance.tracks.blend

    @property
    def fell_back(self) -> str:
        """Why the last blend was given up and what was played instead, or ""."""
        blended = self.plan.blended
        return blended.fell_back if blended is not None else ""

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        return sum(track.restarts for track in self.performance.tracks.every)

    @property
    def way(self) -> list[str]:
        """The motions that the switch under way has still to begin."""
        return [*self.plan.ahead]

    @property
    def queue(self) -> list[str]:
        """The motions that are played after the present one."""
        return [switch.to for switch in self.plan.queued]

    @property
    def place(self) -> LoopPlace | None:
        """The place in the motion, with its present tempo; None while motions are blended, or if that is not known."""
        here, share = self.performance.motion, self.performance.tracks.leading.share
        if share is None or self.blend:
            return None
        alone = self.settled and not self.paused
        return LoopPlace(self.time, here.name, share, here.seconds, here.loop, self.tempo, alone)

    def switch(self, to: str, *, direct: bool = False) -> CommandedSwitch:
        """Starts a switch at the next update, or when the present one-shot has ended; the queue is cleared.

        A switch to the loop that is playing settles at once; a repeated command leaves the switch under way as it is.
        Where the motion is too far away, the switch goes by way of others; `direct` goes straight there at the next
        update, whatever is played. UnknownNameError if there is no such motion; it names the nearest.
        """
        self._check(to)
        direct = direct or self.direct
        loop = self.performance.motions[to].loop
        current = self.plan.current
        goes_there = current is not None and current.to == to and not current.blend and loop
        if current is not None and goes_there and not (direct and self.plan.ahead):
            self.plan.clear_queue(self.time)
            return current
        return self.plan.command(CommandedSwitch(to, self.time), direct=direct)

    def blend_in(
        self, first: str, second: str, weight: float, also: Sequence[tuple[str, float]] = ()
    ) -> CommandedSwitch:
        """Plays a blend of loops, which run side by side.

        The first is switched to if it is not playing, then the others are blended in; a motion whose weight comes to 0
        is dropped. From one blend to another that has a motion in common only the weights change, if there are no more
        than MOST_BLENDED motions in both. UnknownNameError if there is no such motion; it names the nearest.
        MotiondeckError if they cannot be blended, and why.

        Args:
            weight: the blend weight of the second, in [-0.3, 1.3]; beyond 0 and 1 one motion is exaggerated.
            also: further motions with their weights; then each weight is in [0, 1], and the first has the rest.
        """
        for name in (first, second, *(name for name, _ in also)):
            self._check(name)
        weights = blend_weights(first, second, weight, also)
        if why := self._routes.blend_obstacle([*weights]):
            raise MotiondeckError(why)
        if self.blend and self.playing in weights:
            first = self.playing
        blend = tuple((name, part) for name, part in weights.items() if name != first)
        return self.plan.command(CommandedSwitch(first, self.time, blend=blend), direct=self.direct)

    def enqueue(self, to: str) -> CommandedSwitch:
        """Plays a motion after all queued; UnknownNameError, or MotiondeckError if MOST_QUEUED are waiting."""
        self._check(to)
        if len(self.plan.queued) >= MOST_QUEUED:
            raise MotiondeckError(f"the queue is full: {MOST_QUEUED} motions wait; wait until one of them begins")
        self.performance.tracks.leading.finish_round()
        return self.plan.enqueue(CommandedSwitch(to, self.time))

    def require_phase(self) -> None:
        """Checks that the network has a phase; MotiondeckError if it runs by itself."""
        self.performance.tracks.leading.player.require_phase()

    def set_tempo(self, factor: float, over: float = 0.0) -> None:
        """Plays at another tempo, reached within `over` seconds; see `Paced.set_tempo`.

        CommandError if the tempo or the time is out of its range. MotiondeckError if it is negative and the network
        runs by itself.
        """
        TEMPO.check(factor)
        if factor < 0.0:
            self.require_phase()
        super().set_tempo(factor, over)

    def set_input(self, name: str, value: float, seconds: float = HELD) -> None:
        """Changes an input of motions, such as speed, within a second, or gives joints a live value for some seconds.

        UnknownNameError, or MotiondeckError out of range. "off" ends all live values.
        """
        if self.layers is None or name in self._inputs.present:
            self._inputs.command(name, value)
        elif name == OFF:
            self.layers.live.end()
        elif name not in self.layers.groups:
            raise UnknownNameError.among("input or group", name, [*self._inputs.present, *self.layers.groups, OFF])
        else:
            self._say_layers(self.layers.live.set(name, value, seconds))

    def gaze(self, left: float, up: float, ahead: float = 1.0, seconds: float = HELD) -> None:
        """Looks at a point for some seconds; see `LiveValues.gaze`."""
        self._say_layers(self._layers.live.gaze(left, up, ahead, seconds))

    def layer(self, group: str, motion: str, weight: float = 1.0, tempo: float = 1.0) -> None:
        """Plays a motion on a group of joints over what else is played; see `Layers.play`."""
        self._layers.play(group, motion, weight, tempo, over=self.playing)
        self._say_layers(True)

    @property
    def _layers(self) -> Layers:
        if self.layers is None:
            raise MotiondeckError("there are no layers here: this deck drives no named joints")
        return self.layers

    def _say_layers(self, changed: bool) -> None:
        if not changed:  # of a stream only the first value is an event
            return
        text = ", ".join(f"{group}: {motion}" for group, motion in self.layered.items()) or "no layers"
        self.events.append(Event("layer", text, self.motion, self.time))

    def follow(
        self, motion: str, phase: float, tempo: float = 1.0, ago: float = 0.0, body: Sequence[float] = ()
    ) -> None:
        """Goes where a person was `ago` seconds ago, if the deck is locked to them: to that motion, and in step.

        Their body, as of `PersonFollower.body`, has its share in what is shown. CommandError if a number is out of its
        range. UnknownNameError if there is no such motion. MotiondeckError for the body of another skeleton.
        """
        self._check(motion)
        for number, value in ((PHASE, phase), (TEMPO, tempo), (AGO, ago)):
            number.check(value)
        self._led.check(body)
        if isinstance(person := self._source, Person):
            person.see(self._clock() - ago, motion, phase, tempo, body)
            if motion != self.motion:
                self.switch(motion, direct=True)
                self._entry = phase

    def jump(self, phase: float) -> None:
        """Fades to a phase in [0, 1] of the present motion, from the next update on; in a loop 1 is 0.

        CommandError if the phase is out of its range. MotiondeckError if the network runs by itself or blends.
        """
        PHASE.check(phase)
        self.require_phase()
        if self.blend:
            raise MotiondeckError("motions are blended; a jump is possible when one of them plays alone")
        self._jump = phase

    def update(self, dt: float) -> tuple[Array, Pose]:
        """Advances by dt seconds; the joint targets (J,), rad, and the pose they come from."""
        tempo, jump = self._steer(dt)
        if jump is not None:
            self._jump = jump
        self.time += dt
        playing, plan = self.performance, self.plan
        if self._inputs.present:
            for name, value in self._inputs.advance(dt).items():
                playing.tracks.set_input(name, value)
        for switch in (plan.fading, plan.blending):
            if switch is not None and switch.first_change_s is None:
                switch.first_change_s = self.time
        if playing.step(dt, tempo):
            plan.finish_fade(self.time)
        if playing.blend_problem and not plan.ahead:
            plan.give_up_blend(playing.blend_problem, self.time)
        if plan.blending is not None:
            plan.update_blend(plan.blending, self.time)
        if (plan.ahead or plan.queued) and (motion := plan.take_next(self.time)) is not None:
            playing.switch_to(motion, self._entry)
            self._jump = self._entry = None
        elif self._jump is not None:
            playing.jump(self._jump)
            self._jump = None
        person = None if self.paused else self._source
        body = person.body(self._clock()) if isinstance(person, Person) else ()
        self.pose = self._led.shown(playing.finish_tick(), body, dt)
        targets = self._retarget(self.pose)
        if self.layers is not None and self.layers.active:
            settled = self.settled and not playing.tracks.crossing
            targets = self.layers(targets, dt, tempo, settled=settled, still=self.paused)
        if self._lock is not None:
            self._note(targets)
        return targets, self.pose

    def _playhead(self, time: float) -> LoopPlace | None:
        here, phase = self.performance.motion, self.phase
        if phase is None:
            return None
        alone = self.settled and not self.blend and not self.paused
        return LoopPlace(time, here.name, phase, here.seconds, here.loop, self.commanded_tempo, alone)

    def _check(self, motion: str) -> None:
        UnknownNameError.check("motion", motion, self.motions)


ACROSS_SECONDS = 1.0  # s, of an input from one end of its learned range to the other


class Inputs:
    """The inputs of a library's motions and their `present` values."""

    def __init__(self, ranges: Mapping[str, tuple[float, float]], usual: Mapping[str, float]) -> None:
        self._ranges, self._commanded = dict(ranges), dict(usual)
        self.present = dict(usual)

    def command(self, name: str, value: float) -> None:
        """Changes an input to another value; raises as `Deck.set_input`."""
        if not self._ranges:
            raise UnknownNameError(f"there is no input '{name}': no motion of this library was learned with one")
        UnknownNameError.check("input", name, self._ranges)
        least, most = self._ranges[name]
        if not (math.isfinite(value) and least <= value <= most):
            raise MotiondeckError(f"{name} was learned from {least:.3g} to {most:.3g}; {value:g} is not in between")
        self._commanded[name] = value

    def advance(self, dt: float) -> dict[str, float]:
        """Advances by dt seconds; the present values of inputs that have changed."""
        changed = {}
        for name, goal in self._commanded.items():
            present = self.present[name]
            if goal != present:
                least, most = self._ranges[name]
                step = (most - least) * dt / ACROSS_SECONDS
                self.present[name] = changed[name] = present + min(max(goal - present, -step), step)
        return changed
