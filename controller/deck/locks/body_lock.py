"""A lock to the body: a motion waits while its body is held, and follows a hand that moves it.

The lag is found by projecting the measured positions m on the poses q(phi) of the motion. Joints that are at their
targets say nothing about a hold, so each counts by its error r_j = m_j - q_j(phi_d) at the commanded phase phi_d. What
the joints leave open (a motion that stands still, one that passes a pose twice) a prior around phi_d decides:

    phi = argmin  sum_j w_j (m_j - q_j(phi))^2 / s^2  +  (T (phi - phi_d) / s_t)^2,    w_j = r_j^2 / (r_j^2 + s^2)

the maximum a posteriori of phi for errors of s rad and of s_t seconds. Of several minima it is the one downhill of
phi_d: the motion never leaves its body far behind, so this one is continuous where a limb passes a place twice.
"""

import math
from collections.abc import Callable

import numpy as np

from controller.deck.locks.phase_lock import LoopPlace, Steering
from controller.motion.rotations import Array
from controller.wire.messages.arguments import TEMPO
from controller.wire.messages.deck_snapshot import LockStage, LockState

SPACING = 0.02  # time between stored poses of a motion, s
WINDOW = 0.6  # range around the commanded phase in which the body is searched for, s
JOINT_ERROR = 0.1  # s: joint errors that a hold does not explain (following, play, gravity), rad
PRIOR = 0.3  # s_t: the expected lag, s


class PoseTable:
    """The joint targets of one motion over its phase, filled in while it is played."""

    def __init__(self, seconds: float, joints: int, *, loop: bool) -> None:
        self._loop = loop
        self._count = max(8, round(seconds / SPACING))
        self._spacing = seconds / self._count
        self._poses = np.full((self._count + (not loop), joints), np.nan)
        self._around = np.arange(-round(WINDOW / self._spacing), round(WINDOW / self._spacing) + 1)
        self.before: tuple[float, Array] | None = None  # the last pose; None where the next one does not follow it

    def note(self, phase: float, targets: Array) -> None:
        """Keeps the targets (J,), rad, of a phase, interpolated to the rows that were passed since the last call."""
        place, before = phase * self._count, self.before
        self.before = place, targets.copy()
        if before is None:
            return
        start, pose = before
        way = place - start
        if self._loop:
            way -= self._count * round(way / self._count)
        if not 0.0 < abs(way) < 4.0:
            return
        low, high = sorted((start, start + way))
        for row in range(int(np.ceil(low)), int(np.floor(high)) + 1):
            share = (row - start) / way
            self._poses[row % len(self._poses)] = (1.0 - share) * pose + share * targets

    def project(self, phase: float, targets: Array, measured: Array) -> tuple[float, float]:
        """How far the body is behind, s of the motion (negative if it is ahead), and how far beside it at most, rad.

        From the commanded phase, its targets (J,), rad, and what is measured, shape (J,), rad; NaN for what is not.
        """
        off = np.nan_to_num(measured - targets)
        beside = float(np.abs(off).max(initial=0.0))
        weight = off * off / (off * off + JOINT_ERROR**2)
        place = phase * self._count
        rows = round(place) + self._around
        ahead = (rows - place) * self._spacing
        if self._loop:
            rows %= len(self._poses)
        else:
            inside = (rows >= 0) & (rows < len(self._poses))
            rows, ahead = rows[inside], ahead[inside]
        away = np.where(np.isfinite(measured), self._poses[rows] - measured, 0.0)
        cost = away**2 @ weight / JOINT_ERROR**2 + np.square(ahead / PRIOR)
        best = _downhill(cost, int(np.argmin(np.abs(ahead))))
        if best is None:
            return 0.0, beside
        return -float(ahead[best] + self._spacing * _vertex(cost, best)), min(beside, float(np.abs(away[best]).max()))


def _downhill(cost: Array, start: int) -> int | None:
    """The local minimum that lies downhill of an index; None where the cost is not known."""
    if not np.isfinite(cost[start]):
        return None
    known = np.where(np.isfinite(cost), cost, np.inf)
    step = 1 if start + 1 < len(cost) and known[start + 1] < known[start] else -1
    while 0 <= start + step < len(cost) and known[start + step] < known[start]:
        start += step
    return start


def _vertex(cost: Array, best: int) -> float:
    """Where the parabola through the least cost and its neighbours has its least value, in rows from `best`."""
    if not 0 < best < len(cost) - 1 or not np.isfinite(cost[best - 1 : best + 2]).all():
        return 0.0
    left, middle, right = cost[best - 1 : best + 2]
    bend = left - 2.0 * middle + right
    return float(0.5 * (left - right) / bend) if bend > 0.0 else 0.0


Measured = Callable[[], Array | None]
"""The measured joint positions, shape (J,), rad, NaN for a joint that is not measured; None before there are any."""

FREE = 0.08  # so far behind, s of the motion at tempo 1, is how servos follow; the tempo stays as it was commanded
REACH = 0.12  # lag beyond FREE over which the tempo falls to zero, s
BESIDE, STOPPED = 0.15, 0.3  # rad off the path of the motion, from which on a joint slows it down, and stops it
_WAITS = 0.5  # a tempo that is off by more than this share of the commanded one is that of a held body


class BodyLock:
    """Steers the tempo by how far the measured joints are behind."""

    rate = 5.0  # of change of the tempo, 1/s

    def __init__(self, measured: Measured) -> None:
        self._measured = measured
        self._tables: dict[str, PoseTable] = {}
        self._targets: Array | None = None  # of the last tick
        self._stage: LockStage = "searching"
        self._lag_s: float | None = None

    @property
    def state(self) -> LockState:
        """Whether the body follows, and how far it is behind the motion, ms."""
        return LockState("body", self._stage, 1e3 * self._lag_s if self._lag_s is not None else None)

    def steer(self, playhead: LoopPlace) -> Steering:
        """The commanded tempo less what a lag takes from it; it stops at FREE + REACH and goes back with a hand."""
        table, measured = self._tables.get(playhead.motion), self._measured()
        if not playhead.alone or table is None or measured is None or self._targets is None:
            self._stage, self._lag_s = "searching", None
            return playhead.tempo, None
        lag, beside = table.project(playhead.phase, self._targets, measured)
        self._lag_s = lag
        size = max(1.0, abs(playhead.tempo))
        pull = math.copysign(max(0.0, abs(lag) - FREE * size) / REACH, lag)
        on_path = min(max((STOPPED - beside) / (STOPPED - BESIDE), 0.0), 1.0)
        tempo = on_path * min(max(playhead.tempo - pull, -size), 2.0 * size)
        self._stage = "waiting" if abs(tempo - playhead.tempo) > _WAITS * (abs(playhead.tempo) or 1.0) else "locked"
        return min(max(tempo, TEMPO.lowest), TEMPO.highest), None

    def note(self, playhead: LoopPlace, targets: Array) -> None:
        """Takes the joint targets (J,) or more, rad, that a tick has led to; those of joins are not the motion's."""
        measured = self._measured()
        if measured is None:
            return
        own = targets[: len(measured)]
        self._targets = own.copy()
        table = self._tables.get(playhead.motion)
        if table is None:
            table = self._tables[playhead.motion] = PoseTable(playhead.seconds, len(own), loop=playhead.loop)
        if playhead.alone:
            table.note(playhead.phase, own)
        else:
            table.before = None
