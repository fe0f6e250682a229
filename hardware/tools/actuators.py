"""What turns each joint of a rig, in words: servos, operating mode and why, limit of current, gains."""

from collections.abc import Mapping

from hardware.families.table import meaning
from hardware.rig.rig_joint import GAINS, POSITION_MODE, RigJoint


def describe_actuator(joint: RigJoint, gains: Mapping[str, int]) -> str:
    """One line about a joint; `gains` are what its first servo has, in counts, as far as they are known."""
    servos = f"{joint.model} (id {joint.id})"
    if joint.second is not None:
        way = "the same way" if joint.second.direction == joint.direction else "mirrored"
        servos = f"two {joint.model} (id {joint.id} and {joint.second.id}, mounted {way})"
    parts = [f"{joint.name}: {servos}", _mode(joint)]
    if joint.current:
        parts.append(f"{'grips with' if joint.grip else 'at most'} {joint.current:g} A")
    if joint.gear != 1.0:
        parts.append(f"gear {joint.gear:g}")
    known = [f"{letter} {gains[name]}" for name, letter in zip(GAINS, "PID", strict=True) if name in gains]
    if known:
        parts.append(f"gains {' '.join(known)} {'of the rig file' if joint.gains else 'as the servo has them'}")
    return ", ".join(parts)


def _mode(joint: RigJoint) -> str:
    name = "position"
    if joint.modes:
        name = f"{meaning(joint.table, joint.table['operating_mode'], joint.mode)} mode ({joint.mode})"
    low, high = joint.ends
    if joint.several_turns:
        why = f"its horn goes through {(high - low) / joint.table.pulses_per_turn:.1f} turns"
    elif joint.in_one_turn:
        why = "its range lies within one turn" if joint.mode == POSITION_MODE else "it keeps its limit of current"
    else:
        why = "its range crosses the end of one turn"
    return f"{name}: {why}"
