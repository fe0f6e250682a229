"""What is on a bus and what is wrong with it: scanning, examining, fixing, and setting up one servo at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec

from hardware.bus.servo_bus import UNTOLD, Bus, Identity
from hardware.control_table.baud_rates import baud_value
from hardware.control_table.meanings import describe_errors
from hardware.control_table.models import MODELS
from hardware.control_table.table import ControlTable
from hardware.errors import NoReplyError, RigError, ServoError
from hardware.rig.audit import ANSWER_EVERYTHING, Difference, audit, settle
from hardware.rig.identities import hardware_errors, have_answer, have_old_answer, know_fast_reads
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.state_block import arranged, motion
from hardware.rig.wire_load import longest_tick

_USB_SERIAL = Path("/sys/bus/usb-serial/devices")
_LIKELY = (57600, 1_000_000, 4_000_000, 2_000_000, 3_000_000, 115_200, 9600)
_NEWEST = 255  # what a servo that does not answer may have as firmware
_CLOSE_TO_HOT = 12.0  # degC
_VOLTAGE, _HEAT = 1, 4  # bits of a hardware error
_SILENT = (
    "answers a ping but no read, as if its status_return_level is 0, the rig needs 2: --fix sets it, and so does every "
    "switch-on"
)
_SET_ANYWAY = "set at every switch-on"
_FALSIFIES = {"drive_mode", "homing_offset", "multi_turn_offset", "resolution_divider"}  # the position a servo reports
_THE_RIGS_OWN = ("min_position_limit", "max_position_limit", "current_limit")  # of which no servo knows beforehand


class Found(NamedTuple):
    """A servo that answered a scan."""

    baud: int
    identity: Identity


class ServoReport(msgspec.Struct, frozen=True):
    """What a servo of the rig reports.

    Attributes:
        name: of its joint.
        id: on the bus.
        model: the maker's name.
        firmware: version.
        torque: whether torque is on.
        errors: hardware errors in words, with the limits that it keeps; "" for none.
        position: rad.
        temperature: degC.
        voltage: V.
        return_delay_us: how long it waits before it answers.
    """

    name: str
    id: int
    model: str
    firmware: int
    torque: bool
    errors: str
    position: float
    temperature: float
    voltage: float
    return_delay_us: int


class Report(msgspec.Struct, frozen=True):
    """What an examination found.

    Attributes:
        port: that was examined.
        baud: bits/s.
        latency_ms: of the USB adapter's timer; None where there is none to read.
        rate_hz: asked for by the rig file.
        possible_hz: that the wire allows as it is now.
        servos: that answered.
        problems: each with its remedy.
        notes: what differs from what the rig needs, and is set whenever it is switched on.
        missing: IDs that did not answer.
    """

    port: str
    baud: int
    latency_ms: int | None
    rate_hz: float
    possible_hz: float
    servos: list[ServoReport]
    problems: list[str]
    notes: list[str]
    missing: list[int]


class Fixed(NamedTuple):
    """What came of setting registers, one line each.

    Attributes:
        done: what was set.
        refused: what a servo did not take, or that it did not answer.
    """

    done: list[str]
    refused: list[str]


def scan(
    open_bus: Callable[[int], Bus],
    bauds: Iterable[int] = _LIKELY,
    on_garbled: Callable[[int], object] = lambda baud: None,
) -> list[Found]:
    """Who answers at each baud rate, of both protocols; the likely rates first.

    Args:
        open_bus: opens the port at a baud rate.
        bauds: where to look.
        on_garbled: told each baud rate at which some bytes are no answer: two servos may have one ID.

    Raises:
        SerialPortError: if the port cannot be opened, or vanishes.
    """
    found: list[Found] = []
    for baud in bauds:
        bus = open_bus(baud)
        try:
            found += [Found(baud, identity) for identity in bus.ping_all()]
            if bus.garbled:
                on_garbled(baud)
            found += [Found(baud, identity) for identity in bus.ping_old()]
        finally:
            bus.close()
    return found


def latency_timer(port: str) -> int | None:
    """The latency timer of a USB adapter, ms; None where the system has none for this port."""
    try:
        return int(_latency_file(port).read_text())
    except (OSError, ValueError):
        return None


def shorten_latency(port: str) -> str:
    """Sets the latency timer of a USB adapter to 1 ms; what was done, or what to do for it, in words.

    The adapter forgets it when it is unplugged.
    """
    before, file = latency_timer(port), _latency_file(port)
    if before is None:
        return f"{port} has no latency timer that could be set"
    if before <= 1:
        return f"the latency timer of {port} is 1 ms already"
    try:
        file.write_text("1")
    except OSError as error:
        return f"the latency timer of {port} stays {before} ms ({error.strerror}): echo 1 | sudo tee {file}"
    return f"the latency timer of {port} was {before} ms and is {latency_timer(port)} ms now, until it is unplugged"


def _latency_file(port: str) -> Path:
    return _USB_SERIAL / Path(port).resolve().name / "latency_timer"


def examine(config: RigConfig, bus: Bus) -> Report:
    """Asks every servo of a rig how it is, compares its settings, and lists what would go wrong; moves nothing.

    Raises:
        SerialPortError: if the port vanishes.
    """
    problems: list[str] = []
    notes: list[str] = []
    missing: list[int] = []
    servos: list[ServoReport] = []
    for index, joint in enumerate(config.joints):
        identity = bus.ping(joint.id)
        who = f"{joint.name} (id {joint.id})"
        if identity is None and bus.garbled:
            problems.append(
                f"{who} gives garbled answers: two servos may have its id; connect one of them alone, then "
                f"motiondeck rig setup {bus.port.name} --id OTHER --baud {bus.baud}"
            )
        elif identity is None:
            missing.append(joint.id)
            problems.append(
                f"{who} does not answer at {bus.baud} baud: check power, cable, id; try motiondeck rig scan"
            )
        elif identity.model_number == UNTOLD and identity.protocol == joint.table.protocol:
            problems.append(f"{who} {_SILENT}")
        elif identity.model != joint.model:
            problems.append(f"{who} is a {identity.model}, not a {joint.model}: correct the rig file")
        else:
            try:
                servo = _ask(joint, identity, bus)
                differences = audit(config.only([index]), bus)
                servos.append(servo)
            except NoReplyError:
                problems.append(f"{who} {_SILENT}")
                continue
            except ServoError as error:
                problems.append(str(error))
                continue
            problems += _complaints(servo, joint, who, {one.register for one in differences})
            problems += [f"{one}: --fix sets it" for one in differences if one.when != "switch-on"]
            if _turns_endlessly(joint, differences):
                notes.append(f"{who} is set to turn without an end, its position limits are equal: {_SET_ANYWAY}")
            notes += [
                f"{one}: {_SET_ANYWAY}"
                for one in differences
                if one.when == "switch-on" and one.register not in _THE_RIGS_OWN
            ]
    latency = latency_timer(bus.port.name)
    if latency is not None and latency > 1:
        problems.append(
            f"the USB adapter holds answers for up to {latency} ms: --fix sets 1, or: "
            f"echo 1 | sudo tee {_latency_file(bus.port.name)}"
        )
    possible = 1.0 / (_longest_tick(config, servos) + (latency or 0) * 1e-3)
    wanted = max(config.rate_hz, config.read_hz)
    if possible < wanted:
        problems.append(
            f"the wire allows {possible:.0f} Hz, the rig file wants {wanted:g}: raise baud, or lower rate_hz"
        )
    return Report(bus.port.name, bus.baud, latency, config.rate_hz, possible, servos, problems, notes, missing)


def _longest_tick(config: RigConfig, servos: Sequence[ServoReport]) -> float:
    """The longest tick of a rig on its wire, s; of a servo that did not answer, as if it never waited."""
    firmware = {servo.id: servo.firmware for servo in servos}
    delays = {servo.id: servo.return_delay_us * 1e-6 for servo in servos}
    versions = [firmware.get(joint.id, _NEWEST) for joint in config.joints]
    plans = [arranged(joint.table, version) for joint, version in zip(config.joints, versions, strict=True)]
    blocks = [
        motion(joint.table) if plan is None else plan.block for joint, plan in zip(config.joints, plans, strict=True)
    ]
    fast = know_fast_reads(config, versions)
    return longest_tick(config, blocks, fast, [delays.get(joint.id, 0.0) for joint in config.joints])


def look_elsewhere(config: RigConfig, report: Report, open_bus: Callable[[int], Bus]) -> list[str]:
    """Servos that answer at another ID, baud rate or protocol, one line each; not looked for if none is missing.

    Raises:
        SerialPortError: if the port cannot be opened, or vanishes.
    """
    known = {joint.id for joint in config.joints} - {*report.missing}
    bauds = list(dict.fromkeys((report.baud, *_LIKELY))) if report.missing else []
    return [
        f"a {who.model} answers as id {who.id} at {baud} baud{' in Protocol 1.0' * (who.protocol == 1)}: connect it "
        f"alone, then motiondeck rig setup {report.port} "
        f"--id {report.missing[0] if len(report.missing) == 1 else 'ID'} --baud {report.baud}"
        for baud, who in scan(open_bus, bauds)
        if baud != report.baud or who.id not in known
    ]


def fix_settings(config: RigConfig, bus: Bus) -> Fixed:
    """Sets every register in which a servo differs from what the rig needs (see `audit`); torque must be off there.

    Raises:
        SerialPortError: if the port vanishes.
    """
    done: list[str] = []
    refused: list[str] = []
    for index, joint in enumerate(config.joints):
        one = config.only([index])
        try:
            level = _answer_level(joint, bus)
            have_old_answer(one, bus)
            have_answer(one, bus)
            if level != _answer_level(joint, bus) == ANSWER_EVERYTHING:
                done.append(f"{joint.name} (id {joint.id}): status_return_level was {level} and is {ANSWER_EVERYTHING}")
            torque = joint.table["torque_enable"]
            differences = audit(one, bus)
            if differences and bus.read(joint.id, torque.address, torque.length).params != b"\0":
                refused.append(f"{joint.name} (id {joint.id}) has its torque on: motiondeck rig stop takes it off")
                continue
            limits = [difference for difference in differences if difference.when != "switch-on"]
            done.extend(_settle_each(limits, one, bus))
            # Goal PWM and torque limit follow their limits.
            done.extend(_settle_each(audit(one, bus) if limits else differences, one, bus))
        except ServoError as error:
            refused.append(f"{joint.name}: {error}")
    return Fixed(done, refused)


def _answer_level(joint: RigJoint, bus: Bus) -> int:
    """The status return level of a servo: 0, a ping, if it answers no read."""
    register = joint.table["status_return_level"]
    try:
        return register.decode(bus.read(joint.id, register.address, register.length).params)
    except NoReplyError:
        return 0


def _settle_each(differences: Iterable[Difference], config: RigConfig, bus: Bus) -> Iterator[str]:
    """Sets one register after the other, and says so."""
    for one in differences:
        settle([one], config, bus)
        yield f"{one.joint} (id {one.id}): {one.register} was {one.found} and is {one.needed}"


def set_up(open_bus: Callable[[int], Bus], id: int, baud: int) -> tuple[Found, Identity]:
    """Gives the only servo on a bus its ID and baud rate, and a return delay of 0; verifies that it answers there.

    Returns:
        What it was, and what it is now.

    Raises:
        RigError: if there is no servo, or more than one, or its model is not known.
        RefusedError: if it does not take a value.
        NoReplyError: if it does not answer afterwards.
        SerialPortError: if the port cannot be opened, or vanishes.
    """
    garbled: list[int] = []
    found = scan(open_bus, on_garbled=garbled.append)
    if garbled:
        raise RigError(
            f"garbled answers at {garbled[0]} baud: two servos may have the same id. Connect the one to set up alone."
        )
    if not found:
        raise RigError("no servo answers at any baud rate. Check power, cable and adapter.")
    if len(found) > 1:
        who = ", ".join(f"id {one.identity.id} at {one.baud}" for one in found)
        raise RigError(f"{len(found)} servos answer ({who}). Connect the one to set up alone.")
    before = found[0]
    bus = open_bus(before.baud)
    try:
        if before.identity.protocol == 1:
            bus.old = frozenset((before.identity.id, id))
        before = Found(before.baud, _who_answers(before.identity, bus))
        table = MODELS[before.identity.model]
        value = baud_value(table, baud)
        if value is None:
            raise RigError(f"a servo of model {table.model} cannot do {baud} baud.")
        _put(bus, before.identity.id, table, "torque_enable", 0)
        _put(bus, before.identity.id, table, "return_delay_time", 0)
        if before.identity.protocol != table.protocol:
            _put(bus, before.identity.id, table, "protocol_type", table.protocol)
            bus.old = frozenset()
        if id != before.identity.id:
            _put(bus, before.identity.id, table, "id", id)
        if baud != before.baud:
            _put(bus, id, table, "baud_rate", value)
    finally:
        bus.close()
    bus = open_bus(baud)
    try:
        bus.old = frozenset((id,)) if table.protocol == 1 else frozenset()
        after = bus.ping(id)
    finally:
        bus.close()
    if after is None:
        raise NoReplyError(f"the servo does not answer as id {id} at {baud} baud. Try motiondeck rig scan.")
    return before, after


def _who_answers(identity: Identity, bus: Bus) -> Identity:
    """The identity of a servo that answers every instruction from now on, whatever its status return level was."""
    untold = identity.model_number == UNTOLD
    table = MODELS["AX-12A" if untold else identity.model] if untold or identity.model in MODELS else None
    if table is None:
        raise RigError(f"the servo is a {identity.model}, whose control table is not known.")
    for name, value in (("torque_enable", 0), ("status_return_level", 2)):  # at the same place in all of Protocol 1.0
        bus.sync_write(table[name].address, 1, bytes((identity.id, value)))
    return bus.ping(identity.id) or identity if untold else identity


def _put(bus: Bus, id: int, table: ControlTable, name: str, value: int) -> None:
    register = table[name]
    bus.write(id, register.address, register.encode(value))


def _ask(joint: RigJoint, identity: Identity, bus: Bus) -> ServoReport:
    """Reads the report of one servo."""

    def value(name: str) -> int:
        register = joint.table[name]
        return register.decode(bus.read(joint.id, register.address, register.length).params)

    bits, temperature, voltage = (
        hardware_errors(joint, bus),
        float(value("present_temperature")),
        value("present_input_voltage") / 10.0,
    )
    why: list[str] = []
    if bits & _VOLTAGE:
        low, high = value("min_voltage_limit") / 10.0, value("max_voltage_limit") / 10.0
        why.append(f" ({voltage:.1f} V; its own limits are {low:.1f} and {high:.1f} V)")
    if bits & _HEAT:
        why.append(f" ({temperature:.0f} degC; its own limit is {value('temperature_limit')} degC)")
    return ServoReport(
        name=joint.name,
        id=joint.id,
        model=identity.model,
        firmware=identity.firmware,
        torque=value("torque_enable") != 0,
        errors=describe_errors(bits) + "".join(why) if bits else "",
        position=(value("present_position") - joint.zero) / joint.pulses_per_radian,
        temperature=temperature,
        voltage=voltage,
        return_delay_us=2 * value("return_delay_time"),
    )


def _turns_endlessly(joint: RigJoint, differences: Iterable[Difference]) -> bool:
    """Whether an old servo is a wheel (its position limits are both 0) or counts many turns (both at its end)."""
    limits = {one.register: one.found for one in differences}
    low = limits.get("min_position_limit")
    end = joint.table.one_turn[1]
    return joint.table.protocol == 1 and low is not None and low == limits.get("max_position_limit", end)


def _complaints(servo: ServoReport, joint: RigJoint, who: str, differing: set[str]) -> list[str]:
    """What is wrong with one servo, some of whose registers differ from what the rig needs."""
    found: list[str] = []
    if servo.errors:
        found.append(f"{who} reports {servo.errors}: mend the cause, then switch its power off and on")
    position = servo.position
    if "operating_mode" in differing:  # one that counts many turns; in position mode it shows its place in one
        lowest, turn = joint.table.one_turn[0], joint.table.pulses_per_turn
        pulses = lowest + (joint.pulses(position) - lowest) % turn
        position = (pulses - joint.zero) / joint.pulses_per_radian
    if not (joint.lower - 0.05 <= position <= joint.upper + 0.05 or differing & _FALSIFIES):
        found.append(
            f"{who} stands at {position:.2f} rad, its limits are {joint.lower} to {joint.upper}: "
            "move it by hand, or motiondeck rig calibrate"
        )
    if servo.temperature > joint.hottest - _CLOSE_TO_HOT:
        found.append(f"{who} has {servo.temperature:.0f} degC and shuts down at {joint.hottest:.0f}: let it cool")
    return found
