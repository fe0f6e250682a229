"""A gripper closes until it holds, with its limit of current, and is not taken for a joint that is blocked."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import FaultPlan, parse_fault
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.supervision.rig import Rig

AT = 0.3  # rad at which the jaw meets a nut


class Jaw:
    """A jaw that closes downwards onto a nut, and a wrist whose servo restarts at these times, s."""

    def __init__(self, *restarts, model="XL330-M288", current=0.3, grip=True, acceleration=0.0):
        limits = {"zero": 0 if model.startswith("PH") else 2048, "lower": -1.0, "upper": 1.0, "velocity": 1.5}
        self.jaw = RigJoint("jaw", 1, model, 1, **limits, acceleration=acceleration, current=current, grip=grip)
        wrist = RigJoint("wrist", 2, "XL330-M288", 1, 2048, -1.0, 1.0, 1.0)
        self.config = RigConfig("emulated", 1_000_000, 100.0, (self.jaw, wrist))
        plan = FaultPlan([parse_fault(f"reboot:id=2,at={at}") for at in restarts])
        self.port = EmulatedPort(EmulatedBus(self.config), True, plan)
        self.servo = self.port.bus.devices[0]
        if model.startswith("PH"):
            self.servo["shutdown"] = 62
        self.drive, self.row = self.servo.bank.drive, self.servo.row
        self.drive.shaft[self.row] = self.jaw.pulses(0.9)
        self.port.elapse(0.01)
        self.rig = Rig(self.config, lambda part: Bus(self.port, 1_000_000), False, sleep=self.port.elapse)

    @property
    def angle(self):
        return self.jaw.angle(float(self.drive.shaft[self.row]))

    @property
    def current(self):
        """What the motor truly draws, A."""
        return float(self.drive.current[self.row]) * self.drive.motor.stall_current * 1e-3

    def play(self, target, seconds):
        """The motor's current, A, tick by tick."""
        seen = []
        for _ in range(round(100 * seconds)):
            self.rig.collect_state()
            self.rig.write(np.array([target, 0.2]))
            self.drive.jammed[self.row] = self.angle < AT and self.drive.target[self.row] < self.jaw.pulses(AT)
            self.port.elapse(0.01)
            seen.append(self.current)
        return np.array(seen)


@pytest.mark.parametrize(
    ("model", "current"),
    [
        ("XL330-M288", 0.3),
        pytest.param("XM430-W350", 0.5, marks=pytest.mark.thorough),
        pytest.param("PH42-020-S300", 1.0, marks=pytest.mark.thorough),
    ],
)
def test_it_holds_with_its_current_and_opens_again(model, current):
    jaw = Jaw(model=model, current=current)
    jaw.play(-0.8, 2.0)
    held = jaw.play(-0.8, 4.0)
    assert held == pytest.approx(-current, rel=0.03)
    assert not jaw.rig.pace.strain.yielding.any()
    assert list(jaw.rig.incidents) == []
    assert jaw.angle == pytest.approx(AT, abs=0.03)
    jaw.play(0.8, 2.5)
    assert jaw.angle == pytest.approx(0.8, abs=0.03)


def test_a_joint_that_is_no_gripper_yields_there():
    jaw = Jaw(grip=False)
    jaw.play(-0.8, 3.0)
    assert jaw.rig.pace.strain.yielding[0]
    assert any("gives way" in incident.what for incident in jaw.rig.incidents)


def test_it_holds_on_while_another_servo_is_set_up_again_and_in_the_end():
    jaw = Jaw(4.0, model="XM430-W350")
    jaw.play(-0.8, 3.5)
    held = jaw.play(-0.8, 0.8)
    assert (jaw.rig.recoveries, jaw.rig.goals[0]) == (1, -0.8)
    assert held == pytest.approx(-0.3, rel=0.03)
    assert jaw.rig.close(hold=True) == []
    jaw.port.elapse(1.0)
    assert jaw.current == pytest.approx(-0.3, rel=0.03)


@pytest.mark.parametrize("model", ["XM430-W350", "XL330-M288"])
def test_it_holds_on_in_the_end_also_while_its_path_moves(model):
    """Its path then neither stands nor is followed; the goal became the jaw's own place, and it let go."""
    jaw = Jaw(model=model, acceleration=3.0)
    jaw.play(-0.8, 2.5)
    jaw.play(-0.2, 0.2)
    assert jaw.rig.close(hold=True) == []
    jaw.port.elapse(1.0)
    assert jaw.current == pytest.approx(-0.3, rel=0.03)


def test_a_gripper_that_has_lost_its_strength_is_named():
    jaw = Jaw(model="XM430-W350")
    jaw.play(-0.8, 3.0)
    jaw.servo["goal_pwm"] = 0
    with pytest.raises(RigError, match=r"jaw \(id 1\) does not follow its target, although it was set up anew"):
        jaw.play(-0.8, 3.0)
    assert any("does not follow" in incident.what for incident in jaw.rig.incidents)


def test_without_a_current_it_is_refused():
    with pytest.raises(ValueError, match="grip needs current: the A with which it holds"):
        RigJoint("jaw", 1, "XL330-M288", 1, 2048, -1.0, 1.0, 1.0, grip=True)
