"""The deck: plays a library's motions, switches them on command, and turns them into joint targets.

Each update goes the way of the data: generator -> channels -> posture -> fade of the last switch -> path -> pose ->
joints. Whoever drives it (the loop) calls `update` once a tick and hands it commands in between.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import cos, sin

import numpy as np

from controller.errors import MotiondeckError, UnknownNameError
from controller.generators.base import CrossingNetwork
from controller.generators.centralized_network import CentralizedNetwork
from controller.generators.frame_player import FramePlayer
from controller.generators.guard import Guard
from controller.generators.mixture import Mixture
from controller.mocap.posture import Pose, Posture
from controller.realtime.interfaces import Retargeter
from controller.realtime.joining import Joining
from controller.realtime.messages import FASTEST, SLOWEST
from controller.realtime.repertoire import Motion, read_repertoire
from controller.realtime.routes import Routes
from controller.realtime.transition import Briskness, Crossing, Fade, best_anchor, difference
from controller.rotations import Array, multiply, yaw
from controller.training.library import MotionLibrary, Network

# How fast the tempo itself may change, 1/s: a pause takes 0.4 s.
TEMPO_RATE = 2.5

# A difference in joint velocity counts as much as the way it goes in this time (8 frames at 120 Hz), s.
VELOCITY_REACH = 8.0 / 120.0

# How long it takes inside a network from one motion to another, s.
MORPH_SECONDS = 1.0

REMEMBERED_SWITCHES = 1_000
MOST_QUEUED = 32


@dataclass(slots=True)
class Switch:
    """A switch that was commanded; times in s since the deck's start, None while still to come.

    Attributes:
        to: the motion.
        commanded_s: when the command came.
        first_change_s: the first tick whose targets it changed.
        settled_s: when nothing was left of the motion before.
        after: the motion whose end is awaited first, or "".
        via: the motions on the way.
        overtaken: whether another command came before it had settled.
        blend: what is mixed in as soon as the motion is played, and its share.
    """

    to: str
    commanded_s: float
    first_change_s: float | None = None
    settled_s: float | None = None
    after: str = ""
    via: tuple[str, ...] = ()
    overtaken: bool = False
    blend: tuple[str, float] | None = None


class Deck:
    """Plays one library for one robot.

    Args:
        library: the motions.
        retarget: from the skeleton's poses to the robot's joints.
        motion: what to play first.
        direct: whether every switch goes straight to its motion, at once.
        joining: how motions are joined; by itself as suits the network.

    Attributes:
        time: s since the start, in ticks of the loop.
        switches: what was commanded, the latest REMEMBERED_SWITCHES of it.
        speed: the tempo that is being played; it follows the commanded one smoothly.
        commanded_speed: the tempo that was commanded.
        paused: whether the deck stands still on command.
        posture, pose: what is shown.
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
        self._encoding = library.encoding
        self._retarget = retarget
        self._repertoire = read_repertoire(library)
        self._routes = Routes.between(self._repertoire)
        self._direct = direct
        self._check(motion)
        self._joining: Joining | None = joining
        core = self._core = library.network.twin()
        self._guard = None if isinstance(core, CentralizedNetwork) else _guard(core, library)
        self._recues = 0  # how many of the guard's are faded in already
        self._mixture = Mixture(self._guard or core, core)
        self._player = FramePlayer(self._mixture, library.info.rate)
        self._player.cue(motion)
        self._fade: Fade | Crossing | None = None
        self._fade_start = 0.0
        self._current: Switch | None = None  # the switch that is being carried out
        self._fading: Switch | None = None  # the switch that the fade belongs to
        self._mixing: Switch | None = None  # the switch that the present mixture belongs to
        self._ahead: deque[str] = deque()  # the motions that the current one has still to begin
        self._queued: deque[Switch] = deque()
        self._waits = False  # whether the next of them waits for the end of what is played
        self._at = 0.0  # s into the motion
        self._end = self._repertoire[motion].seconds  # the place at which it has ended or gone round
        self.time = 0.0
        self._dt = 1.0 / library.info.rate
        self.switches: deque[Switch] = deque(maxlen=REMEMBERED_SWITCHES)
        self.speed = 1.0
        self.paused = False
        self.commanded_speed = 1.0
        self._tempo_rate = TEMPO_RATE
        self._x = self._y = 0.0
        self._heading = 0.0
        self._before = self.posture = self._decode(self._player.step(0.0), 1.0)
        self.pose = self._place(self.posture, 0.0)

    @property
    def motion(self) -> str:
        """What is played, or being switched to."""
        return self._current.to if self._current else self._player.motion

    @property
    def playing(self) -> str:
        """What is played now: where the way to `motion` has led so far."""
        return self._player.motion

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        return self._current is None and self._fade is None

    @property
    def blend(self) -> tuple[str, float] | None:
        """What is mixed into the motion that is played, and its present share."""
        blended = self._mixture.mixed and not isinstance(self._fade, Crossing)
        return (self._mixture.other, self._mixture.share) if blended else None

    @property
    def recues(self) -> int:
        """How often the network was lost and had to be started again."""
        return self._guard.recues if self._guard else 0

    @property
    def queue(self) -> list[str]:
        """What is played after the present motion."""
        return [switch.to for switch in self._queued]

    def switch(self, to: str, *, direct: bool = False) -> Switch:
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
        loop = self._repertoire[to].loop
        current = self._current
        if current is not None and (current.to, current.blend) == (to, None) and loop and not (direct and self._ahead):
            self._forget(self._queued)
            self._queued.clear()
            return current
        return self._command(Switch(to, self.time), direct)

    def blend_in(self, first: str, second: str, share: float) -> Switch:
        """Plays a mixture of two motions that go on for ever, inside the network, as its paper defines it.

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
            if not self._repertoire[name].loop:
                raise MotiondeckError(f"{name} happens once; only motions that go on for ever can be blended")
        if first == second:
            raise MotiondeckError(f"a blend takes two motions, not {first} twice")
        if not 0.0 <= share <= 1.0:
            raise MotiondeckError(f"a share of {share:g} is not between 0 and 1")
        if not self._direct and (via := self._routes.by_way_of(first, second)):
            raise MotiondeckError(f"{first} and {second} are too far apart to be blended: between them lies {via[0]}")
        if self.blend is not None and (self._player.motion, self._mixture.other) == (second, first):
            first, second, share = second, first, 1.0 - share
        return self._command(Switch(first, self.time, blend=(second, share)), self._direct)

    def _command(self, switch: Switch, direct: bool) -> Switch:
        """Sets out on a switch; what was commanded before is forgotten."""
        self._forget(self._queued)
        self._queued.clear()
        if self._current is not None:
            self._forget([self._current])
        self._ahead.clear()
        self.switches.append(switch)
        self._set_out(switch, direct)
        return switch

    def enqueue(self, to: str) -> Switch:
        """Plays a motion after what is played and queued.

        Raises:
            UnknownNameError: if there is no such motion; it names the nearest.
            MotiondeckError: if MOST_QUEUED are waiting.
        """
        self._check(to)
        if len(self._queued) >= MOST_QUEUED:
            raise MotiondeckError(f"{MOST_QUEUED} motions are queued, and no more can be")
        switch = Switch(to, self.time)
        self.switches.append(switch)
        self._queued.append(switch)
        if self._here.loop and self._at >= self._end:
            rounds = np.floor((self._at - self._end) / self._here.seconds) + 1.0
            self._end += float(rounds) * self._here.seconds
        return switch

    def set_speed(self, factor: float, over: float = 0.0) -> None:
        """Plays at another tempo, SLOWEST to FASTEST times as fast as recorded.

        Args:
            factor: the tempo.
            over: how long the change takes, s; never less than is smooth.

        Raises:
            MotiondeckError: if the factor is outside, or the time is negative.
        """
        if not SLOWEST <= factor <= FASTEST:
            raise MotiondeckError(f"speed {factor:g} is not between {SLOWEST:g} and {FASTEST:g}")
        if not over >= 0.0:
            raise MotiondeckError(f"a change of speed cannot take {over:g} s")
        self.commanded_speed = factor
        self._tempo_rate = min(TEMPO_RATE, abs(factor - self.speed) / over) if over > 0.0 else TEMPO_RATE

    def pause(self) -> None:
        """Comes to a standstill and stays there."""
        self.paused = True
        self._tempo_rate = TEMPO_RATE

    def resume(self) -> None:
        """Goes on after a pause."""
        self.paused = False
        self._tempo_rate = TEMPO_RATE

    def update(self, dt: float) -> tuple[Array, Pose]:
        """Goes dt seconds on; the joint targets (J,), rad, and the pose they come from."""
        self.time += dt
        self._dt = dt
        goal = 0.0 if self.paused else self.commanded_speed
        most = self._tempo_rate * dt
        self.speed += min(max(goal - self.speed, -most), most)
        tempo = self.speed * self._onset()
        self._at += dt * tempo
        shown = self._faded(self._decode(self._player.step(dt * tempo), tempo))
        if self._fading is not None and self._fading.first_change_s is None:
            self._fading.first_change_s = self.time
        self._look_at_mixture()
        if self._is_due():
            self._begin(self._ahead.popleft(), shown, dt)
        elif self._guard and self._guard.recues > self._recues:
            # Where it was put back to is some way off, so it is entered like another motion.
            self._enter(self._player.motion, self._guard.anchor, shown, dt, self._here.briskness)
        self._recues = self.recues
        self._before, self.posture = self.posture, shown
        self.pose = self._place(shown, dt)
        return self._retarget(self.pose), self.pose

    @property
    def _here(self) -> Motion:
        """The motion that is played."""
        return self._repertoire[self._player.motion]

    def _forget(self, switches: Iterable[Switch]) -> None:
        for switch in switches:
            switch.overtaken = True

    def _set_out(self, switch: Switch, direct: bool) -> None:
        """Makes a switch the current one and lays out its way."""
        here = self._here
        blended = self._mixture.other
        if switch.to == here.name and here.loop and (not blended or (switch.blend or ("",))[0] == blended):
            # What is shown already is that motion, or fades to it.
            self._current = switch
            if switch.blend is None:
                switch.first_change_s = switch.settled_s = self.time
                self._current = None
            elif self._fade is None:
                self._mix(switch)
            return
        if not direct:
            switch.via = self._routes.by_way_of(here.name, switch.to)
            switch.after = "" if here.loop or self._at >= self._end else here.name
        self._current = switch
        self._ahead.extend((*switch.via, switch.to))
        self._waits = bool(switch.after)

    def _is_due(self) -> bool:
        """Whether the next motion is to begin now."""
        over = self._fade is None and not self._mixture.crossing and self._at >= self._end
        if self._current is None and self._queued and over:
            self._set_out(self._queued.popleft(), self._direct)
        return bool(self._ahead) and (over or not self._waits)

    def _begin(self, motion: str, shown: Posture, dt: float) -> None:
        """Starts a motion where it resembles the body most, and the fade towards it.

        A network that goes over by itself is left to do so, unless another switch is still under way.
        """
        leaving, entering = self._here, self._repertoire[motion]
        bound = _briskness(leaving, entering)
        joining = self._joining or ("morph" if isinstance(self._core, CrossingNetwork) else "inertialise")
        self._mixing = None
        if joining in ("morph", "crossfade") and self._fade is None and not self._mixture.mixed:
            anchor = self._go_over(motion, shown, dt, bound, inside=joining == "morph")
        else:
            anchor = self._anchor(motion, self.posture, shown, dt)
            self._enter(motion, anchor, shown, dt, bound)
            if joining == "cut":
                self._fade = Crossing(self._mixture)  # which is on no way: it is over at once
        self._at = anchor * entering.spacing
        self._end = entering.seconds + (self._at if entering.loop else 0.0)
        self._waits = True  # only motions that happen once lie on a way, and they are finished
        self._fading = self._current

    def _enter(self, motion: str, anchor: int, shown: Posture, dt: float, bound: Briskness) -> None:
        """Goes on from an anchor of a motion, and fades from what is shown to it."""
        self._player.cue_anchor(motion, anchor)
        tempo = self.speed if self._here.loop else 0.0
        target_before = self._decode(self._player.step(0.0), tempo)
        target = self._decode(self._player.step(dt * tempo), tempo)
        self._fade = difference((self.posture, shown), (target_before, target), dt, self._places, bound)
        self._fade_start = self.time

    def _onset(self) -> float:
        """The share of the tempo at which a motion that happens once is played while a switch to it lasts."""
        if self._fade is None or self._here.loop:
            return 1.0
        return self._fade.onset(self.time - self._fade_start)

    def _faded(self, target: Posture) -> Posture:
        """The target with what is left of the last switch."""
        if self._fade is None:
            return target
        elapsed = self.time - self._fade_start
        if self._fade.lasts(elapsed):
            return self._fade.apply(target, elapsed)
        self._fade = None
        if self._fading is not None:
            if self._fading.first_change_s is None:
                self._fading.first_change_s = self.time
            if self._fading is self._current and not self._ahead:
                if self._fading.blend is None:
                    self._fading.settled_s = self.time
                    self._current = None
                else:
                    self._mix(self._fading)
            self._fading = None
        return target

    def _mix(self, switch: Switch) -> None:
        """Mixes in what a switch has to have mixed in, now that its motion is played."""
        assert switch.blend is not None
        other, share = switch.blend
        frames = round(abs(share - self._mixture.share) * MORPH_SECONDS * self._player.rate)
        self._mixture.mix(other, share, frames, self._anchor(other, self._before, self.posture, self._dt))
        self._mixing = switch

    def _go_over(self, motion: str, shown: Posture, dt: float, bound: Briskness, *, inside: bool) -> int:
        """Goes over to a motion by mixing, inside the network or side by side; the anchor where it is entered."""
        entering = self._repertoire[motion]
        self._fade_start = self.time
        if inside and isinstance(self._core, CrossingNetwork):
            self._fade = Crossing(self._core)
            return self._player.cross(self._core, motion, len(entering.places))
        anchor, seconds = self._anchor(motion, self.posture, shown, dt), MORPH_SECONDS
        if not inside:
            frames = self._mixture.anchors(motion)
            rate = (frames[(anchor + 1) % len(frames)] - frames[anchor - 1]) / (2.0 * entering.spacing)
            before, now = (self._decode(frames[anchor] - back * self.speed * rate, self.speed) for back in (dt, 0.0))
            seconds = difference((self.posture, shown), (before, now), dt, self._places, bound).duration
        self._mixture.mix(motion, 1.0, round(seconds * self._player.rate), anchor, inside=inside)
        self._player.motion = motion
        self._fade = Crossing(self._mixture)
        return anchor

    def _anchor(self, motion: str, before: Posture, now: Posture, dt: float) -> int:
        """Where a motion resembles a body most."""
        there, place = self._repertoire[motion], self._joints(now)
        velocity = (place - self._joints(before)) / dt
        return best_anchor(place, velocity, there.places, there.velocities, VELOCITY_REACH)

    def _look_at_mixture(self) -> None:
        """Keeps record of the switch that a blend belongs to, and of what is played when one motion is left of it."""
        switch, mixture = self._mixing, self._mixture
        if switch is None or not (mixture.heard or not mixture.mixed):
            return
        if switch.first_change_s is None:
            switch.first_change_s = self.time
        if mixture.crossing:
            return
        self._mixing = None
        if mixture.motion != self._player.motion:
            here = self._repertoire[mixture.motion]
            self._player.motion = here.name
            self._at = mixture.anchor * here.spacing
            self._end = here.seconds + self._at
        if switch is self._current and not self._ahead:
            switch.settled_s = self.time
            self._current = None

    def _decode(self, channels: Array, speed: float) -> Posture:
        """The posture of channels, its path played at a speed."""
        posture = self._encoding.decode(channels)
        return replace(
            posture,
            height=posture.height.copy(),
            velocity=posture.velocity * speed,
            turn_rate=posture.turn_rate * speed,
        )

    def _place(self, posture: Posture, dt: float) -> Pose:
        """Where a posture stands after walking on for dt seconds."""
        self._heading += float(posture.turn_rate) * dt
        cosine, sine = cos(self._heading), sin(self._heading)
        forward, left = (posture.velocity * dt).tolist()
        self._x += cosine * forward - sine * left
        self._y += sine * forward + cosine * left
        position = np.array([self._x, self._y, float(posture.height)])
        return Pose(position, np.array(self._heading), multiply(yaw(self._heading), posture.rotation))

    def _places(self, posture: Posture) -> Array:
        """Positions of root and joints in the heading frame, from the ground below the root, shape (1 + B, 3), m."""
        return self._encoding.skeleton.joints(np.array([0.0, 0.0, posture.height]), posture.rotation)

    def _joints(self, posture: Posture) -> Array:
        """Joint positions relative to the root in the heading frame, and the root's height, shape (F,), m."""
        places = self._places(posture)
        return np.append((places[1:] - places[0]).ravel(), posture.height)

    def _check(self, motion: str) -> None:
        if motion not in self._repertoire:
            raise UnknownNameError.among("motion", motion, self.motions)


def _guard(network: Network, library: MotionLibrary) -> Guard:
    """A guard around a network; a centralized one has no state that could be lost, and needs none."""
    motions = library.info.motions
    lengths = {motion.name: motion.frames for motion in motions}
    return Guard(network, lengths, {motion.name: motion.plays == "loop" for motion in motions})


def _briskness(leaving: Motion, entering: Motion) -> Briskness:
    """What joints may do on the way: accelerate as in the brisker of two motions, on top of what the second does."""
    acceleration = max(leaving.briskness.acceleration, entering.briskness.acceleration)
    return Briskness(acceleration, entering.briskness.speed)
