"""Identification of a rig: each joint answers a small chirp while the others hold, and any surprise ends it.

A surprise is whatever the rig's health reports (heat, a lost answer, a low supply, a hardware error), more than half of
the allowed current, and a shaft that does not go with its targets. The joint is then braked within its limits and led
to where it stands; the rig is left switched on.

    target   x(t) = center + a(t) sin(phase(t)),  its frequency rises from LOWEST to HIGHEST within SECONDS
    shaft    y(t) = offset + gain x(t - lag) - dead sign(x'(t - lag))
    current  i(t) = offset + friction sign(y') + c1 y' + c2 y'' + c3 y

Lag, gain and friction follow from the answers: the shaft's equation is fitted by least squares for every lag, and the
best is taken; that of the current with y from it. A lag holds for targets as they are sent: it has the half tick in
which each waits for the next, and the way to the servo.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hardware.errors import RigError
from hardware.rig.rig_file import RigJoint
from hardware.rig.scale import Array
from hardware.rig.supervision.pace import allowed_current
from hardware.rig.supervision.rig import Rig

LOWEST, HIGHEST = 0.4, 2.0  # Hz
SECONDS = 8.0
LATEST = 0.4  # the longest lag that is looked for, s
_SWING, _LEAST_SWING = 0.2, 0.03  # rad
_MARGIN = 0.05  # rad kept away from the joint's limits
_SPEED, _ACCELERATION, _MOST_ACCELERATION = 0.5, 0.5, 10.0  # of the joint's limits; rad/s^2
_SLOW, _TURNS = 0.02, 0.1  # rad/s, below which a shaft's direction is uncertain, above which it surely turns
_NEAR = 0.01  # s between the targets of which speeds are differences
_TAPER = 1.0  # s in which it grows and ends
_SETTLING = 0.5  # s of holding, before the joint moves and before and after its chirp
_MOST_CURRENT = 0.5  # of the allowed one
_READINGS = 3  # in a row with more current are a surprise
_WATCHED, _MOVED, _FOLLOWED = 0.6, 0.12, 0.25  # s in which the shaft goes by this part with targets that go so far, rad
_LATE, _AWAY = 0.25, 0.05  # s, rad: how far behind its targets a shaft may be
_TICK_BYTES, _JOINT_BYTES, _BITS = 28, 10, 10  # of goals and request on the wire, before a servo measures


@dataclass(frozen=True, slots=True)
class Chirp:
    """A swing around `center` (rad) by at most `swing` (rad), within a speed (rad/s) and an acceleration (rad/s^2)."""

    center: float
    swing: float
    speed: float
    acceleration: float

    def at(self, time: float) -> float:
        """The target at a time from 0 to SECONDS, rad."""
        time = min(max(time, 0.0), SECONDS)
        rise = (HIGHEST - LOWEST) / SECONDS
        omega = 2.0 * math.pi * (LOWEST + rise * time)
        # The least of the three, without a kink where another one takes over.
        most = (self.swing, self.speed / omega, self.acceleration / omega**2)
        amplitude = sum(one**-4 for one in most) ** -0.25
        grown = min(1.0, time / _TAPER, (SECONDS - time) / _TAPER)
        phase = 2.0 * math.pi * (LOWEST * time + 0.5 * rise * time * time)
        return self.center + amplitude * math.sin(0.5 * math.pi * grown) ** 2 * math.sin(phase)


def chirp_of(joint: RigJoint, position: float) -> Chirp:
    """The chirp of a joint around where it stands, or as near as its limits allow; RigError if there is no room."""
    low, high = joint.lower + _MARGIN, joint.upper - _MARGIN
    swing = min(_SWING, 0.5 * (high - low))
    if swing < _LEAST_SWING:
        raise RigError(f"{joint.label} cannot be identified: a range of {joint.upper - joint.lower:.2f} rad is small.")
    center = min(max(position, low + swing), high - swing)
    limit = joint.acceleration or math.inf
    # A growing swing adds a little to the speed of one that has grown.
    return Chirp(center, swing, _SPEED * joint.velocity, min(_ACCELERATION * limit, _MOST_ACCELERATION))


class ChirpAnswers(NamedTuple):
    """What was sent to a joint and measured of it, in order of time; the first two (N,), the others (M,)."""

    sent_at: Array  # s
    targets: Array  # rad
    read_at: Array  # when it was asked for what follows, s
    positions: Array  # rad
    currents: Array  # A


class Response(NamedTuple):
    """How a joint answers."""

    lag: float  # of the shaft behind its targets, s
    gain: float  # of the shaft's swing to that of its targets
    friction: float  # the current that turns it slowly, A
    before: float  # of the shaft from its targets, without the constant part, rad RMS
    after: float  # the same from its targets one lag ago


def response(answers: ChirpAnswers) -> Response:
    """Lag, gain and friction of a joint; RigError if answers are too few, or the shaft did not follow its targets."""
    known = answers.read_at >= answers.sent_at[0] + LATEST
    if np.count_nonzero(known) < 100:
        raise RigError("too few answers came back to identify anything. Check the cable, then try again.")
    read_at, y, current = answers.read_at[known], answers.positions[known], answers.currents[known]

    def targets(lag: float) -> Array:
        return np.interp(read_at - lag, answers.sent_at, answers.targets)

    def fitted(lag: float) -> tuple[float, Array]:
        x, speed = targets(lag), (targets(lag - _NEAR) - targets(lag + _NEAR)) / (2.0 * _NEAR)
        terms = np.column_stack((x, _direction(speed), np.ones_like(x)))
        found: Array = np.linalg.lstsq(terms, y, rcond=None)[0].astype(np.float64)
        return float(np.square(y - terms @ found).mean()), found

    lag = 0.0
    for step, reach in ((0.01, LATEST), (0.001, 0.01), (0.0001, 0.001)):
        near = np.arange(max(0.0, lag - reach), lag + reach + 0.5 * step, step)
        lag = float(near[np.argmin([fitted(one)[0] for one in near])])
    gain = float(fitted(lag)[1][0])
    if gain < 0.2 or lag >= LATEST:
        raise RigError(f"the shaft does not move with its targets (gain {gain:.2f}, lag {lag * 1e3:.0f} ms).")
    before, after = (float(np.std(y - targets(late))) for late in (0.0, lag))
    return Response(lag, gain, _friction(lag, targets, y, current), before, after)


def _direction(speed: Array) -> Array:
    """The sign of a speed (rad/s), without a jump at rest."""
    return speed / (np.abs(speed) + _SLOW)


def _friction(lag: float, targets: Callable[[float], Array], y: Array, current: Array) -> float:
    x = {shift: targets(lag + shift) for shift in (-_NEAR, 0.0, _NEAR)}
    speed, bend = (x[-_NEAR] - x[_NEAR]) / (2.0 * _NEAR), (x[-_NEAR] - 2.0 * x[0.0] + x[_NEAR]) / _NEAR**2
    turns = np.abs(speed) > _TURNS
    terms = np.column_stack((np.sign(speed), speed, bend, y, np.ones_like(y)))[turns]
    return max(0.0, float(np.linalg.lstsq(terms, current[turns], rcond=None)[0][0]))


class Stopped(Exception):
    """The identification was asked to stop; the joint was braked."""


class JointTrials:
    """Identifies the joints of a rig that is switched on, one after the other."""

    def __init__(
        self, rig: Rig, now: Callable[[], float], sleep: Callable[[float], None], asked: Callable[[], bool]
    ) -> None:
        """Args: the rig; its clock, s; how to wait, s; and whether to brake and stop, asked in every tick."""
        self._rig, self._now, self._sleep, self._asked = rig, now, sleep, asked
        self._period = 1.0 / rig.config.rate_hz
        self._targets = rig.goals.copy()
        self._due, self._speed = now(), 0.0

    def joint(self, index: int) -> Response:
        """Moves a joint through its chirp and back to where it stood, and returns how it answered.

        RigError after a surprise, or if the answers are of no use; it names the joint. Stopped if it was asked to stop.
        """
        joint, start = self._rig.config.joints[index], float(self._targets[index])
        chirp = chirp_of(joint, start)
        watch, log = _Watch(self._rig, index, chirp), _Log(self._rig, index)
        held = round(_SETTLING / self._period)
        swing = [chirp.at((tick - held) * self._period) for tick in range(round(SECONDS / self._period) + 2 * held)]
        try:
            self._follow(index, [start] * held, watch)
            self._follow(index, _way(start, chirp.center, chirp, self._period), watch)
            self._follow(index, swing, watch, log)
            self._follow(index, _way(chirp.center, start, chirp, self._period), watch)
        except (_Surprise, Stopped) as ended:
            self._brake(index, chirp)
            if isinstance(ended, Stopped):
                raise
            raise RigError(f"{ended}. The joint was braked; nothing is written.") from None
        with RigError.placed(joint.label):
            return response(log.answers)

    def _follow(
        self, index: int, targets: Iterable[float], watch: _Watch | None = None, log: _Log | None = None
    ) -> None:
        """Sends a joint these targets, one a tick, and takes its answers."""
        for target in targets:
            self._due = max(self._due + self._period, self._now())
            self._sleep(max(0.0, self._due - self._now()))
            answered = self._rig.collect_state()
            if log is not None:
                log.read(answered)
            if watch is not None:
                watch.look(float(self._targets[index]), target)
                if self._asked():
                    raise Stopped
            self._speed = (target - self._targets[index]) / self._period
            self._targets[index] = target
            if log is not None:
                log.sent(self._now(), target)
            self._rig.write(self._targets)

    def _brake(self, index: int, chirp: Chirp) -> None:
        """Brakes a joint's target within its acceleration, then leads it to where the shaft stands."""
        target, speed, path = float(self._targets[index]), self._speed, []
        while speed:
            speed = math.copysign(max(0.0, abs(speed) - chirp.acceleration * self._period), speed)
            path.append(target := target + speed * self._period)
        self._due -= self._period  # the tick that was broken off has no target yet
        self._follow(index, path)
        self._follow(index, _way(target, float(self._rig.positions[index]), chirp, self._period))


