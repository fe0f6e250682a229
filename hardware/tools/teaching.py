"""Teaching a rig by hand: joint angles recorded with the torque off, and prepared for playing.

A joint is counted from the turn in which it was found, which is the one it keeps when torque comes on; one that goes
through several turns from the turn that was kept of it.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array
from hardware.rig.switching.turns import find_zeros, recall
from hardware.rig.turn_file import TurnFile
from hardware.tools.loose_joints import positions

_SILENT = 0.5  # s without an answer from one servo
_SMOOTHED_OVER = 0.21  # s, by a cubic: a hand's tremor and the counts' steps go, what a joint can follow stays
_STILL = 0.1  # rad/s
_KEPT = 0.2  # s before the first and after the last movement


class Moment(NamedTuple):
    """The angles (J,), rad, NaN where a servo did not answer, at a time in s since the first."""

    time: float
    angles: Array


def watch_hands(
    config: RigConfig, parts: Sequence[tuple[RigConfig, Bus]], sleep: Callable[[float], None]
) -> Iterator[Moment]:
    """The joints' angles, `rate_hz` times a second, for as long as they are asked for; the torque is off.

    The parts are the joints of each port, and its bus. RigError if a servo is silent for half a second, or in which
    turn it stands is not known; it is named.
    """
    clock = parts[0][1].port
    turns = {name: shift for part, bus in parts for name, shift in _several_turns(part, bus)}
    start = due = clock.now()
    heard = dict.fromkeys(config.names, start)
    while True:
        now = clock.now()
        angles = np.full(len(config.joints), np.nan)
        for part, bus in parts:
            for joint, pulses in positions(part, bus):
                turns.setdefault(joint.name, joint.whole_turns(pulses))
                angles[config.names.index(joint.name)] = joint.angle(pulses - turns[joint.name])
                heard[joint.name] = now
        silent = [joint.label for joint in config.joints if now - heard[joint.name] > _SILENT]
        if silent:
            raise RigError(f"{', '.join(silent)} does not answer any more. Check the cable, then teach again.")
        yield Moment(now - start, angles)
        due = max(due + 1.0 / config.rate_hz, clock.now())
        sleep(max(0.0, due - clock.now()))


def _several_turns(part: RigConfig, bus: Bus) -> Iterator[tuple[str, int]]:
    """The pulses that servos now count more than from their zero, of joints that go through several turns, by name."""
    if part.through_turns:
        part = part.servos
        zeros = find_zeros(part, bus, recall(part, bus, TurnFile.of_port(bus.port.name)))
        for index in part.through_turns:
            yield part.names[index], round(zeros[index]) - part.joints[index].zero


class Taught(NamedTuple):
    """A motion as it was taught."""

    whole: Array  # all that was recorded, gaps closed and smoothed, at a steady rate, shape (T, J), rad
    first: int  # the first frame that is left without the time before the first movement
    end: int  # the frame after the last that is left without the time after the last movement

    @property
    def moving(self) -> Array:
        """The frames in which something moved, and a little before and after, shape (end - first, J), rad."""
        return self.whole[self.first : self.end]


def taught(moments: Sequence[Moment], rate: float) -> Taught:
    """What was written down, at a steady rate (Hz); RigError for too few moments, a silent joint, or no movement."""
    times = np.array([moment.time for moment in moments])
    seen = np.array([moment.angles for moment in moments])
    window = round(_SMOOTHED_OVER * rate) | 1
    if len(moments) < 2 or times[-1] * rate < max(window, 5):
        raise RigError("that was too short to learn anything from. Move the joints for some seconds.")
    grid = np.arange(int(times[-1] * rate) + 1) / rate
    angles = np.empty((len(grid), seen.shape[1]))
    for joint, values in enumerate(seen.T):
        known = np.isfinite(values)
        if not known.any():
            raise RigError(f"joint {joint + 1} of the rig was never heard. Check its cable.")
        angles[:, joint] = np.interp(grid, times[known], values[known])
    if window >= 5:
        angles = np.asarray(savgol_filter(angles, window, 3, axis=0), dtype=np.float64)
    moving = np.flatnonzero((np.abs(np.gradient(angles, 1.0 / rate, axis=0)) > _STILL).any(axis=1))
    if len(moving) == 0:
        raise RigError("no joint was moved. Is the torque off, and the right joint in your hand?")
    kept = round(_KEPT * rate)
    return Taught(angles, max(0, int(moving[0]) - kept), min(len(angles), int(moving[-1]) + 1 + kept))


def beyond_limits(config: RigConfig, angles: Array, rate: float) -> list[str]:
    """Where angles (T, J), rad, at a rate in Hz, go beyond the rig file's limits; one line each, naming the joint."""
    found: list[str] = []
    speeds = np.abs(np.gradient(angles, 1.0 / rate, axis=0)).max(axis=0)
    for joint, values, speed in zip(config.joints, angles.T, speeds, strict=True):
        low, high = float(values.min()), float(values.max())
        if low < joint.lower or high > joint.upper:
            found.append(f"{joint.name} went {low:.2f} to {high:.2f} rad, it may {joint.lower:g} to {joint.upper:g}")
        if speed > joint.velocity:
            found.append(f"{joint.name} was moved at {speed:.1f} rad/s, it may {joint.velocity:g}")
    return found
