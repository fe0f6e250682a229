"""The answers of servos of Protocol 1.0: AX, RX and MX.

There is no sync read; MX servos answer a bulk read, each after the one before it in the list. A broadcast ping makes
all answer at once, and nothing can be understood. A reboot is known to MX only, and a factory reset keeps nothing.
"""

from hardware.families import emulation
from hardware.families import frames as wire
from hardware.families.dynamixel1.family import ANGLE_LIMIT, BAD_CHECKSUM, BAD_INSTRUCTION, FAMILY, OUT_OF_RANGE
from hardware.families.emulation import Answer, EmulatedServo, EmulatedServos, alone_or_mixed, in_turn, sync_write
from hardware.families.frames import BROADCAST, Frame
from hardware.families.plain_frames import build

_ERROR_BITS = {emulation.RANGE: OUT_OF_RANGE, emulation.ACCESS: OUT_OF_RANGE}
_ERROR_BITS |= {emulation.LIMIT: ANGLE_LIMIT, emulation.LENGTH: BAD_INSTRUCTION}


def answer(bus: EmulatedServos, frame: Frame) -> list[Answer]:
    """The servos' answers to one instruction."""
    everybody = frame.id == BROADCAST
    if frame.instruction == wire.SYNC_WRITE:
        return sync_write(bus, FAMILY, frame.params) if everybody else []
    if frame.instruction == wire.BULK_READ:
        blocks = (frame.params[at : at + 3] for at in range(1, len(frame.params) - 2, 3))
        return in_turn(bus, (_read(bus, *block) for block in blocks)) if everybody else []
    devices = bus.everybody(FAMILY) if everybody else bus.hearing(frame.id, FAMILY)
    answers = [one for device in devices for one in _alone(bus, device, frame)]
    bus.reindex()
    if everybody and frame.instruction != wire.PING:
        return []
    return alone_or_mixed(bus, answers)


def damaged(bus: EmulatedServos, id: int) -> list[Answer]:
    """Their answers to a frame whose checksum was wrong."""
    return [one for device in bus.hearing(id, FAMILY) for one in _status(device, BAD_CHECKSUM, b"", 2)]


def _status(device: EmulatedServo, bits: int, params: bytes, level: int, id: int | None = None) -> list[Answer]:
    """An answer as a servo sends it (by default under its own ID), nothing if its status return level is below."""
    if device["status_return_level"] < level:
        return []
    id = device.id if id is None else id
    return [Answer(device.return_delay, build(id, bits | device["hardware_error_status"], params), id)]


def _alone(bus: EmulatedServos, device: EmulatedServo, frame: Frame) -> list[Answer]:
    """Carries out an instruction to one servo; it answers under the ID that it had before."""
    params, id, data, level = frame.params, device.id, b"", 2
    done = _status(device, 0, b"", 2)
    match frame.instruction:
        case wire.PING:
            bits, level = 0, 0
        case wire.READ if len(params) == 2:
            data, level = device.read(params[0], params[1]) or b"", 1
            bits = 0 if data else OUT_OF_RANGE
        case wire.WRITE if len(params) > 1:
            bits = _bits(device.write(params[0], params[1:]))
        case wire.REG_WRITE if len(params) > 1:
            bits = _bits(device.register(params[0], params[1:]))
        case wire.ACTION:
            bits = _bits(device.act())
        case wire.REBOOT if device.series.reboots:
            device.reboot(bus.time + emulation.BOOT_TIME)
            return done
        case wire.FACTORY_RESET:
            device.factory_reset(emulation.RESET_ALL, bus.time + emulation.BOOT_TIME)
            return done
        case _:
            bits = BAD_INSTRUCTION
    return _status(device, bits, data, level, id)


def _bits(error: int) -> int:
    return _ERROR_BITS.get(error, BAD_INSTRUCTION) if error else 0


def _read(bus: EmulatedServos, length: int, id: int, address: int) -> list[Answer]:
    frame = Frame(id, wire.READ, bytes((address, length)))
    asked = (device for device in bus.hearing(id, FAMILY) if device.series.bulk_reads)
    return [one for device in asked for one in _alone(bus, device, frame)]
