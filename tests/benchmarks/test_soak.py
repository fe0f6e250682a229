import subprocess
import sys

import numpy as np
import pytest

import synthetic
from benchmarks.deck.memory_growth import growth
from benchmarks.deck.soak_live import judge, written
from benchmarks.deck.soak_run import soak
from controller.deck.interfaces import JointLimits
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.wire.messages.deck_snapshot import MODES
from controller.wire.run_recording import RunRecording

JOINTS = 9 * 4
LIMITS = JointLimits(*(np.full(JOINTS, x) for x in (-1.1, 1.1, 8.0, 80.0, 4000.0)))


@pytest.fixture(scope="module")
def library():
    return synthetic.small_library()


def directions(pose):
    return pose.rotation.ravel()


def test_half_a_minute_of_commands_faults_and_floods_breaks_nothing(library):
    report = soak(library, directions, LIMITS, seconds=30.0, rate=100.0)
    assert report.passed
    assert report.ticks > 3000
    assert (report.commands, report.answered) == (report.ticks // 50, report.ticks // 50)
    assert report.flood > 500
    assert report.faults["deck"] > 2
    assert report.faults["outputs"] > 15
    assert report.faults["telemetry"] > 2
    assert (report.outside, report.restless) == (0, 0)


def test_the_same_seed_soaks_alike(library):
    first, second = (soak(library, directions, LIMITS, seconds=5.0, rate=100.0, seed=3) for _ in range(2))
    assert (first.ticks, first.faults, first.commands) == (second.ticks, second.faults, second.commands)


def test_a_soak_notices_an_envelope_that_lets_things_pass(library, monkeypatch):
    monkeypatch.setattr(SafetyEnvelope, "__call__", lambda self, targets: targets)
    assert not soak(library, directions, LIMITS, seconds=5.0, rate=100.0).passed


def test_a_leak_grows_in_every_stretch_and_a_step_of_the_allocator_in_one():
    seconds = np.arange(0.0, 900.0, 10.0)
    noise = np.random.default_rng(0).normal(size=len(seconds))
    leak = growth(list(zip(seconds, 100_000.0 + 2.0 * seconds + noise, strict=True)))
    assert 0.0 < leak.low < leak.mean < leak.high
    assert leak.mean == pytest.approx(7200.0, rel=0.01)
    step = growth(list(zip(seconds, 100_000.0 + 1024.0 * (seconds > 400.0), strict=True)))
    assert step.low < 0.0 < step.mean
    assert growth([(0.0, 1.0), (10.0, 2.0)]).mean == 0.0


def test_the_memory_in_use_is_told_in_kb():
    # In a process of its own: what other tests gave back to the allocator comes and goes here.
    taken_kb = 64 * 1024
    code = (
        "import mmap; from benchmarks.deck.memory_growth import memory_kb\n"
        f"before, taken = memory_kb(), mmap.mmap(-1, {taken_kb * 1024})\n"
        "for page in range(0, len(taken), mmap.PAGESIZE): taken[page] = 1\n"
        "print(memory_kb() - before)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert float(told.stdout) == pytest.approx(taken_kb, rel=0.2)


def test_ticks_that_were_not_written_are_left_out_of_a_recording():
    moving = np.linspace(0.0, 0.5, 200)[:, None] ** 2 * np.ones(JOINTS)
    assert np.array_equal(written(np.insert(moving, 100, moving[99], axis=0)), moving)
    still = moving[[7] * 50]
    assert np.array_equal(written(still), still)


@pytest.mark.parametrize(
    ("rows", "by", "what"),
    [
        (slice(150, None), 1.0, {"position", "velocity", "acceleration", "jerk"}),
        (slice(150, 151), np.nan, {"not finite", "position"}),
        (slice(0), 0.0, set()),
    ],
)
def test_what_a_recording_breaks_is_named(rows, by, what):
    targets = np.linspace(0.0, 0.5, 200)[:, None] ** 2 * np.ones(JOINTS)
    targets[rows] += by
    found = judge(RunRecording({}, {"targets": targets, "mode": np.zeros((200, 1))}, complete=True), LIMITS)
    assert {name for name, count in found.items() if count} == what


def test_a_joint_that_moves_long_after_an_emergency_stop_is_seen():
    targets = np.zeros((900, JOINTS))
    targets[800] = 1e-6
    stopped = np.full((900, 1), float(MODES.index("emergency stop")))
    found = judge(RunRecording({}, {"targets": targets, "mode": stopped}, complete=True), LIMITS)
    assert found["moved in an emergency stop"] == 2
