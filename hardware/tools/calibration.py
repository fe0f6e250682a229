"""Calibration of a rig by hand, all joints at once: zero, direction and range of each.

Positions are the servo's own, without homing offset and reversal (`clear_offsets`), counted on through whole turns
while torque is off. A model that does not count turns with torque on has only one then (0 to 4095 on most): what a
range has beyond it is given up, with a note.
"""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, NamedTuple

import msgspec

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError
from hardware.families.register import Counts
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import EXTENDED_MODE, NEAR, RigJoint, SecondServo
from hardware.rig.switching.audit import audit, settle
from hardware.rig.turn_file import Turn
from motiondeck_base.files import write_file

LEAST_RANGE = 0.2  # rad: a joint with less was not moved
_MARGIN = 0.02  # rad kept away from an end that a hand has found


class MeasuredJoint(msgspec.Struct, forbid_unknown_fields=True):
    """The calibration of one joint so far, pulses."""

    id: int
    direction: Literal[-1, 1]  # 1 or -1, which way the servo turns when the joint's angle grows
    zero: Counts | None = None  # where it stands at angle 0; None until that is known
    low: Counts | None = None  # the lowest position seen; None before the first
    high: Counts | None = None  # the highest position seen; None before the first


class Range(NamedTuple):
    """A joint's range as it stands now, rad; NaN where it is not known."""

    lowest: float
    now: float
    highest: float


def rejoined(config: RigConfig, found: RigConfig) -> RigConfig:
    """A rig as it was found servo by servo (see `RigConfig.servos`), with its joints as in `config`.

    Two servos of a joint keep what both can do.
    """
    joints: list[RigJoint] = []
    for joint in config.joints:
        first, *others = (servo for servo in found.joints if servo.joint_name == joint.name)
        for other in others:
            first = msgspec.structs.replace(
                first,
                lower=max(first.lower, other.lower),
                upper=min(first.upper, other.upper),
                second=SecondServo(other.id, other.direction, other.zero),
            )
        joints.append(first)
    return msgspec.structs.replace(config, joints=tuple(joints))


class Sweep:
    """The calibration of a rig under way: the rig as it was, and what is measured so far by joint."""

    def __init__(self, config: RigConfig, measured: Mapping[str, MeasuredJoint] | None = None) -> None:
        self.config = config
        self._joints = {joint.name: joint for joint in config.joints}
        self.measured = dict(measured or {})
        for joint in config.joints:
            self.measured.setdefault(joint.name, MeasuredJoint(joint.id, joint.direction))
        self._now: dict[str, int] = {}
        self._shift: dict[str, int] = {}

    def see(self, name: str, pulses: int) -> None:
        """Takes note of where a joint stands."""
        one = self.measured[name]
        table = self._joints[name].table
        if name not in self._shift:
            self._shift[name] = self._turns_since(name, pulses)
        elif table.series.wraps:
            turn = table.pulses_per_turn
            self._shift[name] = round((self._now[name] - pulses) / turn) * turn
        self._now[name] = place = pulses + self._shift[name]
        one.low = place if one.low is None else min(one.low, place)
        one.high = place if one.high is None else max(one.high, place)

    def zero_here(self, name: str) -> None:
        """Where a joint stands now is its angle 0; raises RigError if it has not answered yet."""
        if name not in self._now:
            raise RigError(f"{name} has not answered yet. Check its cable.")
        self.measured[name].zero = self._now[name]

    def reverse(self, name: str) -> None:
        """The joint's angle grows the other way."""
        one = self.measured[name]
        one.direction = 1 if one.direction == -1 else -1
        for other in self.config.joints:
            if other.joint_name == name != other.name:  # the second servo of the joint
                self.reverse(other.name)

    def forget(self, name: str) -> None:
        """Forgets a joint's range, and begins anew where it stands."""
        self.measured[name].low = self.measured[name].high = self._now.get(name)

    def range_of(self, name: str) -> Range:
        """A joint's range so far, seen from its zero, in the joint's own direction."""
        one, per_radian = self.measured[name], self._per_radian(name)

        def angle(pulses: int | None) -> float:
            return math.nan if pulses is None or one.zero is None else (pulses - one.zero) / per_radian

        ends = (angle(one.low), angle(one.high))
        return Range(min(ends), angle(self._now.get(name)), max(ends))

    def lacking(self, name: str) -> str:
        """What is still to be done for a joint; "" for nothing."""
        one = self.measured[name]
        if one.zero is None:
            return "needs its zero"
        if one.low is None or one.high is None or one.high - one.low < LEAST_RANGE * abs(self._per_radian(name)):
            return "move it to both ends"
        return ""

    def result(self) -> tuple[RigConfig, list[str]]:
        """The rig with what was measured (a joint that lacks something stays as it was), and what to know about it."""
        joints, notes = [], []
        for joint in self.config.joints:
            one = self.measured[joint.name]
            if self.lacking(joint.name) or one.zero is None or one.low is None or one.high is None:
                joints.append(joint)
                notes.append(f"{joint.name} {self.lacking(joint.name)}, it stays as it was")
                continue
            found, given_up = measured_joint(joint, one.direction, one.zero, one.low, one.high, _MARGIN)
            joints.append(found)
            notes += given_up
        return msgspec.structs.replace(self.config, joints=tuple(joints)), notes

    @property
    def turns(self) -> dict[str, Turn]:
        """Where the servos of measured joints stand as they count now, by name."""
        return {
            name: Turn(one.zero - self._shift[name], self._now[name] - self._shift[name], True)
            for name, one in self.measured.items()
            if one.zero is not None and name in self._now
        }

    def _per_radian(self, name: str) -> float:
        return abs(self._joints[name].pulses_per_radian) * self.measured[name].direction

    def _turns_since(self, name: str, pulses: int) -> int:
        """Whole turns by which a servo counts otherwise than when it was measured: its power was off meanwhile."""
        one, turn = self.measured[name], self._joints[name].table.pulses_per_turn
        if one.low is None or one.high is None:
            return 0
        return round(((one.low + one.high) / 2.0 - pulses) / turn) * turn


