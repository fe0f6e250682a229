"""Judges a rig from outside: whether goals and shafts stayed within the limits, when braking began, when all stood.

Knows a record of the bus (see `bus_relay`), a record of the true shafts, and what robot and rig file say; it shares no
code with what it judges. Times are CLOCK_MONOTONIC, s.

**Grid.** A goal holds until the next one. The rig sends one in each period, and the periods may drift a little, so a
frame is compared with the mean phase (on the circle) of the frames around it. It belongs to the period nearest to it;
one that is even later, to the period before, if that has no other. One period without a frame counts as a late frame,
between its neighbours. In two or more the goals stand still: a deck that falls silent in full motion stops its joints
within one period, and is judged as that.

**Rates.** By differences of goals over 1 to 4 periods, less what rounding to pulses can make of them: a path within
the limits, rounded to pulses, is never above 1.

**Braking** begins when the last of the moving joints has begun to slow down and goes on doing so until it stands.
"""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.stop.bus_relay import LOST, TO_SERVOS, entries
from benchmarks.stop.goal_frames import GOAL_POSITION, PULSES_PER_TURN, WRITE, FrameReader, goals_in

Array = NDArray[np.float64]
_AROUND = 51  # frames whose mean phase counts as that of the middle one
_OVER = (1, 2, 3, 4)  # periods
_MOVES = 3.0  # pulses a period, above which a joint counts as moving
_FALLS = 1.5  # pulses a period by which a joint that brakes is slower than before; rounding alone makes 1
_STILL = 5  # periods without a new goal after which all stand
_SHAFT_STEP = 0.015  # s, over which the acceleration of a shaft is measured
_SHAFT_STILL = 0.05  # rad/s
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Joints:
    """What robot and rig file say about the J joints of a rig, in the order of the rig file.

    Attributes:
        period: between two goals, s.
        pulse: rad.
        velocity, acceleration: limits, shape (J,), rad/s, rad/s^2.
        lower, upper: shape (J,), rad.
    """

    names: tuple[str, ...]
    ids: tuple[int, ...]
    models: tuple[str, ...]
    period: float
    zero: Array
    per_radian: Array
    velocity: Array
    acceleration: Array
    lower: Array
    upper: Array

    @property
    def pulse(self) -> Array:
        """The size of a pulse, shape (J,), rad."""
        return 1.0 / np.abs(self.per_radian)


def joints_of(robot: Path, rig: Path) -> Joints:
    """Reads the limits that both files allow."""
    limits = tomllib.loads(robot.read_text())["limits"]
    of_rig = tomllib.loads(rig.read_text())
    joints = of_rig["joints"]

    def allowed(name: str, kind: str) -> float:
        return float(limits.get("joints", {}).get(name, {}).get(kind, limits[kind]))

    turns = np.array([PULSES_PER_TURN[joint["model"]] * joint.get("gear", 1.0) for joint in joints])
    return Joints(
        names=tuple(joint["name"] for joint in joints),
        ids=tuple(joint["id"] for joint in joints),
        models=tuple(joint["model"] for joint in joints),
        period=1.0 / of_rig["rate_hz"],
        zero=np.array([float(joint["zero"]) for joint in joints]),
        per_radian=np.array([joint["direction"] for joint in joints]) * turns / (2.0 * math.pi),
        velocity=np.array([min(joint["velocity"], allowed(joint["name"], "velocity")) for joint in joints]),
        acceleration=np.array([allowed(joint["name"], "acceleration") for joint in joints]),
        lower=np.array([joint["lower"] for joint in joints]),
        upper=np.array([joint["upper"] for joint in joints]),
    )


@dataclass(frozen=True)
class Goals:
    """The goals of all joints as they passed.

    A servo is set up where it stands, by a write to it alone. Positions go on from there without a jump; whether the
    shaft was there is judged from `set_up`.

    Attributes:
        times: shape (n,), s.
        positions: shape (n, J), rad.
        lost: whether the bus was cut, shape (n,).
        set_up: time (s), joint and goal (rad) of each such write.
    """

    times: Array
    positions: Array
    lost: NDArray[np.bool_]
    set_up: list[tuple[float, int, float]] = field(default_factory=list)

    def between(self, start: float, end: float) -> Goals:
        """Those of a stretch of time, and the last ones before it."""
        first = max(0, int(np.searchsorted(self.times, start)) - 1)
        part = slice(first, int(np.searchsorted(self.times, end)))
        set_up = [one for one in self.set_up if start <= one[0] < end]
        return Goals(self.times[part], self.positions[part], self.lost[part], set_up)


