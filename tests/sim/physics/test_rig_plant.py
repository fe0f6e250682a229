"""A robot's body under an emulated rig: torques in, angles out."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from controller.motion.encodings.joint_angles import JointBody
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import load_rig
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import shipped_configs
from sim.physics.rig_plant import RigPlant
from sim.robots.robot import load_robot

CONFIGS = shipped_configs()


@pytest.fixture(scope="module")
def rig():
    return load_rig(CONFIGS / "rigs" / "servo20.toml")


@pytest.fixture(scope="module")
def servo20(rig):
    return load_robot(CONFIGS / "robots" / "servo20.toml", JointBody.of(rig.names))


def test_an_arm_is_held_by_its_servos_and_falls_without_them(rig, servo20):
    port = EmulatedPort(EmulatedBus(rig, plant=RigPlant(servo20, rig.names)))
    roll = rig.names.index("r_shoulder_roll")
    device, goal = port.bus.devices[roll], 2048 - round(1.4 * 4096 / (2 * np.pi))
    register = rig.joints[roll].table["goal_position"]
    for each in port.bus.devices:
        each["goal_position"] = 2048
        each.write(64, b"\x01")
    device.write(register.address, register.encode(goal))
    for _ in range(150):
        port.elapse(0.01)
    assert abs(device["present_position"] - goal) < 15
    assert device["present_position"] > goal  # it sags
    assert device["present_current"] < -10
    device.write(64, b"\x00")
    for _ in range(150):
        port.elapse(0.01)
    assert abs(device["present_position"] - 2048) < 300


def test_only_hinges_of_the_robot_can_be_driven(servo20):
    with pytest.raises(UnknownNameError, match="'tail'"):
        RigPlant(servo20, ("head_pan", "tail"))
    with pytest.raises(MotiondeckError, match="root 'on wheels'"):
        RigPlant(servo20, ("head_pan",), "on wheels")