class _Surprise(Exception):
    """What a joint did that it should not, as a sentence without a full stop."""


class _Watch:
    """Looks at a joint in every tick, and raises _Surprise."""

    def __init__(self, rig: Rig, index: int, chirp: Chirp) -> None:
        self._rig, self._index, self._joint = rig, index, rig.config.joints[index]
        self._most = _MOST_CURRENT * allowed_current(self._joint)
        self._moved = min(_MOVED, 1.5 * chirp.swing)
        self._above = 0
        self._seen: deque[tuple[float, float]] = deque(maxlen=round(_WATCHED * rig.config.rate_hz))
        self._sag = self._fastest = 0.0

    def look(self, target: float, next_target: float) -> None:
        """Looks at what was measured last, rad and A, beside the targets of this tick and the next, rad."""
        rig, index, name = self._rig, self._index, self._joint.label
        for incident in rig.incidents:
            if incident.fault:
                raise _Surprise(f"{incident.source} {incident.what}")
        current, position = float(rig.currents[index]), float(rig.positions[index])
        self._above = self._above + 1 if abs(current) > self._most else 0
        if self._above >= _READINGS:
            raise _Surprise(f"{name} draws {abs(current):.2f} A, more than {self._most:.2f} A for a small swing")
        self._seen.append((target, position))
        moved, followed = np.ptp(np.array(self._seen), axis=0).tolist()
        if moved > self._moved and followed < _FOLLOWED * moved and len(self._seen) == self._seen.maxlen:
            raise _Surprise(f"{name} does not follow: it moved {followed:.2f} rad of {moved:.2f}")
        self._fastest = max(self._fastest, abs(next_target - target) * rig.config.rate_hz)
        if not self._fastest:
            self._sag = target - position
        late = abs(target - position - self._sag)
        if late > _LATE * self._fastest + _AWAY:
            raise _Surprise(f"{name} is {late:.2f} rad from its target")


