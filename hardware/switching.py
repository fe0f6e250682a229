"""Switching a rig on and off: whatever happens, torque comes on only where the joint already stands.

These functions wait for each servo's answer; they are not for use inside a loop.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from hardware.bus import Bus
from hardware.errors import NoReplyError, PortError, RigError, ServoError
from hardware.rig import RigConfig, RigJoint
from hardware.scale import Array, RigScale

_POSITION_MODE = 3
_ANSWER_EVERYTHING = 2
_NEAR = 0.05  # rad that a joint may stand outside its limits when switched on: play, and the rounding of pulses

_HARDWARE_ERRORS = {1: "input voltage", 4: "overheated", 8: "encoder", 16: "electrical shock", 32: "overload"}


def switch_on(config: RigConfig, bus: Bus) -> Array:
    """Checks who is there, takes torque off, settles each servo's settings, makes its position its goal, torque on.

    Returns:
        The angles (J,), rad, at which the joints now hold.

    Raises:
        RigError: if servos are missing, of another model, shut down, or outside their limits; it names them all.
        PortError: if the port vanishes.
    """
    _check_identities(config, bus)
    # A servo told to keep silent would look like one that is missing.
    tell_all(config, bus, "status_return_level", _ANSWER_EVERYTHING)
    try:
        _write(config, bus, "torque_enable", [0] * len(config.joints))
        _refuse_shut_down(config, bus)
        _settle(config, bus, "operating_mode", [_POSITION_MODE] * len(config.joints))
        scale = RigScale(config)
        ends = np.sort([scale.pulses(scale.lower), scale.pulses(scale.upper)], axis=0)
        _settle(config, bus, "min_position_limit", [int(pulses) for pulses in ends[0]])
        _settle(config, bus, "max_position_limit", [int(pulses) for pulses in ends[1]])
        held = hold_still(config, bus)
        _write(config, bus, "torque_enable", [1] * len(config.joints))
    except ServoError as error:
        raise RigError(str(error)) from error
    return held


def hold_still(config: RigConfig, bus: Bus) -> Array:
    """Clears the watchdogs, limits the speed and makes each joint's position its goal, torque on or off.

    Returns:
        The goals (J,), rad.

    Raises:
        RigError: if a servo does not answer, or stands outside its limits.
        PortError: if the port vanishes.
    """
    scale = RigScale(config)
    try:
        _write(config, bus, "bus_watchdog", [0] * len(config.joints))
        _limit_speed(config, bus)
        positions = _positions(config, bus, scale)
        goals = np.clip(positions, scale.lower, scale.upper)
        outside = [
            f"{joint.name} stands at {angle:.2f} rad, its limits are {joint.lower} to {joint.upper}"
            for joint, angle, goal in zip(config.joints, positions, goals, strict=True)
            if abs(angle - goal) > _NEAR
        ]
        if outside:
            raise RigError(f"{'; '.join(outside)}. Move it by hand, or correct its zero and limits in the rig file.")
        _write(config, bus, "goal_position", [int(pulses) for pulses in scale.pulses(goals)])
    except ServoError as error:
        raise RigError(str(error)) from error
    return goals


def switch_off(config: RigConfig, bus: Bus) -> list[str]:
    """Takes the torque off all servos at once, then off each for itself.

    Returns:
        The joints that did not confirm it: dead ones, or all where the port is gone.
    """
    unconfirmed: list[str] = []
    try:
        tell_all(config, bus, "torque_enable", 0)
        tell_all(config, bus, "bus_watchdog", 0)
        for joint in config.joints:
            try:
                bus.write(joint.id, joint.table["torque_enable"].address, b"\0")
            except ServoError:
                unconfirmed.append(joint.name)
    except PortError:
        return list(config.names)
    return unconfirmed


def tell_all(config: RigConfig, bus: Bus, name: str, value: int) -> bool:
    """Writes one value into a register of every servo, unanswered and without waiting; False if the port is full."""
    register = config.joints[0].table[name]
    data = register.encode(value)
    entries = b"".join(bytes((joint.id,)) + data for joint in config.joints)
    return bus.sync_write(register.address, register.length, entries)


def _check_identities(config: RigConfig, bus: Bus) -> None:
    """Pings every servo of the rig file, and names all that are missing or of another model in one error."""
    found = {joint.id: bus.ping(joint.id) for joint in config.joints}
    missing = [joint for joint in config.joints if found[joint.id] is None]
    if missing:
        raise RigError(
            f"no answer on {bus.port.name} at {bus.baud} baud from {_who(missing)}. "
            "Check power, cables, ids and the baud rate."
        )
    others = [
        f"{joint.name} (id {joint.id}) is a {identity.model}, not a {joint.model}"
        for joint in config.joints
        if (identity := found[joint.id]) is not None and identity.model != joint.model
    ]
    if others:
        raise RigError(f"{'; '.join(others)}. Correct the model in the rig file.")


def _refuse_shut_down(config: RigConfig, bus: Bus) -> None:
    """Names the servos that a hardware problem has switched off."""
    errors = zip(_read(config, bus, "shutdown"), _read(config, bus, "hardware_error_status"), strict=True)
    down = [
        f"{joint.name} (id {joint.id}: {', '.join(text for bit, text in _HARDWARE_ERRORS.items() if found & bit)})"
        for joint, (mask, found) in zip(config.joints, errors, strict=True)
        if mask & found
    ]
    if down:
        raise RigError(f"shut down: {'; '.join(down)}. Mend the cause, then switch the servo's power off and on.")


def _limit_speed(config: RigConfig, bus: Bus) -> None:
    """Has each servo keep to its joint's velocity limit by itself; a profile velocity of 0 would mean no limit."""
    profile = config.joints[0].table["profile_velocity"]
    counts = [max(1, min(round(joint.velocity / profile.si), profile.maximum)) for joint in config.joints]
    _write(config, bus, "profile_velocity", counts)
    _write(config, bus, "profile_acceleration", [0] * len(counts))


def _positions(config: RigConfig, bus: Bus, scale: RigScale) -> Array:
    """Where the joints stand, shape (J,), rad."""
    statuses = bus.fast_sync_read([joint.id for joint in config.joints], *scale.state_block)
    silent = [joint for joint in config.joints if joint.id not in statuses]
    if silent:
        raise NoReplyError(f"no position from {_who(silent)}. Check their cables and power.")
    blocks = b"".join(statuses[joint.id].params for joint in config.joints)
    return scale.state(list(range(len(config.joints))), blocks)[0]


def _write(config: RigConfig, bus: Bus, name: str, values: Sequence[int]) -> None:
    """Writes a register of every servo and waits for each answer."""
    for joint, value in zip(config.joints, values, strict=True):
        register = joint.table[name]
        bus.write(joint.id, register.address, register.encode(value))


def _read(config: RigConfig, bus: Bus, name: str) -> list[int]:
    """A register of every servo."""
    rows = [(joint.id, joint.table[name]) for joint in config.joints]
    return [row.decode(bus.read(id, row.address, row.length).params) for id, row in rows]


def _settle(config: RigConfig, bus: Bus, name: str, values: Sequence[int]) -> None:
    """Writes an EEPROM register where it differs: its cells wear out."""
    for joint, value, held in zip(config.joints, values, _read(config, bus, name), strict=True):
        if value != held:
            register = joint.table[name]
            bus.write(joint.id, register.address, register.encode(value))


def _who(joints: Iterable[RigJoint]) -> str:
    return ", ".join(f"{joint.name} (id {joint.id})" for joint in joints)
