"""Stores in which turn joints stand that a hand has put near their angle 0, with the torque off."""

from collections.abc import Mapping

from hardware.bus.servo_bus import Bus
from hardware.rig.registers import read_register
from hardware.rig.rig_file import RigConfig
from hardware.rig.state_block import arrange_state
from hardware.rig.turn_file import Turn, TurnFile


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
