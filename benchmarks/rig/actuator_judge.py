"""The judge of what joints of a fault schedule are: two servos on one horn, several turns, grippers.

pair       the two servos of a joint never work against each other for more than 0.3 s; nor do goals for that long lead
           one of them away from its shaft while the other is cut off, listens to another ID or has no torque
turn       the goal register of a joint that goes through several turns is within its limits, in the true turn of its
           horn; and so is what is kept on disk in the end
grip       a gripper that presses towards its target with its limit of current does so for as long as something holds
           it up, also while another servo is set up again and when the rig ends and holds, unless its target comes back
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from benchmarks.rig.judged_port import PLAY, JudgedBus
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.turn_file import TurnFile

Mask = NDArray[np.bool_]
Note = Callable[[str, Mask, Array], None]
"""Takes what was wrong, with which servos (S,), and how much (S,)."""

_AGAINST = 0.15  # of the stall current
_AGAINST_FOR = _ALONE_FOR = 0.3  # s
_PRESSES, _LETS_GO = 0.9, 0.6  # of the limit of current
_PRESSED_FOR, _LET_GO_FOR = 0.2, 0.1  # s
_BEYOND = 0.3  # rad of the target behind what a gripper holds
_TOLD = 0.1  # s from a target to its goal in the servo


class ActuatorJudge:
    """Judges the S servos of one port."""

    def __init__(self, config: RigConfig, bus: JudgedBus) -> None:
        """Of a rig with each servo as a joint."""
        joints, count = config.joints, len(config.joints)
        self._config, self._bus = config, bus
        names = [joint.joint_name for joint in joints]
        self._others = np.array([_other(names, index) for index in range(count)])
        self._direction = np.array([joint.direction for joint in joints])
        self._per_turn = np.array([joint.table.pulses_per_turn / abs(joint.pulses_per_radian) for joint in joints])
        self._several = np.array([joint.several_turns for joint in joints])
        self._lower = np.array([joint.lower for joint in joints])
        self._upper = np.array([joint.upper for joint in joints])
        self._grips = np.array([joint.grip for joint in joints])
        self._limit = np.array([joint.current or np.inf for joint in joints])
        self._against, self._pressed, self._let_go = np.zeros(count), np.zeros(count), np.zeros(count)
        self._opposed, self._freed = np.zeros(count), np.zeros(count, dtype=np.bool_)
        # When a target was last near what a gripper holds, or on its other side, s; and on which side it is.
        self._near, self._side = np.zeros(count), np.zeros(count)
        self._goals, self._alone = np.full(count, np.nan), np.zeros(count)
        self._astray = np.zeros(count, dtype=np.bool_)
        self._targets = np.full(count, np.nan)

    @property
    def others(self) -> NDArray[np.int64]:
        """Of each servo the other one of its joint, or itself, shape (S,)."""
        return self._others

    @property
    def paired(self) -> Mask:
        """Which servos have another one on their joint, shape (S,)."""
        return self._others != np.arange(len(self._others))

    @property
    def freed(self) -> Mask:
        """Which servos are on a shaft that two held against each other until one has restarted just now, shape (S,).

        The rig could not reach both: the other one's path has gone ahead, and the shaft hurries after it. Torque that
        the rig takes off is no excuse.
        """
        return self._freed

    def asked(self, targets: Array) -> None:
        """Takes the targets (S,), rad, within the limits."""
        self._targets = targets

    def watch(
        self, now: float, passed: float, angles: Array, goals: Array, cut_off: Mask, powered: Mask, note: Note
    ) -> None:
        """Looks at the servos after `passed` seconds.

        Args:
            angles, goals: true ones, shape (S,), rad.
            cut_off: those that miss goals, or hear those of others.
            powered: those with torque, voltage and a watchdog that has not stopped them.
        """
        devices = self._bus.devices
        well = powered & ~cut_off
        shares = np.array([float(device.bank.drive.current[device.row]) for device in devices]) * self._direction
        opposed = np.where(
            shares * shares[self._others] < 0.0, np.minimum(np.abs(shares), np.abs(shares[self._others])), 0.0
        )
        against = (opposed > _AGAINST) & well & well[self._others]
        reached = ~(cut_off | cut_off[self._others])
        restarts = np.array([device.asleep_until > now for device in devices])
        self._freed = (self._opposed > _AGAINST) & ~reached & (restarts != restarts[self._others])
        self._opposed = opposed
        self._against = np.where(against, self._against + passed, 0.0)
        note("has two servos that work against each other, of the stall current", self._against > _AGAINST_FOR, opposed)
        joints = zip(self._config.joints, devices, strict=True)
        away = np.array([device.dead or not device.torque or device.id != joint.id for joint, device in joints])
        alone = away[self._others] & ~away
        # A goal that comes back to the shaft lets go of it.
        on = np.abs(goals - angles) > np.abs(self._goals - angles)
        self._alone = np.where(alone, self._alone + passed * on, 0.0)
        self._goals = goals
        note("was driven on without its other servo, s", self._alone > _ALONE_FOR, self._alone)
        self._astray = self._several & (self._astray | cut_off) & ((goals < self._lower) | (goals > self._upper))
        beyond = (goals < self._lower - PLAY) | (goals > self._upper + PLAY)
        note("has a goal in another turn, rad", self._several & beyond & powered & ~self._astray, goals)
        self._judge_grips(now, passed, angles, well, note)

    def _judge_grips(self, now: float, passed: float, angles: Array, well: Mask, note: Note) -> None:
        devices = self._bus.devices
        amperes = [device.bank.drive.current[device.row] * device.bank.drive.motor.stall_current for device in devices]
        side, before = np.sign(self._targets - angles), self._side
        self._side = side
        share = 1e-3 * np.array(amperes) * self._direction * side / self._limit
        self._near[~(np.abs(self._targets - angles) > _BEYOND) | (side != before)] = now
        jammed = np.array([device.bank.drive.jammed[device.row] for device in devices])
        held = self._grips & well & jammed & (now - self._near > _TOLD)
        self._pressed = np.where(held, self._pressed + passed * (share > _PRESSES), 0.0)
        gone = held & (self._pressed > _PRESSED_FOR) & (share < _LETS_GO)
        self._let_go = np.where(gone, self._let_go + passed, 0.0)
        note("let go of what it gripped, at this part of its current", self._let_go > _LET_GO_FOR, share)

    def end(self, file: TurnFile, angles: Array, note: Note) -> None:
        """Judges where the joints are kept to stand, from where they truly do, shape (S,), rad."""
        if not self._several.any():
            return
        kept, off = file.read(), np.zeros(len(angles))
        for index in np.flatnonzero(self._several & ~self._astray).tolist():
            joint, device = self._config.joints[index], self._bus.devices[index]
            turn = kept[joint.id]
            if turn.stands and not device.dead:
                off[index] = (turn.place - turn.zero) / joint.pulses_per_radian - angles[index]
        note("is kept in another place than where it stands, rad", np.abs(off) > 0.5 * self._per_turn, off)


def _other(names: list[str], index: int) -> int:
    return next((place for place, name in enumerate(names) if name == names[index] and place != index), index)
