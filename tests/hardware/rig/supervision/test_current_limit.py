"""A joint's limit of current: kept by the servo itself, whatever blocks or loads the joint."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.families.models import MODELS, TRAITS
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.audit import current_counts
from hardware.tools.doctor import examine, fix_settings

MEASURING = [model for model in TRAITS if "goal_current" in MODELS[model].registers]
STEP = 0.002  # s
QUICK = ("XM430-W350", "PH54-200-S500")
MODELS_AND_TARGETS = [
    pytest.param(model, target, marks=[] if model in QUICK else [pytest.mark.thorough])
    for model in MEASURING
    for target in ("sine", "step")
]
TARGETS = {"sine": lambda t: 0.8 * np.sin(3.0 * t), "step": lambda t: 1.2 if t > 0.5 else 0.0}


class Gripper:
    """One joint that may take 15 % of its servo's stall current, or `current` amperes, on an emulated bus."""

    def __init__(self, model, current=None, **settings):
        self.limit = 0.15 * TRAITS[model].stall_current if current is None else current
        zero = 0 if TRAITS[model].series.name == "P" else 2048
        joint = RigJoint("grip", 1, model, 1, zero, -1.3, 1.3, 1.5, current=self.limit, **settings)
        self.config = RigConfig("emulated", 1_000_000, 100.0, (joint,))
        self.port = EmulatedPort(EmulatedBus(self.config), True)
        self.servo = self.port.bus.devices[0]
        self.drive = self.servo.bank.drive
        if zero == 0:
            self.servo["shutdown"] = 52  # most of them come without protection against heat, and are refused

    def bus(self):
        return Bus(self.port, self.config.baud)

    def rig(self):
        return Rig(self.config, lambda part: self.bus(), False, sleep=self.port.elapse)

    def play(self, rig, target, seconds, start=0.0):
        """The true current at each step, A, while the joint is to follow `target(time)`."""
        currents = []
        for tick in range(round(seconds * 100)):
            rig.collect_state()
            rig.write(np.array([target(start + 0.01 * tick)]))
            for _ in range(5):
                self.port.elapse(STEP)
                currents.append(abs(float(self.drive.current[0])) * self.drive.motor.stall_current * 1e-3)
        return np.array(currents)


@pytest.mark.parametrize(("model", "target"), MODELS_AND_TARGETS)
def test_a_blocked_servo_is_above_its_limit_for_20_ms_at_most_and_yields(model, target):
    gripper = Gripper(model)
    rig = gripper.rig()
    assert gripper.play(rig, TARGETS[target], 0.7).max() <= 1.01 * gripper.limit
    assert np.abs(rig.velocities[0]) > 0.3
    gripper.drive.jammed[0] = True
    currents = gripper.play(rig, TARGETS[target], 2.0, 0.7)
    assert (currents[round(0.02 / STEP) :] <= 1.01 * gripper.limit).all()
    assert currents.max() > 0.9 * gripper.limit
    assert rig.incidents[0].what == "pushes against something and gives way"
    gripper.drive.jammed[0] = False
    gripper.play(rig, lambda t: 1.0, 4.0)
    assert (rig.positions[0], rig.recoveries) == (pytest.approx(1.0, abs=0.02), 0)


@pytest.mark.parametrize("model", QUICK)
def test_a_load_above_the_limit_is_not_held_and_takes_no_more_current(model):
    gripper = Gripper(model)
    rig = gripper.rig()
    gripper.drive.load[0] = 0.05  # an identified motor has friction in it, too
    gripper.play(rig, lambda t: 0.5, 1.0)
    held = float(rig.positions[0])
    assert held > 0.3
    gripper.drive.load[0] = 0.3
    # Later it is driven faster than its no-load speed, where no voltage of its own can hold the current back.
    assert gripper.play(rig, lambda t: 0.5, 0.08).max() <= 1.01 * gripper.limit
    assert rig.positions[0] < held - 0.05


