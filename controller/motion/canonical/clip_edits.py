"""Edits of clips: resampling, trimming, mirroring, and detection of jumps and spikes."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from controller.motion import rotations
from controller.motion.canonical.canonical_body import CANONICAL_BONES, to_canonical
from controller.motion.clip import Clip
from controller.motion.rotations import Array, Flags, Indices, by_blocks, conjugate, continuous, multiply, normalise
from motiondeck_base.errors import FileFormatError
from motiondeck_base.words import counted

STILL_SPEED = 0.05  # m/s: a body with slower joints stands still
STILL_KEPT = 0.1  # s of stillness kept before and after the motion
# A reference pose before the motion ends with a jump: within the first seconds, by a least distance (m) and a factor
# over the largest step of a joint in the seconds that follow.
JUMP_WITHIN, JUMP, JUMP_TIMES, AFTER_JUMP = 0.1, 0.1, 5.0, 0.25
FASTEST_BODY = 20.0  # m/s: a faster body was pasted or lost
SPIKE = 0.25  # m: least deviation of a joint from its path
FASTEST_TURN = 600.0  # m/s^2, that no limb reaches
SMOOTHED = 0.1  # s over which speeds are averaged: marker noise is fast


def resampled(clip: Clip, rate: float) -> Clip:
    """The same motion at another rate, Hz: cubics through four frames (Catmull-Rom), for rotations in tangent space.

    The first frame stays; the last one is the last within the recording, extrapolated by a parabola of its last three.
    """
    if abs(rate - clip.rate) <= 1e-6 * rate:
        return clip
    count = int(np.floor((len(clip) - 1) * rate / clip.rate + 1e-6)) + 1
    at = np.minimum(np.arange(count) * (clip.rate / rate), len(clip) - 1)
    low = np.minimum(at.astype(np.int64), max(len(clip) - 2, 0))
    ends = (low == 0, low == len(clip) - 2) if len(clip) > 2 else (low < 0, low < 0)
    return replace(interpolated(clip, low, lambda points: _catmull_rom(points, *ends, at - low)), rate=rate)


def interpolated(clip: Clip, low: Indices, between: Callable[[list[Array]], Array]) -> Clip:
    """A clip with a frame behind each frame `low`, shape (T,): `between` gets what four frames around it have.

    These are positions of the root, shape (T, 3), and rotation vectors from the frame `low`, shape (T, B, 3).
    """
    near = [np.clip(low + step, 0, len(clip) - 1) for step in (-1, 0, 1, 2)]
    position = between([clip.root_position[index] for index in near])
    start = clip.rotation[low]
    turns = [rotations.to_rotation_vector(multiply(conjugate(start), clip.rotation[index])) for index in near]
    rotation = normalise(multiply(start, rotations.from_rotation_vector(between(turns))))
    return replace(clip, root_position=position, rotation=continuous(rotation))


def cubic(start: Array, slope: Array, end: Array, slope_end: Array, s: Array) -> Array:
    """The cubic between two points with slopes over all of the way between them, at shares `s` of it (Hermite)."""
    before, after = (1.0 - s) ** 2, s**2
    return before * ((1.0 + 2.0 * s) * start + s * slope) + after * ((3.0 - 2.0 * s) * end + (s - 1.0) * slope_end)


def _catmull_rom(points: list[Array], at_first: Flags, at_last: Flags, s: Array) -> Array:
    """Between the second and the third of four points at shares of 0 to 1; beyond an end they are extrapolated."""
    before, start, end, after = points
    shape = (-1, *[1] * (start.ndim - 1))
    ahead = np.where(at_first.reshape(shape), 3.0 * (start - end) + after, before)
    beyond = np.where(at_last.reshape(shape), 3.0 * (end - start) + before, after)
    return cubic(start, 0.5 * (end - ahead), end, 0.5 * (beyond - start), s.reshape(shape))


def moving_part(clip: Clip) -> tuple[int, int]:
    """The frames (first, end) between still ends, without a reference pose (arms out); (0, 0) if nothing moves."""
    if len(clip) < 2:
        return 0, 0
    joints = clip.joints()
    skipped = _reference_frames(joints, clip.rate)
    first, end = _between_still_ends(joints[skipped:], clip.rate)
    return (first + skipped, end + skipped) if end else (0, 0)


def jumps(clip: Clip) -> list[int]:
    """The frames at which the body has moved faster than FASTEST_BODY since the frame before."""
    step = np.sqrt(np.square(np.diff(clip.root_position, axis=0)).sum(-1))
    return [int(frame) + 1 for frame in np.flatnonzero(step * clip.rate > FASTEST_BODY)]


def spikes(clip: Clip) -> list[tuple[int, int]]:
    """The frames in which a joint is far from the middle of its neighbours in time, and the bone that ends there."""
    if len(clip) < 3:
        return []
    own = clip.joints()[:, 1:] - clip.root_position[:, None]
    aside = by_blocks(lambda a, b, c: np.sqrt(np.square(b - 0.5 * (c + a)).sum(-1)), own[:-2], own[1:-1], own[2:])
    bone = aside.argmax(axis=1)
    at = np.flatnonzero(aside.max(axis=1) > max(SPIKE, 0.5 * FASTEST_TURN / clip.rate**2))
    return [(int(frame) + 1, int(bone[frame])) for frame in at]


def breaks(clip: Clip, first: int = 0, end: int | None = None) -> tuple[list[int], list[str]]:
    """The frames at which to cut for jumps and spikes, by default of all, and a phrase for each kind with times."""
    part = span(clip, first, len(clip) if end is None else end)
    jumped = [first + jump for jump in jumps(part)]
    spiked = [(first + frame, bone) for frame, bone in spikes(part)]
    found: list[str] = []
    if jumped:
        far = max(float(np.linalg.norm(clip.root_position[frame] - clip.root_position[frame - 1])) for frame in jumped)
        found.append(f"the body jumps by up to {far:.1f} m between two frames {_times(jumped, clip.rate)}")
    if spiked:
        bone, when = clip.skeleton.bones[spiked[0][1]], _times([frame for frame, _ in spiked], clip.rate)
        found.append(f"the end of bone '{bone}' is elsewhere for a moment {when}")
    return sorted({*jumped, *(edge for frame, _ in spiked for edge in (frame, frame + 1))}), found


def _times(frames: Sequence[int], rate: float) -> str:
    """The first time of an event in s, and the number of further ones; adjacent frames are one event."""
    more = sum(later > frame + 2 for frame, later in pairwise(frames))
    return f"at {frames[0] / rate:.2f} s" + (f" and {counted(more, 'more time')}" if more else "")


def without_reference_pose(clip: Clip) -> tuple[Clip, int]:
    """A clip without the reference pose before its motion, and the number of frames removed."""
    skipped = _reference_frames(clip.joints(), clip.rate) if len(clip) > 2 else 0
    return (span(clip, skipped, len(clip)) if skipped else clip), skipped


def _reference_frames(joints: Array, rate: float) -> int:
    within, after = max(1, round(JUMP_WITHIN * rate)), max(2, round(AFTER_JUMP * rate))
    step = np.sqrt(np.square(np.diff(joints[: within + after + 2], axis=0)).sum(-1)).max(1)
    for frame in range(min(within, len(step) - 2)):
        following = step[frame + 1 : frame + 1 + after]
        if step[frame] > max(JUMP, JUMP_TIMES * float(following.max())):
            return frame + 1
    return 0


def _between_still_ends(joints: Array, rate: float) -> tuple[int, int]:
    """The frames (first, end) in which joints (T, J, 3) move; (0, 0) if none does."""
    width = max(1, round(SMOOTHED * rate))
    count = len(joints)
    ahead = joints[width:] - joints[:-width] if count > width else joints[-1:] - joints[:1]
    speed = by_blocks(lambda way: np.sqrt(np.square(way).sum(-1)).max(axis=1), ahead) * rate
    speed = speed / max(1, min(width, count - 1))
    moving = np.flatnonzero(speed > STILL_SPEED)
    if len(moving) == 0:
        return 0, 0
    kept = round(STILL_KEPT * rate)
    first = max(0, int(moving[0]) + width // 2 - kept)
    return (0 if first < kept else first), min(count, int(moving[-1]) + width + 1 + kept)


def mirrored(clip: Clip) -> Clip:
    """The motion on the canonical body with left and right exchanged (FileFormatError for a rig, or without legs)."""
    if clip.skeleton.is_rig:
        raise FileFormatError(f"clip '{clip.name}': a rig's joints have no left and right to exchange here")
    own = to_canonical(clip)
    swapped = {"l" + end: "r" + end for end in _SIDED} | {"r" + end: "l" + end for end in _SIDED}
    partner = np.array([CANONICAL_BONES.index(swapped.get(bone, bone)) for bone in CANONICAL_BONES])
    rotation = own.rotation[:, np.concatenate([[0], 1 + partner])] * np.array([1.0, -1.0, 1.0, -1.0])
    aside, body = np.array([1.0, -1.0, 1.0]), own.skeleton
    body = replace(body, length=body.length[partner], rest_direction=body.rest_direction[partner] * aside)
    return replace(own, skeleton=body, root_position=own.root_position * aside, rotation=rotation)


def mirrored_joints(clip: Clip, signs: Mapping[str, int]) -> Clip:
    """The motion of a rig with left_ and right_ joints exchanged, each times its sign, -1 or 1, by its name.

    FileFormatError names a joint without a sign or without its twin.
    """
    joints = clip.skeleton.bones
    if unknown := [name for name in joints if name not in signs]:
        raise FileFormatError(
            f"{clip.source}: how {', '.join(unknown)} turns in a mirror is not known. Write mirror = 1 or -1 "
            "into the row of each in the rig file."
        )
    twins = [twin_of(name) for name in joints]
    if lone := [name for name, twin in zip(joints, twins, strict=True) if twin not in joints]:
        raise FileFormatError(f"{clip.source}: {lone[0]} has no twin {twin_of(lone[0])}. Add it, at rest if need be.")
    rotation = clip.rotation.copy()
    rotation[:, 1:] = rotation[:, [1 + joints.index(twin) for twin in twins]]
    rotation[:, 1:, 3] *= [signs[name] for name in joints]
    return replace(clip, rotation=rotation)


def twin_of(joint: str) -> str:
    """The name of the joint on the other side: left and right, or l and r, exchanged; of others the same."""
    return _SIDE.sub(lambda found: _OTHER[found[0]], joint)


_OTHER = {"left": "right", "right": "left", "Left": "Right", "Right": "Left", "l": "r", "r": "l", "L": "R", "R": "L"}
_SIDE = re.compile("(?<![A-Za-z])(left|right|Left|Right|[lrLR])(?![A-Za-z])")
_SIDED = {bone[1:] for bone in CANONICAL_BONES if bone[0] == "l"}


def span(clip: Clip, first: int, end: int) -> Clip:
    """The frames of a clip from `first` to `end`."""
    return replace(clip, root_position=clip.root_position[first:end], rotation=clip.rotation[first:end])


def thinned(clip: Clip, rate: float) -> Clip:
    """Every n-th frame of a clip, so that about `rate` of them, Hz, are left."""
    n = max(1, round(clip.rate / rate))
    return replace(clip, rate=clip.rate / n, root_position=clip.root_position[::n], rotation=clip.rotation[::n])


def seconds_of(clip: Clip, begin: float, end: float | None = None) -> Clip:
    """The piece of a clip between two times, s, by default up to its end (FileFormatError beyond it)."""
    frames = len(clip) if end is None else round(end * clip.rate)
    first = round(begin * clip.rate)
    if not 0 <= first < frames <= len(clip):
        until = "its end" if end is None else f"{end:g} s"
        raise FileFormatError(
            f"{clip.source}: from {begin:g} s to {until} is no piece of {clip.duration:.2f} s. Give times within it."
        )
    return replace(span(clip, first, frames), plays=None)  # a piece of a loop is none
