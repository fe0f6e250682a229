"""The performance: what a library's network shows, and how it gets from one motion into another without a jump.

    generator -> channels -> posture -> fade of the last switch

It does what it is told at once; what is to be played when is the deck's affair.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from controller.deck.blend_check import BlendCheck
from controller.deck.frame_player import FramePlayer
from controller.deck.joining import Joining
from controller.deck.mixture import Mixture
from controller.deck.motions import Motion, read_motions
from controller.deck.transition import Fade, NetworkSwitch, best_anchor, difference
from controller.library.motion_library import MotionLibrary
from controller.library.network_arrays import Network
from controller.mocap.posture import Posture
from controller.networks.base import CrossingNetwork
from controller.networks.guard import Guard
from controller.rotations import Array

# A difference in joint velocity counts as much as the way it goes in this time (8 frames at 120 Hz), s.
VELOCITY_REACH = 8.0 / 120.0

# How long it takes inside a network from one motion to another, s.
MORPH_SECONDS = 1.0


class Performance:
    """Plays one motion of a library, or a mixture of two.

    A tick is one `step`, then `switch_to` or `fade_after_restart`, and in the end `remember`.

    Attributes:
        motions: the motions of the library by name.
        posture: what was shown last.
        at: how far into the motion it is, s.
        end: the place at which the motion has ended or gone round, s.
        blend_problem: the problem of the blend in the last step, or "".
    """

    def __init__(self, library: MotionLibrary, motion: str, joining: Joining | None) -> None:
        """Begins with a motion of the library; `joining` as for the deck."""
        self.motions = read_motions(library)
        self._encoding = library.encoding
        self._joining: Joining | None = joining
        core = self._core = library.network.twin()
        self._guard = _guard(core, library) if isinstance(core, Network) else None
        self._faded_restarts = 0  # how many of the guard's restarts are faded in already
        self._mixture = Mixture(self._guard or core, core)
        self._player = FramePlayer(self._mixture, library.info.rate)
        self._player.cue(motion)
        self._check: BlendCheck | None = None
        self.blend_problem = ""
        self._fade: Fade | NetworkSwitch | None = None
        self._fade_start = 0.0
        self._turned = 0.0  # by how much the heading has turned since, rad
        self.at, self.end = 0.0, self.here.seconds
        self._time = 0.0
        self._dt = 1.0 / library.info.rate
        self._speed = 1.0
        self._before = self.posture = self._decode(self._player.step(0.0), 1.0)

    @property
    def here(self) -> Motion:
        """The motion that is played."""
        return self.motions[self._player.motion]

    @property
    def fading(self) -> bool:
        """Whether the last switch is still to be seen."""
        return self._fade is not None

    @property
    def crossing(self) -> bool:
        """Whether the share of a mixture is still changing."""
        return self._mixture.crossing

    @property
    def blend_reached_output(self) -> bool:
        """Whether the last change of the mixture has reached what is shown."""
        return self._mixture.reached_output or not self._mixture.mixed

    @property
    def other(self) -> str:
        """The second motion of the mixture, or ""."""
        return self._mixture.other

    @property
    def blend(self) -> tuple[str, float] | None:
        """What is mixed into the motion that is played, and its present share."""
        blended = self._mixture.mixed and not isinstance(self._fade, NetworkSwitch)
        return (self._mixture.other, self._mixture.weight) if blended else None

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        return self._guard.recues if self._guard else 0

    @property
    def ended(self) -> bool:
        """Whether the motion has ended or gone round, and nothing else is being faded or mixed in."""
        return self._fade is None and not self._mixture.crossing and self.at >= self.end

    def finish_round(self) -> None:
        """Has a loop that has gone round be over when it has done so once more."""
        if self.here.loop and self.at >= self.end:
            rounds = np.floor((self.at - self.end) / self.here.seconds) + 1.0
            self.end += float(rounds) * self.here.seconds

    def step(self, dt: float, speed: float) -> tuple[Posture, bool]:
        """Goes dt seconds on at a speed: what is to be shown, and whether a fade has ended with it."""
        self._time += dt
        self._dt, self._speed = dt, speed
        tempo = speed * self._onset()
        self.at += dt * tempo
        target = self._decode(self._player.step(dt * tempo), tempo)
        self.blend_problem = ""
        if self._check is not None and self.blend is not None:
            self.blend_problem = self._check.problem(self._joints(target), dt * tempo)
            if self.blend_problem == "turns over":
                target = self.posture  # whose speed is no motion's own: the fade begins from a standstill
        if self._fade is None:
            return target, False
        elapsed = self._time - self._fade_start
        if self._fade.lasts(elapsed):
            self._turned += float(target.turn_rate) * dt
            return self._fade.apply(target, elapsed, self._turned), False
        self._fade = None
        return target, True

    def remember(self, shown: Posture) -> None:
        """Takes what is shown for the past, from which what comes next is seen."""
        self._before, self.posture = self.posture, shown
        self._faded_restarts = self.restarts

    def switch_to(self, motion: str, shown: Posture) -> None:
        """Starts a motion where it resembles the body most, and the fade from what is shown towards it.

        A network that goes over by itself is left to do so, unless another switch is still under way.
        """
        entering = self.motions[motion]
        bound = max(self.here.acceleration, entering.acceleration)
        joining = self._joining or ("morph" if isinstance(self._core, CrossingNetwork) else "inertialise")
        if joining in ("morph", "crossfade") and self._fade is None and not self._mixture.mixed:
            anchor = self._go_over(motion, shown, bound, inside=joining == "morph")
        else:
            anchor = self._anchor(motion, self.posture, shown)
            self._enter(motion, anchor, shown, bound)
            if joining == "cut":
                self._fade = NetworkSwitch(self._mixture)  # which is on no way: it is over at once
        self.at = anchor * entering.spacing
        self.end = entering.seconds + (self.at if entering.loop else 0.0)

    def fade_after_restart(self, shown: Posture) -> None:
        """Fades to where a network that was lost has been put back to, which is some way off, like another motion."""
        if self._guard and self._guard.recues > self._faded_restarts:
            self._enter(self._player.motion, self._guard.anchor, shown, self.here.acceleration)

    def blend_in(self, other: str, weight: float) -> None:
        """Mixes another motion in, side by side, from its present share to this one.

        Inside the network, as the papers have it, most mixtures of unlike motions stand still
        (benchmarks/deck/blends.py).
        """
        if not self._mixture.mixed:
            self._check = BlendCheck(self.here, self.motions[other])
        frames = round(abs(weight - self._mixture.weight) * MORPH_SECONDS * self._player.rate)
        self._mixture.mix(other, weight, frames, self._anchor(other, self._before, self.posture), inside=False)

    def drop_first_motion(self) -> None:
        """Goes on with the second motion of a mixture where that is left alone."""
        if self._mixture.motion != self._player.motion:
            here = self.motions[self._mixture.motion]
            self._player.motion = here.name
            self.at = self._mixture.anchor * here.spacing
            self.end = here.seconds + self.at

    def _enter(self, motion: str, anchor: int, shown: Posture, bound: float) -> None:
        """Goes on from an anchor of a motion, and fades from what is shown to it."""
        dt = self._dt
        self._player.cue_anchor(motion, anchor)
        tempo = self._speed if self.here.loop else 0.0
        target_before = self._decode(self._player.step(0.0), tempo)
        target = self._decode(self._player.step(dt * tempo), tempo)
        self._fade = difference((self.posture, shown), (target_before, target), dt, self._limbs, bound)
        self._fade_start, self._turned = self._time, 0.0

    def _onset(self) -> float:
        """The share of the tempo at which a motion that happens once is played while a switch to it lasts."""
        if self._fade is None or self.here.loop:
            return 1.0
        return self._fade.onset(self._time - self._fade_start)

    def _go_over(self, motion: str, shown: Posture, bound: float, *, inside: bool) -> int:
        """Goes over to a motion by mixing, inside the network or side by side; the anchor where it is entered."""
        dt, speed, entering = self._dt, self._speed, self.motions[motion]
        self._fade_start = self._time
        if inside and isinstance(self._core, CrossingNetwork):
            self._fade = NetworkSwitch(self._core)
            return self._player.cross(self._core, motion, len(entering.places))
        anchor, seconds = self._anchor(motion, self.posture, shown), MORPH_SECONDS
        if not inside:
            frames = self._mixture.anchors(motion)
            rate = (frames[(anchor + 1) % len(frames)] - frames[anchor - 1]) / (2.0 * entering.spacing)
            before, now = (self._decode(frames[anchor] - back * speed * rate, speed) for back in (dt, 0.0))
            seconds = difference((self.posture, shown), (before, now), dt, self._limbs, bound).duration
        self._mixture.mix(motion, 1.0, round(seconds * self._player.rate), anchor, inside=inside)
        self._player.motion = motion
        self._fade = NetworkSwitch(self._mixture)
        return anchor

    def _anchor(self, motion: str, before: Posture, now: Posture) -> int:
        """Where a motion resembles a body most."""
        there, place = self.motions[motion], self._joints(now)
        velocity = (place - self._joints(before)) / self._dt
        return best_anchor(place, velocity, there.places, there.velocities, VELOCITY_REACH)

    def _decode(self, channels: Array, speed: float) -> Posture:
        """The posture of channels, its path played at a speed."""
        posture = self._encoding.decode(channels)
        return replace(
            posture,
            height=posture.height.copy(),
            velocity=posture.velocity * speed,
            turn_rate=posture.turn_rate * speed,
        )

    def _places(self, posture: Posture) -> Array:
        """Positions of root and joints in the heading frame, from the ground below the root, shape (1 + B, 3), m."""
        return self._encoding.skeleton.joints(np.array([0.0, 0.0, posture.height]), posture.rotation)

    def _limbs(self, rotation: Array) -> Array:
        """Positions of root and joints relative to the root, of rotations (..., 1 + B, 4), m."""
        return self._encoding.skeleton.joints(np.zeros((*rotation.shape[:-2], 3)), rotation)

    def _joints(self, posture: Posture) -> Array:
        """Joint positions relative to the root in the heading frame, and the root's height, shape (F,), m."""
        places = self._places(posture)
        return np.append((places[1:] - places[0]).ravel(), posture.height)


def _guard(network: Network, library: MotionLibrary) -> Guard:
    """A guard around a network that runs by itself; one that a center drives cannot lose its place, and needs none."""
    motions = library.info.motions
    lengths = {motion.name: motion.frames for motion in motions}
    return Guard(network, lengths, {motion.name: motion.plays == "loop" for motion in motions})
