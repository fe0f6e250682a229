"""Identification against the true shafts of emulated servos, on motions that it does not use, and its surprises."""

import math

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.tools.identify import LATEST, SECONDS, ChirpAnswers, JointTrials, Stopped, chirp_of, response


class Bench:
    """A rig of joints of one model on an emulated bus in simulated time; `at(seconds, do)` does something then."""

    def __init__(self, *models, load=0.0, rate=100.0, baud=1_000_000, **settings):
        settings = {"lower": -1.2, "upper": 1.2, "velocity": 4.0} | settings
        joints = [RigJoint(f"j{id}", id, model, 1, 2048, **settings) for id, model in enumerate(models, 1)]
        self.config = RigConfig("emulated", baud, rate, tuple(joints), reconnect_s=0)
        self.port = EmulatedPort(EmulatedBus(self.config), True)
        self.drive = self.port.bus.devices[0].bank.drive
        self.drive.load[:] = load
        self.rig = Rig(self.config, lambda part: Bus(self.port, baud), False, sleep=self.port.elapse)
        self.deeds, self.asked, self.goals = [], False, []

    def at(self, seconds, do):
        self.deeds.append((self.port.now() + seconds, do))

    def elapse(self, seconds):
        if seconds <= 0.0:
            return
        self.port.elapse(seconds)
        self.goals.append(self.rig.goals.copy())
        due = [do for time, do in self.deeds if time <= self.port.now()]
        self.deeds = [one for one in self.deeds if one[0] > self.port.now()]
        for do in due:
            do()

    def identify(self, index=0):
        return JointTrials(self.rig, self.port.now, self.elapse, lambda: self.asked).joint(index)

    def shaft(self, index=0):
        device = self.port.bus.devices[index]
        return self.config.joints[index].angle(float(device.bank.shaft[device.row]))

    def true_lag(self, motion, seconds=6.0):
        """How much later than `motion(time)`, as it was sent, the shaft is there, s: the best fit at 2 ms."""
        period, start = 1.0 / self.config.rate_hz, self.port.now()
        times, shafts = [], []
        while self.port.now() - start < seconds:
            self.rig.collect_state()
            now = self.port.now() - start
            self.rig.write(np.full(len(self.config.joints), motion(now) * min(1.0, now)))
            for _ in range(5):
                self.port.elapse(period / 5)
                times.append(self.port.now() - start)
                shafts.append(self.shaft())
        times, shafts = np.array(times), np.array(shafts)
        late = times > 1.5
        return min(np.arange(0, 0.2, 5e-4), key=lambda lag: np.std(shafts[late] - motion(times[late] - lag)))


def walk(t):
    return 0.4 * np.sin(2 * np.pi * 0.8 * t) + 0.1 * np.sin(2 * np.pi * 1.6 * t + 2)


def nod(t):
    return 0.3 * np.sin(2 * np.pi * 1.1 * t + 1) + 0.15 * np.sin(2 * np.pi * 0.5 * t)


@pytest.mark.parametrize(
    ("model", "load", "rate", "baud"),
    [
        ("XL330-M288", 0.0, 100.0, 1_000_000),
        *(
            pytest.param(*each, marks=pytest.mark.thorough)
            for each in (
                ("MX-28(1.0)", 0.0, 100.0, 1_000_000),
                ("XL330-M288", 0.03, 50.0, 57600),
                ("XM430-W350", 0.0, 50.0, 57600),
                ("MX-64", 0.0, 100.0, 1_000_000),
                ("MX-64", -0.04, 200.0, 3_000_000),
                ("MX-106", 0.05, 100.0, 1_000_000),
                ("XM430-W350", 0.2, 125.0, 1_000_000),
                ("XC330-T288", 0.1, 100.0, 1_000_000),
            )
        ),
    ],
)
def test_the_lag_is_that_of_the_true_shaft_in_a_motion(model, load, rate, baud):
    bench = Bench(model, load=load, rate=rate, baud=baud)
    found = bench.identify()
    true = [bench.true_lag(motion) for motion in (walk, nod)]
    assert found.lag == pytest.approx(np.mean(true), abs=0.005)
    assert found.after < 0.25 * found.before
    assert found.gain == pytest.approx(1.0, abs=0.05)


