"""Whole turns: where angle 0 of each joint is as its servo counts now.

In position mode a servo reports its place in one turn. In the other modes it counts on through whole turns, and begins
anew within one when its power comes back. The place in one turn is then enough where the joint's range is shorter than
a turn. Else the joint stands where it is believed to: at first by what was kept in a `TurnFile`, later on the way from
where it was last seen to its goal.

What was kept is believed if the servo has counted on since, or if it stands where it stood. It has counted on if its
indirect addresses, which its power takes along, are those of a rig. A servo that was turned by whole turns while its
power was off is not noticed.
"""

import numpy as np

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError
from hardware.rig.registers import read_register
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import POSITION_MODE, RigJoint
from hardware.rig.scale import Array, RigScale
from hardware.rig.state_block import arranged
from hardware.rig.turn_file import Turn, TurnFile

_SURE = 0.25
"""Of a turn: farther from where, or from the way on which, it is believed, a servo may stand in another one."""
_SAME_PLACE = 1.0 / 16.0
"""Of a turn, by which a joint may sink or be touched while its power is off."""
_REMEDY = "Store where it stands with motiondeck rig turns RIG."


def find_zeros(config: RigConfig, bus: Bus, believed: Array) -> Array:
    """The position of each servo at angle 0 as it counts now, shape (J,), pulses.

    `believed` is where joints that go through several turns stand, roughly, shape (J,), rad; or two such places, of
    which it may be on the way from one to the other, shape (2, J). RigError if such a joint stands elsewhere, or may be
    on this way in two turns; it is named with the remedy.
    """
    zeros = RigScale(config).zero
    middle, half = way(believed)
    for index, joint in enumerate(config.joints):
        if joint.mode != POSITION_MODE:
            pulses = read_register(joint, bus, "present_position")
            zeros[index] += _whole_turns(joint, pulses, float(middle[index]), float(half[index]))
    return zeros


def way(believed: Array) -> tuple[Array, Array]:
    """The middle of the way that joints are believed to be on, and half its length, both (J,), rad."""
    ends = np.atleast_2d(believed)
    return 0.5 * (ends[0] + ends[-1]), 0.5 * np.abs(ends[0] - ends[-1])


def _whole_turns(joint: RigJoint, pulses: int, middle: float, half: float) -> int:
    """The pulses of the whole turns that a servo counts more than from the rig file's zero.

    Its turn is the one that is nearest to both ends of its way, if it is at most `_SURE` off the way.
    """
    if not joint.several_turns:
        return joint.whole_turns(pulses)
    per_turn = joint.table.pulses_per_turn
    turns = (pulses - joint.pulses(middle)) / per_turn
    half *= abs(joint.pulses_per_radian) / per_turn
    if abs(turns - round(turns)) > min(_SURE + half, 0.5 - half):
        raise RigError(f"{joint.label} is not where it was, and may stand in another turn. {_REMEDY}")
    return round(turns) * per_turn


def recall(config: RigConfig, bus: Bus, file: TurnFile | None) -> Array:
    """Where joints that go through several turns stand, shape (J,), rad, before anything is written; 0 for others.

    Without a file of what was kept, servos are taken to count from the rig file's zero. RigError if nothing was kept of
    such a joint, or it stands elsewhere; it is named with the remedy.
    """
    places = np.zeros(len(config.joints))
    kept = file.read() if config.through_turns and file is not None else {}
    for index in config.through_turns:
        joint = config.joints[index]
        pulses = read_register(joint, bus, "present_position")
        zero = joint.zero if file is None else _zero_by(kept.get(joint.id), joint, bus, pulses)
        places[index] = (pulses - zero) / joint.pulses_per_radian
    return places


def _zero_by(turn: Turn | None, joint: RigJoint, bus: Bus, pulses: int) -> int:
    """The position of a servo at angle 0 as it counts now, by what was kept of it."""
    if turn is None:
        raise RigError(f"{joint.label} goes through several turns, and in which it stands was not stored. {_REMEDY}")
    if _counted_on(joint, bus):
        return turn.zero
    if not turn.stands:
        raise RigError(f"{joint.label} was moving when its power went, and may stand in another turn. {_REMEDY}")
    per_turn = joint.table.pulses_per_turn
    moved = round((pulses - turn.place) / per_turn) * per_turn
    away = abs(pulses - moved - turn.place) / per_turn
    if away > _SAME_PLACE:
        raise RigError(
            f"the horn of {joint.label} stands {360.0 * away:.0f} degrees from where it was left, and may stand in "
            f"another turn. {_REMEDY}"
        )
    return turn.zero + moved


def keep_zeros(config: RigConfig, zeros: Array, file: TurnFile | None) -> None:
    """Keeps the zeros of servos that count otherwise than before, as of joints that move."""
    # This comes before their indirect addresses are set, which would make older zeros believed.
    if file is None or not config.through_turns:
        return
    kept, found = file.read(), {config.joints[index].id: round(zeros[index]) for index in config.through_turns}
    changed = {id: Turn(zero, zero, False) for id, zero in found.items() if id not in kept or kept[id].zero != zero}
    if changed:
        file.keep(changed)


def _counted_on(joint: RigJoint, bus: Bus) -> bool:
    """Whether a servo has had its power, and has counted turns, since a rig drove it."""
    plan = arranged(joint.table, read_register(joint, bus, "firmware_version"))
    if plan is None or joint.table["indirect_address_1"].memory != "RAM":
        return False
    pointers = bus.read(joint.id, plan.address, len(plan.pointers)).params
    return pointers == plan.pointers and read_register(joint, bus, "operating_mode") == joint.mode
