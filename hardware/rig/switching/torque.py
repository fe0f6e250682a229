"""Switching a rig on and off: torque comes on only where the joint stands. These functions wait; none is for a loop."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hardware.bus.servo_bus import Bus
from hardware.errors import NoReplyError, RigError, SerialPortError, ServoError
from hardware.families.models import TRAITS
from hardware.families.register import decode_block
from hardware.rig.registers import list_joints, read_each, read_register, sync_write_all, write_each
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import NEAR, RigJoint
from hardware.rig.scale import Array, RigScale, force_of
from hardware.rig.switching import identities
from hardware.rig.switching.audit import audit, driving_settings, in_counts, settle
from hardware.rig.switching.turns import find_zeros, recall, way
from hardware.rig.turn_file import TurnFile

_PATH = ("present_velocity", "present_position", "velocity_trajectory", "position_trajectory")
_NO_PATH = ("present_velocity", "present_position", "present_velocity", "goal_position")
_LOOK_AT = ("profile_velocity", "goal_position", "present_velocity", "present_position")
APART = 0.1
"""rad by which two servos of one joint may disagree: play between them, and zeros that a hand has set."""
_LAG = 0.15  # s that a joint may be behind its path and still follows it
_LOOKS, _LOOK = 30, 0.05  # at a partner that comes to rest, and s between two of them
_OPPOSED = 0.12  # of the stall current, with which two servos of a joint work against each other
_STANDS, _TURNS = 0.05, 0.2  # rad/s of a path, up to which it stands, and of a shaft
_UNTIL_TAKEN = 0.02  # s from reading a joint's position to its taking the new goal
_OFF, _SWINGS = 0.03, 2.0  # rad from its goal at which a joint takes torque, and s in which a limp one comes to that
_ROUNDS = 2  # of asking for torque or its end: a servo that has just restarted is deaf for a while


class Held(NamedTuple):
    """J joints that hold."""

    angles: Array  # where, shape (J,), rad
    zeros: Array  # each servo's position at angle 0 as it counts now, shape (J,), pulses


def switch_on(
    config: RigConfig, bus: Bus, believed: Array | TurnFile | None, cancelled: Callable[[], bool] = lambda: False
) -> Held:
    """Checks identities, takes torque off, audits and sets registers, makes each position the goal, takes torque on.

    Torque does not come on if it is `cancelled` meanwhile. `believed` is as for `find_zeros`, or the file for `recall`.
    RigError if servos are missing, of another model, shut down, set so that they could move wrongly (see `audit`),
    outside their limits, or in an unknown turn, it names them all; or if it was cancelled.
    """
    identities.raise_answer_level_in_eeprom(config, bus)
    identities.check_identities(config, bus)
    identities.raise_answer_level(config, bus)
    try:
        if not isinstance(believed, np.ndarray):
            believed = recall(config, bus, believed)
        write_each(config, bus, "torque_enable", [0] * len(config.joints))
        write_each(config, bus, "bus_watchdog", [0] * len(config.joints))  # one that has tripped locks the goals
        identities.refuse_shut_down(config, bus)
        differences = audit(config, bus)
        refused = [str(difference) for difference in differences if difference.when == "refused"]
        if refused:
            raise RigError(f"{'; '.join(refused)}. Set it with motiondeck rig doctor RIG --fix.")
        for _ in settle((one for one in differences if one.when == "switch-on"), config, bus):
            pass
        held = hold_still(config, bus, believed)
        if cancelled():
            raise RigError("the rig was closed before torque was on.")
        return Held(_take_torque_on(config, bus, held.zeros), held.zeros)
    except ServoError as error:
        raise RigError(str(error)) from error


def hold_still(config: RigConfig, bus: Bus, believed: Array, pace: float = 1.0) -> Held:
    """Clears the watchdogs, limits the speed, and has each joint hold where it stands or can come to rest.

    Each servo keeps the part `pace` of its speed limit from now on. ServoError if a servo does not answer, RigError if
    it stands outside its limits, or in an unknown turn (see `find_zeros`).
    """
    scale = RigScale(config)
    write_each(config, bus, "bus_watchdog", [0] * len(config.joints))
    _limit_speed(config, bus, pace)
    scale.zero[:] = find_zeros(config, bus, believed)
    positions, rests, torque = places_of_rest(config, bus, scale)
    _refuse_other_turns(config, positions, believed)
    _refuse_outside(config, positions)
    _refuse_disagreement(config, positions)
    goals = scale.within(_together(config, rests, torque))
    write_each(config, bus, "goal_position", [int(pulses) for pulses in scale.pulses(goals)])
    return Held(goals, scale.zero)


def resume(
    config: RigConfig, bus: Bus, believed: Array, pace: float, cancelled: Callable[[], bool] = lambda: False
) -> Held:
    """Brings a rig back that was switched on before: identities and settings verified, each joint where it stands.

    A servo that has kept torque and settings just holds; one that has lost them is switched on anew (see `switch_on`).
    So is one of two on a joint whose path has left the other's; a path takes its time to come back.

    Arguments, result and errors as of `hold_still` and `switch_on`.
    """
    identities.check_identities(config, bus)
    identities.raise_answer_level(config, bus)
    try:
        identities.refuse_shut_down(config, bus)
        ends = RigScale(config).ends.astype(np.int64).tolist()
        joints = enumerate(zip(config.joints, *ends, strict=True))
        lost = [index for index, (joint, low, high) in joints if not _is_set(joint, bus, low, high)]
        lost = _await_partners(config, bus, believed, lost, pace)
        if lost:
            switch_on(config.only(lost), bus, believed[..., lost], cancelled)
        return hold_still(config, bus, believed, pace)
    except ServoError as error:
        raise RigError(str(error)) from error


def _await_partners(config: RigConfig, bus: Bus, believed: Array, lost: list[int], pace: float) -> list[int]:
    """The `lost` servos, and those whose paths have left their partners', all of whose partners stand.

    Where no paths are shown, two that work against each other have parted.

    Partners that move are held, as all others are, and waited for; RigError if they still move then.
    """
    pairs = np.flatnonzero(np.diff(config.joint_of) == 0).tolist()
    if not pairs:
        return lost
    scale = RigScale(config)
    scale.zero[:] = find_zeros(config, bus, believed)
    velocity, angles, path_velocity, path = _read_path(config, bus, scale)
    shown = _show_paths(config).tolist()
    away = np.abs(path - np.atleast_2d(believed)[-1]).tolist()
    kept = set(range(len(path))) - set(lost)
    partners: list[int] = []
    for one in pairs:
        pair = {one, one + 1}
        fight = pair <= kept and not shown[one] and _oppose(config.only(sorted(pair)), bus)
        if fight or (pair <= kept and abs(path[one] - path[one + 1]) > APART):
            # Also the other, if it is held off its path: alone it would leap back to it. Where no path is shown, both:
            # either may be.
            first = max(pair, key=away.__getitem__)
            off = [fight or index == first or abs(path[index] - angles[index]) > APART for index in sorted(pair)]
            astray = [index for index, is_off in zip(sorted(pair), off, strict=True) if is_off]
            write_each(config.only(astray), bus, "torque_enable", [0] * len(astray))
            kept -= set(astray)
        if len(own := pair & kept) == 1:
            partners += own
    for look in range(_LOOKS):
        if not ((np.abs(path_velocity) > _STANDS) | (np.abs(velocity) > _TURNS))[partners].any():
            break
        if look == 0:
            rest = sorted(kept)
            hold_still(config.only(rest), bus, believed[..., rest], pace)
        bus.port.wait(_LOOK)
        velocity, _, path_velocity, _ = _read_path(config, bus, scale)
    else:
        raise RigError(f"{list_joints(config.only(partners).joints)} still moves. Try again.")
    return sorted(set(range(len(path))) - kept)


def _oppose(pair: RigConfig, bus: Bus) -> bool:
    """Whether the two servos of a joint work against each other, by their currents."""
    counts = np.array([read_register(joint, bus, force_of(joint.table)) for joint in pair.joints])
    amperes = counts * RigScale(pair).amperes
    return bool(amperes.prod() < 0.0 and np.abs(amperes).min() > _OPPOSED * TRAITS[pair.joints[0].model].stall_current)


def switch_off(config: RigConfig, bus: Bus) -> list[str]:
    """Takes the torque off all servos at once, then off each; returns the joints that did not confirm it."""

    def confirms(joint: RigJoint) -> bool:
        try:
            bus.write(joint.id, joint.table["torque_enable"].address, b"\0")
        except ServoError:
            return False
        return True

    unconfirmed = list(config.joints)
    try:
        sync_write_all(config, bus, "torque_enable", 0)
        sync_write_all(config, bus, "bus_watchdog", 0)
        for _ in range(_ROUNDS):
            unconfirmed = [joint for joint in unconfirmed if not confirms(joint)]
    except SerialPortError:
        return list(config.names)
    return [joint.name for joint in unconfirmed]


def hold_each(config: RigConfig, bus: Bus, believed: Array) -> list[str]:
    """Has each servo hold where it can come to rest, without a watchdog; returns the joints that did not confirm it."""
    unconfirmed: list[str] = []
    try:
        sync_write_all(config, bus, "bus_watchdog", 0)
        joints = config.joint_of
        for joint in dict.fromkeys(joints):
            own = [index for index, of in enumerate(joints) if of == joint]
            one = config.only(own)
            try:
                write_each(one, bus, "bus_watchdog", [0] * len(own))
                scale = RigScale(one)
                scale.zero[:] = find_zeros(one, bus, believed[..., own])
                _, rest, torque = places_of_rest(one, bus, scale)
                rest = _together(one, rest, torque)
                write_each(one, bus, "goal_position", [int(pulses) for pulses in scale.pulses(scale.within(rest))])
            except (ServoError, RigError):
                unconfirmed += one.names
    except SerialPortError:
        return list(config.names)
    return unconfirmed


def _take_torque_on(config: RigConfig, bus: Bus, zeros: Array) -> Array:
    """Takes torque on, joint by joint, each where it stands then; returns the goals, shape (J,), rad.

    It comes on only in a servo of the right model that still keeps its speed limit, which one that has restarted or was
    swapped does not. The write behind the look is sent once and not answered: one that is repeated until it is answered
    may reach a servo that has restarted meanwhile.
    """
    goals = np.zeros(len(config.joints))
    off = list(range(len(config.joints)))
    for _ in range(_ROUNDS):
        for joint in dict.fromkeys(config.joint_of[index] for index in off):
            own = [index for index in off if config.joint_of[index] == joint]
            one = config.only(own)
            identities.check_identities(one, bus)
            goals[own] = _keep_goals_near(one, bus, zeros[own])
            sync_write_all(one, bus, "torque_enable", 1)
        off = [index for index in off if read_each(config.only([index]), bus, "torque_enable") == [0]]
    if off:
        raise RigError(f"{list_joints(config.only(off).joints)} did not take torque on. Try again.")
    return goals


def _keep_goals_near(config: RigConfig, bus: Bus, zeros: Array) -> Array:
    """Has the goals of a joint without torque follow it until it is there and slow; returns them, shape (J,), rad.

    A joint may fall or swing since its place was read; a look and the write behind it leave it the least time for that.
    """
    scale, until = RigScale(config), bus.port.now() + _SWINGS
    scale.zero[:] = zeros
    limits = [speed_counts(joint, 1.0) for joint in config.joints]
    while True:
        kept, goals, velocity, positions = _read_together(config, bus, [_LOOK_AT] * len(limits))
        if kept.tolist() != limits:
            raise RigError(f"{list_joints(config.joints)} has restarted while it was switched on. Check its power.")
        goals, positions = scale.angles(goals), scale.angles(positions)
        places = scale.within(_together(config, positions, np.zeros(len(goals), dtype=np.bool_)))
        if (np.abs(goals - places) + np.abs(velocity * scale.rad_per_s) * _UNTIL_TAKEN).max() < _OFF:
            return goals
        if bus.port.now() > until:
            raise RigError(f"{list_joints(config.joints)} swings. Hold it still while it is switched on.")
        _refuse_outside(config, positions)
        write_each(config, bus, "goal_position", [int(pulses) for pulses in scale.pulses(places)])


def _is_set(joint: RigJoint, bus: Bus, low: int, high: int) -> bool:
    wanted = {"torque_enable": 1} | driving_settings(joint, low, high)
    return all(read_register(joint, bus, name) == v for name, v in wanted.items() if name in joint.table.registers)


def speed_counts(joint: RigJoint, pace: float) -> int:
    """The profile velocity with which a servo keeps this part of its joint's speed limit; 0 would mean no limit."""
    return in_counts(joint, "profile_velocity", joint.velocity * joint.gear * pace)