@pytest.mark.thorough
@pytest.mark.parametrize("model", ["MX-64", "XL330-M288", "MX-106"])
def test_friction_is_about_the_current_that_turns_the_joint_slowly(model):
    bench = Bench(model, lower=-3.0, upper=3.0)
    found = bench.identify()
    drive, currents = bench.drive, []
    for step in range(600):
        bench.rig.collect_state()
        bench.rig.write(np.array([0.004 * step if step < 300 else 1.2 - 0.004 * (step - 300)]))
        way = 1.0 if step < 300 else -1.0
        for _ in range(10):
            bench.port.elapse(0.001)
            if step % 300 > 100:
                currents.append(way * float(drive.current[0]) * drive.motor.stall_current * 1e-3)
    assert found.friction == pytest.approx(np.mean(currents), rel=0.35)


@pytest.mark.thorough
def test_it_takes_no_more_than_half_of_the_limits_and_comes_back():
    bench = Bench("XM430-W350", "XM430-W350", lower=-0.5, upper=1.2, velocity=1.0, acceleration=4.0)
    for _ in range(300):
        bench.rig.collect_state()
        bench.rig.write(np.array([-0.45, 0.1]))
        bench.elapse(0.01)
    bench.goals = []
    bench.identify()
    goals = np.array(bench.goals)
    speed = np.diff(goals[:, 0]) * 100.0
    assert np.abs(speed).max() <= 0.55 * 1.0
    assert np.abs(np.diff(speed)).max() * 100.0 <= 0.65 * 4.0
    assert goals[:, 0].min() >= -0.45 - 1e-9
    assert np.ptp(goals[:, 0]) > 0.2
    assert goals[-1, 0] == pytest.approx(-0.45, abs=1e-6)
    assert np.ptp(goals[:, 1]) == 0.0


def stopped(bench, match):
    """Identifies; it must end with this message, the joint braked within its limits and standing."""
    with pytest.raises(RigError, match=match):
        bench.identify()
    goals = np.array(bench.goals)[:, 0]
    speed = np.diff(goals) * bench.config.rate_hz
    assert np.abs(np.diff(speed)).max() * bench.config.rate_hz < 25.0
    assert abs(speed[-1]) < 0.3
    assert bench.port.now() < 9.0


@pytest.mark.parametrize("at", [1.5, 3.1, 4.4, 6.0])
def test_a_jammed_joint_stops_it(at):
    bench = Bench("XL330-M288")

    def jam():
        bench.drive.jammed[0] = True

    bench.at(at, jam)
    stopped(
        bench, r"j1 \(id 1\) does not follow: it moved 0.0. rad of 0..|gives way|draws .* more than|from its target"
    )
    assert bench.port.now() < at + 2.0
    assert bench.rig.goals[0] == pytest.approx(bench.shaft(), abs=0.01)


def test_a_jammed_joint_with_little_current_stops_it():
    bench = Bench("XM430-W350", position_p_gain=100)
    bench.at(3.0, lambda: bench.drive.jammed.__setitem__(0, True))
    stopped(bench, r"j1 \(id 1\) does not follow: it moved 0.0. rad of 0..")


def test_a_joint_that_is_pushed_away_stops_it():
    bench = Bench("XM430-W350", position_p_gain=300)
    bench.at(1.5, lambda: bench.drive.load.__setitem__(0, 0.35))
    stopped(bench, r"j1 \(id 1\) is 0.[12]. rad from its target")


def test_a_joint_that_warms_up_stops_it():
    bench = Bench("XM430-W350")
    bench.at(3.0, lambda: bench.drive.temperature.__setitem__(0, 70.0))
    stopped(bench, r"j1 \(id 1\) is getting hot: 70 degC")


def test_a_joint_that_is_warm_from_the_start_is_not_moved():
    bench = Bench("XM430-W350")
    bench.drive.temperature[0] = 70.0
    with pytest.raises(RigError, match="is getting hot"):
        bench.identify()
    assert np.ptp(np.array(bench.goals)[:, 0]) < 0.01


def test_much_current_stops_it():
    bench = Bench("XM430-W350")
    bench.at(3.0, lambda: bench.drive.load.__setitem__(0, 0.5))
    stopped(bench, r"j1 \(id 1\) draws 1..* A, more than 0.92 A for a small swing")


