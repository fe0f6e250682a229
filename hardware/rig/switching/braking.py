"""Where joints stand, and where each would come to rest if it began to brake now."""

from __future__ import annotations

import numpy as np

from hardware.bus.servo_bus import Bus
from hardware.errors import NoReplyError
from hardware.rig.registers import list_joints, read_each
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array, RigScale

_PATH = ("present_velocity", "present_position", "velocity_trajectory", "position_trajectory")
_LAG = 0.15  # s that a joint may be behind its path and still follows it
_UNTIL_TOLD = 0.02  # s from reading where a joint is to its taking the new goal


def places_of_rest(config: RigConfig, bus: Bus, scale: RigScale) -> tuple[Array, Array]:
    """Where the joints stand, and where each would come to rest if it began to brake now; both (J,), rad.

    With an acceleration limit a servo runs past any goal nearer than its braking distance v^2 / (2 a), and hurries back
    to it at up to its speed limit. It brakes along its own path (position and velocity trajectory); a joint without
    torque, or that does not turn the way of its path, has no braking distance.
    """
    torque = np.array(read_each(config, bus, "torque_enable")) != 0
    rows = _read_path(config, bus)
    velocity, position, path_velocity, path = (
        np.array([row[name] for row in rows], dtype=np.float64) for name in _PATH
    )
    angles, velocity, path_velocity = (
        scale.angles(position),
        velocity * scale.rad_per_s,
        path_velocity * scale.rad_per_s,
    )
    rates = np.array([joint.acceleration for joint in config.joints])
    braking = np.divide(path_velocity * path_velocity, 2.0 * rates, out=np.zeros(len(rates)), where=rates > 0.0)
    ahead = scale.angles(path) - angles + np.sign(path_velocity) * braking + path_velocity * _UNTIL_TOLD
    # What the path is ahead of a joint that follows it, at most; farther ahead is one that is held up.
    most = np.abs(path_velocity) * (_LAG + _UNTIL_TOLD) + braking
    moves = torque & (velocity * path_velocity > 0.0)
    return angles, angles + np.where(moves, np.clip(ahead, -most, most), 0.0)


def _read_path(config: RigConfig, bus: Bus) -> list[dict[str, int]]:
    """The registers of `_PATH` of every servo, read at the same time; a model without a path is where it is.

    Raises:
        NoReplyError: if a servo stays silent; all that do are named.
    """
    rows = [[joint.table[name] for name in _PATH if name in joint.table.registers] for joint in config.joints]
    starts = [min(row.address for row in own) for own in rows]
    ends = [max(row.address + row.length for row in own) for own in rows]
    blocks = zip(config.joints, starts, ends, strict=True)
    statuses = bus.bulk_read(tuple((joint.id, start, end - start) for joint, start, end in blocks))
    silent = [joint for joint in config.joints if joint.id not in statuses]
    if silent:
        raise NoReplyError(f"no position from {list_joints(silent)}. Check their cables and power.")
    found: list[dict[str, int]] = []
    for joint, own, start in zip(config.joints, rows, starts, strict=True):
        data = statuses[joint.id].params
        values = {row.name: row.decode(data[row.address - start :][: row.length]) for row in own}
        values.setdefault("velocity_trajectory", values["present_velocity"])
        values.setdefault("position_trajectory", values["present_position"])
        found.append(values)
    return found
