"""The answers of emulated servos of Protocol 2.0.

Where the e-Manual is silent: in a sync or bulk read a servo waits for the one before it in the list, so a dead one
silences all behind it (on a strict bus; otherwise they answer anyway).
"""

from collections.abc import Callable

from hardware.families import emulation
from hardware.families import frames as wire
from hardware.families.dynamixel2 import frames
from hardware.families.dynamixel2.family import FAMILY
from hardware.families.dynamixel2.frames import ALERT, HEADER, STATUS, build_status, checksum
from hardware.families.emulation import Answer, EmulatedServo, EmulatedServos, alone_or_mixed, in_turn
from hardware.families.frames import BROADCAST, Frame

_NEWER_FIRMWARE = 42  # a factory reset of everything is no longer taken from a broadcast
_BACKUPS = {frames.BACKUP_STORE: False, frames.BACKUP_RESTORE: True}
_LAST_ID_ADDRESS = 13  # of the ID, the baud rate, the second ID and the protocol


def answer(bus: EmulatedServos, frame: Frame) -> list[Answer]:
    """The servos' answers to one instruction."""
    if frame.instruction == STATUS:
        return []
    group = _GROUP.get(frame.instruction)
    if group is not None:
        return group(bus, frame.params) if frame.id == BROADCAST else []
    if frame.id == BROADCAST:
        if frame.instruction == wire.PING:
            return [answer for id in bus.ids() for answer in _together(bus, id, frame)]
        reset_all = frame.instruction == wire.FACTORY_RESET and frame.params == bytes((emulation.RESET_ALL,))
        for device in bus.everybody(FAMILY):
            if frame.instruction != wire.READ and not (reset_all and device["firmware_version"] >= _NEWER_FIRMWARE):
                _alone(bus, device, device.id, frame)
        return []
    answers = _together(bus, frame.id, frame)
    for device in bus.shadows(frame.id, FAMILY):
        if frame.instruction not in (wire.PING, wire.READ):
            _alone(bus, device, frame.id, frame, shadow=True)
    return answers


def damaged(bus: EmulatedServos, id: int) -> list[Answer]:
    """Their answers to a frame whose checksum was wrong."""
    return [one for device in bus.hearing(id, FAMILY) for one in _status(device, id, emulation.CHECKSUM, b"", 2)]


def _together(bus: EmulatedServos, id: int, frame: Frame) -> list[Answer]:
    return alone_or_mixed(bus, [one for device in bus.hearing(id, FAMILY) for one in _alone(bus, device, id, frame)])


def _alone(bus: EmulatedServos, device: EmulatedServo, id: int, frame: Frame, shadow: bool = False) -> list[Answer]:
    params, error, answer, level = frame.params, 0, b"", 2
    deaf_until = bus.time + emulation.BOOT_TIME
    # The answer leaves before the instruction changes ID, speed or status return level.
    done = _status(device, id, 0, b"", 2)
    match frame.instruction:
        case wire.PING:
            answer, level = device.read(0, 2) or b"", 0
            answer += bytes((device["firmware_version"],))
        case wire.READ:
            level, error = 1, emulation.LENGTH
            if len(params) == 4 and (data := device.read(_word(params, 0), _word(params, 2))) is not None:
                answer, error = data, 0
        case wire.WRITE if len(params) > 2:
            error = _write(bus, device, _word(params, 0), params[2:], shadow)
        case wire.REG_WRITE if len(params) > 2:
            error = device.register(_word(params, 0), params[2:], shadow)
        case wire.WRITE | wire.REG_WRITE:
            error = emulation.LENGTH
        case wire.ACTION:
            error = device.act()
            bus.reindex()
        case wire.REBOOT:
            device.reboot(deaf_until)
            return done
        case wire.FACTORY_RESET if not shadow:
            if len(params) == 1 and device.factory_reset(params[0], deaf_until):
                bus.reindex()
                return done
            error = emulation.RANGE if len(params) == 1 else emulation.LENGTH
        case wire.CLEAR:
            error = device.clear() if params == frames.CLEAR_TURNS else emulation.RANGE
        case wire.BACKUP if not shadow:
            error = device.back_up(_BACKUPS.get(params), deaf_until)
            bus.reindex()
        case _:
            error = emulation.INSTRUCTION
    return _status(device, id, error, answer, level)


