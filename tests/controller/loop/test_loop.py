import gc
import os
import signal
import threading

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from benchmarks.simulated_time import VirtualClock
from controller.deck.interfaces import JointLimits
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.loop.stop_requests import SIGNALS
from controller.motion.skeleton import Pose
from motiondeck_base.errors import MotiondeckError

JOINTS = 3
RATE = 200.0
POSE = Pose(np.zeros(3), np.array(0.0), np.array([[1.0, 0.0, 0.0, 0.0]]))
LIMITS = JointLimits(*(np.full(JOINTS, x) for x in (-2.0, 2.0, 6.0, 60.0, 2000.0)))


class WavingDeck:
    """Slow waves; at the ticks in `failing` it raises, at those in `spoilt` it answers nonsense."""

    def __init__(self, failing=(), spoilt=()):
        self.tick = 0
        self.failing, self.spoilt = failing, spoilt

    def update(self, dt):
        self.tick += 1
        if self.tick in self.failing:
            raise RuntimeError("no idea")
        if self.tick in self.spoilt:
            return np.full(JOINTS, np.nan), POSE
        return 0.5 - 0.5 * np.cos(np.arange(1, JOINTS + 1) * self.tick * dt), POSE


class Recording:
    """An output that keeps what it is given; it raises at the ticks in `failing`."""

    def __init__(self, name="recording", failing=(), present=None, reading=()):
        self.name = name
        self.failing, self.reading, self.present = failing, reading, present
        self.written, self.turn = [], -1

    def write(self, targets, pose):
        self.turn += 1
        if self.turn in self.failing:
            raise OSError("the cable is loose")
        self.written.append(targets.copy())

    def measured(self):
        if self.turn in self.reading:
            raise OSError("no answer")
        return self.present

    def report(self):
        return {"written": len(self.written)}

    def close(self):
        pass


def play(deck, *channels, **options):
    clock = VirtualClock(RATE)
    return run(deck, channels, clock, SafetyEnvelope(LIMITS, clock.period), **options)


def assert_calm(written):
    """What was written obeys the limits from tick to tick."""
    written = np.array(written)
    assert np.isfinite(written).all()
    assert np.abs(np.diff(written, axis=0)).max() * RATE <= 6.0
    assert np.abs(np.diff(written, n=2, axis=0)).max() * RATE**2 <= 60.0
    assert np.abs(np.diff(written, n=3, axis=0)).max() * RATE**3 <= 2000.0


def test_it_plays_for_so_long_and_comes_to_rest():
    output = Recording()
    report = play(WavingDeck(), Channel(output), seconds=1.0)
    assert report.reason == "played to the end"
    assert 200 < report.ticks < 260
    assert report.rate_hz == pytest.approx(200.0)
    assert report.outputs == [{"name": "recording", "faults": 0, "parked": False, "written": report.ticks}]
    assert (report.overruns, report.lateness_us.max, report.faults["deck"]) == (0, 0.0, 0)
    assert np.array_equal(output.written[-1], output.written[-2])
    assert_calm(output.written)


def test_the_same_deck_gives_the_same_targets():
    first, second = Recording(), Recording()
    play(WavingDeck(), Channel(first), seconds=1.0)
    play(WavingDeck(), Channel(second), seconds=1.0)
    assert np.array_equal(first.written, second.written)


def test_an_output_may_want_each_third_tick_only():
    every, third = Recording(), Recording()
    report = play(WavingDeck(), Channel(every), Channel(third, every=3), seconds=1.0)
    assert len(every.written) == report.ticks
    assert np.array_equal(third.written, every.written[::3])


def test_a_long_run_with_every_fault_at_once_counts_them_and_goes_on():
    rng = np.random.default_rng(5)
    ticks = 10_000
    failing = set(range(100, ticks, 97)) | {500, 501}
    spoilt = set(rng.choice(ticks, 300, replace=False).tolist()) - failing - {1}
    shaky = Recording("shaky", failing=set(range(50, ticks, 40)) | {51})
    broken = Recording("broken", failing=range(1000, 10**9))
    healthy = Recording("healthy")
    report = play(
        WavingDeck(failing, spoilt), Channel(broken), Channel(shaky), Channel(healthy), seconds=(ticks - 1) / RATE
    )
    assert report.ticks >= ticks - 1
    assert report.faults == {"deck": len(failing), "commands": 0, "stops": 0, "telemetry": 0}
    by_name = {output["name"]: output for output in report.outputs}
    assert (by_name["broken"]["faults"], by_name["broken"]["parked"]) == (3, True)
    assert by_name["broken"]["fault"] == "OSError: the cable is loose"
    assert by_name["broken"]["written"] == 1000
    assert (by_name["shaky"]["faults"], by_name["shaky"]["parked"]) == (
        report.ticks - by_name["shaky"]["written"],
        False,
    )
    assert by_name["shaky"]["faults"] >= 250
    assert (by_name["healthy"]["faults"], by_name["healthy"]["written"]) == (0, report.ticks)
    assert_calm(healthy.written)
    assert min(report.changed) >= len(spoilt)


