"""The answers of emulated Feetech STS servos.

An answer tells the servo's problems, never that an instruction was refused: what a servo cannot take, it ignores. A
broadcast ping is answered in order of ID, as LeRobot expects it.
"""

from hardware.families import emulation
from hardware.families import frames as wire
from hardware.families.emulation import Answer, EmulatedServo, EmulatedServos, alone_or_mixed, in_turn, sync_write
from hardware.families.feetech.family import FAMILY
from hardware.families.frames import BROADCAST, Frame
from hardware.families.plain_frames import build


def answer(bus: EmulatedServos, frame: Frame) -> list[Answer]:
    """The servos' answers to one instruction."""
    everybody = frame.id == BROADCAST
    if frame.instruction == wire.SYNC_WRITE:
        return sync_write(bus, FAMILY, frame.params) if everybody else []
    if frame.instruction == wire.SYNC_READ:
        read = Frame(0, wire.READ, frame.params[:2])
        return in_turn(bus, (_together(bus, id, read) for id in frame.params[2:])) if everybody else []
    if everybody and frame.instruction == wire.PING:
        return [one for id in bus.ids() for one in _together(bus, id, frame)]
    devices = bus.everybody(FAMILY) if everybody else bus.hearing(frame.id, FAMILY)
    answers = [one for device in devices for one in _alone(bus, device, frame)]
    bus.reindex()
    return [] if everybody else alone_or_mixed(bus, answers)


def damaged(bus: EmulatedServos, id: int) -> list[Answer]:
    """Nothing: a frame whose checksum was wrong is ignored."""
    return []


def _together(bus: EmulatedServos, id: int, frame: Frame) -> list[Answer]:
    return alone_or_mixed(bus, [one for device in bus.hearing(id, FAMILY) for one in _alone(bus, device, frame)])


def _alone(bus: EmulatedServos, device: EmulatedServo, frame: Frame) -> list[Answer]:
    """Carries out an instruction to one servo; it answers under the ID that it had before, if its level allows it."""
    params, data = frame.params, b""
    always = frame.instruction in (wire.PING, wire.READ)
    answers = always or device["status_return_level"] != 0
    id, delay, problems = device.id, device.return_delay, device["hardware_error_status"]
    match frame.instruction:
        case wire.PING:
            pass
        case wire.READ if len(params) == 2:
            found = device.read(params[0], params[1])
            answers, data = found is not None, found or b""
        case wire.WRITE if len(params) > 1:
            device.write(params[0], params[1:])
        case wire.REG_WRITE if len(params) > 1:
            device.register(params[0], params[1:])
        case wire.ACTION:
            device.act()
        case wire.FACTORY_RESET:
            device.factory_reset(emulation.RESET_BUT_ID, bus.time + emulation.BOOT_TIME)
        case _:
            answers = False
    return [Answer(delay, build(id, problems, data), id)] if answers else []