def read_goals(record: Path, joints: Joints) -> Goals:
    """Reads a record of the bus; goals of some of the joints leave the others as they are."""
    readers = {TO_SERVOS: FrameReader(), TO_SERVOS + LOST: FrameReader()}
    address_of = {id: GOAL_POSITION[model] for id, model in zip(joints.ids, joints.models, strict=True)}
    place_of = {id: place for place, id in enumerate(joints.ids)}
    present: dict[int, int] = {}
    shift = np.zeros(len(joints.ids))
    times, rows, lost, set_up = [], [], [], []
    for now, way, data in entries(record):
        for id, instruction, params in readers[way].feed(data) if way in readers else ():
            goals = goals_in(id, instruction, params, address_of)
            if instruction == WRITE and id in goals and id in present:
                place = place_of[id]
                shift[place] += present[id] - goals[id]
                set_up.append((now * 1e-9, place, (goals[id] - joints.zero[place]) / joints.per_radian[place]))
            present.update(goals)
            if goals and len(present) == len(joints.ids) and instruction != WRITE:
                times.append(now * 1e-9)
                rows.append([present[id] for id in joints.ids] + shift)
                lost.append(way >= LOST)
    positions = (np.array(rows, dtype=float).reshape(-1, len(joints.ids)) - joints.zero) / joints.per_radian
    return Goals(np.array(times), positions, np.array(lost, dtype=bool), set_up)


@dataclass(frozen=True)
class Track:
    """Goals on the grid of periods.

    Attributes:
        times: when frames of each period pass, shape (K,), s.
        positions: shape (K, J), rad.
        held: whether the goals stand for lack of frames, shape (K,).
        late: how many single frames came a period late.
    """

    times: Array
    positions: Array
    held: NDArray[np.bool_]
    late: int

    def until(self, end: float) -> Track:
        """The part of it before a time, s."""
        part = slice(0, int(np.searchsorted(self.times, end)))
        return Track(self.times[part], self.positions[part], self.held[part], self.late)


def on_grid(goals: Goals, period: float, until: float) -> Track:
    """Puts goals on the grid of periods, and holds the last ones until a time, s."""
    times = goals.times
    turns = (times - times[0]) / period
    around = np.convolve(np.exp(2j * np.pi * turns), np.ones(min(_AROUND, len(turns))), "same")
    phase = np.unwrap(np.angle(around)) / (2.0 * np.pi)
    slots = np.rint(turns - phase).astype(int)
    due = times[0] + (slots + phase) * period
    for index in range(1, len(slots)):
        if slots[index] <= slots[index - 1]:
            before = slots[index - 2] if index > 1 else slots[index - 1] - 2
            if slots[index - 1] - 1 > before:
                slots[index - 1] -= 1
                due[index - 1] -= period
    first, last = int(slots[0]), int(slots[-1]) + math.floor((until - due[-1]) / period)
    last = last if last > slots[-1] + 1 else int(slots[-1])  # the last frame may just be late
    grid = np.arange(first, last + 1)
    source = np.searchsorted(slots, grid, side="right") - 1
    positions = goals.positions[source].copy()
    missing = slots[source] != grid
    starts = np.flatnonzero(missing & ~np.roll(missing, 1))
    late = 0
    for index in starts:
        alone = index + 1 < len(grid) and not missing[index + 1]
        if alone and index > 0:
            positions[index] = 0.5 * (positions[index - 1] + positions[index + 1])
            missing[index] = False
            late += 1
    ideal = due[source] + (grid - slots[source]) * period
    return Track(ideal, positions, missing, late)


def acceleration_parts(track: Track, joints: Joints) -> Array:
    """The acceleration as a part of its limit, at least, around each period, shape (K, J)."""
    parts = np.zeros_like(track.positions)
    for over in _OVER:
        if len(track.positions) > 2 * over:
            p = track.positions
            second = np.abs(p[2 * over :] - 2.0 * p[over:-over] + p[: -2 * over]) - 2.0 * joints.pulse - _ROUNDING
            part = second / ((over * joints.period) ** 2 * joints.acceleration)
            parts[over:-over] = np.maximum(parts[over:-over], part)
    return parts


def velocity_parts(track: Track, joints: Joints) -> Array:
    """The speed as a part of its limit, at least, after each period, shape (K, J)."""
    parts = np.zeros_like(track.positions)
    for over in _OVER:
        if len(track.positions) > over:
            first = np.abs(track.positions[over:] - track.positions[:-over]) - joints.pulse - _ROUNDING
            parts[:-over] = np.maximum(parts[:-over], first / (over * joints.period * joints.velocity))
    return parts


@dataclass(frozen=True)
class Standstill:
    """How goals came to stand after a moment.

    Attributes:
        braking_after: when the last moving joint began to slow down for good, s after it; None if none moved or it
            never stood.
        still_after: when all goals stood, s after it; None if they never did.
        moved: rad by which a goal moved after that.
    """

    braking_after: float | None
    still_after: float | None
    moved: float


