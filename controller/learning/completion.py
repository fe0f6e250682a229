"""The whole of a recording from some points of its body, or some joints of its rig: ridge regression on a window.

    y(n) = W [s(n + k)]_k + w,    k from -0.4 to 0.4 s

W and w are learned from whole recordings, each at three tempos. s are the points in the frame of moment n (on the
ground below their middle, x along the smoothed line from right to left), and y the root and the directions of all bones
in it; of a rig, s are the angles of some joints and y those of all. docs/networks.md ("A body that drives") has rivals.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

from controller.deck.person_body import paired
from controller.motion.canonical.actors import actors_of, nearest_to_all
from controller.motion.canonical.canonical_body import carried, to_canonical
from controller.motion.canonical.clip_edits import resampled
from controller.motion.clip import AS_FOUND, Clip, Markers, between_rows, bridged
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.reading import read_as_stored, read_clip
from controller.motion.formats.taught_clip import taught_clip
from controller.motion.orientation import orient
from controller.motion.rotations import Array, conjugate, continuous, normalise, rotate, yaw
from controller.motion.skeleton import Skeleton
from controller.motion.take.steps import taken
from controller.motion.up_axis import TO_OURS
from controller.networks.ridge import affine_ridge
from motiondeck_base.errors import FileFormatError, MotiondeckError, UnknownNameError

_AFTER = (0.033, 0.067, 0.1, 0.17, 0.27, 0.4)  # s
WINDOW = (0.0, *_AFTER, *(-lag for lag in _AFTER))
SMOOTHED = 0.2  # s, standard deviation over which the line from right to left is smoothed
RATE, TEMPOS = 30.0, (0.5, 1.0, 2.0)  # of the lessons, Hz
RIDGE = 0.01  # of the regression on windows of deviation 1, per frame


def complete_recording(path: Path, like: Sequence[Path], names: Sequence[str], height: float | None) -> Clip:
    """The whole of a recording from what it has of these names (all, if none), learned from recordings `like` it.

    A body is that of the recordings, or as high as `height`, m. FileFormatError for what is not read, and for bodies
    beside rigs; other errors as below.
    """
    found, known = read_as_stored(path), [resampled(read_clip(one), RATE) for one in like]
    rig = found if isinstance(found, Clip) and found.skeleton.is_rig else None
    if any(clip.skeleton.is_rig != (rig is not None) for clip in known):
        raise FileFormatError(f"{path}: --like needs recordings of {'rigs' if rig is not None else 'bodies'} alone.")
    if rig is not None:
        return complete_joints(rig, names or rig.skeleton.bones, known)
    if isinstance(found, Clip):
        clip = to_canonical(taken(found, AS_FOUND))
        found = Markers(("root", *clip.skeleton.bones), clip.rate, clip.joints(), "z", clip.source)
    body = nearest_to_all(actors_of({str(index): clip for index, clip in enumerate(known)})).body
    if height is not None:
        body = replace(body, length=body.length * height / body.stature)
    return complete_body(found, names or found.labels, known, body)


def complete_body(points: Markers, labels: Sequence[str], known: Sequence[Clip], body: Skeleton) -> Clip:
    """The body from those points of these labels, its joints or `root`; recordings are carried to it.

    MotiondeckError without points of a left and a right side, or for one that is never seen; UnknownNameError for one
    that the body, or the recording, lacks.
    """
    own = UnknownNameError.indices("point", labels, ("root", *body.bones))
    given = points.position[:, UnknownNameError.indices("point", labels, points.labels)].swapaxes(0, 1)
    if not (pairs := paired(labels)):
        raise MotiondeckError(f"{points.source}: give a point with its twin on the right, such as lhan and rhan")
    if unseen := [label for label, place in zip(labels, given, strict=True) if np.isnan(place).all()]:
        raise MotiondeckError(f"{points.source}: {unseen[0]} is never seen. Name the other points in --from.")
    right, left = map(list, zip(*pairs, strict=True))

    def windows(place: Array, rate: float) -> tuple[Array, Array, Array]:
        """Those of points (T, K, 3), and origins (T, 3) and rotations (T, 4) of their frames."""
        line = (place[:, left, :2] - place[:, right, :2]).mean(1)
        turn = yaw(np.arctan2(*gaussian_filter1d(line, SMOOTHED * rate, axis=0, mode="nearest").T[::-1]))
        origin = place.mean(1) * [1.0, 1.0, 0.0]
        seen = rotate(conjugate(turn)[:, None], _window(place, rate) - origin[:, None])
        return seen.reshape(len(place), -1), origin, turn

    lessons: list[tuple[Array, Array]] = []
    for clip in known:
        whole = carried(clip, body)
        joints, bones = whole.joints(), rotate(whole.rotation[:, 1:], body.rest_direction)
        for tempo in TEMPOS:
            window, origin, turn = windows(joints[:, own], clip.rate * tempo)
            rows = np.concatenate([joints[:, :1] - origin[:, None], bones], axis=1)
            lessons.append((window, rotate(conjugate(turn)[:, None], rows).reshape(len(rows), -1)))
    seen = rotate(TO_OURS["y" if points.up == "y" else "z"], np.stack([bridged(place) for place in given], axis=1))
    window, origin, turn = windows(seen, points.rate)
    found = rotate(turn[:, None], _regressed(lessons, window).reshape(len(seen), -1, 3))
    rotation = continuous(orient(body, normalise(found[:, 1:])))
    return Clip(points.source.rpartition(".")[0], body, points.rate, origin + found[:, 0], rotation, points.source)


def complete_joints(part: Clip, names: Sequence[str], known: Sequence[Clip]) -> Clip:
    """All joints of recordings of a rig from those of these names, which stay as they are.

    UnknownNameError for a joint that either lacks. FileFormatError if the recordings have not the same joints.
    """
    joints, lessons = known[0].skeleton.bones, list[tuple[Array, Array]]()
    own, given = (UnknownNameError.indices("joint", names, bones) for bones in (joints, part.skeleton.bones))
    for clip in known:
        angles = angles_of(carried(clip, known[0].skeleton).rotation[:, 1:])
        lessons += [(_window(angles[:, own], clip.rate * tempo), angles) for tempo in TEMPOS]
    seen = angles_of(part.rotation[:, 1:])[:, given]
    whole = _regressed(lessons, _window(seen, part.rate))
    whole[:, own] = seen
    return taught_clip(part.name, joints, part.rate, whole, part.source, part.plays)


def _window(values: Array, rate: float) -> Array:
    """Values (T, K, ...) at the moments about each, side by side, (T, W K, ...); the ends are held."""
    now, rows = np.arange(len(values), dtype=np.float64), values.reshape(len(values), -1)
    return np.concatenate([between_rows(rows, now, now + lag * rate).reshape(values.shape) for lag in WINDOW], axis=1)


def _regressed(lessons: Sequence[tuple[Array, Array]], asked: Array) -> Array:
    x, y = (np.concatenate([lesson[side] for lesson in lessons]) for side in (0, 1))
    middle, spread = x.mean(0), np.maximum(x.std(0), 1e-6)
    weights = affine_ridge((x - middle) / spread, y, RIDGE * len(x))
    return (asked - middle) / spread @ weights[:, :-1].T + weights[:, -1]