def test_targets_are_held_while_the_deck_fails():
    output = Recording()
    play(WavingDeck(failing=range(30, 45)), Channel(output), seconds=1.0)
    held = np.array(output.written[40:42])
    assert np.abs(held[1] - held[0]).max() < 1e-3
    assert_calm(output.written)


def test_a_deck_that_keeps_failing_ends_the_run_with_the_joints_at_rest_and_the_reason():
    output = Recording()
    report = play(WavingDeck(failing=range(100, 10**9)), Channel(output))
    assert report.reason == "the deck keeps failing: RuntimeError: no idea"
    assert report.faults["deck"] == 20
    assert np.array_equal(output.written[-1], output.written[-2])
    assert_calm(output.written)


def test_a_deck_that_changes_the_number_of_joints_counts_as_failing():
    class Shrinking(WavingDeck):
        def update(self, dt):
            targets, pose = super().update(dt)
            return (targets[:1] if self.tick > 10 else targets), pose

    assert "shape (1,) instead of (3,)" in play(Shrinking(), Channel(Recording())).reason


def test_a_deck_that_fails_before_anything_moves_is_an_error():
    output = Recording()
    with pytest.raises(RuntimeError, match="no idea"):
        play(WavingDeck(failing=[1]), Channel(output))
    assert output.written == []


def test_first_targets_that_are_no_numbers_start_the_joints_in_the_middle():
    output = Recording()
    play(WavingDeck(spoilt=range(1, 10**9)), Channel(output), seconds=0.1)
    assert np.allclose(output.written, 0.0, atol=1e-9)


def test_an_error_that_is_written_for_the_user_is_told_without_the_name_of_its_type():
    class Rig(Recording):
        def write(self, targets, pose):
            raise MotiondeckError("the rig has stopped: elbow (id 3) does not answer")

    report = play(WavingDeck(), Channel(Rig("rig")))
    assert report.reason == "every output is parked (rig: the rig has stopped: elbow (id 3) does not answer)"


def test_with_every_output_parked_the_loop_ends():
    report = play(WavingDeck(), Channel(Recording(failing=range(10**6))), Channel(Recording(failing=range(5, 10**6))))
    assert report.reason.startswith("every output is parked (")
    for output in report.outputs:
        assert f"{output['name']}: {output['fault']}" in report.reason
    assert report.ticks == 8


def test_reading_that_fails_parks_an_output_too():
    report = play(WavingDeck(), Channel(Recording(reading=range(20, 10**6))), Channel(Recording()), seconds=1.0)
    assert [(o["faults"], o["parked"]) for o in report.outputs] == [(3, True), (0, False)]
    assert report.outputs[0]["fault"] == "OSError: no answer"


def test_faults_that_an_output_counts_itself_are_added_and_a_failing_report_is_one():
    class Rig(Recording):
        def report(self):
            return {"faults": 7, "joints": 3}

    class Mute(Recording):
        def report(self):
            raise OSError("gone")

    report = play(WavingDeck(), Channel(Rig("rig", failing=[3])), Channel(Mute("mute")), seconds=0.1)
    assert (report.outputs[0]["faults"], report.outputs[0]["joints"]) == (8, 3)
    assert (report.outputs[1]["faults"], report.outputs[1]["fault"]) == (1, "OSError: gone")


def test_the_first_pose_is_approached_slowly_from_where_the_joints_are():
    output = Recording(present=np.array([1.5, np.nan, -1.0]))
    report = play(WavingDeck(), Channel(output), seconds=0.5)
    written = np.array(output.written)
    assert np.abs(written[0] - [1.5, 0.0, -1.0]).max() < 1e-3
    assert np.abs(written[:, 1]).max() < 0.5
    assert np.abs(np.diff(written[: report.ticks - 150], axis=0)).max() * RATE < 2.0
    assert report.ticks > 300
    assert_calm(written)


def test_in_the_end_the_joints_go_to_the_rest_pose():
    output = Recording()
    rest = np.array([0.2, -0.4, 0.0])
    play(WavingDeck(), Channel(output), seconds=1.0, rest=rest)
    assert np.allclose(output.written[-1], rest, atol=1e-9)
    assert_calm(output.written)


