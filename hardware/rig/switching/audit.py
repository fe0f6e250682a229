"""The audit of a servo's settings: every register that bears on motion, compared with what the rig needs.

A used servo keeps what an earlier program has written: a time-based profile makes it faster than its limit, an offset
puts its zero elsewhere, a second ID lets another servo's goals move it.

    register                 needed                                            set
    operating_mode, current_limit                                              at switch-on: the rig file states them
    min_position_limit, max_position_limit  the range, if within one turn      at switch-on
    gains P, I and D     what the rig file has, if it has any                  at switch-on: they are in RAM
    gains, feed-forward, compliance: as delivered                              never: another one is kept, and named
    goal_pwm, torque_limit   what pwm_limit or max_torque allows               at switch-on
    goal_current             where it limits: the joint's current, or all      at switch-on
    status_return_level      that at which every instruction is answered       at switch-on, before all else
    goal_time                0: the speed counts, not a time                   at switch-on
    drive_mode               0: not reversed, velocity-based profile           on request, refused until then
    homing_offset            the rig file's                                    on request, refused until then
    multi_turn_offset        0: the rig file has the zero                      on request, refused until then
    resolution_divider       1: a count means what the table says              on request, refused until then
    secondary_id             above 252: none                                   on request, refused until then
    startup_configuration    0: torque stays off at power-up                   on request, refused until then
    shutdown                 at least heat, shock and overload                 on request, refused until then
    temperature_limit        at most the model's own, at least 40 degC         on request, refused until then
    velocity_limit           at least the joint's velocity                     on request, advised (or refused)
    acceleration_limit       at least the joint's, if it checks profiles       on request, refused until then
    pwm_limit, max_torque    the model's own                                   on request, advised (0: refused)
    return_delay_time        20 us at most                                     on request, advised

Profiles and bus watchdog are RAM too; `switching` writes them each time.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple

from hardware.bus.servo_bus import Bus
from hardware.errors import RefusedError
from hardware.rig.registers import put, read_block
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.scale import RigScale

_PROTECTED = 4 | 16 | 32  # heat, shock, overload
_GAINS = ("position_p_gain", "position_i_gain", "position_d_gain", "feedforward_1st_gain", "feedforward_2nd_gain",
          "cw_compliance_margin", "ccw_compliance_margin", "cw_compliance_slope", "ccw_compliance_slope")  # fmt: skip
_LAST_ID, _NO_SECOND_ID = 252, 255
_COOLEST_LIMIT = 40  # degC: with a lower one a servo shuts down where it is warm
_ROUNDED_UP = 1.01  # of a limit: a register may hold so much of it
_SLOW_ANSWER = 10  # counts of 2 us that do no harm
_WHY = {
    "drive_mode": "reversed, led by another servo, with a profile in time, or with torque that a goal takes on",
    "homing_offset": "its zero is elsewhere",
    "secondary_id": "it also does all that is sent to that ID",
    "startup_configuration": "torque or RAM come back at power-up",
    "shutdown": "it does not protect itself",
    "temperature_limit": "it gets too hot, or shuts down while it is cool",
    "velocity_limit": "it is slower than the rig file asks",
    "acceleration_limit": "it takes no profile as quick as the rig file asks",
    "pwm_limit": "it is weaker than its model",
    "max_torque": "it is weaker than its model",
    "multi_turn_offset": "its zero is elsewhere",
    "resolution_divider": "its counts mean other angles",
    "status_return_level": "it leaves instructions unanswered",
    "return_delay_time": "it waits before each answer, in counts of 2 us",
}
_COMPARED = {
    *_WHY, *_GAINS, "operating_mode", "control_mode", "torque_control_mode", "min_position_limit", "max_position_limit",
    "current_limit", "goal_current", "goal_pwm", "goal_time", "torque_limit",
}  # fmt: skip


When = Literal["switch-on", "refused", "advised", "kept"]


class Difference(NamedTuple):
    """A register that differs from what the rig needs."""

    joint: str
    id: int
    register: str
    found: int  # in counts
    needed: int  # in counts
    # "switch-on" if it is set then; "kept" if it is never set, because the rig file does not ask for it; else it is set
    # on request, and "refused" until then or only "advised".
    when: When

    def __str__(self) -> str:
        why = f" ({_WHY[self.register]})" if self.register in _WHY else ""
        if self.when == "kept":
            return f"{self.joint} (id {self.id}): {self.register} is {self.found}, as delivered it is {self.needed}"
        return f"{self.joint} (id {self.id}): {self.register} is {self.found}, the rig needs {self.needed}{why}"


def audit(config: RigConfig, bus: Bus) -> list[Difference]:
    """Where the servos' settings differ from what the rig needs, joint by joint."""
    found: list[Difference] = []
    for joint, (low, high) in zip(config.joints, RigScale(config).ends.T, strict=True):
        held = _read_settings(joint, bus)
        changes_mode = held.get("operating_mode", joint.mode) != joint.mode
        for name, needed, when in _needs(joint, int(low), int(high), held):
            # A change of the mode puts the gains back to those delivered, and the goal current to its limit.
            put_back = changes_mode and name in (*joint.gains, "goal_current")
            if name in held and (held[name] != needed or put_back):
                found.append(Difference(joint.name, joint.id, name, held[name], needed, when))
    return found


