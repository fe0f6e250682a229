"""A limit holds in time: whatever stalls the loop, joints do not move faster than their limits per second."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.pace import Pace
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.skeleton import Pose

PERIOD_NS = 5_000_000
MOST_AHEAD = 1.25  # ticks: in any time T at most T / period + 2.25 are written, of which the first needs no time
LIMITS = JointLimits(*(np.array([value]) for value in (-3.0, 3.0, 4.7, 200.0, 20_000.0)))
POSE = Pose(np.zeros(3), np.array(0.0), np.array([[1.0, 0.0, 0.0, 0.0]]))


@dataclass
class StalledClock:
    """Time that passes while ticks work, with the two policies of `clock.Ticker`."""

    policy: str
    time: int = 0
    period: float = PERIOD_NS * 1e-9
    overruns: int = 0
    skipped: int = 0
    deadline: int = field(default=0, init=False)

    def now(self):
        return self.time

    def start(self):
        self.deadline = self.time

    def wait(self):
        self.deadline += PERIOD_NS
        self.time = max(self.time, self.deadline)
        late = self.time - self.deadline
        if late > PERIOD_NS:
            self.overruns += 1
            if self.policy == "skip":
                self.skipped += late // PERIOD_NS
                self.deadline += late // PERIOD_NS * PERIOD_NS
        return late


class Swinging:
    """A deck whose joint swings as fast as its limits allow; each update takes 50 us, and some stall."""

    def __init__(self, clock, stalls):
        self.clock, self.stalls, self.updates = clock, stalls, 0
        self.time = 0.0

    def update(self, dt):
        self.updates += 1
        self.time += dt
        self.clock.time += 50_000 + self.stalls.get(self.updates, 0) * 1_000_000
        return np.array([1.5 * np.sin(3.0 * self.time)]), POSE


class Port:
    """An output that keeps when it was written and with what."""

    name = "port"

    def __init__(self, clock):
        self.clock, self.written = clock, []

    def write(self, targets, pose):
        self.written.append((self.clock.time * 1e-9, float(targets[0])))

    def measured(self):
        return None

    def report(self):
        return {}

    def close(self):
        pass


def played(policy, stalls, seconds=3.0):
    clock = StalledClock(policy)
    deck, port = Swinging(clock, stalls), Port(clock)
    run(deck, [Channel(port)], clock, SafetyEnvelope(LIMITS, clock.period), seconds=seconds)
    return np.array(port.written).T, deck


def fastest(times, targets, window):
    """The largest distance within a window of so many seconds, over the window's length, rad/s."""
    reach = np.searchsorted(times, times + window, side="right") - 1
    moved = [np.abs(targets[i : j + 1] - targets[i]).max() for i, j in enumerate(reach)]
    return max(moved) / window


@pytest.mark.parametrize("policy", ["skip", "catch_up"])
@pytest.mark.parametrize("stalls", [{}, {150: 150}, {100: 150, 130: 40, 200: 150, 203: 9, 300: 14}])
def test_after_stalls_the_port_never_asks_for_more_than_the_limit_per_second(policy, stalls):
    """With 150 ms of ticks written at once, the port asked for several times the velocity limit."""
    (times, targets), _ = played(policy, stalls)
    for window in (0.05, 0.1, 0.2):
        burst = 1.0 + (MOST_AHEAD + 1.0) * PERIOD_NS * 1e-9 / window  # a write may be a period behind its tick's start
        assert fastest(times, targets, window) <= LIMITS.velocity[0] * burst
    jumps = np.abs(np.diff(targets))
    assert jumps.max() <= LIMITS.velocity[0] * PERIOD_NS * 1e-9 * (1.0 + 1e-9)


def test_a_deck_that_catches_up_is_on_time_again():
    (times, targets), deck = played("catch_up", {150: 150})
    assert deck.updates == 601
    late = times > times[0] + 1.5  # long after the stall the joint is where the deck is
    expected = 1.5 * np.sin(3.0 * (times[late] + PERIOD_NS * 1e-9))
    assert np.abs(targets[late] - expected)[:100].max() < 0.05


@settings(max_examples=100)
@given(st.lists(st.sampled_from([0, 0, PERIOD_NS // 4]) | st.integers(0, 4 * PERIOD_NS), min_size=1, max_size=300))
def test_no_more_ticks_are_written_than_periods_have_passed(steps):
    pace, now, written = Pace(PERIOD_NS * 1e-9), 0, []
    for step in steps:
        now += step
        if pace.may_write(now):
            written.append(now)
    ahead = np.arange(len(written)) - np.array(written) / PERIOD_NS
    assert (ahead - np.minimum.accumulate(ahead)).max() <= MOST_AHEAD


@given(st.lists(st.sampled_from([0, PERIOD_NS // 2, PERIOD_NS - 1]) | st.integers(0, PERIOD_NS - 1), max_size=100))
def test_ticks_that_come_less_than_a_period_late_are_all_written(lateness):
    pace = Pace(PERIOD_NS * 1e-9)
    assert all(pace.may_write(tick * PERIOD_NS + late) for tick, late in enumerate([0, *lateness]))
