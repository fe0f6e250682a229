"""The mechanism that the horns of an emulated rig turn, with masses and contacts; `sim.physics.rig_plant` has one."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from hardware.emulator.servos.device import Device
from hardware.emulator.servos.drive import makers_motor
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array

STEP = 0.002  # how often torques and angles are exchanged, s


class JointPlant(Protocol):
    """J joints that turn under torques."""

    def advance(self, torques: Array, seconds: float) -> tuple[Array, Array]:
        """Advances under torques (J,), N·m; returns the joints' angles (J,), rad, and velocities (J,), rad/s."""
        ...


class Coupling:
    """Horns on a plant: the motors' torques go in, the joints' angles come back."""

    def __init__(self, plant: JointPlant, config: RigConfig, devices: Sequence[Device]) -> None:
        self._plant = plant
        self._devices = devices
        servos, self._joint_of = config.servos.joints, np.array(config.joint_of)
        self._ratio = np.array([servo.direction * servo.gear for servo in servos])  # turns of the horn per joint turn
        self._per_radian = np.array([servo.pulses_per_radian for servo in servos])
        for device in devices:
            device.bank.drive.couple(makers_motor(device.model))
        self._angles, _ = plant.advance(np.zeros(len(config.joints)), 0.0)
        for device, pulses in zip(devices, self._per_radian * self._angles[self._joint_of], strict=True):
            device.bank.shaft[device.row] += pulses

    def advance(self) -> None:
        """Advances by one STEP."""
        torques = np.array([device.bank.drive.torque(device.row) for device in self._devices]) * self._ratio
        of = self._joint_of
        angles, velocities = self._plant.advance(np.bincount(of, torques).astype(np.float64), STEP)
        # Only the change: the whole turns that a servo counts are its own.
        moved, speeds = self._per_radian * (angles - self._angles)[of], self._per_radian * velocities[of]
        self._angles = angles.copy()
        for device, pulses, speed in zip(self._devices, moved, speeds, strict=True):
            drive = device.bank.drive
            drive.shaft[device.row] += pulses
            drive.speed[device.row] = speed