def _limit_speed(config: RigConfig, bus: Bus, pace: float) -> None:
    speeds = [speed_counts(joint, pace) for joint in config.joints]
    rates = [
        in_counts(joint, "profile_acceleration", joint.acceleration * joint.gear) if joint.acceleration else 0
        for joint in config.joints
    ]
    write_each(config, bus, "profile_velocity", speeds)
    write_each(config, bus, "profile_acceleration", rates)


def _together(config: RigConfig, rests: Array, torque: NDArray[np.bool_]) -> Array:
    """The places of rest (J,), rad, where two servos of one joint get the same: the mean of those with torque."""
    joints = np.array(config.joint_of)
    weights = np.where(torque | ~np.bincount(joints, torque).astype(np.bool_)[joints], 1.0, 0.0)
    return (np.bincount(joints, rests * weights) / np.bincount(joints, weights))[joints]


def _refuse_outside(config: RigConfig, positions: Array) -> None:
    outside = [
        f"{joint.name} stands at {angle:.2f} rad, its limits are {joint.lower} to {joint.upper}"
        for joint, angle in zip(config.joints, positions, strict=True)
        if not joint.lower - NEAR <= angle <= joint.upper + NEAR
    ]
    if outside:
        raise RigError(f"{'; '.join(outside)}. Move it by hand, or correct its zero and limits in the rig file.")