def measured_joint(
    joint: RigJoint, direction: int, zero: int, low: int, high: int, margin: float
) -> tuple[RigJoint, list[str]]:
    """A joint as it was measured, and what of its range its servo cannot do and is given up.

    The zero is in pulses, in any turn; both ends of the range are in the same turn. The margin, rad, is kept away from
    both ends, but never past angle 0. RigError if nothing is left of its range.
    """
    bottom, top = joint.table.one_turn
    turns = (zero - bottom) // joint.table.pulses_per_turn * joint.table.pulses_per_turn
    zero, low, high = zero - turns, low - turns, high - turns
    notes: list[str] = []
    if joint.table.series.wraps and not bottom <= low <= high <= top and high - low <= top - bottom:
        turn = joint.table.pulses_per_turn
        shift = (low + high - turn) // 2  # puts the range into the middle of one turn
        offset = (joint.homing_offset + shift + turn // 2) % turn - turn // 2
        if offset == -(turn // 2):  # which a size and a sign cannot be
            offset, shift = offset + 1, shift + 1
        joint = msgspec.structs.replace(joint, homing_offset=offset)
        zero, low, high = zero - shift, low - shift, high - shift
        notes.append(f"{joint.name} needs homing_offset {joint.homing_offset}: motiondeck rig doctor RIG --fix")
    if EXTENDED_MODE in joint.modes:
        bottom, top = min(bottom, low), max(top, high)
    kept_low, kept_high = max(low, bottom), min(high, top)
    per_radian = abs(joint.pulses_per_radian) * direction
    lower, upper = sorted(((kept_low - zero) / per_radian, (kept_high - zero) / per_radian))
    lower, upper = min(lower + margin, max(lower, 0.0)), max(upper - margin, min(upper, 0.0))
    for lost, end in ((bottom - low, "low"), (high - top, "high")):
        if lost > 0:
            which = "lower" if (end == "low") == (direction > 0) else "upper"
            notes.append(
                f"{joint.name}: {math.degrees(lost / abs(per_radian)):.0f} degrees at its {which} end lie beyond the "
                "servo's own 0 and are given up. To have them, put the horn on elsewhere and calibrate again"
            )
    if kept_high - kept_low <= joint.table.pulses_per_turn < kept_high - kept_low + 2.0 * NEAR * abs(per_radian):
        lower, upper = lower + NEAR, upper - NEAR
        notes.append(
            f"{joint.name}: {math.degrees(NEAR):.0f} degrees at each end are given up, so that one turn tells its place"
        )
    try:
        return msgspec.structs.replace(
            joint,
            direction=direction,
            zero=zero,
            # Rounded inwards, so that no limit leaves what was measured.
            lower=math.ceil(lower * 1e3) / 1e3,
            upper=math.floor(upper * 1e3) / 1e3,
        ), notes
    except ValueError as error:
        raise RigError(f"{joint.name}: {error}.") from error


def clear_offsets(config: RigConfig, bus: Bus) -> list[str]:
    """Sets homing offset (as in the rig file) and drive mode (0), torque off; returns the changes, a line each."""
    config = config.servos
    left = [one for one in audit(config, bus) if one.register in ("homing_offset", "drive_mode")]
    return list(settle(left, config, bus))


def save_progress(sweep: Sweep, path: Path) -> None:
    """Writes what was measured so far."""
    write_file(path, msgspec.json.format(msgspec.json.encode(sweep.measured)))


def load_progress(config: RigConfig, path: Path) -> Sweep:
    """Goes on with what `save_progress` has kept; raises RigError if that is of another rig."""
    try:
        measured = msgspec.json.decode(path.read_bytes(), type=dict[str, MeasuredJoint])
    except (OSError, msgspec.DecodeError) as error:
        raise RigError(f"{path} is no calibration to go on with ({error}). Remove it to begin anew.") from error
    if {name: one.id for name, one in measured.items()} != {joint.name: joint.id for joint in config.joints}:
        raise RigError(f"{path} is the calibration of a rig with other joints. Remove it to begin anew.")
    return Sweep(config, measured)
