"""The judge of `benchmarks round_trip` finds joints that are off, late or exchanged, and no fault in good ones."""

import numpy as np
import pytest

from benchmarks.robots.round_trip import SLOWS, compared

RATE, TICKS, SECONDS = 30.0, 120.0, 3.0
LOOP = {"plays": "loop", "from_s": 0.5, "to_s": 0.5 + SECONDS}
ONCE = {"plays": "once", "from_s": 0.5, "to_s": 0.5 + SECONDS + 1.0 / TICKS}


def angles(seconds):
    beat = 2.0 * np.pi * (seconds - 0.5) / SECONDS
    return np.stack([0.5 * np.sin(beat), 0.3 * np.cos(2.0 * beat)], axis=1)


def played(told, late=0.0):
    """What a deck would play: loops three times, a one-shot slower and slower in its last 0.2 s, then its last pose."""
    when = np.arange(round(3.0 * SECONDS * TICKS) + 2) / TICKS - late
    if told["plays"] == "once":
        share = np.clip((when - (SECONDS - SLOWS)) / (2.0 * SLOWS), 0.0, 1.0)
        eased = SECONDS - SLOWS + 2.0 * SLOWS * (share - share**3 + 0.5 * share**4)
        when = np.where(when < SECONDS - SLOWS, when, eased)
    return angles(0.5 + when)


@pytest.mark.parametrize("told", [LOOP, ONCE])
def test_joints_that_are_as_recorded_have_no_error(told):
    recorded = angles(np.arange(round(4.0 * RATE)) / RATE)
    row, off = compared(recorded, RATE, played(told), TICKS, told)
    assert row["within"]
    assert row["worst"] < 0.01
    assert row.get("held", 0.0) < 0.01
    assert off.size == round(row["share"] * len(recorded)) * 2 * (3 if told is LOOP else 1)


@pytest.mark.parametrize("told", [LOOP, ONCE])
@pytest.mark.parametrize("fault", ["one moment", "a frame late", "exchanged"])
def test_joints_that_are_not_are_noticed(told, fault):
    recorded = angles(np.arange(round(4.0 * RATE)) / RATE)
    wrong = played(told, late=1.0 / TICKS if fault == "a frame late" else 0.0)
    if fault == "one moment":
        wrong[round(1.5 * TICKS), 1] += np.radians(1.0)
    if fault == "exchanged":
        wrong = wrong[:, ::-1]
    assert not compared(recorded, RATE, wrong, TICKS, told)[0]["within"]


def test_a_pose_that_is_held_elsewhere_is_noticed():
    wrong = played(ONCE)
    wrong[-1, 0] += np.radians(1.0)
    row, _ = compared(angles(np.arange(round(4.0 * RATE)) / RATE), RATE, wrong, TICKS, ONCE)
    assert row["within"]
    assert row["held"] == pytest.approx(1.0, abs=0.01)
