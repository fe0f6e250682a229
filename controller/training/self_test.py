"""The self-test: does every motion of a library run free, and is it the right one?

Each motion is started at its first anchor and left alone for three times its length. What counts is the last third:

- a loop passes if at least 70 % of its windows are nearest to the motion that was meant, the median distance is under
  40 mm or 0.4 of the motion's own spread, and the joints move 0.4 to 2.5 times as fast as in training (still motions
  excepted);
- a motion that happens once passes if it went through at least 70 % of its moving windows in order and then holds its
  last pose to 40 mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.evaluation.matching import LOST_MM, Matcher, activity, joint_features, rising_length, windows
from controller.generators.base import FrameNetwork
from controller.mocap.bone_directions import BoneDirections
from controller.rotations import Array

RUN_LENGTHS = 3
STILL_MM = 0.3


@dataclass(frozen=True)
class Verdict:
    """What the self-test found.

    Attributes:
        passed: whether the motion may be played.
        error_mm: median distance to the nearest window of the motion, over the last third of the run, mm.
        right: share of those windows that are nearest to this motion and no other (1 for motions that happen once).
        reason: why it failed, or "".
    """

    passed: bool
    error_mm: float
    right: float
    reason: str


def run_free(network: FrameNetwork, motion: str, frames: int) -> Array:
    """What a network plays when started at a motion's first anchor, shape (frames, channels)."""
    network.cue(motion, 0)
    out = np.empty((frames, network.channels))
    for frame in out:
        network.advance(frame)
    return out


def self_test(
    network: FrameNetwork, encoding: BoneDirections, references: dict[str, Array], loops: dict[str, bool]
) -> dict[str, Verdict]:
    """Runs every motion of a network free and judges it.

    Args:
        network: what is tested.
        encoding: of its channels.
        references: the frames that each motion was learned from, shape (T_j, channels); loops as one period.
        loops: whether each motion is a loop.

    Returns:
        One verdict a motion.
    """
    names = list(references)
    features = [joint_features(encoding, references[name]) for name in names]
    matcher = Matcher(features, [loops[name] for name in names])
    return {
        name: judge(
            joint_features(encoding, run_free(network, name, RUN_LENGTHS * len(references[name]))),
            matcher,
            index,
            features[index],
            loop=loops[name],
        )
        for index, name in enumerate(names)
    }


def judge(run: Array, matcher: Matcher, index: int, reference: Array, *, loop: bool) -> Verdict:
    """The verdict on one run of features (T, F) of the motion at an index, learned from reference features."""
    if not np.isfinite(run).all():
        return Verdict(False, np.inf, 0.0, "the network ran away")
    found = matcher.match(run, index)
    last = slice(2 * len(found.motion) // 3, None)
    error = float(np.median(found.distance[last]))
    if not loop:
        own = windows(reference)
        moving = np.square(np.diff(own, axis=0)).mean(1) > STILL_MM**2
        places = found.place[found.place < len(moving)]
        passed_through = rising_length(places[moving[places]]) / max(1, int(moving.sum()))
        end = float(np.sqrt(np.square(run[-1] - reference[-1]).sum() / (len(run[-1]) / 3.0)))
        if passed_through < 0.7:
            return Verdict(False, error, 1.0, f"went through {passed_through:.0%} of the motion only")
        if end > LOST_MM:
            return Verdict(False, error, 1.0, f"holds a pose {end:.0f} mm away from the last one")
        return Verdict(True, error, 1.0, "")
    right = float(np.mean(found.motion[last] == index))
    bound = max(LOST_MM, 0.4 * matcher.spread(index))
    own = activity(reference)
    pace = activity(run[2 * len(run) // 3 :]) / own if own > STILL_MM else 1.0
    if right < 0.7:
        return Verdict(False, error, right, f"only {right:.0%} of it looks like this motion")
    if error > bound:
        return Verdict(False, error, right, f"{error:.0f} mm off, {bound:.0f} mm allowed")
    if not 0.4 <= pace <= 2.5:
        return Verdict(False, error, right, f"moves {pace:.2f} times as fast as it should")
    return Verdict(True, error, right, "")