@pytest.mark.parametrize(("model", "mode"), [("XM430-W350", 5), ("MX-64", 5), ("XL330-M077", 5), ("PH42-020-S300", 3)])
def test_the_mode_that_keeps_the_limit_is_written_once_and_named_by_the_doctor(model, mode):
    gripper = Gripper(model)
    counts = current_counts(gripper.config.joints[0])
    assert 0.98 * gripper.limit < counts * MODELS[model]["goal_current"].si <= 1.01 * gripper.limit
    named = "\n".join(examine(gripper.config, gripper.bus()).notes)
    assert (f"operating_mode is 3, the rig needs {mode}" in named) == (mode == 5)
    assert f"needs {counts}" in named
    gripper.servo["bus_watchdog"] = -1  # another program has left it so, and it locks the goals
    assert fix_settings(gripper.config, gripper.bus()).refused == []
    kept = [gripper.servo[name] for name in ("operating_mode", "current_limit", "goal_current")]
    assert kept == [mode, counts, counts]
    assert fix_settings(gripper.config, gripper.bus()).done == []
    gripper.rig()
    assert gripper.servo["operating_mode"] == mode


def test_a_servo_that_counted_turns_is_within_one_when_its_mode_keeps_a_limit():
    gripper = Gripper("XM430-W350")
    gripper.servo["operating_mode"] = 4
    gripper.drive.shaft[0] += 3 * 4096
    rig = gripper.rig()
    gripper.play(rig, lambda t: 0.3, 1.0)
    assert rig.positions[0] == pytest.approx(0.3, abs=0.02)


@pytest.fixture
def playing():
    """An XM430 that plays, its rig and the goal current with which it keeps its limit."""
    gripper = Gripper("XM430-W350")
    rig = gripper.rig()
    gripper.play(rig, lambda t: 0.5, 0.3)
    return gripper, rig, current_counts(gripper.config.joints[0])


def test_the_limit_is_back_after_a_restart(playing):
    gripper, rig, counts = playing
    gripper.servo.reboot(gripper.port.now() + 0.1)
    gripper.play(rig, lambda t: 0.5, 1.5)
    assert (rig.recoveries, gripper.servo["operating_mode"], gripper.servo["goal_current"]) == (1, 5, counts)


def test_the_limit_is_back_after_another_program_has_raised_it(playing):
    gripper, rig, counts = playing
    gripper.port.elapse(0.5)
    gripper.servo["current_limit"] = gripper.servo["goal_current"] = 1193
    gripper.play(rig, lambda t: 0.5, 1.0)
    assert (rig.recoveries, gripper.servo["goal_current"]) == (1, counts)


def test_the_limit_is_set_also_where_a_change_of_the_mode_takes_it_away():
    gripper = Gripper("XM430-W350")
    gripper.servo["operating_mode"], gripper.servo["goal_current"] = 4, current_counts(gripper.config.joints[0])
    gripper.rig()
    assert gripper.servo["goal_current"] == current_counts(gripper.config.joints[0])


def test_a_p_series_servo_without_a_limit_gets_the_whole_of_its_own_back():
    gripper = Gripper("PH42-020-S300", current=0.0)
    gripper.servo["goal_current"] = 100
    gripper.rig()
    assert gripper.servo["goal_current"] == gripper.servo["current_limit"] == 4500


def test_a_weak_joint_that_pushes_below_its_limit_is_not_taken_for_idle():
    """It draws 0.22 of the 0.35 A allowed, too little to yield, and less than a fifth of the stall current."""
    gripper = Gripper("XL330-M288", current=0.35, position_p_gain=34)
    rig = gripper.rig()
    gripper.drive.jammed[0] = True
    assert gripper.play(rig, lambda t: 0.6, 3.0)[-1] == pytest.approx(0.22, abs=0.01)
    assert (rig.recoveries, list(rig.pace.strain.yielding)) == (0, [False])


@pytest.mark.parametrize("model", [model for model in TRAITS if model not in MEASURING])
def test_a_model_that_measures_no_current_takes_no_limit_of_it(model):
    with pytest.raises(ValueError, match="measures no current, so it takes no limit of it"):
        RigJoint("grip", 1, model, 1, 512, -0.1, 0.1, 1.0, current=0.5)
