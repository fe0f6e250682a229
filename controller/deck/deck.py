"""The deck: plays a library's motions, switches them on command, and turns them into joint targets.

Each update goes the way of the data: generator -> channels -> posture -> fade of the last switch -> path -> pose ->
joints. Whoever drives it (the loop) calls `update` once a tick and hands it commands in between. The deck decides what
is played when; how it is played and joined is the `performance`'s affair.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from controller.deck.interfaces import Retargeter
from controller.deck.joining import Joining
from controller.deck.performance import Performance
from controller.deck.routes import Routes
from controller.deck.switch import CommandedSwitch
from controller.deck.tempo import Paced
from controller.deck.walked_path import Path
from controller.library.motion_library import MotionLibrary
from controller.mocap.posture import Pose, Posture
from controller.rotations import Array
from motiondeck_base.errors import MotiondeckError, UnknownNameError

__all__ = ["MOST_QUEUED", "REMEMBERED_SWITCHES", "CommandedSwitch", "Deck"]

REMEMBERED_SWITCHES = 1_000
MOST_QUEUED = 32


class Deck(Paced):
    """Plays one library for one robot.

    Args:
        library: the motions.
        retarget: from the skeleton's poses to the robot's joints.
        motion: what to play first.
        direct: whether every switch goes straight to its motion, at once.
        joining: how motions are joined; by itself as suits the network.

    Attributes:
        motions: all that can be played.
        time: s since the start, in ticks of the loop.
        switches: what was commanded, the latest REMEMBERED_SWITCHES of it.
        pose: what is shown, and where.
    """

    def __init__(
        self,
        library: MotionLibrary,
        retarget: Retargeter,
        motion: str,
        *,
        direct: bool = False,
        joining: Joining | None = None,
    ) -> None:
        self.motions = library.network.motions
        self._check(motion)
        self._retarget = retarget
        self._show = Performance(library, motion, joining)
        self._routes = Routes.between(self._show.repertoire)
        self._direct = direct
        self._current: CommandedSwitch | None = None  # the switch that is being carried out
        self._fading: CommandedSwitch | None = None  # the switch that the fade belongs to
        self._mixing: CommandedSwitch | None = None  # the switch that the present mixture belongs to
        self._blended: CommandedSwitch | None = None  # the switch that was mixed in last
        self._ahead: deque[str] = deque()  # the motions that the current one has still to begin
        self._queued: deque[CommandedSwitch] = deque()
        self._waits = False  # whether the next of them waits for the end of what is played
        self.time = 0.0
        self.switches: deque[CommandedSwitch] = deque(maxlen=REMEMBERED_SWITCHES)
        super().__init__()
        self._path = Path()
        self.pose = self._path.place(self.posture, 0.0)

    @property
    def motion(self) -> str:
        """What is played, or being switched to."""
        return self._current.to if self._current else self.playing

    @property
    def playing(self) -> str:
        """What is played now: where the way to `motion` has led so far."""
        return self._show.here.name

    @property
    def posture(self) -> Posture:
        """What is shown, seen from its own heading."""
        return self._show.posture

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        return self._current is None and not self._show.fading

    @property
    def blend(self) -> tuple[str, float] | None:
        """What is mixed into the motion that is played, and its present share."""
        return self._show.blend

    @property
    def fell_back(self) -> str:
        """Why the last blend was given up and what was played instead, or ""."""
        return self._blended.fell_back if self._blended else ""

    @property
    def recues(self) -> int:
        """How often the network was lost and had to be started again."""
        return self._show.recues

    @property
    def queue(self) -> list[str]:
        """What is played after the present motion."""
        return [switch.to for switch in self._queued]

    def switch(self, to: str, *, direct: bool = False) -> CommandedSwitch:
        """Starts a switch at the next update, or when the motion that happens once has ended; the queue is forgotten.

        A switch to the loop that is playing is settled at once; asked for again, a switch under way goes on. Where the
        motion is too far away, the switch goes by way of others.

        Args:
            to: the motion.
            direct: go straight there at the next update, whatever is played.

        Raises:
            UnknownNameError: if there is no such motion; it names the nearest.
        """
        self._check(to)
        direct = direct or self._direct
        loop = self._show.repertoire[to].loop
        current = self._current
        if current is not None and (current.to, current.blend) == (to, None) and loop and not (direct and self._ahead):
            self._forget(self._queued)
            self._queued.clear()
            return current
        return self._command(CommandedSwitch(to, self.time), direct)

    def blend_in(self, first: str, second: str, share: float) -> CommandedSwitch:
        """Plays a mixture of two motions that go on for ever: both run side by side, and their frames are mixed.

        The first is switched to if it is not played, then the second is mixed in; at a share of 0 or 1 one plays alone.

        Args:
            first, second: the motions.
            share: of the second, in [0, 1].

        Raises:
            UnknownNameError: if there is no such motion; it names the nearest.
            MotiondeckError: if the two cannot be blended; it says why.
        """
        for name in (first, second):
            self._check(name)
            if not self._show.repertoire[name].loop:
                raise MotiondeckError(f"{name} happens once; only motions that go on for ever can be blended")
        if first == second:
            raise MotiondeckError(f"a blend takes two motions, not {first} twice")
        if not 0.0 <= share <= 1.0:
            raise MotiondeckError(f"a share of {share:g} is not between 0 and 1")
        if not self._direct and (via := self._routes.by_way_of(first, second)):
            raise MotiondeckError(f"{first} and {second} are too far apart to be blended: between them lies {via[0]}")
        if self.blend is not None and (self.playing, self._show.other) == (second, first):
            first, second, share = second, first, 1.0 - share
        return self._command(CommandedSwitch(first, self.time, blend=(second, share)), self._direct)

    def enqueue(self, to: str) -> CommandedSwitch:
        """Plays a motion after what is played and queued.

        Raises:
            UnknownNameError: if there is no such motion; it names the nearest.
            MotiondeckError: if MOST_QUEUED are waiting.
        """
        self._check(to)
        if len(self._queued) >= MOST_QUEUED:
            raise MotiondeckError(f"{MOST_QUEUED} motions are queued, and no more can be")
        switch = CommandedSwitch(to, self.time)
        self.switches.append(switch)
        self._queued.append(switch)
        self._show.await_round()
        return switch

    def update(self, dt: float) -> tuple[Array, Pose]:
        """Goes dt seconds on; the joint targets (J,), rad, and the pose they come from."""
        self.time += dt
        show = self._show
        shown, fade_has_ended = show.step(dt, self._tempo.advance(dt))
        if fade_has_ended:
            self._look_at_switch()
        if show.trouble and not self._ahead:
            self._fall_back(show.trouble)
        if self._fading is not None and self._fading.first_change_s is None:
            self._fading.first_change_s = self.time
        self._look_at_mixture()
        if self._is_due():
            show.begin(self._ahead.popleft(), shown)
            self._mixing = None
            self._waits = True  # only motions that happen once lie on a way, and they are finished
            self._fading = self._current
        else:
            show.put_back(shown)
        show.keep(shown)
        self.pose = self._path.place(shown, dt)
        return self._retarget(self.pose), self.pose

    def _command(self, switch: CommandedSwitch, direct: bool) -> CommandedSwitch:
        """Sets out on a switch; what was commanded before is forgotten."""
        self._forget(self._queued)
        self._queued.clear()
        if self._current is not None:
            self._forget([self._current])
        self._ahead.clear()
        self.switches.append(switch)
        self._set_out(switch, direct)
        return switch

    def _forget(self, switches: Iterable[CommandedSwitch]) -> None:
        for switch in switches:
            switch.overtaken = True

    def _set_out(self, switch: CommandedSwitch, direct: bool) -> None:
        """Makes a switch the current one and lays out its way."""
        show, here = self._show, self._show.here
        if switch.to == here.name and here.loop and (not show.other or (switch.blend or ("",))[0] == show.other):
            # What is shown already is that motion, or fades to it.
            self._current = switch
            if switch.blend is None:
                switch.first_change_s = self.time
                self._settle(switch)
            elif show.fading:
                self._fading = switch  # its mixture begins when the fade has ended
            else:
                self._mix(switch)
            return
        if not direct:
            switch.via = self._routes.by_way_of(here.name, switch.to)
            switch.after = "" if here.loop or show.at >= show.end else here.name
        self._current = switch
        self._ahead.extend((*switch.via, switch.to))
        self._waits = bool(switch.after)

    def _is_due(self) -> bool:
        """Whether the next motion is to begin now."""
        over = self._show.over
        if self._current is None and self._queued and over:
            self._set_out(self._queued.popleft(), self._direct)
        return bool(self._ahead) and (over or not self._waits)

    def _mix(self, switch: CommandedSwitch) -> None:
        """Mixes in what a switch has to have mixed in, now that its motion is played."""
        assert switch.blend is not None
        self._show.mix(*switch.blend)
        self._mixing = self._blended = switch

    def _settle(self, switch: CommandedSwitch) -> None:
        switch.settled_s = self.time
        self._current = None

    def _look_at_switch(self) -> None:
        """Keeps record of the switch whose fade has ended, and goes on to what it has to have mixed in."""
        switch = self._fading
        if switch is None:
            return
        if switch.first_change_s is None:
            switch.first_change_s = self.time
        if switch is self._current and not self._ahead:
            if switch.blend is None:
                self._settle(switch)
            else:
                self._mix(switch)
        self._fading = None

    def _fall_back(self, trouble: str) -> None:
        """Gives a mixture up and goes over to the motion it has more of."""
        show, blended = self._show, self._blended
        if show.blend is None or blended is None:
            return
        first, (second, share) = self.playing, show.blend
        nearer = second if share > 0.5 else first
        blended.fell_back = f"{first} with {share:.2f} of {second} {trouble}, fell back to {nearer}"
        if self._current is not None:
            self._forget([self._current])
        switch = CommandedSwitch(nearer, self.time)
        self.switches.append(switch)
        self._current, self._waits = switch, False
        self._ahead.append(nearer)

    def _look_at_mixture(self) -> None:
        """Keeps record of the switch that a blend belongs to, and of what is played when one motion is left of it."""
        switch, show = self._mixing, self._show
        if switch is None or not show.mixture_is_heard:
            return
        if switch.first_change_s is None:
            switch.first_change_s = self.time
        if show.crossing:
            return
        self._mixing = None
        show.adopt_what_is_left()
        if switch is self._current and not self._ahead:
            self._settle(switch)

    def _check(self, motion: str) -> None:
        if motion not in self.motions:
            raise UnknownNameError.among("motion", motion, self.motions)
