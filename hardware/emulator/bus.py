"""An emulated bus: bytes and the time in, the servos' answers out; without port, clock or thread.

What servos answer is their family's (`answers` in its folder). Where the manuals are silent: any instruction on the bus
feeds every servo's watchdog; servos that share an ID all obey, and their simultaneous answers mix on the wire.
"""

from collections import defaultdict
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from hardware.emulator.servos.device import Device
from hardware.emulator.servos.drive import makers_motor
from hardware.emulator.servos.servo_bank import ServoBank
from hardware.families.emulation import BOOT_TIME, Answer, Answers, answers_of
from hardware.families.family import Family
from hardware.families.frames import FrameParser
from hardware.families.models import FAMILIES, USUAL
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array

STEP = 0.002  # how often torques and angles are exchanged, s


class JointPlant(Protocol):
    """A mechanism of J joints that the horns turn, with masses and contacts; `sim.physics.rig_plant` has one."""

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
            device.bank.drive.use(makers_motor(device.model))
            device.bank.drive.coupled = True
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


class EmulatedBus:
    """Servos on a wire."""

    def __init__(self, config: RigConfig, plant: JointPlant | None = None) -> None:
        """Switches all servos on at their zeros and the rig's baud rate; with a plant, where its joints are."""
        self.strict = True  # whether a servo keeps silent when the one before it in a sync read does
        self.baud = config.baud  # the host's, bits/s; a servo set to another hears nothing
        # The silence inside an instruction after which servos forget its beginning, s; None for never.
        self.longest_gap: float | None = 1.5e-3
        self.time = 0.0  # up to which the servos are computed, s
        self._heard = 0.0
        self._fed = 0.0
        self._heard_by = _listeners()
        by_model: defaultdict[str, list[int]] = defaultdict(list)
        joint_of, servos = config.joint_of, config.servos
        for index, joint in enumerate(servos.joints):
            by_model[joint.model].append(index)
        self._banks: list[ServoBank] = []
        placed: dict[int, Device] = {}
        for members in by_model.values():
            joints = [servos.joints[index] for index in members]
            bank = ServoBank(joints[0].table, [joint.id for joint in joints], [float(joint.zero) for joint in joints])
            bank.registers["baud_rate"] = bank.table.baud_value(config.baud)
            self._banks.append(bank)
            pairs = [
                (row, row + 1, joints[row].direction * joints[row + 1].direction)
                for row in range(len(members) - 1)
                if joint_of[members[row]] == joint_of[members[row + 1]]
            ]
            bank.drive.joined = np.array(pairs, dtype=np.int64).reshape(-1, 3).T
            placed |= {index: Device(bank, row) for row, index in enumerate(members)}
        self.devices = [placed[index] for index in range(len(servos.joints))]
        self._coupling = Coupling(plant, config, self.devices) if plant is not None else None
        self._turned = 0.0  # time of the plant, s
        self.reindex()

    def __getitem__(self, id: int) -> Device:
        return self._by_id[id][0]

    def exchange(self, data: bytes, now: float) -> list[Answer]:
        """Puts bytes on the wire, the last one at the time `now` (s), and returns the servos' answers."""
        self.advance(now)
        waiting = any(parser.waiting for _, parser, _ in self._heard_by)
        if self.longest_gap is not None and now - self._heard > self.longest_gap and waiting:
            self._heard_by = _listeners()
        self._heard = now
        answers: list[Answer] = []
        for family, parser, answering in self._heard_by:
            if family not in self._spoken:
                continue
            for frame in parser.feed(data):
                if family.mirrors or family.as_status(frame) is None:
                    self._fed = self.time
                answers += answering.answer(self, frame)
            for id in parser.damaged:
                answers += answering.damaged(self, id)
        return answers

    def advance(self, now: float) -> None:
        """Advances the servos to the time `now`, s; an earlier time changes nothing."""
        if now <= self.time:
            return
        while self._coupling is not None and now - self._turned >= STEP:
            self._turned += STEP
            for bank in self._banks:
                bank.live_until(self._turned, self._fed)
            self._coupling.advance()
        for bank in self._banks:
            bank.live_until(now, self._fed)
            if bank.browned_out:
                for device in self.devices:
                    if device.bank is bank and device.row in bank.browned_out:
                        device.reboot(now + BOOT_TIME)
                bank.browned_out.clear()
        self.time = now

    def feed(self, at: float) -> None:
        """Feeds the watchdogs at the time `at`, s, without any bytes."""
        self._fed = max(self._fed, at)

    def reindex(self) -> None:
        """Updates which servo listens to which ID, as which family, after a change."""
        self._by_id: defaultdict[int, list[Device]] = defaultdict(list)
        self._shadows: defaultdict[int, list[Device]] = defaultdict(list)
        for device in self.devices:
            device.choose_family()
            self._by_id[device.id].append(device)
            if device.shadow_id <= 252 and device.shadow_id != device.id:
                self._shadows[device.shadow_id].append(device)
        self._spoken = {device.family for device in self.devices}

    def everybody(self, family: Family) -> list[Device]:
        """The servos that hear, and speak as this family."""
        return self._awake(self.devices, family)

    def hearing(self, id: int, family: Family = USUAL) -> list[Device]:
        """Those with this ID."""
        return self._awake(self._by_id[id], family) if id in self._by_id else []

    def shadows(self, id: int, family: Family = USUAL) -> list[Device]:
        """Those with this second ID, to which they listen without answering."""
        return self._awake(self._shadows[id], family) if id in self._shadows else []

    def ids(self) -> list[int]:
        """Every ID that some servo has, in order."""
        return sorted(self._by_id)

    def _awake(self, devices: list[Device], family: Family) -> list[Device]:
        awake = (one for one in devices if one.family is family and not one.dead and self.time >= one.asleep_until)
        return [one for one in awake if one.baud == self.baud]

    def mixed(self, answers: list[Answer]) -> Answer:
        """Answers given at the same time: a 0 on the wire wins against a 1, as it does where drivers share a line."""
        first = min(answer.delay for answer in answers)
        late = [round((answer.delay - first) * self.baud / 10) for answer in answers]
        mixed = bytearray(b"\xff" * max(start + len(answer.data) for start, answer in zip(late, answers, strict=True)))
        for start, answer in zip(late, answers, strict=True):
            for place, byte in enumerate(answer.data, start):
                mixed[place] &= byte
        return Answer(first, bytes(mixed), answers[0].id)


def _listeners() -> list[tuple[Family, FrameParser, Answers]]:
    return [(family, family.parser(), answers_of(family)) for family in FAMILIES]
