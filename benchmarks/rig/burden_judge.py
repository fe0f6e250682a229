"""The judge of currents, loads and gains in a fault schedule; it reads true motors and registers of emulated servos.

current    the true current of a joint is above the rig file's limit for at most 20 ms, whatever happens to it
rest       a joint that stands at its target, with torque that it has kept, stays there when others are set up again
gains      at switch-on and in the end a servo has the gains of the rig file, or else those that it had; a restart and a
           change of the mode bring those back with which it was delivered
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.rig.burdens import GAINS, Burdens
from benchmarks.rig.jams import ALLOWED, PAGES, true_current
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.servos.device import Device
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import POSITION_MODE
from hardware.rig.scale import Array

Mask = NDArray[np.bool_]
Note = Callable[[str, Mask, NDArray[np.float64]], None]
"""Takes what was wrong, with which joints (J,), and how much (J,)."""

_ABOVE = 1.02  # of the limit: a register may hold 1 % more
_STRAINED = 0.7  # of the limit of current: beyond it a joint may give way, wherever it stands
_STILL = 0.02  # rad/s
_STANDS_FOR = 0.4  # s
_MOVED = 0.008  # rad
_AT = 0.005  # rad from the goal register to the target


class BurdenJudge:
    """Judges the joints of one port."""

    def __init__(self, config: RigConfig, bus: EmulatedBus, burdens: Burdens, others: NDArray[np.int64]) -> None:
        """Of a rig with each servo as a joint; `others` are the other servos of their joints, shape (J,)."""
        self._others = others
        count = len(config.joints)
        self._config, self._bus, self._burdens = config, bus, burdens
        self._per_radian = np.array([joint.pulses_per_radian for joint in config.joints])
        self._zero = np.array([joint.zero for joint in config.joints])
        pages = [PAGES.get(joint.model) for joint in config.joints]
        self._unit = np.array([0.0 if page is None else page.count for page in pages])
        self._limit = np.array([joint.current or np.inf for joint in config.joints])
        self._above = np.zeros(count)  # s
        self._anchor, self._since = np.full(count, np.nan), np.zeros(count)
        self._target, self._target_since = np.full(count, np.nan), np.zeros(count)
        self._misled = np.zeros(count, dtype=bool)
        self._gains = [_gains(device) for device in bus.devices]

    @property
    def sag(self) -> Array:
        """How far off its goal each joint may be because of its weight, shape (J,), rad."""
        drives = [(device.bank.drive, device.row) for device in self._bus.devices]
        stiffness = np.array([drive.p_gain[row] / drive.motor.full_pwm for drive, row in drives])
        return self._burdens.weight / np.abs(stiffness * self._per_radian)

    def switched_on(self, note: Note) -> None:
        """Judges the gains with which servos are switched on; a change of the mode puts them back."""
        settings = zip(self._config.joints, self._bus.devices, self._gains, strict=True)
        changed = [
            joint.mode == POSITION_MODE and _gains(device) != before | joint.gains for joint, device, before in settings
        ]
        note("lost its gains at switch-on", np.array(changed), np.array(changed, dtype=np.float64))

    def asked(self, targets: Array, now: float) -> None:
        """Takes the targets (J,), rad, within the limits."""
        changed = targets != self._target
        self._target_since[changed] = now
        self._target = targets.copy()

    def watch(self, now: float, passed: float, blocked: Mask, cut_off: Mask, steady: Mask, note: Note) -> None:
        """Looks at the motors after `passed` seconds, and puts the weights on the horns.

        Args:
            blocked, cut_off, steady: joints that something holds; that miss goals or hear those of others; with torque,
                voltage and a watchdog that has not stopped them.
        """
        devices = self._bus.devices
        shafts = np.array([device.bank.shaft[device.row] for device in devices])
        speeds = np.array([device.bank.drive.speed[device.row] for device in devices]) / self._per_radian
        angles = (shafts - self._zero) / self._per_radian
        self._burdens.press(devices, angles, self._per_radian)
        self._misled |= cut_off
        counts = [
            true_current(device) if measured else 0.0 for device, measured in zip(devices, self._unit, strict=True)
        ]
        amperes = self._unit * counts
        above = (amperes > _ABOVE * self._limit) & ~cut_off
        self._above = np.where(above, self._above + passed, 0.0)
        too_long = self._above > ALLOWED
        note("had a true current above the rig file's limit for more than 20 ms, A", too_long, amperes)
        at_target = np.abs((true_goals(devices) - self._zero) / self._per_radian - self._target) < _AT
        # Where one of two servos loses its torque, the other takes the whole weight.
        free = ~blocked & ~cut_off & (amperes < _STRAINED * self._limit)
        kept = steady & steady[self._others] & free & (now - self._target_since > _STANDS_FOR)
        moving = np.isnan(self._anchor) & (np.abs(speeds) > _STILL)
        self._anchor[~kept] = np.nan
        self._since[~kept | moving | (np.isnan(self._anchor) & ~at_target)] = now
        stands = np.isnan(self._anchor) & (now - self._since > _STANDS_FOR)
        self._anchor[stands] = angles[stands]
        moved = np.abs(angles - np.where(np.isnan(self._anchor), angles, self._anchor))
        note("kept its torque, and moved at another's recovery, rad", moved > _MOVED, moved)

    def end(self, note: Note) -> None:
        """Judges the gains that the servos have in the end."""
        joints, devices = self._config.joints, self._bus.devices
        wrong = np.zeros(len(joints))
        for index, (joint, device, before) in enumerate(zip(joints, devices, self._gains, strict=True)):
            if device.dead or self._misled[index] or not device.torque:
                continue
            asked = joint.gains
            delivered = {name: joint.table[name].default for name in before}
            for name, value in _gains(device).items():
                right = (asked[name],) if name in asked else (before[name], delivered[name])
                wrong[index] += value not in right
        note("has gains that nothing asked for", wrong > 0, wrong)


def true_goals(devices: Sequence[Device]) -> Array:
    """The goal registers of servos, pulses of their true horns, with the whole turns that they no longer count."""
    return np.array([device["goal_position"] + device.bank.drive.forgotten[device.row] for device in devices])


def _gains(device: Device) -> dict[str, int]:
    return {name: device[name] for name in GAINS if name in device.bank.public.registers}
