"""The motions of a library for the deck: entry and exit poses, course, peak speed and acceleration."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from controller.library.motion_library import MotionInfo, MotionLibrary, once_a_library
from controller.motion.clip import between_frames, nearest
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array, dot, normalise, rotate
from controller.motion.skeleton import Posture, Skeleton, walk_path
from controller.networks.base import AnyNetwork, Channels


def course_of(posture: Posture, skeleton: Skeleton) -> Array:
    """The course of a body through postures (S, ...) in its own heading frame, in one array for fast interpolation.

    Of each moment it has the vector along each bone, m, the height of the root, m, its velocity forward and left, m/s,
    and the turn rate of the heading, rad/s, shape (S, 3 B + 4).
    """
    bones = rotate(posture.rotation[:, 1:], skeleton.rest_direction * skeleton.length[:, None])
    moving = np.column_stack([posture.height, posture.velocity, posture.turn_rate])
    return np.concatenate([bones.reshape(len(bones), -1), moving], axis=1)


ENTRY_SHARE = 0.1
HELD_M = 0.02
LEAST_SPEED, LEAST_ACCELERATION = 0.5, 2.0  # m/s, m/s^2; less is standing still
SUMMED = 1.13e-3  # s; sums of ticks, also of 32 bits in an exported player, are off by less; no whole number of ms
PEAKS_OVER = 0.005  # s over which the largest speeds and accelerations are taken; over less a footfall is harder


@dataclass(frozen=True)
class Motion:
    """One motion of a library."""

    name: str
    loop: bool  # whether it is a loop; else it is a one-shot
    places: Array  # joint positions in the heading frame at the anchors where it may be entered, shape (A, F), m
    velocities: Array  # their rates, m/s
    exits: Array  # places where it may be left: all of a loop, the end of a one-shot, shape (E, F), m
    course: Array  # as of `course_of`, at all anchors, those too where it may not be entered
    postures: Posture
    offsets: Array  # of the body of its recording, shape (B, 3), m, as `Skeleton.offsets`
    spacing: float  # from anchor to anchor, s
    seconds: float  # of a round of a loop, or of a one-shot until it holds its last pose
    whole: float  # time until its phase is 1, s
    speed: float  # the largest of any joint in the world, over PEAKS_OVER, m/s
    acceleration: float  # likewise, m/s^2

    def ahead(self, at: Array, rate: Array) -> Array:
        """The course at times (S,), s from its beginning, when it is played at these rates (S,), 1 being its own."""
        place = at / self.spacing
        low, mode = np.floor(place).astype(np.int64), "wrap" if self.loop else "clip"
        first, second = self.course.take(low, 0, mode=mode), self.course.take(low + 1, 0, mode=mode)
        rows = first + (place - low)[:, None] * (second - first)
        rows[:, -3:] *= rate[:, None]
        return rows

    def postures_ahead(self, at: Array, rate: float) -> Posture:
        """The postures at times (S,), s from its beginning, when it is played at this rate, 1 being its own."""
        place = at / self.spacing
        low = np.floor(place)
        near = [(low + beside).astype(np.int64) for beside in (0.0, 1.0)]
        share, stored = place - low, self.postures
        first, second = (now % len(self.course) if self.loop else now.clip(0, len(self.course) - 1) for now in near)

        def between(values: Array) -> Array:
            weight = share.reshape(-1, *[1] * (values.ndim - 1))
            return (1.0 - weight) * values[first] + weight * values[second]

        after = stored.rotation[second]
        side = np.where(dot(stored.rotation[first], after) < 0.0, -1.0, 1.0)[..., None]
        weight = share[:, None, None]
        rotation = normalise((1.0 - weight) * stored.rotation[first] + weight * side * after)
        return Posture(
            between(stored.height), between(stored.velocity) * rate, between(stored.turn_rate) * rate, rotation
        )


def rounds_beside(first: Motion, other: Motion) -> float:
    """Rounds of a loop per round of the first, when both stay in step."""
    # The shorter goes round a whole number of times in each round of the longer, as often as suits its own tempo best.
    ratio = first.seconds / other.seconds
    return float(nearest(ratio)) if ratio >= 1.0 else 1.0 / nearest(1.0 / ratio)


def tempos_in_step(lasts: Sequence[float], weights: Sequence[float]) -> tuple[float, ...]:
    """The tempos at which the loops of a blend stay in step; of each its duration at its own tempo, s, and its weight.

    The durations are over their rounds in a common round, and the weights sum to 1. That round takes the product of
    T_i^w_i, as in a morph inside the network (`phase_conceptor.morph`).
    """
    common = math.prod(own**weight for own, weight in zip(lasts, weights, strict=True))
    return tuple(own / common for own in lasts)


@once_a_library
def read_motions(library: MotionLibrary) -> Mapping[str, Motion]:
    """The motions of a library by name; a one-shot may be entered at its beginning only."""
    return {info.name: read_motion(library, info) for info in library.info.motions}


def read_motion(library: MotionLibrary, info: MotionInfo) -> Motion:
    """One motion of a library."""
    network = library.network.twin()
    frames = library.network.anchors(info.name)
    spacing = info.frames / len(frames) / library.info.rate
    loop = info.plays == "loop"
    places = 1e-3 * joint_features(library.encoding, frames)
    velocities = _rate(places, spacing, loop=loop)
    moving = len(frames) if loop else _moving(places)
    entries = moving if loop else max(1, int(ENTRY_SHARE * moving))
    postures, played = _played(library, network, info, frames)
    speed, acceleration = _peaks(library, played)
    whole = spacing * len(frames)
    if (driven := network.as_phase_network) is not None and not loop:
        whole = driven.period(info.name) / library.info.rate
    return Motion(
        name=info.name,
        loop=loop,
        places=places[:entries].copy(),
        velocities=velocities[:entries].copy(),  # a view would hold all of them
        exits=places if loop else places[-1:].copy(),
        course=course_of(postures, library.encoding.skeleton),
        postures=postures,
        offsets=library.offsets(info.name),
        spacing=spacing,
        seconds=moving * spacing,
        whole=whole,
        speed=speed,
        acceleration=acceleration,
    )


def _moving(places: Array) -> int:
    """The number of frames until only the last pose is held."""
    away = np.abs(places - places[-1]).max(1) > HELD_M
    return int(np.flatnonzero(away)[-1]) + 1 if away.any() else len(places)


def _rate(values: Array, spacing: float, *, loop: bool) -> Array:
    """Central differences along the first axis, periodic for loops."""
    if loop:
        return (np.roll(values, -1, axis=0) - np.roll(values, 1, axis=0)) / (2.0 * spacing)
    return np.gradient(values, spacing, axis=0)


def _played(
    library: MotionLibrary, network: AnyNetwork, info: MotionInfo, anchors: Channels
) -> tuple[Posture, Posture]:
    """The postures of a motion: at its anchors, and each PEAKS_OVER as it is played alone, a little more than once."""
    decode = library.encoding.decode
    network.cue(info.name, 0)  # whatever it has to compute before it plays is computed now, and not in a tick
    if (settled := network.settled(info.name)) is not None:
        anchors = settled[:: -(-len(settled) // len(anchors))]
        frames = np.concatenate([settled, settled[:5] if info.plays == "loop" else settled[-1:]])
    else:
        frames = np.empty((info.frames + 5, network.channels))
        for frame in frames:
            network.advance(frame)
    at = np.arange(1.0, len(frames) - 2.0, PEAKS_OVER * library.info.rate)
    return decode(anchors), decode(between_frames(frames, at))


def _peaks(library: MotionLibrary, played: Posture) -> tuple[float, float]:
    """The largest speed, m/s, and acceleration, m/s^2, of any joint while a motion plays alone, not below LEAST_*."""
    pose = walk_path(played, PEAKS_OVER)
    step = np.diff(library.encoding.skeleton.joints(pose.root_position, pose.rotation), axis=0) / PEAKS_OVER
    speed = float(np.linalg.norm(step, axis=-1).max())
    acceleration = float(np.linalg.norm(np.diff(step, axis=0), axis=-1).max()) / PEAKS_OVER
    return max(speed, LEAST_SPEED), max(acceleration, LEAST_ACCELERATION)
