"""An emulated bus: bytes and the time in, the servos' answers out; without port, clock or thread.

Where the e-Manual is silent: in a sync or bulk read a servo waits for the one before it in the list, so a dead one
silences all behind it (`strict`; otherwise they answer anyway); any instruction on the bus feeds every servo's
watchdog; servos that share an ID all obey, and their simultaneous answers mix on the wire.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable

from hardware.emulator.plant import STEP, Coupling, JointPlant
from hardware.emulator.servos import protocol1_answers
from hardware.emulator.servos.device import ACCESS, INSTRUCTION, LENGTH, RANGE, Device
from hardware.emulator.servos.protocol1_answers import BOOT_TIME, Answer
from hardware.emulator.servos.servo_bank import ServoBank
from hardware.families.dynamixel1.frames import BAD_CHECKSUM as BAD_CHECKSUM1
from hardware.families.dynamixel1.frames import Parser1
from hardware.families.dynamixel2 import instructions as wire
from hardware.families.dynamixel2.frames import ALERT, BROADCAST, HEADER, STATUS, Frame, Parser, build_status, checksum
from hardware.rig.rig_file import RigConfig

LONGEST_GAP = 1.5e-3
"""The silence inside an instruction after which servos forget its beginning, s."""

_BAD_CHECKSUM = 3
_NEWER_FIRMWARE = 42  # a factory reset of everything is no longer taken from a broadcast


class EmulatedBus:
    """Servos on a wire.

    Attributes:
        strict: whether a servo keeps silent when the one before it in a sync read does.
        baud: the host's, bits/s; a servo set to another hears nothing.
        longest_gap: the silence inside an instruction that the servos forgive, s; None for any.
        time: up to which the servos are computed, s.
    """

    def __init__(
        self,
        config: RigConfig,
        strict: bool = True,
        longest_gap: float | None = LONGEST_GAP,
        plant: JointPlant | None = None,
    ) -> None:
        """Switches the rig on, every servo at its zero and set to the rig's baud rate.

        With a plant the horns are where its joints are, and feel what they turn.
        """
        self.strict = strict
        self.baud = config.baud
        self.longest_gap = longest_gap
        self.time = 0.0
        self._heard = 0.0
        self._fed = 0.0
        self._parser, self._parser1 = Parser(), Parser1()
        by_model: defaultdict[str, list[int]] = defaultdict(list)
        for index, joint in enumerate(config.joints):
            by_model[joint.model].append(index)
        self._banks: list[ServoBank] = []
        placed: dict[int, Device] = {}
        for members in by_model.values():
            joints = [config.joints[index] for index in members]
            bank = ServoBank(joints[0].table, [joint.id for joint in joints], [float(joint.zero) for joint in joints])
            bank.registers["baud_rate"] = bank.table.baud_value(config.baud)
            self._banks.append(bank)
            placed |= {index: Device(bank, row) for row, index in enumerate(members)}
        self.devices = [placed[index] for index in range(len(config.joints))]
        self._coupling = Coupling(plant, config.joints, self.devices) if plant is not None else None
        self._turned = 0.0  # time of the plant, s
        self.reindex()

    def __getitem__(self, id: int) -> Device:
        """The servo with this ID."""
        return self._by_id[id][0]

    def exchange(self, data: bytes, now: float) -> list[Answer]:
        """Puts bytes on the wire, the last one at the time `now` (s), and returns the servos' answers."""
        self.advance(now)
        waiting = self._parser.waiting or self._parser1.waiting
        if self.longest_gap is not None and now - self._heard > self.longest_gap and waiting:
            self._parser, self._parser1 = Parser(), Parser1()
        self._heard = now
        answers: list[Answer] = []
        for frame in self._parser.feed(data):
            if frame.instruction != STATUS:
                self._fed = self.time
                answers += self._answer(frame)
        for id in self._parser.damaged:
            for device in self.hearing(id):
                answers += self._status(device, id, _BAD_CHECKSUM, b"", 2)
        return answers + self._answer_protocol1(data) if self._speaks_protocol1 else answers

    def _answer_protocol1(self, data: bytes) -> list[Answer]:
        answers: list[Answer] = []
        for frame in self._parser1.feed(data):
            self._fed = self.time
            answers += protocol1_answers.answer(self, frame)
        for id in self._parser1.damaged:
            for device in self.hearing(id, 1):
                answers += protocol1_answers.status(device, BAD_CHECKSUM1, b"", 2)
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

    @property
    def moving(self) -> bool:
        """Whether any servo reports that it moves: it turns faster than its moving threshold."""
        return any(device.moving for device in self.devices)

    def reindex(self) -> None:
        """Updates which servo listens to which ID, in which protocol, after a change."""
        self._by_id: defaultdict[int, list[Device]] = defaultdict(list)
        self._shadows: defaultdict[int, list[Device]] = defaultdict(list)
        for device in self.devices:
            device.choose_protocol()
            self._by_id[device.id].append(device)
            if device.shadow_id <= 252 and device.shadow_id != device.id:
                self._shadows[device.shadow_id].append(device)
        self._speaks_protocol1 = any(device.protocol == 1 for device in self.devices)

    def everybody(self, protocol: int) -> list[Device]:
        """The servos that hear and speak this protocol."""
        return self._awake(self.devices, protocol)

    def _awake(self, devices: list[Device], protocol: int = 2) -> list[Device]:
        """Those that are alive, not starting up, listen at the host's speed, and speak this protocol."""
        return [
            d
            for d in devices
            if d.protocol == protocol and not d.dead and self.time >= d.asleep_until and d.baud == self.baud
        ]

    def hearing(self, id: int, protocol: int = 2) -> list[Device]:
        """The servos with this ID that hear, and speak this protocol."""
        return self._awake(self._by_id[id], protocol) if id in self._by_id else []

    def _answer(self, frame: Frame) -> list[Answer]:
        group = _GROUP.get(frame.instruction)
        if group is not None:
            return group(self, frame.params) if frame.id == BROADCAST else []
        if frame.id == BROADCAST:
            if frame.instruction == wire.PING:
                return [answer for id in sorted(self._by_id) for answer in self._together(id, frame)]
            reset_all = frame.instruction == wire.FACTORY_RESET and frame.params == bytes((wire.RESET_ALL,))
            for device in self._awake(self.devices):
                if frame.instruction != wire.READ and not (reset_all and device["firmware_version"] >= _NEWER_FIRMWARE):
                    self._alone(device, device.id, frame)
            return []
        answers = self._together(frame.id, frame)
        for device in self._awake(self._shadows.get(frame.id, [])):
            if frame.instruction not in (wire.PING, wire.READ):
                self._alone(device, frame.id, frame, shadow=True)
        return answers

    def _together(self, id: int, frame: Frame) -> list[Answer]:
        """The answers of all servos with this ID, mixed into one where there are several."""
        answers = [answer for device in self.hearing(id) for answer in self._alone(device, id, frame)]
        return answers if len(answers) < 2 else [self.mixed(answers)]

    def mixed(self, answers: list[Answer]) -> Answer:
        """Answers given at the same time: a 0 on the wire wins against a 1, as it does where drivers share a line."""
        first = min(answer.delay for answer in answers)
        late = [round((answer.delay - first) * self.baud / 10) for answer in answers]
        mixed = bytearray(b"\xff" * max(start + len(answer.data) for start, answer in zip(late, answers, strict=True)))
        for start, answer in zip(late, answers, strict=True):
            for place, byte in enumerate(answer.data, start):
                mixed[place] &= byte
        return Answer(first, bytes(mixed), answers[0].id)

    def _alone(self, device: Device, id: int, frame: Frame, shadow: bool = False) -> list[Answer]:
        params, error, answer, level = frame.params, 0, b"", 2
        deaf_until = self.time + BOOT_TIME
        # The answer leaves before the instruction changes ID, speed or status return level.
        done = self._status(device, id, 0, b"", 2)
        match frame.instruction:
            case wire.PING:
                answer, level = device.read(0, 2) or b"", 0
                answer += bytes((device["firmware_version"],))
            case wire.READ:
                level = 1
                answer, error = self._read(device, params)
            case wire.WRITE if len(params) > 2:
                error = self._write(device, _word(params, 0), params[2:], shadow)
            case wire.REG_WRITE if len(params) > 2:
                error = ACCESS if shadow else device.register(_word(params, 0), params[2:])
            case wire.WRITE | wire.REG_WRITE:
                error = LENGTH
            case wire.ACTION:
                error = device.act()
                self.reindex()
            case wire.REBOOT:
                device.reboot(deaf_until)
                return done
            case wire.FACTORY_RESET if not shadow:
                if len(params) == 1 and device.factory_reset(params[0], deaf_until):
                    self.reindex()
                    return done
                error = RANGE if len(params) == 1 else LENGTH
            case wire.CLEAR:
                error = device.clear(params)
            case wire.BACKUP if not shadow:
                error = device.back_up(params, deaf_until)
                self.reindex()
            case _:
                error = INSTRUCTION
        return self._status(device, id, error, answer, level)

    def _status(self, device: Device, id: int, error: int, params: bytes, level: int) -> list[Answer]:
        """A status as the servo sends it, nothing if its status return level is below `level`."""
        if device["status_return_level"] < level:
            return []
        return [Answer(device.return_delay, build_status(id, error, params, device.alert), id)]

    def _read(self, device: Device, params: bytes) -> tuple[bytes, int]:
        if len(params) != 4:
            return b"", LENGTH
        data = device.read(_word(params, 0), _word(params, 2))
        return (b"", LENGTH) if data is None else (data, 0)

    def _write(self, device: Device, address: int, data: bytes, shadow: bool = False) -> int:
        error = device.write(address, data, shadow)
        if address <= _LAST_ID_ADDRESS and not error:
            self.reindex()
        return error

    def _sync_read(self, params: bytes) -> list[Answer]:
        return self._in_turn([(id, params[:4]) for id in params[4:]]) if len(params) > 4 else []

    def _bulk_read(self, params: bytes) -> list[Answer]:
        return self._in_turn([(block[0], block[1:]) for block in _blocks(params, 5)])

    def _in_turn(self, asked: list[tuple[int, bytes]]) -> list[Answer]:
        answers: list[Answer] = []
        for id, params in asked:
            own: list[Answer] = []
            for device in self.hearing(id):
                data, error = self._read(device, params)
                own += self._status(device, id, error, data, 1)
            if not own and self.strict:
                break
            answers += own if len(own) < 2 else [self.mixed(own)]
        return answers

    def _fast_sync_read(self, params: bytes) -> list[Answer]:
        if len(params) <= 4:
            return []
        address, length = _word(params, 0), _word(params, 2)
        return self._in_one_frame([(id, address, length) for id in params[4:]])

    def _fast_bulk_read(self, params: bytes) -> list[Answer]:
        return self._in_one_frame([(block[0], _word(block, 1), _word(block, 3)) for block in _blocks(params, 5)])

    def _in_one_frame(self, asked: list[tuple[int, int, int]]) -> list[Answer]:
        size = 1 + sum(length + 4 for _, _, length in asked)
        answer = HEADER + bytes((BROADCAST, size & 0xFF, size >> 8 & 0xFF, STATUS))
        crc = checksum(answer)
        delay: float | None = None
        pieces = [answer]
        for id, address, length in asked:
            device = next(iter(self.hearing(id)), None)
            if device is None or device["status_return_level"] < 1 or not device.answers_fast_reads:
                if self.strict:
                    break
                continue
            data = device.read(address, length)
            error = (LENGTH if data is None else 0) | (ALERT if device.alert else 0)
            piece = bytes((error, id)) + (data if data is not None else bytes(length))
            tail = checksum(piece, crc).to_bytes(2, "little")
            crc = checksum(tail, checksum(piece, crc))
            pieces.append(piece + tail)
            delay = device.return_delay if delay is None else delay
        return [] if delay is None else [Answer(delay, b"".join(pieces), BROADCAST)]

    def _sync_write(self, params: bytes) -> list[Answer]:
        if len(params) > 4 and (length := _word(params, 2)) > 0:
            address = _word(params, 0)
            for entry in _blocks(params[4:], length + 1):
                self._write_unanswered(entry[0], address, entry[1:])
        return []

    def _bulk_write(self, params: bytes) -> list[Answer]:
        while len(params) > 5:
            id, address, length = params[0], _word(params, 1), _word(params, 3)
            data, params = params[5 : 5 + length], params[5 + length :]
            if len(data) == length:
                self._write_unanswered(id, address, data)
        return []

    def _write_unanswered(self, id: int, address: int, data: bytes) -> None:
        for device in self.hearing(id):
            self._write(device, address, data)
        if id in self._shadows:
            for device in self._awake(self._shadows[id]):
                self._write(device, address, data, shadow=True)


_LAST_ID_ADDRESS = 13  # of the ID, the baud rate, the second ID and the protocol

_GROUP: dict[int, Callable[[EmulatedBus, bytes], list[Answer]]] = {
    wire.SYNC_READ: EmulatedBus._sync_read,
    wire.BULK_READ: EmulatedBus._bulk_read,
    wire.FAST_SYNC_READ: EmulatedBus._fast_sync_read,
    wire.FAST_BULK_READ: EmulatedBus._fast_bulk_read,
    wire.SYNC_WRITE: EmulatedBus._sync_write,
    wire.BULK_WRITE: EmulatedBus._bulk_write,
}


def _word(data: bytes, at: int) -> int:
    return data[at] | data[at + 1] << 8


def _blocks(data: bytes, size: int) -> list[bytes]:
    """The data in pieces of `size` bytes; a shorter remainder is dropped."""
    return [data[at : at + size] for at in range(0, len(data) - size + 1, size)]
