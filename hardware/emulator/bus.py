"""An emulated bus: bytes and the time in, bytes out; no port, no clock and no thread of its own.

Where the e-Manual is silent: in a sync read a servo waits for the one before it in the list, so a dead one hushes all
behind it (`strict`; otherwise they answer anyway), and any instruction on the bus feeds every servo's watchdog.

Not emulated yet: factory reset, clear, backup (answered with error 2), the time that bytes take, return delay, baud
rate, and a second servo with the same ID.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

from hardware.emulator.bank import ServoBank
from hardware.emulator.device import INSTRUCTION, LENGTH, Device
from hardware.protocol2 import instructions as wire
from hardware.protocol2.crc import checksum
from hardware.protocol2.frames import ALERT, BROADCAST, HEADER, STATUS, Frame, Parser, build_status
from hardware.rig import RigConfig

_BOOT_TIME = 0.1  # s a servo is deaf after a reboot; the manual gives no figure
_ID_ADDRESS = 7
_FAST_READ_FIRMWARE = 45


class EmulatedBus:
    """Servos on a wire.

    Attributes:
        devices: the servos, in the order of the rig.
        strict: whether a servo keeps silent when the one before it in a sync read does.
    """

    def __init__(self, config: RigConfig, strict: bool = True) -> None:
        """Switches the rig on, every servo at its zero."""
        self.strict = strict
        self._time = 0.0
        self._fed = 0.0
        self._parser = Parser()
        by_model: defaultdict[str, list[int]] = defaultdict(list)
        for index, joint in enumerate(config.joints):
            by_model[joint.model].append(index)
        self._banks: list[ServoBank] = []
        placed: dict[int, Device] = {}
        for members in by_model.values():
            joints = [config.joints[index] for index in members]
            bank = ServoBank(joints[0].table, [joint.id for joint in joints], [float(joint.zero) for joint in joints])
            self._banks.append(bank)
            placed |= {index: Device(bank, row) for row, index in enumerate(members)}
        self.devices = [placed[index] for index in range(len(config.joints))]
        self._by_id: dict[int, Device] = {}
        self._index()

    def __getitem__(self, id: int) -> Device:
        """The servo with this ID."""
        return self._by_id[id]

    def exchange(self, data: bytes, now: float) -> bytes:
        """Puts bytes onto the wire at the time `now` (s, never running back) and takes the servos' answers off it."""
        self.advance(now)
        answers = b""
        for frame in self._parser.feed(data):
            if frame.instruction != STATUS:
                self._fed = now
                answers += self._answer(frame)
        return answers

    def advance(self, now: float) -> None:
        """Lets the servos live until the time `now`, s."""
        for bank in self._banks:
            bank.live_until(now, self._fed)
        self._time = now

    @property
    def moving(self) -> bool:
        """Whether any servo says so itself: it turns faster than its moving threshold."""
        return any(device["moving"] for device in self.devices)

    def _index(self) -> None:
        self._by_id = {device["id"]: device for device in self.devices}

    def _hearing(self, id: int) -> Device | None:
        """The servo with this ID if it is alive and awake."""
        device = self._by_id.get(id)
        return device if device is not None and not device.dead and self._time >= device.asleep_until else None

    def _all(self) -> Iterator[tuple[int, Device]]:
        """Every servo that hears, by ID."""
        for id in sorted(self._by_id):
            if (device := self._hearing(id)) is not None:
                yield id, device

    def _answer(self, frame: Frame) -> bytes:
        """What the servos send back on one instruction."""
        group = _GROUP.get(frame.instruction)
        if group is not None:
            return group(self, frame.params) if frame.id == BROADCAST else b""
        if frame.id == BROADCAST:
            if frame.instruction == wire.PING:
                return b"".join(self._alone(device, id, frame) for id, device in self._all())
            if frame.instruction != wire.READ:
                for id, device in list(self._all()):
                    self._alone(device, id, frame)
            return b""
        device = self._hearing(frame.id)
        return b"" if device is None else self._alone(device, frame.id, frame)

    def _alone(self, device: Device, id: int, frame: Frame) -> bytes:
        """Does what an instruction to a single servo says, and gives its status."""
        params, error, answer, level = frame.params, 0, b"", 2
        match frame.instruction:
            case wire.PING:
                answer, level = device.read(0, 2) or b"", 0
                answer += bytes((device["firmware_version"],))
            case wire.READ:
                level = 1
                answer, error = self._read(device, params)
            case wire.WRITE if len(params) > 2:
                error = self._write(device, _word(params, 0), params[2:])
            case wire.REG_WRITE if len(params) > 2:
                error = device.register(_word(params, 0), params[2:])
            case wire.WRITE | wire.REG_WRITE:
                error = LENGTH
            case wire.ACTION:
                error = device.act()
                self._index()
            case wire.REBOOT:
                status = self._status(device, id, 0, b"", 2)
                device.reboot(self._time + _BOOT_TIME)
                return status
            case _:
                error = INSTRUCTION
        return self._status(device, id, error, answer, level)

    def _status(self, device: Device, id: int, error: int, params: bytes, level: int) -> bytes:
        """A status as the servo sends it, nothing if its status return level is below `level`."""
        if device["status_return_level"] < level:
            return b""
        return build_status(id, error, params, device.alert)

    def _read(self, device: Device, params: bytes) -> tuple[bytes, int]:
        if len(params) != 4:
            return b"", LENGTH
        data = device.read(_word(params, 0), _word(params, 2))
        return (b"", LENGTH) if data is None else (data, 0)

    def _write(self, device: Device, address: int, data: bytes) -> int:
        error = device.write(address, data)
        if address <= _ID_ADDRESS < address + len(data):
            self._index()
        return error

    def _sync_read(self, params: bytes) -> bytes:
        return self._in_turn([(id, params[:4]) for id in params[4:]]) if len(params) > 4 else b""

    def _bulk_read(self, params: bytes) -> bytes:
        return self._in_turn([(block[0], block[1:]) for block in _blocks(params, 5)])

    def _in_turn(self, asked: list[tuple[int, bytes]]) -> bytes:
        """The statuses of servos that answer one behind the other."""
        answers = b""
        for id, params in asked:
            device = self._hearing(id)
            status = b""
            if device is not None:
                data, error = self._read(device, params)
                status = self._status(device, id, error, data, 1)
            if not status and self.strict:
                break
            answers += status
        return answers

    def _fast_sync_read(self, params: bytes) -> bytes:
        """One frame that the servos write together, each with a CRC over all that was sent before it."""
        if len(params) <= 4:
            return b""
        address, length, ids = _word(params, 0), _word(params, 2), params[4:]
        size = wire.fast_reply_length(len(ids), length) - 7
        answer = HEADER + bytes((BROADCAST, size & 0xFF, size >> 8 & 0xFF, STATUS))
        crc = checksum(answer)
        spoken = False
        for id in ids:
            device = self._hearing(id)
            if device is None or device["status_return_level"] < 1 or device["firmware_version"] < _FAST_READ_FIRMWARE:
                if self.strict:
                    break
                continue
            data = device.read(address, length)
            error = (LENGTH if data is None else 0) | (ALERT if device.alert else 0)
            piece = bytes((error, id)) + (data if data is not None else bytes(length))
            tail = checksum(piece, crc).to_bytes(2, "little")
            crc = checksum(piece + tail, crc)
            answer += piece + tail
            spoken = True
        return answer if spoken else b""

    def _sync_write(self, params: bytes) -> bytes:
        if len(params) > 4 and (length := _word(params, 2)) > 0:
            address = _word(params, 0)
            for entry in _blocks(params[4:], length + 1):
                if (device := self._hearing(entry[0])) is not None:
                    self._write(device, address, entry[1:])
        return b""

    def _bulk_write(self, params: bytes) -> bytes:
        while len(params) > 5:
            id, address, length = params[0], _word(params, 1), _word(params, 3)
            data, params = params[5 : 5 + length], params[5 + length :]
            if len(data) == length and (device := self._hearing(id)) is not None:
                self._write(device, address, data)
        return b""


_GROUP: dict[int, Callable[[EmulatedBus, bytes], bytes]] = {
    wire.SYNC_READ: EmulatedBus._sync_read,
    wire.BULK_READ: EmulatedBus._bulk_read,
    wire.FAST_SYNC_READ: EmulatedBus._fast_sync_read,
    wire.SYNC_WRITE: EmulatedBus._sync_write,
    wire.BULK_WRITE: EmulatedBus._bulk_write,
}


def _word(data: bytes, at: int) -> int:
    return data[at] | data[at + 1] << 8


def _blocks(data: bytes, size: int) -> list[bytes]:
    """The data in pieces of `size` bytes; a short rest is dropped."""
    return [data[at : at + size] for at in range(0, len(data) - size + 1, size)]
