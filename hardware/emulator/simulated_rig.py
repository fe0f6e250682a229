"""A rig in this process: the emulator's servos with their rules and motors. Time passes in `elapse` only."""

import numpy as np

from hardware.emulator.bus import EmulatedBus
from hardware.emulator.servos.device import Device
from hardware.rig.counters import RigFaults
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array, RigScale, force_of
from hardware.rig.switching.audit import driving_settings


class SimulatedRig:
    """Servos that are switched on where they stand; with the loop's side of `hardware.rig.supervision.rig.Rig`."""

    def __init__(self, config: RigConfig) -> None:
        """Switches the servos on; raises RigError if a model cannot be emulated."""
        self.config = config
        self.names = config.names
        self.servos = EmulatedBus(config)  # the emulated servos, to look at and to harm
        self.faults = RigFaults.none(len(config.joints))
        servos = config.servos
        self._scale = RigScale(servos)
        self._joint_of = np.array(config.joint_of)
        self._rows = servos.joints
        self._now = 0.0
        self._fed = 0.0
        self._asked = False
        self._goals = np.zeros(len(config.joints))
        # Last measured, shape (J,), rad, rad/s, A.
        self.positions, self.velocities, self.currents = (np.zeros(len(config.joints)) for _ in range(3))
        ends = self._scale.ends.astype(int).tolist()
        for index, (joint, low, high) in enumerate(zip(servos.joints, *ends, strict=True)):
            device = self.servos.devices[index]
            self._scale.zero[index] -= device.bank.drive.forgotten[device.row]
            speed = joint.velocity * joint.gear / joint.table["profile_velocity"].si
            for name, value in (
                *driving_settings(joint, low, high).items(),
                ("profile_velocity", max(1, round(speed))),
                ("goal_position", device["present_position"]),
                ("torque_enable", 1),
                ("bus_watchdog", config.watchdog_units),
            ):
                self._write(index, name, value)
        self._measure()
        self._goals = self.positions.copy()

    def write(self, targets: Array) -> None:
        """Sets the servos' targets (J,), rad, clipped to the limits, and asks for the state; NaN changes nothing."""
        finite = np.isfinite(targets)
        wanted = np.where(finite, targets, self._goals)
        self._goals = RigScale(self.config).within(wanted)
        self.faults.clipped[:] += wanted != self._goals
        self.faults.refused[:] += ~finite
        self._asked, self._fed = True, self._now
        for index, pulses in enumerate(self._scale.pulses(self._goals[self._joint_of]).tolist()):
            if self.servos.devices[index].dead or self._write(index, "goal_position", int(pulses)):
                self.faults.unsent[self._joint_of[index]] += 1

    def request_state(self) -> None:
        """Asks for the state without giving targets."""
        self._asked, self._fed = True, self._now

    def collect_state(self) -> bool:
        """Takes the state; whether it was asked for."""
        if self._asked:
            self._measure()
        asked, self._asked = self._asked, False
        return asked

    def elapse(self, seconds: float) -> None:
        """Lets time pass; after more silence than the watchdog's time the servos stop."""
        self._now += seconds
        self.servos.feed(self._fed)
        self.servos.advance(self._now)

    def close(self) -> list[str]:
        """Ends as the rig file asks; returns the dead joints, which did not confirm it."""
        off = ("bus_watchdog", "torque_enable") if self.config.on_exit == "off" else ("bus_watchdog",)
        for index, device in enumerate(self.servos.devices):
            for name in off if not device.dead else ():
                self._write(index, name, 0)
        names = self.config.servos.names
        return [name for name, device in zip(names, self.servos.devices, strict=True) if device.dead]

    def _write(self, index: int, name: str, count: int) -> int:
        """Writes a register of a servo that has it; the error number, 0 for none."""
        register = self._rows[index].table.registers.get(name)
        return 0 if register is None else self.servos.devices[index].write(register.address, register.encode(count))

    def _measure(self) -> None:
        for row, (index, joint, device) in enumerate(zip(self._joint_of, self._rows, self.servos.devices, strict=True)):
            if device.dead:
                self.faults.missed[index] += 1
                continue
            self.faults.alert[index] += device.alert
            self.positions[index] = (device["present_position"] - self._scale.zero[row]) / joint.pulses_per_radian
            speed = _number(device, "present_velocity") * joint.table["present_velocity"].si
            self.velocities[index] = speed / (joint.direction * joint.gear)
            self.currents[index] = _number(device, force_of(joint.table)) * self._scale.amperes[row]


def _number(device: Device, name: str) -> int:
    """What a register says, where a bit of it may be a sign."""
    register = device.bank.table[name]
    return register.decode(device[name].to_bytes(register.length, "little", signed=register.signed))
