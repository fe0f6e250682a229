"""Scan of a bus for servos at every baud rate, of every family; and the set-up of a single one or a bag of them."""

from collections.abc import Callable, Iterable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import NamedTuple

from hardware.bus.servo_bus import UNKNOWN_MODEL, Bus, Identity
from hardware.errors import NoReplyError, RigError, ServoError
from hardware.families.models import MODELS
from hardware.rig.registers import put
from hardware.rig.rig_file import load_rig
from hardware.rig.rig_joint import RigJoint
from motiondeck_base.files import write_file

LIKELY_BAUDS = (57600, 1_000_000, 4_000_000, 2_000_000, 3_000_000, 115_200, 9600)
"""Where a servo is looked for, the likely rates first."""


class Found(NamedTuple):
    """A servo that answered a scan."""

    baud: int
    identity: Identity


def scan(
    open_bus: Callable[[int], Bus],
    bauds: Iterable[int] = LIKELY_BAUDS,
    on_garbled: Callable[[int], object] = lambda baud: None,
) -> list[Found]:
    """The servos that answer at each baud rate, of every family; the likely rates first.

    `on_garbled` is called with each baud rate at which some bytes are no answer: two servos may share an ID.
    """
    found: list[Found] = []
    for baud in bauds:
        with closing(open_bus(baud)) as bus:
            found += [Found(baud, identity) for identity in bus.ping_all()]
            if bus.garbled:
                on_garbled(baud)
            found += [Found(baud, identity) for identity in bus.ping_each()]
    return found


def set_up(
    open_bus: Callable[[int], Bus], id: int, baud: int, check: Callable[[Found], object] = lambda found: None
) -> tuple[Found, Identity]:
    """Gives the only servo on a bus its ID and baud rate, and a return delay of 0; verifies that it answers there.

    Returns what it was, and what it is now; `check` may refuse it before it is changed. RigError if there is no servo,
    or more than one, or its model is not known. ServoError if it does not take a value, or does not answer afterwards.
    """
    garbled: list[int] = []
    found = scan(open_bus, on_garbled=garbled.append)
    if garbled:
        raise RigError(f"garbled answers at {garbled[0]} baud: two servos may have the same id. Connect one alone.")
    if not found:
        raise RigError("no servo answers at any baud rate. Check power, cable and adapter.")
    if len(found) > 1:
        servos = ", ".join(f"id {one.identity.id} at {one.baud}" for one in found)
        raise RigError(f"{len(found)} servos answer ({servos}). Connect the one to set up alone.")
    before = found[0]
    with closing(open_bus(before.baud)) as bus:
        bus.families = dict.fromkeys((before.identity.id, id), before.identity.family)
        before = Found(before.baud, _who_answers(before.identity, bus))
        check(before)
        table = MODELS[before.identity.model]
        value = table.baud_value(baud)
        if value is None:
            raise RigError(f"a servo of model {table.model} cannot do {baud} baud.")
        put(bus, before.identity.id, table, "torque_enable", 0)
        put(bus, before.identity.id, table, "return_delay_time", 0)
        if before.identity.family is not table.family and (choice := table.family.choice) is not None:
            put(bus, before.identity.id, table, *choice)
            bus.families = dict.fromkeys((before.identity.id, id), table.family)
        if id != before.identity.id:
            put(bus, before.identity.id, table, "id", id)
        if baud != before.baud:
            put(bus, id, table, "baud_rate", value)
    with closing(open_bus(baud)) as bus:
        bus.families = {id: table.family}
        after = bus.ping(id)
    if after is None:
        raise NoReplyError(f"the servo does not answer as id {id} at {baud} baud. Try motiondeck rig scan.")
    return before, after


def _who_answers(identity: Identity, bus: Bus) -> Identity:
    """The identity of a servo that answers every instruction from now on, whatever its status return level was."""
    untold = identity.model_number == UNKNOWN_MODEL
    table = MODELS.get(identity.family.mute_model if untold else identity.model)
    if table is None:
        raise RigError(f"the servo answers as {identity.model}, whose control table is not known.")
    for name, value in (("torque_enable", 0), ("status_return_level", table.family.answers_all)):
        bus.sync_write(table[name].address, 1, bytes((identity.id, value)))
    return bus.ping(identity.id) or identity if untold else identity


def set_up_all(
    rig: Path, open_bus: Callable[[int], Bus], ask: Callable[[str], object], say: Callable[[str], object]
) -> None:
    """Sets up every servo of a rig file in turn; `ask` waits until the next one is connected alone.

    Which ones are done is kept in a file beside the rig file, from which the next run goes on. A servo that cannot be
    set up is asked for again, with the reason. MotiondeckError if the rig file or that file cannot be read or written.
    """
    config, kept = load_rig(rig), rig.with_name(f"{rig.name}.setup")
    servos = config.servos.joints
    known = [joint.name for joint in servos]
    done = [name for name in kept.read_text().splitlines() if name in known] if kept.exists() else []
    for joint in servos:
        while joint.name not in done:
            ask(f"{joint.label}: connect a new {joint.model} alone, and press Enter ")
            earlier = {servo.id: servo.name for servo in servos if servo.name in done}
            try:
                check = partial(_check, joint, config.baud, earlier)
                before, _ = set_up(open_bus, joint.id, config.baud, check)
            except (RigError, ServoError) as error:
                say(f"{error}")
                continue
            done.append(joint.name)
            write_file(kept, "".join(f"{name}\n" for name in done).encode())
            was = f"id {before.identity.id} at {before.baud} baud"
            say(f"{joint.name}: {was} is now id {joint.id} at {config.baud} baud ({len(done)} of {len(servos)})")
    kept.unlink(missing_ok=True)


def _check(joint: RigJoint, baud: int, earlier: dict[int, str], found: Found) -> None:
    """Refuses a servo of another model, or one that was set up before, by RigError."""
    if found.identity.model != joint.model:
        raise RigError(f"a {found.identity.model} answers, but {joint.label} is a {joint.model}. Connect that.")
    table = joint.table
    new = found.identity.id == 1 and table.baud_value(found.baud) == table["baud_rate"].default
    if found.baud == baud and found.identity.id in earlier and not new:
        raise RigError(f"this is the servo of {earlier[found.identity.id]}, set up before. Connect the next one.")
