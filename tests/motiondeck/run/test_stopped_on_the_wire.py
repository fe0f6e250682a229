"""A deck with a rig that is killed, stopped and stalled, as seen on its wire; and cells of the fault matrix.

A busy machine hands frames over late, so here they are judged by their order alone: a frame a tick. By their times they
are judged by the benchmarks.
"""

import signal
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.stop import bus_relay, fault_matrix, goal_judge
from benchmarks.stop.fault_matrix import Stage
from benchmarks.stop.judged_rig import JudgedDeck, JudgedRig
from waiting import runs, until

_ATTEMPTS = 3  # of a cell, on a machine that may be busy; where something is broken, none of them succeeds


def silent(record):
    """Whether nothing passes on a bus for a while; what the relay notes of a busy machine does not count."""
    before = passed(record)
    time.sleep(0.5)
    return passed(record) == before


def passed(record):
    """How many times something has passed."""
    return sum(way != bus_relay.PROBE for _, way, _ in bus_relay.entries(record))


def test_a_bus_is_silent_while_the_relay_notes_how_late_the_machine_is(tmp_path):
    record = tmp_path / "bus.record"
    probe = bus_relay.ENTRY.pack(1, bus_relay.PROBE, 8) + bytes(8)
    record.write_bytes(probe)
    assert passed(record) == 0
    record.write_bytes(probe + bus_relay.ENTRY.pack(2, bus_relay.TO_SERVOS, 1) + b"x")
    assert passed(record) == 1


@pytest.mark.thorough
def test_joints_of_a_deck_that_is_stopped_stalled_and_killed_brake_within_their_limits(tmp_path):
    with JudgedRig(tmp_path) as rig:
        with JudgedDeck(rig, tmp_path, "walk", "--headless", "--command-port", "0") as deck:
            deck.plays()
            began = time.monotonic()
            for seconds in (0.3, 0.012):
                deck.signal(signal.SIGSTOP)
                time.sleep(seconds)
                deck.signal(signal.SIGCONT)
                time.sleep(0.5)
                deck.plays()
            beside = Path(f"/proc/{deck.process.pid}/task/{deck.process.pid}/children").read_text().split()
            deck.signal(signal.SIGKILL)
            until(lambda: not any(map(runs, beside)) and silent(rig.bus), "the end of the guard")
            over = time.monotonic()
        joints, goals = rig.joints, goal_judge.read_goals(rig.bus, rig.joints).between(began, over)
    steps, pulse = np.diff(goals.positions, axis=0), joints.pulse
    assert len(steps) > 100
    assert np.abs(steps).max() > 0.01, "nothing moved"
    assert (np.abs(steps) <= joints.velocity * joints.period + pulse).all()
    assert (np.abs(np.diff(steps, axis=0)) <= joints.acceleration * joints.period**2 + 2.0 * pulse).all()
    assert np.abs(steps[-1]).max() < 0.005, "the goals froze in full motion"


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("fault", "sources"),
    [
        ("nothing", ("door", "network", "wired")),
        ("stopped", ("door",)),
        ("raising", ("door",)),
        ("cut", ("door",)),
        ("1000", ("door",)),
        ("nothing", ("signal",)),
        ("page", ("death",)),
    ],
)
def test_stops_beside_broken_parts(fault, sources):
    for _ in range(_ATTEMPTS):
        trials, failures = fault_matrix.run(Stage(fault, sources), repetitions=1, seed=1)
        wrong = [failure for failure in failures if "too busy" not in failure]
        wrong += [str(trial) for trial in trials if not (trial.at_rest and trial.in_time)]
        if not wrong:
            return
    pytest.fail("; ".join(wrong))
