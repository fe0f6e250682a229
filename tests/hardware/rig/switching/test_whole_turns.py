"""A range anywhere on the circle of the horn, also across its zero: in a mode that counts turns, from any of them."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import FaultPlan, parse_fault
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import NEAR, POSITION_MODE, RigJoint
from hardware.rig.supervision.rig import Rig

MODELS = [("XM430-W350", 4), ("XL430-W250", 4), ("XL330-M288", 4), ("PH42-020-S300", 4), ("MX-28", 4)]
LIMITED = [("XM430-W350", 5), ("XL330-M288", 5), ("PH42-020-S300", 4)]


def across(model="XM430-W350", direction=1, current=0.0, lower=-1.0, upper=1.5):
    """A joint whose range crosses the end of the servo's one turn."""
    probe = RigJoint("probe", 1, model, 1, 0, -0.1, 0.1, 1.0).table.one_turn
    return RigJoint("neck", 1, model, direction, probe[1], lower, upper, 1.0, current=current)


class Play:
    """One joint on an emulated bus, first moved by hand to an angle and some turns away."""

    def __init__(self, joint, angle=0.0, turns=0, faults=()):
        self.joint, config = joint, RigConfig("emulated", 1_000_000, 100.0, (joint,))
        plan = FaultPlan([parse_fault(fault) for fault in faults])
        self.port = EmulatedPort(EmulatedBus(config), True, plan)
        self.servo = self.port.bus.devices[0]
        self.turn = joint.table.pulses_per_turn
        if joint.model.startswith("PH"):
            self.servo["shutdown"] = 62
        self.servo["operating_mode"] = 4
        self.servo.bank.settle()
        self.servo.bank.shaft[self.servo.row] = joint.pulses(angle) + turns * self.turn
        self.turns = turns
        self.port.elapse(0.01)
        self.before = {name: self.servo[name] for name in ("min_position_limit", "max_position_limit", "homing_offset")}
        self.rig = Rig(config, lambda part: Bus(self.port, part.baud), False, sleep=self.port.elapse)

    @property
    def angle(self):
        """Where the horn really is, rad, in the turn in which the joint was put."""
        return self.joint.angle(float(self.servo.bank.shaft[self.servo.row]) - self.turns * self.turn)

    def go(self, target, seconds):
        seen = []
        for _ in range(round(100 * seconds)):
            self.rig.collect_state()
            self.rig.write(np.array([target]))
            self.port.elapse(0.01)
            seen.append(self.angle)
        return np.array(seen)


@st.composite
def places(draw):
    """A joint that counts turns, an angle at which it may stand, and the whole turns that its servo counts."""
    model, current = draw(st.sampled_from([("XM430-W350", 0.0), ("XM430-W350", 0.5), ("PH42-020-S300", 0.0)]))
    gear, direction = draw(st.floats(0.2, 4.0)), draw(st.sampled_from([1, -1]))
    lower = draw(st.floats(-6.0, 5.9))
    upper = draw(st.floats(lower + 0.01, 6.1))
    zero = draw(st.integers(-5000, 5000))
    joint = RigJoint("neck", 1, model, direction, zero, lower, upper, 20.0 / gear, gear=gear, current=current)
    assume(joint.mode != POSITION_MODE and not joint.several_turns)
    angle = draw(st.floats(lower - 0.99 * NEAR, upper + 0.99 * NEAR))
    return joint, angle, draw(st.integers(-200, 200))


@given(places())
def test_the_place_in_one_turn_tells_the_angle(place):
    joint, angle, turns = place
    counted = round(joint.pulses(angle)) + turns * joint.table.pulses_per_turn
    assert joint.angle(counted - joint.whole_turns(counted)) == pytest.approx(
        angle, abs=1 / abs(joint.pulses_per_radian)
    )


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("turns", [0, 3, -7])
@pytest.mark.parametrize(("model", "mode"), MODELS)
def test_a_joint_goes_across_the_horns_zero_from_any_turn(model, mode, turns, direction):
    play = Play(across(model, direction), -0.9, turns)
    assert play.rig.positions[0] == pytest.approx(-0.9, abs=0.01)
    way = play.go(1.4, 4.0)
    assert play.angle == pytest.approx(1.4, abs=0.05)
    assert np.all(np.diff(way) > -0.02), "it took the way around"
    assert play.rig.positions[0] == pytest.approx(play.angle, abs=0.01)
    assert play.servo["operating_mode"] == mode
    assert {name: play.servo[name] for name in play.before} == play.before


@pytest.mark.parametrize(("model", "mode"), LIMITED)
def test_a_limit_of_current_is_kept_across_the_horns_zero(model, mode):
    current = 0.3 if model != "PH42-020-S300" else 1.0
    play = Play(across(model, current=current), -0.9, 2)
    play.go(1.0, 3.0)
    assert play.angle == pytest.approx(1.0, abs=0.05)
    assert play.servo["operating_mode"] == mode
    assert play.servo["goal_current"] == pytest.approx(1e3 * current / play.joint.table["goal_current"].scale, abs=1)


@pytest.mark.parametrize("target", [1.2, -0.8])
def test_a_servo_that_restarts_comes_back_in_its_new_turn(target):
    play = Play(across(), 0.5, 5, ["reboot:id=1,at=2.0"])
    play.go(target, 1.9)
    at = play.angle
    assert np.abs(play.go(target, 3.0) - at).max() < 0.4
    assert (play.rig.recoveries, play.angle) == (1, pytest.approx(target, abs=0.02))
    assert abs(play.servo["present_position"] - play.joint.pulses(target)) < 2 * 4096


@pytest.mark.parametrize("end", ["off", "hold"])
def test_the_end_is_where_it_stands(end):
    play = Play(across(), 0.5, 5)
    play.go(1.2, 2.0)
    assert play.rig.close(hold=end == "hold") == []
    play.port.elapse(1.0)
    assert (play.angle, play.servo["torque_enable"]) == (pytest.approx(1.2, abs=0.02), end == "hold")


def test_a_joint_outside_its_range_is_named():
    with pytest.raises(RigError, match=r"neck stands at 2\.50 rad, its limits are -1\.0 to 1\.5"):
        Play(across(), 2.5, 1)


def test_a_range_of_a_turn_needs_more_than_the_place_in_one():
    assert not across(lower=-3.0, upper=3.1).several_turns
    assert across(lower=-3.1, upper=math.pi).several_turns
