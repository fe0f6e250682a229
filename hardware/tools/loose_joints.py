"""Joints moved by hand: without torque a servo counts its position through whole turns, also past its own zero.

In which turn joints stand that a hand has put near their angle 0 is stored.
"""

from collections.abc import Iterator, Mapping

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError
from hardware.rig.registers import read_register
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.state_block import arrange_state
from hardware.rig.switching.identities import check_identities
from hardware.rig.switching.torque import switch_off
from hardware.rig.turn_file import Turn, TurnFile


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


def store_turns(config: RigConfig, bus: Bus, file: TurnFile) -> dict[str, float]:
    """Takes each joint that goes through several turns as less than half a turn of its horn from its angle 0.

    Returns the angle at which each of them stands now, rad, by name.
    """
    config = config.servos
    found: dict[str, Turn] = {}
    angles: dict[str, float] = {}
    for joint in (config.joints[index] for index in config.through_turns):
        place, turn = read_register(joint, bus, "present_position"), joint.table.pulses_per_turn
        zero = joint.zero + round((place - joint.zero) / turn) * turn
        found[joint.name] = Turn(zero, place, True)
        angles[joint.name] = (place - zero) / joint.pulses_per_radian
    keep_turns(config, bus, file, found)
    return angles


def keep_turns(config: RigConfig, bus: Bus, file: TurnFile, found: Mapping[str, Turn]) -> None:
    """Keeps where the joints of a port that go through several turns stand, by name, as far as it is known."""
    config = config.servos
    own = config.only([index for index in config.through_turns if config.names[index] in found])
    file.keep({joint.id: found[joint.name] for joint in own.joints})
    arrange_state(own, bus)  # by which a servo is known to have counted on