def _status(device: EmulatedServo, id: int, error: int, params: bytes, level: int) -> list[Answer]:
    """A status as the servo sends it, nothing if its status return level is below `level`."""
    if device["status_return_level"] < level:
        return []
    return [Answer(device.return_delay, build_status(id, error, params, device.alert), id)]


def _write(bus: EmulatedServos, device: EmulatedServo, address: int, data: bytes, shadow: bool = False) -> int:
    error = device.write(address, data, shadow)
    if address <= _LAST_ID_ADDRESS and not error:
        bus.reindex()
    return error


def _each_in_turn(bus: EmulatedServos, blocks: list[bytes]) -> list[Answer]:
    return in_turn(bus, (_together(bus, id, Frame(id, wire.READ, bytes(params))) for id, *params in blocks))


def _in_one_frame(bus: EmulatedServos, blocks: list[bytes]) -> list[Answer]:
    asked = [(block[0], _word(block, 1), _word(block, 3)) for block in blocks]
    size = 1 + sum(length + 4 for _, _, length in asked)
    answer = HEADER + bytes((BROADCAST, size & 0xFF, size >> 8 & 0xFF, STATUS))
    crc = checksum(answer)
    delay: float | None = None
    pieces = [answer]
    for id, address, length in asked:
        device = next(iter(bus.hearing(id, FAMILY)), None)
        if device is None or device["status_return_level"] < 1 or not device.answers_fast_reads:
            if bus.strict:
                break
            continue
        data = device.read(address, length)
        error = (emulation.LENGTH if data is None else 0) | (ALERT if device.alert else 0)
        piece = bytes((error, id)) + (data if data is not None else bytes(length))
        tail = checksum(piece, crc).to_bytes(2, "little")
        crc = checksum(tail, checksum(piece, crc))
        pieces.append(piece + tail)
        delay = device.return_delay if delay is None else delay
    return [] if delay is None else [Answer(delay, b"".join(pieces), BROADCAST)]


def _sync_write(bus: EmulatedServos, params: bytes) -> list[Answer]:
    if len(params) > 4 and (length := _word(params, 2)) > 0:
        address = _word(params, 0)
        for entry in _blocks(params[4:], length + 1):
            _write_unanswered(bus, entry[0], address, entry[1:])
    return []


def _bulk_write(bus: EmulatedServos, params: bytes) -> list[Answer]:
    while len(params) > 5:
        id, address, length = params[0], _word(params, 1), _word(params, 3)
        data, params = params[5 : 5 + length], params[5 + length :]
        if len(data) == length:
            _write_unanswered(bus, id, address, data)
    return []


def _write_unanswered(bus: EmulatedServos, id: int, address: int, data: bytes) -> None:
    for device in bus.hearing(id, FAMILY):
        _write(bus, device, address, data)
    for device in bus.shadows(id, FAMILY):
        _write(bus, device, address, data, shadow=True)


_GROUP: dict[int, Callable[[EmulatedServos, bytes], list[Answer]]] = {
    wire.SYNC_READ: lambda bus, params: _each_in_turn(bus, _blocks_of(params)),
    wire.BULK_READ: lambda bus, params: _each_in_turn(bus, _blocks(params, 5)),
    wire.FAST_SYNC_READ: lambda bus, params: _in_one_frame(bus, _blocks_of(params)),
    wire.FAST_BULK_READ: lambda bus, params: _in_one_frame(bus, _blocks(params, 5)),
    wire.SYNC_WRITE: _sync_write,
    wire.BULK_WRITE: _bulk_write,
}


def _word(data: bytes, at: int) -> int:
    return data[at] | data[at + 1] << 8


def _blocks_of(params: bytes) -> list[bytes]:
    """A sync read as the blocks of a bulk read."""
    return [bytes((id,)) + params[:4] for id in params[4:]]


def _blocks(data: bytes, size: int) -> list[bytes]:
    """The data in pieces of `size` bytes; a shorter remainder is dropped."""
    return [data[at : at + size] for at in range(0, len(data) - size + 1, size)]