def standstill(track: Track, joints: Joints, at: float, periods: int = _STILL) -> Standstill:
    """Judges how the goals come to stand after the time `at`, s: for so many periods, so that it counts."""
    # Row k is the step, in pulses, that arrives at period k + 1.
    steps = np.abs(np.diff(track.positions, axis=0)) / joints.pulse
    begin = int(np.searchsorted(track.times, at - _ROUNDING)) - 1  # the first step that could know of it
    if begin < 1 or begin + periods >= len(track.positions):
        return Standstill(None, None, 0.0)
    spans = np.ptp(np.lib.stride_tricks.sliding_window_view(track.positions[begin:], periods + 1, axis=0), axis=2)
    stand = np.flatnonzero((spans <= 1.5 * joints.pulse).all(axis=1))  # a pulse is what rounding can make of nothing
    still = begin + int(stand[0]) if len(stand) else None
    if still is None:
        return Standstill(None, None, 0.0)
    moved = float(np.max(np.abs(track.positions[still + 1 :] - track.positions[still]), initial=0.0))
    moved = moved if moved > 1.5 * float(joints.pulse.max()) else 0.0
    onsets = [onset for speeds in steps.T if (onset := _onset(speeds, begin, still)) is not None]
    braking = float(track.times[max(onsets) + 1] - at) if onsets else None
    return Standstill(braking, max(0.0, float(track.times[still] - at)), moved)


def _onset(speeds: Array, begin: int, still: int) -> int | None:
    """The first step of a joint's last slowing down from `begin` on; None if it does not move."""
    earliest = max(0, begin - 2)
    fast = np.flatnonzero(speeds[earliest:still] >= _MOVES)
    if not len(fast):
        return None
    row = max(begin, earliest + int(fast[-1]) + 1)  # the first slow one
    while row > begin and (
        speeds[row - 2] - speeds[row - 1] > _FALLS
        or (row > 2 and speeds[row - 2] >= speeds[row - 1] and speeds[row - 3] - speeds[row - 1] > _FALLS)
    ):
        row -= 1
    return row


@dataclass(frozen=True)
class Shafts:
    """Where the shafts really were: times (n,) and the servos' own times (n,), s, and positions (n, J), rad."""

    times: Array
    own_times: Array
    positions: Array

    def between(self, start: float, end: float) -> Shafts:
        """Those of a stretch of time."""
        part = slice(*np.searchsorted(self.times, (start, end)).tolist())
        return Shafts(self.times[part], self.own_times[part], self.positions[part])


def read_shafts(record: Path) -> Shafts:
    """Reads a record of `motiondeck rig emulate --record`."""
    head, _, rows = record.read_bytes().partition(b"\n")
    width = 2 + len(json.loads(head)["joints"])
    whole = len(rows) // (8 * width) * 8 * width
    table = np.frombuffer(rows[:whole]).reshape(-1, width)
    keep = np.diff(table[:, 1], prepend=-1.0) > 0.0
    return Shafts(table[keep, 0], table[keep, 1], table[keep, 2:])


def shaft_acceleration(shafts: Shafts, joints: Joints) -> float:
    """The largest acceleration of a shaft as a part of its limit, by the servos' own time over 15 ms."""
    if len(shafts.own_times) < 3:
        return 0.0
    step = _SHAFT_STEP / 3.0
    times = np.arange(shafts.own_times[0], shafts.own_times[-1], step)
    if len(times) < 7:
        return 0.0
    p = np.stack([np.interp(times, shafts.own_times, column) for column in shafts.positions.T], axis=1)
    second = np.abs(p[6:] - 2.0 * p[3:-3] + p[:-6]) / _SHAFT_STEP**2
    return float((second / joints.acceleration).max())


def set_up_elsewhere(goals: Goals, shafts: Shafts) -> float:
    """The largest distance, rad, between a shaft and where its servo was set up to stand."""
    if not goals.set_up or not len(shafts.times):
        return 0.0
    return max(abs(float(np.interp(at, shafts.times, shafts.positions[:, j])) - goal) for at, j, goal in goals.set_up)


def shafts_still_after(shafts: Shafts, at: float) -> float | None:
    """When all shafts stood for good, s after the time `at`; None if they moved until the end."""
    if len(shafts.times) < 2:
        return None
    speed = np.abs(np.diff(shafts.positions, axis=0)).max(axis=1) / np.maximum(np.diff(shafts.own_times), 1e-4)
    fast = np.flatnonzero(speed > _SHAFT_STILL)
    if not len(fast):
        return 0.0
    if fast[-1] >= len(speed) - 2:
        return None
    return max(0.0, float(shafts.times[fast[-1] + 1] - at))
