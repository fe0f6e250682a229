"""Diagnosis of a rig's servos, and repair of their registers."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import NamedTuple

import msgspec

from hardware.bus.servo_bus import UNKNOWN_MODEL, Bus, Identity
from hardware.errors import NoReplyError, RigError, ServoError
from hardware.families.models import MODELS
from hardware.families.series import HEAT, VOLTAGE
from hardware.families.table import describe_errors, meaning
from hardware.rig.driving.servo_port import longest_tick
from hardware.rig.registers import read_register, write_each
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import GAINS, NEAR, POSITION_MODE, RigJoint
from hardware.rig.state_block import arranged, motion
from hardware.rig.switching import identities
from hardware.rig.switching.audit import Difference, audit, settle
from hardware.rig.switching.turns import recall
from hardware.rig.turn_file import TurnFile
from hardware.tools.backup import ServoBackup, back_up
from hardware.tools.scan import LIKELY_BAUDS, scan

_NEWEST = 255  # what a servo that does not answer may have as firmware
_CLOSE_TO_HOT = 12.0  # degC
_USB_SERIAL = Path("/sys/bus/usb-serial/devices")
_SILENT = (
    "answers a ping but no read, as if its status_return_level is 0, the rig needs 2: --fix sets it, and so does every "
    "switch-on"
)
_SET_ANYWAY = "set at every switch-on"
_KEPT = "kept; the rig file may set gains, and a restart of the servo brings back those delivered"
_SECOND_ID = "secondary_id"
_FALSIFIES = {"drive_mode", "homing_offset", "multi_turn_offset", "resolution_divider"}  # the position a servo reports
_THE_RIGS_OWN = ("min_position_limit", "max_position_limit", "current_limit")  # of which no servo knows beforehand


class ServoReport(msgspec.Struct, frozen=True):
    """What a servo of the rig reports."""

    name: str
    id: int
    model: str
    firmware: int
    torque: bool
    errors: str  # hardware errors in words, with the limits that it keeps; "" for none
    position: float  # rad
    temperature: float  # degC
    voltage: float  # V
    return_delay_us: int  # how long it waits before it answers


class Report(msgspec.Struct, frozen=True):
    """What an examination found."""

    port: str
    baud: int  # bits/s
    latency_ms: int | None  # of the USB adapter's timer; None where there is none to read
    rate_hz: float  # asked for by the rig file
    possible_hz: float  # that the wire allows as it is now
    servos: list[ServoReport]  # those that answered
    actuators: list[str]  # what turns each joint, and why so, a line each
    problems: list[str]  # each with its remedy
    notes: list[str]  # what differs from what the rig needs, and is set whenever it is switched on
    missing: list[int]  # IDs that did not answer


class Fixed(NamedTuple):
    """Registers that were set, and those that a servo refused or did not answer; one line each."""

    done: list[str]
    refused: list[str]


def examine(config: RigConfig, bus: Bus) -> Report:
    """Reads every servo of a rig, compares its settings, and lists the problems; moves nothing."""
    problems: list[str] = []
    notes: list[str] = []
    missing: list[int] = []
    servos: list[ServoReport] = []
    heard: set[int] = set()
    joints, config = config.joints, config.servos
    for index, joint in enumerate(config.joints):
        identity, name = bus.ping(joint.id), joint.label
        if identity is None:
            problems.append(f"{name} {_no_answer(bus)}")
            missing += [] if bus.garbled else [joint.id]
            continue
        mute = identity.model_number == UNKNOWN_MODEL and identity.family is joint.table.family
        if mute or identity.model != joint.model:
            other = f"answers as {identity.model}, not as {joint.model}: correct the rig file"
            problems.append(f"{name} {_SILENT if mute else other}")
            continue
        try:
            servo = _ask(joint, identity, bus)
            differences = audit(config.only([index]), bus)
            lost = ""
            if joint.several_turns:
                try:
                    place = recall(config.only([index]), bus, TurnFile.of_port(bus.port.name))
                    servo = msgspec.structs.replace(servo, position=float(place[0]))
                except RigError as error:
                    problems.append(lost := str(error))
            servos.append(servo)
            heard.add(joint.id)
        except NoReplyError:
            problems.append(f"{name} {_SILENT}")
            continue
        except ServoError as error:
            problems.append(str(error))
            continue
        problems += _complaints(servo, joint, name, not (lost or _FALSIFIES & {one.register for one in differences}))
        problems += [f"{one}: --fix sets it" for one in differences if one.when in ("refused", "advised")]
        if _turns_endlessly(joint, differences):
            notes.append(f"{name} is set to turn without an end, its position limits are equal: {_SET_ANYWAY}")
        at_switch_on = [one for one in differences if one.when == "switch-on" and one.register not in _THE_RIGS_OWN]
        notes += [f"{one}: {_SET_ANYWAY}" for one in at_switch_on]
        notes += [f"{one}: {_KEPT}" for one in differences if one.when == "kept"]
    driven = [describe_actuator(joint, _gains(joint, bus) if joint.id in heard else {}) for joint in joints]
    problems += _followers_beside(config, bus)
    if bus.echoes:
        notes.append("the adapter returns what is sent to it, which is dropped")
    latency = latency_timer(bus.port.name)
    if latency is not None and latency > 1:
        problems.append(
            f"the USB adapter holds answers for up to {latency} ms: --fix sets 1, or: "
            f"echo 1 | sudo tee {latency_file(bus.port.name)}"
        )
    possible = 1.0 / (_longest_tick(config, servos) + (latency or 0) * 1e-3)
    wanted = max(config.rate_hz, config.read_hz)
    if possible < wanted:
        problems.append(f"the wire allows {possible:.0f} Hz, the rig file has {wanted:g}: raise baud or lower rate_hz")
    return Report(bus.port.name, bus.baud, latency, config.rate_hz, possible, servos, driven, problems, notes, missing)


def _followers_beside(config: RigConfig, bus: Bus) -> Iterator[str]:
    """Servos that the rig file does not have, and that do all that is sent to one of its own, a line each."""
    joints = {joint.id: joint for joint in config.joints}
    if not any(_SECOND_ID in joint.table.registers for joint in config.joints):
        return
    beside = [identity for identity in bus.ping_all() if identity.id not in joints and identity.model in MODELS]
    for id, model in ((one.id, one.model) for one in beside if _SECOND_ID in MODELS[one.model].registers):
        with suppress(ServoError):  # a servo that answers a ping alone is none of the rig's
            followed = joints.get(bus.read(id, MODELS[model][_SECOND_ID].address, 1).params[0])
            if followed is not None:
                yield (
                    f"{model} with id {id} is not in the rig file, and also does all that is sent to {followed.label}, "
                    f"its {_SECOND_ID}: make it that joint's second servo in the rig file, then --fix sets it"
                )


def _gains(joint: RigJoint, bus: Bus) -> dict[str, int]:
    try:
        return {name: read_register(joint, bus, name) for name in GAINS if name in joint.table.registers}
    except ServoError:
        return {}


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


def _no_answer(bus: Bus) -> str:
    if bus.garbled:
        return (
            "gives garbled answers: two servos may have its id; connect one of them alone, then "
            f"motiondeck rig setup {bus.port.name} --id OTHER --baud {bus.baud}"
        )
    return f"does not answer at {bus.baud} baud: check power, cable, id; try motiondeck rig scan"


def _longest_tick(config: RigConfig, servos: Sequence[ServoReport]) -> float:
    """The longest tick of a rig on its wire, s; of a servo that did not answer, as if it never waited."""
    firmware = {servo.id: servo.firmware for servo in servos}
    delays = {servo.id: servo.return_delay_us * 1e-6 for servo in servos}
    versions = [firmware.get(joint.id, _NEWEST) for joint in config.joints]
    blocks = [
        plan.block if (plan := arranged(joint.table, version)) else motion(joint.table)
        for joint, version in zip(config.joints, versions, strict=True)
    ]
    fast = identities.know_fast_reads(config, versions)
    return longest_tick(config, blocks, fast, [delays.get(joint.id, 0.0) for joint in config.joints])


def look_elsewhere(config: RigConfig, report: Report, open_bus: Callable[[int], Bus]) -> list[str]:
    """Servos that answer at another ID, baud rate or protocol, one line each; not looked for if none is missing."""
    known = {joint.id for joint in config.servos.joints} - {*report.missing}
    bauds = list(dict.fromkeys((report.baud, *LIKELY_BAUDS))) if report.missing else []
    return [
        f"{found.model} answers as id {found.id} at {baud} baud{found.family.spoken}: connect it "
        f"alone, then motiondeck rig setup {report.port} "
        f"--id {report.missing[0] if len(report.missing) == 1 else 'ID'} --baud {report.baud}"
        for baud, found in scan(open_bus, bauds)
        if baud != report.baud or found.id not in known
    ]


def fix_settings(config: RigConfig, bus: Bus, keep: Callable[[ServoBackup], object] = lambda backup: None) -> Fixed:
    """Sets every register in which a servo differs from what the rig needs (see `audit`); torque must be off there.

    `keep` is called with the settings of each servo before they are changed.
    """
    done: list[str] = []
    refused: list[str] = []
    config = config.servos
    for index, joint in enumerate(config.joints):
        one = config.only([index])
        try:
            level = identities.answer_level(joint, bus)
            identities.raise_answer_level_in_eeprom(one, bus)
            identities.raise_answer_level(one, bus)
            raised = level != identities.answer_level(joint, bus) == joint.table.family.answers_all
            differences = _to_set(one, bus)
            if raised or differences:
                (found,) = back_up(one, bus)
                keep(msgspec.structs.replace(found, registers=found.registers | {"status_return_level": level}))
            if raised:
                done.append(f"{joint.label}: status_return_level was {level} and is {joint.table.family.answers_all}")
            if not differences:
                continue
            if read_register(joint, bus, "torque_enable"):
                refused.append(f"{joint.label} has its torque on: motiondeck rig stop takes it off")
                continue
            write_each(one, bus, "bus_watchdog", [0])  # one that has tripped locks the goals
            limits = [difference for difference in differences if difference.when != "switch-on"]
            done.extend(settle(limits, one, bus))
            # Goal PWM and torque limit follow their limits.
            done.extend(settle(_to_set(one, bus) if limits else differences, one, bus))
        except (ServoError, RigError) as error:
            refused.append(f"{joint.name}: {error}")
    return Fixed(done, refused)


def _to_set(config: RigConfig, bus: Bus) -> list[Difference]:
    return [one for one in audit(config, bus) if one.when != "kept"]


def _ask(joint: RigJoint, identity: Identity, bus: Bus) -> ServoReport:
    value = partial(read_register, joint, bus)
    bits, place = identities.hardware_errors(joint, bus), value("present_position")
    temperature, voltage = float(value("present_temperature")), value("present_input_voltage") / 10.0
    why: list[str] = []
    if bits & VOLTAGE:
        low, high = value("min_voltage_limit") / 10.0, value("max_voltage_limit") / 10.0
        why.append(f" ({voltage:.1f} V; its own limits are {low:.1f} and {high:.1f} V)")
    if bits & HEAT:
        why.append(f" ({temperature:.0f} degC; its own limit is {value('temperature_limit')} degC)")
    errors, torque = describe_errors(bits) + "".join(why) if bits else "", value("torque_enable") != 0
    known = joint.name, joint.id, identity.model, identity.firmware, torque, errors
    angle = joint.angle(place - joint.whole_turns(place))
    return ServoReport(*known, angle, temperature, voltage, 2 * value("return_delay_time"))


def _turns_endlessly(joint: RigJoint, differences: Iterable[Difference]) -> bool:
    """Whether a servo without modes is a wheel (both position limits 0) or counts many turns (both at its end)."""
    limits = {one.register: one.found for one in differences}
    low = limits.get("min_position_limit")
    end = joint.table.one_turn[1]
    wheels = "operating_mode" not in joint.table.registers
    return wheels and low is not None and low == limits.get("max_position_limit", end)


def _complaints(servo: ServoReport, joint: RigJoint, name: str, placed: bool) -> list[str]:
    found: list[str] = []
    if servo.errors:
        found.append(f"{name} reports {servo.errors}: mend the cause, then switch its power off and on")
    position = servo.position
    if placed and not joint.lower - NEAR <= position <= joint.upper + NEAR:
        found.append(
            f"{name} stands at {position:.2f} rad, its limits are {joint.lower} to {joint.upper}: "
            "move it by hand, or motiondeck rig calibrate"
        )
    if servo.temperature > joint.hottest - _CLOSE_TO_HOT:
        found.append(f"{name} has {servo.temperature:.0f} degC and shuts down at {joint.hottest:.0f}: let it cool")
    return found


def latency_timer(port: str) -> int | None:
    """The latency timer of a USB adapter, ms; None where the system has none for this port."""
    try:
        return int(latency_file(port).read_text())
    except (OSError, ValueError):
        return None


def shorten_latency(port: str) -> str:
    """Sets the latency timer of a USB adapter to 1 ms until it is unplugged; what was done, or what to do, in words."""
    before, file = latency_timer(port), latency_file(port)
    if before is None:
        return f"{port} has no latency timer that could be set"
    if before <= 1:
        return f"the latency timer of {port} is 1 ms already"
    try:
        file.write_text("1")
    except OSError as error:
        return f"the latency timer of {port} stays {before} ms ({error.strerror}): echo 1 | sudo tee {file}"
    return f"the latency timer of {port} was {before} ms and is {latency_timer(port)} ms now, until it is unplugged"


def latency_file(port: str) -> Path:
    """Where the system shows the latency timer of a port."""
    return _USB_SERIAL / Path(port).resolve().name / "latency_timer"