class _Log:
    def __init__(self, rig: Rig, index: int) -> None:
        self._rig, self._index = rig, index
        part = next(part for part in rig.config.parts if rig.names[index] in part.names)
        self._delay = _BITS * (_TICK_BYTES + _JOINT_BYTES * len(part.joints)) / part.baud
        self._sent: list[tuple[float, float]] = []
        self._read: list[tuple[float, float, float]] = []
        self._last, self._late = 0.0, False

    def sent(self, at: float, target: float) -> None:
        """A target (rad) that leaves now, with the request for the next answer."""
        self._sent.append((at, target))

    def read(self, answered: bool) -> None:
        """Takes the joint's answer to the last request; one that came after an unanswered tick may be older."""
        rig, index = self._rig, self._index
        read_at = float(rig.measured.read_at[index])
        fresh, self._last = read_at != self._last, read_at
        if fresh and self._sent and not self._late:
            at = self._sent[-1][0] + self._delay
            self._read.append((at, float(rig.positions[index]), float(rig.currents[index])))
        self._late = not answered

    @property
    def answers(self) -> ChirpAnswers:
        sent, read = np.array(self._sent).reshape(-1, 2), np.array(self._read).reshape(-1, 3)
        return ChirpAnswers(sent[:, 0], sent[:, 1], read[:, 0], read[:, 1], read[:, 2])


def _way(start: float, end: float, chirp: Chirp, period: float) -> Iterator[float]:
    """Targets of a way at half the chirp's speed and acceleration, rad, one a period (s)."""
    way = abs(end - start)
    seconds = max(1.5 * way / (0.5 * chirp.speed), math.sqrt(6.0 * way / (0.5 * chirp.acceleration)), 1e-9)
    for step in range(1, math.ceil(seconds / period) + 1):
        share = min(1.0, step * period / seconds)
        yield start + (end - start) * share * share * (3.0 - 2.0 * share)
