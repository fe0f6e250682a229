"""Velocity and current as measured: positive where they are in the joint's own direction, however it is mounted."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("model", "zero"), [("XM430-W350", 2048), ("XL430-W250", 2048), ("AX-12A", 512)])
def test_a_joint_that_lifts_draws_a_positive_current(model, zero, direction):
    joint = RigJoint("arm", 1, model, direction, zero, -1.3, 1.3, 1.0)
    config = RigConfig("emulated", 1_000_000, 100.0, (joint,))
    port = EmulatedPort(EmulatedBus(config), True)
    rig = Rig(config, lambda part: Bus(port, part.baud), False, sleep=port.elapse)
    port.bus.devices[0].bank.drive.load[0] = 0.3 * direction
    fastest = 0.0
    for _ in range(150):
        rig.collect_state()
        rig.write(np.array([0.8]))
        port.elapse(0.01)
        fastest = max(fastest, rig.velocities[0])
    assert rig.positions[0] > 0.5
    assert 0.9 < fastest < 1.2
    stall = {"XM430-W350": 2.3, "XL430-W250": 1.4, "AX-12A": 1.5}[model]
    assert rig.currents[0] == pytest.approx(0.3 * stall, rel=0.05)
