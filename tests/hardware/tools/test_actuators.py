"""The doctor says of each joint what turns it, and why so."""

import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint, SecondServo
from hardware.tools.actuators import describe_actuator
from hardware.tools.doctor import examine


def joint(model="XM430-W350", lower=-1.0, upper=1.0, zero=2048, **keys):
    return RigJoint("j", 1, model, 1, zero, lower, upper, 1.0, **keys)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        (joint(), "j: XM430-W350 (id 1), position mode (3): its range lies within one turn"),
        (joint(zero=0), "extended position mode (4): its range crosses the end of one turn"),
        (joint(lower=-3.0, upper=3.0, gear=3.0), "(4): its horn goes through 2.9 turns, gear 3"),
        (joint(current=0.5), "current-based position mode (5): it keeps its limit of current, at most 0.5 A"),
        (joint(current=0.5, grip=True), "grips with 0.5 A"),
        (joint(second=SecondServo(2, -1, 2048)), "two XM430-W350 (id 1 and 2, mounted mirrored)"),
        (joint("AX-12A", zero=512), "j: AX-12A (id 1), position: its range lies within one turn"),
        (joint("PH42-020-S300", zero=0, current=1.0), "position mode (3): its range lies within one turn, at most 1 A"),
    ],
)
def test_a_joint_is_described(row, said):
    assert said in describe_actuator(row, {})


def test_gains_are_those_of_the_servo_or_of_the_rig_file():
    own, asked = joint(), RigJoint("k", 2, "XL330-M288", 1, 2048, -1.0, 1.0, 1.0, position_p_gain=250)
    config = RigConfig("p", 1_000_000, 100.0, (own, asked))
    bus = Bus(EmulatedPort(EmulatedBus(config)), 1_000_000)
    one, other = examine(config, bus).actuators
    assert one.endswith("gains P 800 I 0 D 0 as the servo has them")
    assert other.endswith("of the rig file")
