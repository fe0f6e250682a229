"""Backup of a rig's control tables: all registers are saved, and those in EEPROM can be restored."""

from collections.abc import Iterable
from pathlib import Path

import msgspec

from hardware.bus.servo_bus import Bus
from hardware.errors import NoReplyError, RigError
from hardware.families.models import FAMILIES
from hardware.families.register import Counts
from hardware.rig.registers import parts, put, read_block, read_register
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.switching.identities import MUTE, check_identities
from motiondeck_base.files import write_file

_CHUNK = 64  # bytes a read
# The servo would be gone from its place on the bus.
_NOT_RESTORED = {"id", "baud_rate"} | {family.choice[0] for family in FAMILIES if family.choice}


class ServoBackup(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The control table of one servo, in counts by register name."""

    joint: str
    id: int
    model: str
    registers: dict[str, Counts]


def back_up(config: RigConfig, bus: Bus) -> list[ServoBackup]:
    """Reads the whole table of every servo; raises RigError if one is missing or of another model."""
    check_identities(config.servos, bus)
    backups: list[ServoBackup] = []
    for joint in config.servos.joints:
        try:
            held = _read_all(joint, bus)
        except NoReplyError:
            held = _read_silent(joint, bus)
        backups.append(ServoBackup(joint.name, joint.id, joint.model, held))
    return backups


def _read_all(joint: RigJoint, bus: Bus) -> dict[str, int]:
    blocks = parts(joint.table.registers.values(), _CHUNK)
    return {name: count for block in blocks for name, count in read_block(joint, bus, block).items()}


def _read_silent(joint: RigJoint, bus: Bus) -> dict[str, int]:
    """As `_read_all` of a servo that answers a ping but no read; its level is raised in RAM meanwhile."""
    level = joint.table["status_return_level"]
    if level.memory != "RAM":
        raise RigError(MUTE.format(joint.label))
    answers, mute = (bytes((joint.id,)) + level.encode(value) for value in (2, 0))
    bus.sync_write(level.address, level.length, answers)
    try:
        return _read_all(joint, bus) | {level.name: 0}
    finally:
        bus.sync_write(level.address, level.length, mute)


def restore(config: RigConfig, backups: Iterable[ServoBackup], bus: Bus) -> list[str]:
    """Writes the EEPROM registers that differ from the backup, but ID and baud rate; torque must be off.

    What was written, one line a register, and which joints are not in the backup. RigError if a servo is missing or of
    another model, or has its torque on, or the backup has what it cannot take; nothing is written then.
    """
    config, kept = config.servos, {backup.joint: backup for backup in backups}
    lines = [f"{joint.label}: not in the backup" for joint in config.joints if joint.name not in kept]
    writes: list[tuple[RigJoint, str, int]] = []
    for index, joint in enumerate(config.joints):
        if joint.name not in kept:
            continue
        backup, servo = kept[joint.name], joint.label
        if backup.model != joint.model:
            raise RigError(f"{joint.name} is {joint.model} in the rig file, and {backup.model} in the backup.")
        check_identities(config.only([index]), bus)
        if read_register(joint, bus, "torque_enable"):
            raise RigError(f"{servo} has its torque on. Take it off with motiondeck rig stop.")
        for name, value in backup.registers.items():
            register = joint.table.registers.get(name)
            if register is None:
                raise RigError(f"the backup of {servo} has a register '{name}', which a {joint.model} has not.")
            if register.memory != "EEPROM" or register.access == "R" or name in _NOT_RESTORED:
                continue
            held = read_register(joint, bus, name)
            if held == value:
                continue
            try:
                register.encode(value)
                writes.append((joint, name, value))
            except ValueError as error:
                raise RigError(f"the backup of {servo} cannot be restored: {error}.") from error
            lines.append(f"{servo}: {name} was {held} and is {value}")
    for joint, name, value in writes:
        put(bus, joint.id, joint.table, name, value)
    return lines


def save_backups(backups: list[ServoBackup], path: Path) -> None:
    """Writes backups as JSON."""
    write_file(path, msgspec.json.format(msgspec.json.encode(backups)))


def load_backups(path: Path) -> list[ServoBackup]:
    """Reads what `save_backups` wrote; raises RigError if the file is not that."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=list[ServoBackup])
    except OSError as error:
        raise RigError(f"cannot read the backup {path}: {error.strerror}.") from error
    except msgspec.DecodeError as error:
        raise RigError(f"{path} is not a backup of motiondeck rig backup: {error}.") from error
