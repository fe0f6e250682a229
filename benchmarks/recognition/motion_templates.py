"""Motion templates (Mueller and Roeder 2006): what all examples of a class have in common, as true, false or either.

A frame becomes a row of yes-or-no relations between body parts ("is the left hand above the head?"). The examples of a
class are warped onto each other and averaged; what they agree on is yes or no, the rest does not count. A motion
belongs to the template it can be warped onto at the least cost. The relations below are ours, in the spirit of the
paper's 39.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from benchmarks.recognition.alignment import warped, warping_path
from benchmarks.recognition.methods import Scorer, learned_by_class
from controller.learning.recognition.features import resampled
from controller.learning.recognition.labelled_recordings import Example
from controller.motion.rotations import Array, Indices, conjugate, rotate, yaw
from motiondeck_base.errors import MotiondeckError

RATE = 15.0  # Hz
AGREED = 0.15  # within this of 0 or 1 the examples agree
ROUNDS = 3
NEEDED = tuple(side + bone for bone in ("femur", "tibia", "foot", "humerus", "radius", "wrist") for side in "lr")
NEEDED = (*NEEDED, "thorax", "head")


def relations(example: Example, stretch: float) -> Array:
    """Yes (1) or no (0) to each relation, frame by frame, shape (T, 34); lengths are shares of the leg's.

    Raises:
        MotiondeckError: if the skeleton lacks one of the joints they speak of.
    """
    clip = example.clip
    missing = [joint for joint in NEEDED if joint not in clip.skeleton.bones]
    if missing:
        raise MotiondeckError(
            f"{example.path}: motion templates need a bone '{missing[0]}', which is not in its skeleton."
        )
    world = resampled(clip.joints().reshape(len(clip), -1), clip.rate / stretch, RATE).reshape(
        -1, len(clip.skeleton) + 1, 3
    )
    facing = resampled(np.unwrap(clip.heading())[:, None], clip.rate / stretch, RATE)[:, 0]
    leg = clip.skeleton.leg_length
    seen = rotate(conjugate(yaw(facing))[:, None], world - world[:, :1]) / leg
    joint = {name: seen[:, clip.skeleton.index(name) + 1] for name in NEEDED}
    floor = float(world[:, :, 2].min())
    root_height = (world[:, 0, 2] - floor) / leg
    root_speed = _speed(world[:, 0]) / leg
    said = [
        root_height < 0.8,
        root_height < 0.5,
        root_speed > 0.5,
        _rate(world[:, 0, 2]) / leg > 0.4,
        _rate(world[:, 0, 2]) / leg < -0.4,
        np.linalg.norm(joint["lwrist"] - joint["rwrist"], axis=1) < 0.35,
        np.linalg.norm(joint["lfoot"] - joint["rfoot"], axis=1) > 0.5,
        joint["head"][:, 2] < 0.45,
    ]
    for own, other in (("l", "r"), ("r", "l")):
        hand, foot = joint[own + "wrist"], joint[own + "foot"]
        outward = 1.0 if own == "l" else -1.0
        said += [
            hand[:, 2] > joint["head"][:, 2],
            hand[:, 2] > joint[own + "humerus"][:, 2],
            hand[:, 0] > 0.25,
            hand[:, 0] < 0.0,
            outward * hand[:, 1] > 0.45,
            _bend(joint["thorax"], joint[own + "humerus"], hand) < np.radians(110.0),
            np.linalg.norm(hand - joint[other + "tibia"], axis=1) < 0.3,
            _speed(world[:, clip.skeleton.index(own + "wrist") + 1] - world[:, 0]) / leg > 1.2,
            _bend(joint[own + "femur"] * 0.0, joint[own + "femur"], joint[own + "tibia"]) < np.radians(130.0),
            foot[:, 0] > 0.3,
            foot[:, 0] < -0.3,
            foot[:, 2] - joint[other + "foot"][:, 2] > 0.15,
            _speed(world[:, clip.skeleton.index(own + "foot") + 1] - world[:, 0]) / leg > 1.2,
        ]
    return np.column_stack(said).astype(np.float64)


def template(examples: list[Array]) -> tuple[Array, NDArray[np.bool_]]:
    """What examples (T_j, F) have in common.

    Returns:
        The mean relations along the class's time, shape (T, F), and which of them count, shape (T, F).
    """
    lengths = [len(example) for example in examples]
    mean = examples[int(np.argsort(lengths)[len(lengths) // 2])]
    for _ in range(ROUNDS):
        warps = [_warped_onto(mean, example) for example in examples]
        mean = np.asarray(np.mean(warps, axis=0), dtype=np.float64)
    return mean, (mean < AGREED) | (mean > 1.0 - AGREED)


def motion_templates(signals: list[Array], labels: Indices, classes: int) -> Scorer:
    """The template a motion can be warped onto at the least cost per frame; signals are `relations`."""

    def score(learn: Indices, ask: Indices) -> Array:
        costs = np.full((len(ask), classes), np.inf)
        for label, own in enumerate(learned_by_class(learn, labels, classes)):
            if len(own):
                mean, counts = template([signals[i] for i in own])
                for row, i in enumerate(ask):
                    costs[row, label] = _cost(signals[i], mean, counts)
        return costs

    return score


def _cost(signal: Array, mean: Array, counts: NDArray[np.bool_]) -> float:
    """The mean disagreement along the best warping, as a share of the relations that count."""
    agreed = np.where(counts, (mean > 0.5).astype(np.float64), 0.0)
    # |s - a| summed over what counts, for zeros and ones: s + a - 2 s a.
    weight = counts.astype(np.float64)
    differ = signal @ weight.T + agreed.sum(1) - 2.0 * signal @ agreed.T
    table = warped((differ / np.maximum(weight.sum(1), 1.0))[None])
    return float(table[0, -1, -1]) / max(len(signal), len(mean))


def _warped_onto(reference: Array, example: Array) -> Array:
    """An example brought to a reference's time: where several frames meet one, their mean."""
    path = np.array(warping_path(warped(_differences(reference, example))[0]))
    out = np.zeros_like(reference)
    np.add.at(out, path[:, 0], example[path[:, 1]])
    return out / np.bincount(path[:, 0], minlength=len(reference))[:, None]


def _differences(a: Array, b: Array) -> Array:
    """In how many relations each frame of a differs from each of b, shape (1, n, m)."""
    return np.asarray(cdist(a, b, "cityblock"), dtype=np.float64)[None]


def _bend(a: Array, b: Array, c: Array) -> Array:
    """The angle at b between a and c, rad."""
    u, v = a - b, c - b
    cosine = np.einsum("ij,ij->i", u, v) / np.maximum(np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1), 1e-9)
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def _rate(values: Array) -> Array:
    return np.gradient(values, 1.0 / RATE, axis=0) if len(values) > 1 else np.zeros_like(values)


def _speed(points: Array) -> Array:
    return np.linalg.norm(_rate(points), axis=1)