def test_a_command_stops_the_loop_and_a_failing_one_does_not():
    calls = []

    def commands(stop):
        calls.append(stop)
        if len(calls) == 100:
            stop.ask("enough")
        if len(calls) % 2:
            raise ValueError("nonsense")

    report = play(WavingDeck(), Channel(Recording()), commands=commands)
    assert report.reason == "enough"
    assert report.faults["commands"] == (len(calls) + 1) // 2


def test_commands_that_keep_failing_end_the_run_with_the_joints_at_rest():
    """A deck that hears no emergency stop must not play on."""
    calls, output = [], Recording()

    def commands(stop):
        calls.append(stop)
        if len(calls) > 300:
            raise OSError("stderr is gone")

    report = play(WavingDeck(), Channel(output), commands=commands, seconds=1e4)
    assert report.reason == "commands keep failing: OSError: stderr is gone"
    assert report.ticks < 1000
    assert_calm(output.written)
    assert np.allclose(output.written[-1], output.written[-2], atol=1e-9)


@pytest.mark.parametrize("pressed", [5, 40])  # 20 failures end the run
def test_an_emergency_stop_is_taken_while_commands_keep_failing_and_on_the_way_to_rest(pressed):
    """The sources of the stop are asked apart from commands, until the joints are at rest."""
    output, ticks = Recording(), []

    def commands(stop):
        raise OSError("stderr is gone")

    def door(stop):
        ticks.append(len(output.written))
        if len(ticks) == pressed:
            stop.state.press("stop door")

    report = play(WavingDeck(), Channel(output), commands=commands, stops=[door], rest=np.full(JOINTS, 1.5))
    assert report.reason == "commands keep failing: OSError: stderr is gone"
    assert_calm(output.written)
    assert np.allclose(output.written[-1], output.written[-2], atol=1e-9)
    assert not np.allclose(output.written[-1], 1.5, atol=0.1)  # not the rest pose


def test_a_source_of_the_stop_that_keeps_failing_ends_the_run_and_the_others_are_asked_until_rest():
    output, asked, at_end = Recording(), [], []

    def broken(stop):
        if len(output.written) > 300:
            raise OSError("the door is off its hinges")

    def door(stop):
        asked.append(len(output.written))
        if stop and not at_end:
            at_end.append(len(output.written))

    report = play(WavingDeck(), Channel(output), stops=[broken, door], rest=np.zeros(JOINTS), seconds=1e4)
    assert report.reason == "an emergency stop cannot be taken: OSError: the door is off its hinges"
    assert report.faults["stops"] == 5
    assert_calm(output.written)
    assert asked[-1] == len(output.written) > at_end[0] + 20


def test_telemetry_is_shown_every_so_many_ticks_and_given_up_when_it_keeps_failing():
    seen = []

    def publish(state):
        seen.append((state.tick, state.targets.copy(), state.rate))
        if state.tick >= 40:
            raise OSError("disk full")

    report = play(WavingDeck(), Channel(Recording()), seconds=2.0, publish=publish, publish_every=4)
    assert [tick for tick, _, _ in seen[:11]] == list(range(0, 44, 4))
    assert seen[10][2] == pytest.approx(RATE)
    assert len(seen) == 30
    assert report.faults["telemetry"] == 20
    assert report.reason == "played to the end"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_run_with_the_joints_at_rest(number):
    output = Recording()

    def commands(stop):
        if len(output.written) == 100:
            os.kill(os.getpid(), number)

    before = signal.getsignal(number)
    report = play(WavingDeck(), Channel(output), commands=commands)
    assert report.reason == SIGNALS[number]
    assert np.array_equal(output.written[-1], output.written[-2])
    assert_calm(output.written)
    assert signal.getsignal(number) is before


def test_a_second_signal_ends_it_at_once():
    output = Recording()

    def commands(stop):
        if len(output.written) in (100, 101):
            os.kill(os.getpid(), signal.SIGINT)

    report = play(WavingDeck(), Channel(output), commands=commands)
    assert report.reason == "stopped at once by a second signal"
    assert report.ticks == len(output.written) == 101


def test_it_runs_outside_the_main_thread_too():
    reports = []
    thread = threading.Thread(target=lambda: reports.append(play(WavingDeck(), Channel(Recording()), seconds=0.1)))
    thread.start()
    thread.join()
    assert reports[0].reason == "played to the end"


def test_inside_it_no_garbage_is_collected_and_blas_has_one_thread():
    inside = []

    def commands(stop):
        threads = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
        inside.append((gc.isenabled(), gc.get_freeze_count() > 0, threads))

    play(WavingDeck(), Channel(Recording()), seconds=0.01, commands=commands)
    assert all(not collecting and frozen and set(threads) <= {1} for collecting, frozen, threads in inside)
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
