"""Layers: groups of joints that play other motions over what the deck plays.

A layer is mixed into the joint targets q of the deck on the joints of its group alone,

    q <- q + s (p - q),

where p are the targets of its motion and s its share, which goes to the layer's weight (see `Share`). All other
targets stay as they are, bit for bit. While s changes both motions play on.

Of layers that share a joint one at a time changes its share, the latest first, and none while the deck joins motions.
Live values come over all layers.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from controller.deck.interfaces import JointLimits, Retargeter
from controller.deck.joins.deck_motions import LEAST_ACCELERATION, LEAST_SPEED, Motion, read_motions
from controller.deck.live_values import Gains, LiveValues, Share
from controller.deck.performance import at_origin
from controller.deck.tempo import TEMPO_RATE
from controller.deck.tracks.track import Track
from controller.library.motion_library import MotionLibrary
from controller.motion.rotations import Array, conjugate, multiply, to_rotation_vector
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import MotiondeckError, UnknownNameError

OFF = "off"  # in place of a group or a motion
MOST_VOICES = 16


@dataclass(eq=False)
class Voice(Share):
    """One motion on the joints of a group."""

    group: str
    joints: NDArray[np.int64]
    track: Track
    retarget: Retargeter
    tempo: float  # times that of the deck
    commanded_tempo: float  # what the present one follows

    def mixed(self, beneath: Array, dt: float, tempo: float, *, may_change: bool) -> Array:
        """Targets of its joints (G,), rad, dt seconds later, over those beneath."""
        most = TEMPO_RATE * dt
        self.tempo += min(max(self.commanded_tempo - self.tempo, -most), most)
        own = self.retarget(at_origin(self.track.step(dt, tempo * self.tempo)))[self.joints]
        apart = own - beneath
        if not self.arrived or self.pace:
            self.approach(float(np.abs(apart).max()), dt, may_change=may_change)
        return beneath + self.share * apart


class Layers:
    """The layers of a deck that plays a library on named joints.

    Args:
        limits: of the joints.
        groups: the joints of each group; every joint is a group too.
        twin: makes a copy of the deck's retargeter as it is now.
        refused: why, of each joint that can have none.
        gaze: the angle of each joint that takes part in a gaze, per angle to the left and up.
    """

    def __init__(
        self,
        library: MotionLibrary,
        joints: Sequence[str],
        limits: JointLimits,
        groups: Mapping[str, Sequence[str]],
        twin: Callable[[], Retargeter],
        refused: Mapping[str, str] | None = None,
        gaze: Gains | None = None,
    ) -> None:
        self._library, self._twin = library, twin
        self._motions = read_motions(library)
        named = {joint: (joint,) for joint in joints} | dict(groups)
        self.groups = {name: np.array([joints.index(one) for one in group]) for name, group in named.items()}
        self.live = LiveValues(joints, limits, self.groups, gaze or {}, refused or {})
        self._voices: list[Voice] = []  # the lowest first
        self._first = Track(library, self._motions)
        self._idle = [self._first]

    @property
    def active(self) -> bool:
        """Whether any joint has a layer or live values, perhaps one that goes."""
        return bool(self._voices or self.live.joints)

    @property
    def playing(self) -> dict[str, str]:
        """The motion of each group that has a layer, and `live` for each joint that follows live values."""
        return {voice.group: voice.track.motion.name for voice in self._voices if voice.goal} | self.live.following

    def play(self, group: str, motion: str, weight: float = 1.0, tempo: float = 1.0, *, over: str) -> None:
        """Plays a motion on a group over the deck's motion `over`; OFF ends the layer of a group, or all.

        UnknownNameError for an unknown group or motion. MotiondeckError if there can be no layer, or no further one.
        """
        UnknownNameError.check("group", group, [*self.groups, OFF])
        if OFF in (group, motion):
            self._end(group)
            return
        self.live.check(self.groups[group])
        UnknownNameError.check("motion", motion, self._motions)
        mine = [voice for voice in self._voices if voice.group == group and voice.goal]
        if mine and mine[-1].track.motion.name == motion and mine[-1].track.motion.loop:
            mine[-1].goal, mine[-1].commanded_tempo = weight, tempo
            return
        if len(self._voices) >= MOST_VOICES:
            raise MotiondeckError(f"{MOST_VOICES} layers come and go already; wait until one of them has ended")
        track = self._idle.pop() if self._idle else Track(self._library, self._motions, self._first)
        track.cue_phase(motion, 0.0)
        involved = [self._motions[motion], self._motions[over], *(voice.track.motion for voice in mine)]
        peaks = [joint_peaks(one, self._library.skeleton) for one in involved]
        speed, acceleration = (max(values) for values in zip(*peaks, strict=True))
        self._end(group)
        peak = {"speed": speed, "acceleration": acceleration}
        self._voices.append(Voice(group, self.groups[group], track, self._twin(), tempo, tempo, goal=weight, **peak))

    def __call__(self, targets: Array, dt: float, tempo: float, *, settled: bool, still: bool = False) -> Array:
        """Targets (J,), rad, dt seconds later at a tempo, with the layers.

        The deck joins nothing if it is settled. Joints with live values are held if it is to stand still.
        """
        if self._voices:
            targets = self._mixed(targets, dt, tempo, settled)
        return self.live(targets, dt, still=still) if self.live.joints else targets

    def _mixed(self, targets: Array, dt: float, tempo: float, settled: bool) -> Array:
        mixed = targets.copy()
        moving, waiting = np.zeros((2, len(targets)), dtype=np.int64)  # how many voices change, or are to, by joint
        for voice in self._voices:
            if voice.goal and not voice.track.motion.loop and voice.track.ended:
                voice.goal = 0.0
            moving[voice.joints] += voice.pace != 0.0
        may_change: list[bool] = []
        for voice in reversed(self._voices):
            others = moving[voice.joints] - (voice.pace != 0.0) + waiting[voice.joints]
            may_change.append(settled and not others.any())
            waiting[voice.joints] += not voice.arrived
        for voice, may in zip(self._voices, reversed(may_change), strict=True):
            mixed[voice.joints] = voice.mixed(mixed[voice.joints], dt, tempo, may_change=may)
        self._idle += [voice.track for voice in self._voices if not voice.goal and voice.arrived]
        self._voices = [voice for voice in self._voices if voice.goal or not voice.arrived]
        return mixed

    def _end(self, group: str) -> None:
        for voice in self._voices:
            if group in (OFF, voice.group):
                voice.goal = 0.0


def joint_peaks(motion: Motion, skeleton: Skeleton) -> tuple[float, float]:
    """The largest speed, rad/s, and acceleration, rad/s^2, of a joint: of a body the turns of its bones."""
    if skeleton.is_rig:
        return motion.speed, motion.acceleration  # of a body of joints both are those of the joints
    turns = motion.postures.rotation
    bent = multiply(conjugate(turns[:, skeleton.parent + 1]), turns[:, 1:])
    rate = to_rotation_vector(multiply(conjugate(bent[:-1]), bent[1:])) / motion.spacing
    hardest = np.linalg.norm(np.diff(rate, axis=0), axis=-1).max(initial=0.0) / motion.spacing
    fastest = np.linalg.norm(rate, axis=-1).max(initial=0.0)
    return max(float(fastest), LEAST_SPEED), max(float(hardest), LEAST_ACCELERATION)
