"""One register of every servo of a rig: read and written one by one, or broadcast."""

from collections.abc import Iterable, Sequence

from hardware.bus.servo_bus import Bus
from hardware.families.family import Family
from hardware.families.register import Register, decode_block
from hardware.families.table import ControlTable
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint


def read_register(joint: RigJoint, bus: Bus, name: str) -> int:
    """A register of one servo, in counts."""
    register = joint.table[name]
    return register.decode(bus.read(joint.id, register.address, register.length).params)


def read_block(joint: RigJoint, bus: Bus, rows: Sequence[Register]) -> dict[str, int]:
    """Registers of one servo in order of address, read at once with all between them, in counts by name."""
    start, end = rows[0].address, rows[-1].address + rows[-1].length
    return decode_block(rows, bus.read(joint.id, start, end - start).params, start)


def parts(rows: Iterable[Register], most: int) -> list[list[Register]]:
    """Divides registers in order of address; no part has more bytes than `most` from its first to its last."""
    found: list[list[Register]] = []
    for row in rows:
        if found and row.address + row.length - found[-1][0].address <= most:
            found[-1].append(row)
        else:
            found.append([row])
    return found


def read_each(config: RigConfig, bus: Bus, name: str) -> list[int]:
    """A register of every servo, in counts."""
    return [read_register(joint, bus, name) for joint in config.joints]


def put(bus: Bus, id: int, table: ControlTable, name: str, value: int) -> None:
    """Writes a count into a register and waits for the answer; EEPROM is unlocked meanwhile where it must be."""
    register = table[name]
    lock = table.registers.get(table.family.eeprom_lock) if register.memory == "EEPROM" else None
    if lock is not None:
        bus.write(id, lock.address, lock.encode(0))
    bus.write(id, register.address, register.encode(value))
    # At another baud rate the servo is heard only when the bus is; its lock comes back with its power.
    if lock is not None and name != "baud_rate":
        bus.write(value if name == "id" else id, lock.address, lock.encode(1))


def write_each(config: RigConfig, bus: Bus, name: str, values: Sequence[int]) -> None:
    """Writes a register of every servo that has it and waits for each answer."""
    for joint, value in zip(config.joints, values, strict=True):
        if name in joint.table.registers:
            put(bus, joint.id, joint.table, name, value)


def sync_write_all(config: RigConfig, bus: Bus, name: str, value: int) -> bool:
    """Writes one value into a register of every servo that has it, unanswered, without waiting; False if not sent."""
    sent = True
    for (_, address, length), members in same_place(config, name).items():
        data = config.joints[members[0]].table[name].encode(value)
        entries = b"".join(bytes((config.joints[index].id,)) + data for index in members)
        sent &= bus.sync_write(address, length, entries)
    return sent


def same_place(config: RigConfig, name: str) -> dict[tuple[Family, int, int], list[int]]:
    """The joints that have a register, by family, address and length of it, so that one sync write is for each."""
    groups: dict[tuple[Family, int, int], list[int]] = {}
    for index, joint in enumerate(config.joints):
        if (register := joint.table.registers.get(name)) is not None:
            groups.setdefault((joint.table.family, register.address, register.length), []).append(index)
    return groups


def list_joints(joints: Iterable[RigJoint]) -> str:
    """Joints in words, each with its ID."""
    return ", ".join(joint.label for joint in joints)
