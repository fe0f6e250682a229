"""Measurements of joints from those of their servos, where two servos turn one joint.

position, velocity    the mean, without a servo that is silent
current               the larger one, without a servo that is silent
temperature, voltage  of the servo that is worse off; so are errors, torque and missed answers
"""

import numpy as np

from hardware.rig.driving.readings import Measurements
from hardware.rig.rig_file import RigConfig

_SETTLED = 0.5  # s: more than a watchdog waits, usually, and a joint needs to stand
_MOVED = 0.15  # of the slack: so far a joint goes on with whose goal a servo that has stopped is at odds


class JoinedMeasurements:
    """Joins the measurements of S servos into those of J joints."""

    def __init__(self, config: RigConfig, servos: Measurements, joints: Measurements) -> None:
        """Writes into `joints` in each `update`."""
        of = np.array(config.joint_of)
        self._firsts = np.flatnonzero(np.diff(of, prepend=-1))  # the first servo of each joint
        self._count = np.bincount(of)
        self._fastest = np.array([joint.velocity for joint in config.joints])
        self._servos, self._joints = servos, joints
        # Whether one of two servos of a joint is limp or silent, shape (J,); the other stays at its goal.
        self.waits = np.zeros(len(self._firsts), dtype=np.bool_)
        # Where a joint that went on meanwhile stays when both have come to rest, rad; NaN before, and for any other.
        self.places = np.full(len(self._firsts), np.nan)
        self._since, self._before = np.zeros(len(self._firsts)), np.full(len(of), np.nan)

    def update(self) -> None:
        """Takes over what the servos have measured."""
        joints, servos, firsts = self._joints, self._servos, self._firsts
        highest, lowest = np.maximum.reduceat, np.minimum.reduceat
        weights, count, missed = 1.0, self._count, servos.missed_in_a_row
        if np.logical_or.reduce(missed):
            weights = (missed == np.repeat(lowest(missed, firsts), self._count)).astype(np.float64)
            count = np.add.reduceat(weights, firsts)
        for mean, values in ((joints.positions, servos.positions), (joints.velocities, servos.velocities)):
            mean[:] = np.add.reduceat(values * weights, firsts) / count
        most, least = highest(servos.currents * weights, firsts), lowest(servos.currents * weights, firsts)
        joints.currents[:] = np.where(most > -least, most, least)
        joints.against[:] = np.minimum(np.maximum(most, 0.0), np.maximum(-least, 0.0))
        joints.temperatures[:] = np.fmax.reduceat(servos.temperatures, firsts)
        joints.voltages[:] = np.fmin.reduceat(servos.voltages, firsts)
        joints.errors[:] = np.bitwise_or.reduceat(servos.errors, firsts)
        joints.shutdown[:] = np.bitwise_or.reduceat(servos.shutdown, firsts)
        joints.torque[:] = np.logical_and.reduceat(servos.torque, firsts)
        # A servo that has restarted tells no position before it is set up again.
        known = joints.torque & (count == self._count)
        # Nor are both read at the same time where each is asked alone.
        moved = self._fastest * (highest(servos.read_at, firsts) - lowest(servos.read_at, firsts))
        apart = highest(servos.positions, firsts) - lowest(servos.positions, firsts) - moved
        joints.apart[:] = np.maximum(apart, 0.0) * known
        joints.read_at[:] = lowest(servos.read_at, firsts)
        joints.missed_in_a_row[:] = highest(servos.missed_in_a_row, firsts)
        joints.alone[:] = (self._count > 1) & (joints.missed_in_a_row > 1)
        joints.hottest[:], joints.slack[:] = lowest(servos.hottest, firsts), lowest(servos.slack, firsts)
        waits = (self._count > 1) & ((joints.missed_in_a_row > 0) | ~joints.torque)
        now = np.maximum.reduce(servos.read_at)
        self._since = np.where(waits, self._since, now)
        self._before = np.where(np.repeat(waits, self._count), self._before, servos.positions)
        moved = highest(np.abs(servos.positions - self._before), firsts) > _MOVED * joints.slack
        new = waits & moved & np.isnan(self.places) & (now - self._since > _SETTLED)
        self.places = np.where(new, joints.positions, np.where(waits, self.places, np.nan))
        self.waits = waits
