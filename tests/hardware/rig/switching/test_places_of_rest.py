"""A servo that has to hold while it moves gets a goal at which its own path can come to rest."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.registers import write_each
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.switching.torque import hold_still, switch_on


@pytest.mark.parametrize("model", ["STS3215", "MX-28(1.0)", "XM430-W350"])
@pytest.mark.parametrize("turning_for", [0.02, 0.1, 0.2])
def test_one_that_brakes_to_turn_back_rests_ahead_of_where_it_is(model, turning_for):
    """Of a model that shows no path its goal was taken for it, which lay far behind by then."""
    joint = RigJoint("joint", 1, model, 1, 2048, -1.4, 1.4, velocity=1.5, acceleration=4.0)
    config = RigConfig("emulated", 1_000_000, 100.0, (joint,))
    port = EmulatedPort(EmulatedBus(config), True)
    bus, servo = Bus(port, 1_000_000), port.bus.devices[0]
    bus.families = config.families
    switch_on(config, bus, np.zeros(1))
    for goal, seconds in ((-1.4, 0.6), (1.4, turning_for)):
        write_each(config, bus, "goal_position", [round(joint.pulses(goal))])
        port.elapse(seconds)
    held = hold_still(config, bus, np.zeros(1)).angles[0]
    place = joint.angle(float(servo.bank.shaft[servo.row]))
    assert servo.bank.drive.speed[servo.row] < 0.0
    assert place - 0.35 < held < place
    port.elapse(1.0)
    assert joint.angle(float(servo.bank.shaft[servo.row])) == pytest.approx(held, abs=0.005)
