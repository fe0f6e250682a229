"""The self-test: does every motion of a library run free, and is it the right one?

Each motion is started at its first anchor and left alone for three times its length. What counts is the last third:

- a loop passes if at least 70 % of its windows are nearest to the motion that was meant, the median distance is under
  40 mm or 0.4 of the motion's own spread, and the joints move 0.4 to 2.5 times as fast as in training (still motions
  excepted); and after the first third it has to come by at least 70 % of the motion's windows, to 40 mm, for a network
  may take a short cut where a motion comes near to itself, and play a part of it for ever;
- a one-shot passes if it went through at least 70 % of its moving windows in order, or was where it should be at every
  time (a gesture that is repeated looks like itself), and then holds its last pose to 40 mm.

A network that a center drives knows its phase, so there each frame is compared with the recorded one of the same phase,
and a gesture that is repeated within a motion is not mistaken for itself. It passes if, over the last time that it goes
through the motion, the mean distance is under PHASE_SHARE of the motion's spread (5 mm at least, 40 mm at most) and no
frame is further off than 40 mm.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.motion_matching import (
    LOST_MM,
    Matcher,
    activity,
    joint_features,
    rising_length,
    windows,
)
from controller.motion.rotations import Array
from controller.networks.base import FrameNetwork

RUN_LENGTHS = 3
STILL_MM = 0.3  # from window to window
STILL_SPEED = 36.0  # mm/s
PHASE_SHARE = 0.2
LEAST_BOUND_MM = 5.0
RECOVERED_SECONDS = 0.5  # at the end of a disturbed run, by which it is judged


@dataclass(frozen=True)
class MotionVerdict:
    """The result of the self-test for one motion."""

    passed: bool
    # Median distance to the nearest window of the motion, over the last third of the run, mm; the mean distance at the
    # same phase where that is known.
    error_mm: float
    right: float  # share of those windows that are nearest to this motion and no other (1 for one-shots)
    reason: str  # why it failed, or ""


def run_free(network: FrameNetwork, motion: str, frames: int, anchor: int = 0) -> Array:
    """The channels that a network plays from an anchor of a motion, shape (frames, channels)."""
    network.cue(motion, anchor)
    out = np.empty((frames, network.channels))
    for frame in out:
        network.advance(frame)
    return out


def self_test(network: FrameNetwork, judge: Judge, motions: Iterable[str] | None = None) -> dict[str, MotionVerdict]:
    """Runs motions of a network free (by default all) and judges them: one verdict per motion."""
    return {name: _tested(network, judge, name) for name in (judge.loops if motions is None else motions)}


def _tested(network: FrameNetwork, judge: Judge, motion: str) -> MotionVerdict:
    length = len(judge.features(motion))
    run = run_free(network, motion, RUN_LENGTHS * length)
    if network.as_phase_network is not None:
        return judge.at_the_same_phase(motion, run if judge.loops[motion] else run[:length], length)
    verdict = judge(motion, run)
    if not (verdict.passed and judge.loops[motion]):
        return verdict
    passed_by = judge.share_passed(motion, run[length:])
    if passed_by >= 0.7:
        return verdict
    return replace(verdict, passed=False, reason=f"comes by {passed_by:.0%} of the motion only")


def after_disturbance(network: FrameNetwork, judge: Judge, motion: str, run: Array) -> MotionVerdict:
    """The verdict on the channels (T, C) of a run that was disturbed at its beginning."""
    if network.as_phase_network is not None:
        return judge.at_the_same_phase(motion, run, round(RECOVERED_SECONDS * judge.rate))
    return judge(motion, run)


class Judge:
    """Judges whether a run is the intended motion, by comparing it with all motions.

    `known` are the frames that each motion was learned from, shape (T_j, channels), at `rate` Hz, loops as one
    period; `loops` says which are loops, `holds` whether a one-shot was taught to hold its end.
    """

    def __init__(
        self, encoding: Encoding, known: Mapping[str, Array], loops: dict[str, bool], rate: float, *, holds: bool = True
    ) -> None:
        self.encoding, self.loops, self.rate, self.holds = encoding, loops, rate, holds
        self._references, self._names = known, list(known)
        self._latest = "", np.empty(0)

    def features(self, motion: str) -> Array:
        """The joints of a motion, shape (T_j, F), mm; only the latest ones are kept."""
        if self._latest[0] != motion:
            self._latest = motion, joint_features(self.encoding, self._references[motion])
        return self._latest[1]

    @cached_property
    def _matcher(self) -> Matcher:
        features = [self.features(name) for name in self._names]
        return Matcher(features, [self.loops[name] for name in self._names], self.rate)

    def share_passed(self, motion: str, run: Array) -> float:
        """The share of a motion's windows that a run with channels (T, C) passes within LOST_MM."""
        nearest = self._matcher.nearest(joint_features(self.encoding, run), self._names.index(motion))
        return float(np.mean(nearest <= LOST_MM))

    def at_the_same_phase(self, motion: str, run: Array, last: int) -> MotionVerdict:
        """The verdict on the channels (T, C) of a run from the first frame on, by its `last` frames."""
        if not np.isfinite(run).all():
            return MotionVerdict(False, np.inf, 0.0, "the network ran away")
        reference = self.features(motion)
        frame = np.arange(1, len(run) + 1)[-last:]
        frame = frame % len(reference) if self.loops[motion] else np.minimum(frame, len(reference) - 1)
        off = distances(joint_features(self.encoding, run[-last:]), reference[frame])
        bound = _bound_in_time(reference)
        error, largest = float(off.mean()), float(off.max())
        if error > bound:
            return MotionVerdict(False, error, 1.0, f"{error:.0f} mm off at the same phase, {bound:.0f} mm allowed")
        if largest > LOST_MM:
            return MotionVerdict(False, error, 1.0, f"{largest:.0f} mm off at one frame, {LOST_MM:.0f} mm allowed")
        return MotionVerdict(True, error, 1.0, "")

    def __call__(self, motion: str, run: Array) -> MotionVerdict:
        """The verdict on the channels (T, C) of a run."""
        return self.of_features(motion, joint_features(self.encoding, run))

    def of_features(self, motion: str, run: Array) -> MotionVerdict:
        """The verdict on the features (T, F) of a run."""
        if not np.isfinite(run).all():
            return MotionVerdict(False, np.inf, 0.0, "the network ran away")
        return self._judge_loop(motion, run) if self.loops[motion] else self._judge_once(motion, run)

    def _judge_once(self, motion: str, run: Array) -> MotionVerdict:
        matcher, index, reference = self._matcher, self._names.index(motion), self.features(motion)
        found = matcher.match(run, index, alone=True)
        error = float(np.median(found.distance[2 * len(found.distance) // 3 :]))
        moving = np.square(np.diff(windows(reference, matcher.stride), axis=0)).mean(1) > STILL_MM**2
        places = found.place[found.place < len(moving)]
        passed_through = rising_length(places[moving[places]]) / max(1, int(moving.sum()))
        end = float(distances(run[-1], reference[-1]))
        whole = run[: len(reference) - 1]
        in_time = distances(whole, reference[1 : 1 + len(whole)]).mean() <= _bound_in_time(reference)
        if passed_through < 0.7 and not in_time:
            return MotionVerdict(False, error, 1.0, f"went through {passed_through:.0%} of the motion only")
        if self.holds and end > LOST_MM:
            return MotionVerdict(False, error, 1.0, f"holds a pose {end:.0f} mm away from the last one")
        return MotionVerdict(True, error, 1.0, "")

    def _judge_loop(self, motion: str, run: Array) -> MotionVerdict:
        matcher, index, reference = self._matcher, self._names.index(motion), self.features(motion)
        found = matcher.match(run[matcher.stride * (2 * matcher.window_count(len(run)) // 3) :], index)
        error = float(np.median(found.distance))
        right = float(np.mean(found.motion == index))
        bound = max(LOST_MM, 0.4 * matcher.spread(index))
        own = activity(reference, self.rate)
        pace = activity(run[2 * len(run) // 3 :], self.rate) / own if own > STILL_SPEED else 1.0
        if right < 0.7:
            return MotionVerdict(False, error, right, f"only {right:.0%} of it looks like this motion")
        if error > bound:
            return MotionVerdict(False, error, right, f"{error:.0f} mm off, {bound:.0f} mm allowed")
        if not 0.4 <= pace <= 2.5:
            return MotionVerdict(False, error, right, f"moves {pace:.2f} times as fast as it should")
        return MotionVerdict(True, error, right, "")


def distances(features: Array, others: Array) -> Array:
    """The root mean square distance of joints between features (T, F) and others (T, F) or (F,), shape (T,), mm."""
    return np.sqrt(np.square(features - others).sum(-1) / (features.shape[-1] / 3.0))


def _bound_in_time(reference: Array) -> float:
    """The largest mean distance of a motion from its features (T, F) at the same phase or time, mm."""
    spread = float(np.sqrt(np.square(distances(reference, reference.mean(0))).mean()))
    return min(max(PHASE_SHARE * spread, LEAST_BOUND_MM), LOST_MM)
