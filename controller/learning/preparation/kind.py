"""Decides whether a recording is a loop: it returns to an earlier state, and it is repeated or moves on through there.

A gesture that begins and ends in the same rest is no loop, though its ends meet.
"""

from typing import NamedTuple

import numpy as np

from controller.learning.measures.self_test import distances
from controller.learning.preparation.loops import best_seam, eased_mm, in_place, largest_omission, with_velocities
from controller.learning.preparation.takes import spread_of
from controller.motion.clip import Decision, Plays
from controller.motion.rotations import Array

LOOP_KEEPS = 0.5  # a loop keeps at least this share of its recording
# Of a repeated motion whose ends deviate by more than EASED_MM once the seam is eased out, one round of at least ROUND
# periods is kept, if that deviates by LESS of it.
EASED_MM, ROUND, LESS = 10.0, 0.85, 0.8
# Largest mismatch at the seam of a loop: of joints, mm, and with velocities, relative to the spread of the motion; of
# joints any, if that share is below LARGE_MOTION; and largest distance of omitted frames from the loop, likewise.
SEAM_MM, SEAM_SHARE, LARGE_MOTION, LEFT_OUT_SHARE = 45.0, 0.5, 0.33, 0.6
# A repeated motion has at least PERIODS. Poses a period apart differ by at most ALIKE of what poses at any two times
# do, and those at a shorter lag by RISES more.
PERIODS, ALIKE, RISES = 1.4, 0.35, 0.25
SHORTEST_PERIOD = 0.3  # s
MOVES_ON = 0.8  # least speed at both ends of a single period, relative to its mean
ENDS_SECONDS = 0.1  # over which the speed at an end is measured


class FoundKind(NamedTuple):
    """How a recording plays, and the cut of its best seam."""

    plays: Plays
    seam: tuple[int, int]  # frames
    decision: Decision
    one_round: bool = False  # whether the seam is that of one round out of several


def kind_of(features: Array, rate: float, given: Plays | None = None) -> FoundKind:
    """How a motion with joint positions (T, F), mm, at a rate in Hz plays; `given` overrules the figures."""
    places = in_place(features)
    seam = best_seam(places, rate, at_least=LOOP_KEEPS)
    apart = float(distances(features[seam.end], features[seam.start]))
    seen = with_velocities(features, rate)
    spread = spread_of(seen)
    mismatch = float(np.linalg.norm(seen[seam.end] - seen[seam.start])) / spread
    omitted = largest_omission(seen, seam) / spread
    found, pace = periods(features, rate), pace_at_ends(features, rate)
    meets = (apart < SEAM_MM and mismatch < SEAM_SHARE) or mismatch < LARGE_MOTION
    returns = meets and omitted < LEFT_OUT_SHARE
    plays: Plays = given or ("loop" if returns and (found >= PERIODS or pace >= MOVES_ON) else "once")
    why = (
        f"{found:.1f} periods of at least {PERIODS:g}, or a speed at the ends of {pace:.2f} of at least {MOVES_ON:g} "
        f"of the mean; seam {apart:.0f} mm of at most {SEAM_MM:.0f}, and {mismatch:.2f} of {SEAM_SHARE:g} of the "
        f"motion's spread ({LARGE_MOTION:g} alone suffices); left out {omitted:.2f} of "
        f"{LEFT_OUT_SHARE:g} of it"
    )
    words = ("a loop" if plays == "loop" else "once") + (", as given" if given else "")
    decision = Decision("kind", words, why, "--as, or plays in the recipe")
    if plays == "loop" and found >= PERIODS and (off := eased_mm(places, seam, rate)) > EASED_MM:
        one = best_seam(places, rate, at_least=min(LOOP_KEEPS, ROUND / found))
        if eased_mm(places, one, rate) < LESS * off:
            return FoundKind(plays, (one.start, one.end), decision, one_round=True)
    return FoundKind(plays, (seam.start, seam.end), decision)


def periods(features: Array, rate: float) -> float:
    """How often a motion (T, F) at a rate in Hz is repeated in its recording; 1 if it is not.

    The mean square distance of poses a lag apart follows from the autocorrelation; the first dip in it is the period.
    """
    frames, centred = len(features), features - features.mean(0)
    lags = np.arange(1, frames - 1)
    spectrum = np.square(np.abs(np.fft.rfft(centred, 2 * frames, axis=0))).sum(1)
    product = np.fft.irfft(spectrum)[lags]
    square = np.concatenate([[0.0], np.cumsum(np.square(centred).sum(1))])
    total = square[frames - lags] + square[-1] - square[lags] - 2.0 * product
    apart = np.sqrt(np.maximum(total, 0.0) / (frames - lags)) / (np.sqrt(2.0) * spread_of(features) + 1e-9)
    for at in range(round(SHORTEST_PERIOD * rate), len(apart) - 1):
        dips = apart[at] <= min(apart[at - 1], apart[at + 1]) and apart[at] < ALIKE
        if dips and apart[:at].max() > apart[at] + RISES:
            return frames / float(lags[at])
    return 1.0


def pace_at_ends(features: Array, rate: float) -> float:
    """The smaller one of the mean speeds at both ends of a motion (T, F) at a rate in Hz, relative to its mean."""
    speed = np.linalg.norm(np.diff(features, axis=0), axis=1)
    few = max(2, round(ENDS_SECONDS * rate))
    return float(min(speed[:few].mean(), speed[-few:].mean()) / (speed.mean() + 1e-9))
