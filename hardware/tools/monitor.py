"""Watching a rig without touching it: what every servo measures, once a second, and how often the wire lets us ask."""

from __future__ import annotations

import time
from collections.abc import Iterator

from hardware.bus.servo_bus import Bus
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import RigScale
from hardware.rig.switching import describe_errors

_SHOWN_EVERY = 1.0  # s
_FORCE = ("present_current", "present_load")


def observe(config: RigConfig, bus: Bus, share: float = 1.0) -> Iterator[tuple[list[dict[str, object]], float]]:
    """What the joints measure, a row each, and how often it could be read in the last second (Hz); for ever.

    Args:
        config: the joints of one port.
        bus: that port's.
        share: of each second that is spent on this port, where several are watched one after another.

    Raises:
        SerialPortError: if the port vanishes.
    """
    ids = [joint.id for joint in config.joints]
    table = config.joints[0].table
    scale = RigScale(config)
    lasting = share * _SHOWN_EVERY
    # From the force to the temperature stands side by side in every model that a rig may have.
    force = next(name for name in _FORCE if name in table.registers)
    block = table.block(force, "present_temperature")
    error = table.block("hardware_error_status", "hardware_error_status")
    while True:
        since, count = time.monotonic(), 0
        statuses = bus.sync_read(ids, *block)
        while statuses and time.monotonic() - since < lasting:
            statuses = bus.sync_read(ids, *block)
            count += 1
        errors = bus.sync_read(ids, *error)
        elapsed = time.monotonic() - since
        rows: list[dict[str, object]] = []
        for index, joint in enumerate(config.joints):
            row: dict[str, object] = {"id": joint.id, "name": joint.name, "heard": False}
            status, problem = statuses.get(joint.id), errors.get(joint.id)
            if status is not None and not status.error:
                value = {
                    name: register.decode(status.params[register.address - block[0] :][: register.length])
                    for name, register in joint.table.registers.items()
                    if block[0] <= register.address < block[0] + block[1]
                }
                strength = force if force in value else next(name for name in _FORCE if name in value)
                row |= {
                    "heard": True,
                    "position": round((value["present_position"] - joint.zero) / joint.pulses_per_radian, 4),
                    "velocity": round(float(scale.rad_per_s[index]) * value["present_velocity"], 3),
                    "current": round(float(scale.amperes[index]) * value[strength], 3),
                    "temperature": value["present_temperature"],
                    "voltage": value["present_input_voltage"] / 10.0,
                    "errors": describe_errors(problem.params[0]) if problem and problem.params[0] else "",
                }
            rows.append(row)
        if not statuses:
            time.sleep(max(0.0, lasting - elapsed))
        yield rows, count / elapsed
