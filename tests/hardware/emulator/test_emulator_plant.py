"""Emulated servos on joints with masses: they sag, stall, shut down and fall as the real ones do."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.rig.supervision.rig import Rig


class Pendulums:
    """Rods that stand up at angle 0 and fall to either side; `weight` is the torque of gravity at the horizontal."""

    inertia = 0.02  # kg m2

    def __init__(self, joints, weight, start=0.0):
        self.weight = np.full(joints, weight)
        self.angles, self.velocities = np.full(joints, float(start)), np.zeros(joints)

    def advance(self, torques, seconds):
        for _ in range(4):
            pull = self.weight * np.sin(self.angles) - 0.02 * self.velocities
            self.velocities = self.velocities + (torques + pull) / self.inertia * seconds / 4
            self.angles = self.angles + self.velocities * seconds / 4
        return self.angles, self.velocities


def on_plant(config, plant):
    port = EmulatedPort(EmulatedBus(config, plant=plant), paced=True)
    return port, Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)


def follow(port, rig, targets, seconds):
    for _ in range(round(seconds * 100)):
        rig.collect_state()
        rig.write(targets)
        port.elapse(0.01)


def test_the_horns_are_where_the_joints_are(rig_of_four):
    port, rig = on_plant(rig_of_four, Pendulums(4, 0.0, start=0.3))
    assert rig.positions == pytest.approx(np.full(4, 0.3), abs=2e-3)
    assert port.bus[2]["present_position"] < 2048 < port.bus[1]["present_position"]


def test_a_load_is_felt_as_current_and_sag(rig_of_four):
    plant = Pendulums(4, 0.0)
    plant.weight[0] = 1.5  # N·m, of the 4 that the servo has at stall
    port, rig = on_plant(rig_of_four, plant)
    follow(port, rig, np.full(4, 1.2), 2.0)
    holding = 1.5 * np.sin(1.2)
    assert plant.angles == pytest.approx([1.2] * 4, abs=0.15)
    assert plant.angles[0] - 1.2 > 0.03  # it hangs lower than it should
    assert rig.currents[0] == pytest.approx(-holding / 4.0 * 2.3, rel=0.1)
    assert rig.currents[1:] == pytest.approx(np.zeros(3), abs=0.05)


def test_an_overload_shuts_the_servo_down_and_the_joint_falls(rig_of_four):
    plant = Pendulums(4, 0.0, start=0.5)
    port, _ = on_plant(rig_of_four, plant)
    plant.weight[1] = 12.0  # put on it once it holds: a joint that falls is not switched on
    port.elapse(3.0)  # without a loop the servos hold, and no joint yields
    assert port.bus[2]["hardware_error_status"] & 0x20
    assert port.bus[2]["torque_enable"] == 0
    assert plant.angles[1] > 1.5
    assert plant.angles[[0, 2, 3]] == pytest.approx(np.full(3, 0.5), abs=0.01)
    with pytest.raises(RigError, match="joint_2"):
        Rig(rig_of_four, lambda part: Bus(port, part.baud))


def test_without_torque_a_joint_falls_and_its_servo_tells(rig_of_four):
    plant = Pendulums(4, 1.0, start=0.2)
    port, rig = on_plant(rig_of_four, plant)
    rig.close()
    for _ in range(60):
        port.elapse(0.01)
    assert (plant.angles > 0.6).all()
    assert port.bus[1]["present_position"] == pytest.approx(2048 + plant.angles[0] * 4096 / (2 * np.pi), abs=1.5)
