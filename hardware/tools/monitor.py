"""Monitor of a rig: the measurements of every servo once a second, and the rate that the wire allows."""

import time
from collections.abc import Iterator

from hardware.bus.servo_bus import Bus
from hardware.errors import ServoError
from hardware.families.register import decode_block
from hardware.families.table import ControlTable, describe_errors
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint
from hardware.rig.scale import RigScale, force_of
from hardware.rig.switching.identities import hardware_errors

_SHOWN_EVERY = 1.0  # s


def observe(config: RigConfig, bus: Bus, share: float = 1.0) -> Iterator[tuple[list[dict[str, object]], float]]:
    """What the joints measure, a row each, and how often it could be read in the last second (Hz); for ever.

    A share of each second is spent on this port, where several are watched one after another.
    """
    config = config.servos
    scale = RigScale(config)
    lasting = share * _SHOWN_EVERY
    blocks = {joint.id: _measured(joint.table) for joint in config.joints}
    asked = tuple((id, *block) for id, block in blocks.items())
    while True:
        since, count = time.monotonic(), 0
        statuses = bus.bulk_read(asked)
        while statuses and time.monotonic() - since < lasting:
            statuses = bus.bulk_read(asked)
            count += 1
        errors = {joint.id: _errors(joint, bus) for joint in config.joints if joint.id in statuses}
        elapsed = time.monotonic() - since
        rows: list[dict[str, object]] = []
        for index, joint in enumerate(config.joints):
            row: dict[str, object] = {"id": joint.id, "name": joint.name, "heard": False}
            status, (start, length) = statuses.get(joint.id), blocks[joint.id]
            if status is not None and not status.error:
                shown = (one for one in joint.table.registers.values() if start <= one.address < start + length)
                value = decode_block(shown, status.params, start)
                row |= {
                    "heard": True,
                    "position": round(joint.angle(value["present_position"]), 4),
                    "velocity": round(float(scale.rad_per_s[index]) * value["present_velocity"], 3),
                    "current": round(float(scale.amperes[index]) * value[force_of(joint.table)], 3),
                    "temperature": value["present_temperature"],
                    "voltage": value["present_input_voltage"] / 10.0,
                    "errors": errors[joint.id],
                }
            rows.append(row)
        if not statuses:
            time.sleep(max(0.0, lasting - elapsed))
        yield rows, count / elapsed


def _measured(table: ControlTable) -> tuple[int, int]:
    """Address and length of what is shown of a servo: it stands close together in every model."""
    names = ("present_position", "present_velocity", "present_input_voltage", "present_temperature")
    rows = [table[name] for name in (*names, force_of(table))]
    start = min(row.address for row in rows)
    return start, max(row.address + row.length for row in rows) - start


def _errors(joint: RigJoint, bus: Bus) -> str:
    try:
        return describe_errors(hardware_errors(joint, bus), none="")
    except ServoError:
        return ""