def test_the_allowed_current_counts():
    bench = Bench("XM430-W350", current=0.4)
    bench.at(3.0, lambda: bench.drive.load.__setitem__(0, 0.14))
    stopped(bench, r"j1 \(id 1\) draws 0.3. A, more than 0.20 A for a small swing")


def test_another_joint_that_is_silent_stops_it():
    bench = Bench("XM430-W350", "XM430-W350")
    bench.at(2.0, lambda: setattr(bench.port.bus.devices[1], "dead", True))
    stopped(bench, r"j2 \(id 2\) does not answer")


def test_asked_to_stop_it_brakes():
    bench = Bench("XM430-W350")
    bench.at(4.0, lambda: setattr(bench, "asked", True))
    with pytest.raises(Stopped):
        bench.identify()
    speed = np.diff(np.array(bench.goals)[:, 0]) * 100.0
    assert np.abs(speed).max() > 0.5
    assert np.abs(np.diff(speed)).max() * 100.0 < 25.0
    assert bench.port.now() < 4.8


def test_a_range_too_small_for_a_swing_is_refused():
    joint = RigJoint("a", 1, "XM430-W350", 1, 2048, -0.07, 0.07, 4.0)
    with pytest.raises(RigError, match=r"a \(id 1\) cannot be identified: a range of 0.14 rad"):
        chirp_of(joint, 0.0)


@pytest.mark.parametrize("position", [-1.5, -0.2, 1.3])
def test_a_chirp_keeps_away_from_the_limits_and_begins_and_ends_in_its_center(position):
    joint = RigJoint("a", 1, "XM430-W350", 1, 2048, -1.0, 0.7, 2.0)
    chirp = chirp_of(joint, position)
    angles = np.array([chirp.at(t) for t in np.arange(-0.5, SECONDS + 0.5, 0.001)])
    assert -0.95 - 1e-9 <= angles.min() < angles.max() <= 0.65 + 1e-9
    assert angles[0] == angles[-1] == chirp.center
    assert np.ptp(angles) > 0.3
    assert np.abs(np.diff(angles)).max() / 0.001 <= 1.1


@pytest.mark.parametrize(("lag", "gain", "dead"), [(0.03, 1.0, 0.0), (0.083, 0.9, 0.004), (0.15, 1.04, 0.01)])
def test_lag_and_gain_of_a_made_up_shaft(lag, gain, dead):
    joint = RigJoint("a", 1, "XM430-W350", 1, 2048, -1.0, 1.0, 4.0)
    chirp, rng = chirp_of(joint, 0.1), np.random.default_rng(3)
    sent = np.cumsum(rng.uniform(0.008, 0.012, 900))
    read = sent + rng.uniform(0.0, 0.01, 900)
    target = np.array([chirp.at(t) for t in sent])
    late = np.array([[chirp.at(t - lag + step) for step in (-1e-3, 0.0, 1e-3)] for t in read])
    way = np.sign(late[:, 2] - late[:, 0])
    shaft = 0.05 + gain * late[:, 1] - dead * way + rng.normal(0, 1e-3, 900)
    current = 0.3 * way + 0.05 * (late[:, 2] - late[:, 0]) / 2e-3 + 0.2 + rng.normal(0, 0.02, 900)
    found = response(ChirpAnswers(sent, target, read, shaft, current))
    assert found.lag == pytest.approx(lag, abs=1e-3)
    assert found.gain == pytest.approx(gain, abs=0.01)
    assert found.friction == pytest.approx(0.3, abs=0.03)
    assert found.after < found.before


def test_a_shaft_that_stands_is_not_identified():
    times = np.arange(0.0, 9.0, 0.01)
    targets = 0.2 * np.sin(6.0 * times)
    still = np.zeros_like(times)
    with pytest.raises(RigError, match="does not move with its targets"):
        response(ChirpAnswers(times, targets, times, still, still))
    with pytest.raises(RigError, match="too few answers"):
        response(ChirpAnswers(times, targets, times[:50] + LATEST, still[:50], still[:50]))
    assert math.isfinite(LATEST)