def _refuse_other_turns(config: RigConfig, positions: Array, believed: Array) -> None:
    """Raises a RigError if a servo has restarted since its zero was found, and counts turns otherwise."""
    joints = enumerate(zip(config.joints, np.abs(positions - way(believed)[0]).tolist(), strict=True))
    turns = {i: away * abs(joint.pulses_per_radian) / joint.table.pulses_per_turn for i, (joint, away) in joints}
    restarted = [index for index in config.through_turns if turns[index] > 0.5]
    if restarted:
        raise RigError(f"{list_joints(config.only(restarted).joints)} has restarted while it was set up. Try again.")


def _refuse_disagreement(config: RigConfig, positions: Array) -> None:
    joints = config.joint_of
    for index in np.flatnonzero((np.diff(joints) == 0) & (np.abs(np.diff(positions)) > APART)).tolist():
        one, other = config.joints[index : index + 2]
        raise RigError(
            f"{one.label} stands at {positions[index]:.2f} rad and {other.label} at {positions[index + 1]:.2f}. "
            "Correct direction and zero of the second in the rig file, or tighten the horns."
        )


def places_of_rest(config: RigConfig, bus: Bus, scale: RigScale) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Present positions, where each joint would come to rest if it braked now, (J,), rad, and whether it has torque."""
    # With an acceleration limit a servo runs past any goal nearer than its braking distance v^2 / (2 a), and hurries
    # back to it at up to its speed limit. It brakes along its own path (position and velocity trajectory). A load keeps
    # a joint off its path, by at most its slack; holding where the path stands, it does not sink any further. A joint
    # without torque, or that is held off its path, rests where it is; but a gripper holds on where its path leads.
    torque = np.array(read_each(config, bus, "torque_enable")) != 0
    velocity, angles, path_velocity, path = _read_path(config, bus, scale)
    grips = np.array([joint.grip for joint in config.joints])
    # A model that shows no path, and turns away from its goal, brakes from where it is before it turns back.
    away = ~_show_paths(config) & ~grips & (velocity * (path - angles) < 0.0) & (np.abs(velocity) > _STANDS)
    path = np.where(away, angles, path)
    rates = np.array([joint.acceleration for joint in config.joints])
    braking = np.divide(path_velocity * path_velocity, 2.0 * rates, out=np.zeros(len(rates)), where=rates > 0.0)
    ahead = path - angles + np.sign(path_velocity) * braking + path_velocity * _UNTIL_TAKEN
    slack = np.where(grips, math.inf, [joint.slack(joint.position_p_gain) for joint in config.joints])
    # What the path is ahead of a joint that follows it, at most; farther ahead is one that is held up.
    most = np.abs(path_velocity) * (_LAG + _UNTIL_TAKEN) + braking + slack
    moves = torque & ((velocity * path_velocity > 0.0) | grips)
    stands = torque & (np.abs(path_velocity) < _STANDS) & (np.abs(ahead) < slack)
    return angles, angles + np.where(moves | stands, np.clip(ahead, -most, most), 0.0), torque


def _show_paths(config: RigConfig) -> NDArray[np.bool_]:
    """Which servos have registers of their paths, shape (J,)."""
    return np.array([_PATH[-1] in joint.table.registers for joint in config.joints])


def _read_path(config: RigConfig, bus: Bus, scale: RigScale) -> tuple[Array, Array, Array, Array]:
    """The registers of `_PATH` (J,), rad/s and rad, read at the same time; a model without a path goes to its goal."""
    names = [_PATH if path else _NO_PATH for path in _show_paths(config)]
    velocity, position, path_velocity, path = _read_together(config, bus, names)
    rate = scale.rad_per_s
    return velocity * rate, scale.angles(position), path_velocity * rate, scale.angles(path)


def _read_together(config: RigConfig, bus: Bus, names: Sequence[tuple[str, ...]]) -> Array:
    """N registers of each servo, read at the same time with all between them, shape (N, J), counts."""
    rows = [[joint.table[name] for name in own] for joint, own in zip(config.joints, names, strict=True)]
    starts = [min(row.address for row in own) for own in rows]
    ends = [max(row.address + row.length for row in own) for own in rows]
    blocks = zip(config.joints, starts, ends, strict=True)
    statuses = bus.bulk_read(tuple((joint.id, start, end - start) for joint, start, end in blocks))
    silent = [joint for joint in config.joints if joint.id not in statuses]
    if silent:
        raise NoReplyError(f"no position from {list_joints(silent)}. Check their cables and power.")
    counts: list[list[int]] = []
    for joint, own, start in zip(config.joints, rows, starts, strict=True):
        values = decode_block(own, statuses[joint.id].params, start)
        counts.append([values[row.name] for row in own])
    return np.array(counts, dtype=np.float64).T
