"""Joints moved by hand: without torque a servo counts its position through whole turns, also past its own zero."""

from collections.abc import Iterator

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.switching.identities import check_identities
from hardware.rig.switching.torque import switch_off


def loosen(config: RigConfig, bus: Bus) -> None:
    """Takes the torque off every servo; raises RigError naming those that are missing or do not confirm it."""
    check_identities(config.servos, bus)
    unconfirmed = switch_off(config.servos, bus)
    if unconfirmed:
        raise RigError(f"torque may still be on: {', '.join(unconfirmed)}. Check their cables.")


def positions(part: RigConfig, bus: Bus) -> Iterator[tuple[RigJoint, int]]:
    """The joints of one port that answer, and where their servos stand, pulses."""
    registers = {joint.id: joint.table["present_position"] for joint in part.joints}
    statuses = bus.bulk_read(tuple((id, register.address, register.length) for id, register in registers.items()))
    for joint in part.joints:
        status = statuses.get(joint.id)
        if status is not None and not status.error:
            yield joint, registers[joint.id].decode(status.params)