def settle(differences: Iterable[Difference], config: RigConfig, bus: Bus) -> Iterator[str]:
    """Writes what the rig needs where it differs, but nothing "kept", and says so, one by one; torque must be off.

    ServoError if a servo refuses; a locked EEPROM stays so until its power is off.
    """
    tables = {joint.id: joint.table for joint in config.joints}
    for difference in differences:
        if difference.when == "kept":
            continue
        id, table = difference.id, tables[difference.id]
        register, lock = table[difference.register], table.registers.get("lock")
        try:
            put(bus, id, table, register.name, difference.needed)
        except RefusedError as error:
            if lock is None or register.memory != "EEPROM" or bus.read(id, lock.address, 1).params == b"\0":
                raise
            raise RefusedError(
                f"id {id} keeps its EEPROM locked, and its {register.name} cannot be set: switch its power off and on."
            ) from error
        yield f"{difference.joint} (id {id}): {difference.register} was {difference.found} and is {difference.needed}"


def in_counts(joint: RigJoint, name: str, limit: float) -> int:
    """A limit in SI units as what a register of the joint takes: at most 1 % above it, at least one count; 0 for 0."""
    register = joint.table[name]
    exact = limit / register.si
    nearest = round(exact)
    counts = nearest if nearest <= _ROUNDED_UP * exact else math.floor(exact)
    return max(1 if limit else 0, min(counts, register.largest))


def driving_settings(joint: RigJoint, low: int, high: int) -> dict[str, int]:
    """What a joint is driven with, by register, in the order of writing: mode, range `low` to `high`, current."""
    settings = {"operating_mode": joint.mode}
    if joint.in_one_turn:
        settings |= {"min_position_limit": low, "max_position_limit": high}
    if joint.current:
        settings["goal_current"] = current_counts(joint)
    return settings


def current_counts(joint: RigJoint) -> int:
    """The goal current with which a servo keeps its joint's limit of current; 0 for no limit."""
    return in_counts(joint, "current_limit", joint.current) if joint.current else 0


def _read_settings(joint: RigJoint, bus: Bus) -> dict[str, int]:
    compared = _COMPARED | joint.table.series.bits_needed.keys()
    rows = [register for name, register in joint.table.registers.items() if name in compared]
    memories = ([row for row in rows if row.memory == memory] for memory in ("EEPROM", "RAM"))
    return {name: count for block in memories for name, count in read_block(joint, bus, block).items()}


def _needs(joint: RigJoint, low: int, high: int, held: dict[str, int]) -> Iterator[tuple[str, int, When]]:
    """Register, needed value, and when it is set; a model may lack some of these registers."""
    series = joint.table.series
    # First the mode: a change of it puts gains and goals back.
    yield "operating_mode", joint.mode, "switch-on"
    yield "torque_control_mode", 0, "switch-on"
    if "control_mode" in held:
        yield "control_mode", joint.table["control_mode"].default or 0, "switch-on"
    if joint.in_one_turn:
        yield "min_position_limit", low, "switch-on"
        yield "max_position_limit", high, "switch-on"
    if joint.current:
        yield "current_limit", current_counts(joint), "switch-on"
    for name in _GAINS:
        default = joint.table.registers[name].default if name in held else None
        if name in joint.gains:
            yield name, joint.gains[name], "switch-on"
        elif default is not None:
            yield name, default, "kept"
    for name, most in (("goal_pwm", "pwm_limit"), ("torque_limit", "max_torque")):
        if name in held:
            yield name, held[most], "switch-on"
    if "goal_current" in held and joint.mode in series.current_limited:
        yield "goal_current", current_counts(joint) or held["current_limit"], "switch-on"
    yield "status_return_level", joint.table.family.answers_all, "switch-on"
    yield "goal_time", 0, "switch-on"
    yield "homing_offset", joint.homing_offset, "refused"
    for name in ("drive_mode", "startup_configuration", "multi_turn_offset"):
        yield name, 0, "refused"
    for name, (mask, value) in series.bits_needed.items():
        yield name, held[name] & ~mask | value, "refused"
    yield "resolution_divider", 1, "refused"
    if held.get("secondary_id", _NO_SECOND_ID) <= _LAST_ID:
        yield "secondary_id", _NO_SECOND_ID, "refused"
    yield "shutdown", held["shutdown"] | series.own_problems(_PROTECTED), "refused"
    hottest, limit = round(joint.hottest), held["temperature_limit"]
    yield "temperature_limit", limit if _COOLEST_LIMIT <= limit <= hottest else hottest, "refused"
    if "velocity_limit" in held:
        fast_enough = in_counts(joint, "velocity_limit", joint.velocity * joint.gear)
        # Without the profile a joint would not keep its limits.
        when: When = "refused" if series.checks_profiles else "advised"
        yield "velocity_limit", max(held["velocity_limit"], fast_enough), when
        if series.checks_profiles:
            quick_enough = in_counts(joint, "acceleration_limit", joint.acceleration * joint.gear)
            yield "acceleration_limit", max(held["acceleration_limit"], quick_enough), when
    for name in ("pwm_limit", "max_torque"):
        default = joint.table.registers[name].default if name in held else None
        if default is not None:
            yield name, default, "advised" if held[name] else "refused"
    if held["return_delay_time"] > _SLOW_ANSWER:
        yield "return_delay_time", 0, "advised"
