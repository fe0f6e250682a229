"""How a joint answers its targets: a small chirp to ask with, and lag, gain and friction from what came back.

    target   x(t) = center + a(t) sin(phase(t)),  its frequency rises from LOWEST to HIGHEST within SECONDS
    shaft    y(t) = offset + gain x(t - lag) - dead sign(x'(t - lag))
    current  i(t) = offset + friction sign(y') + c1 y' + c2 y'' + c3 y

The first is fitted by least squares for every lag, and the best is taken; the second with y from the first. A lag holds
for targets as they are sent: it has the half tick in which each waits for the next, and the way to the servo.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hardware.errors import RigError
from hardware.rig.rig_file import RigJoint
from hardware.rig.scale import Array

LOWEST, HIGHEST = 0.4, 2.0  # Hz
SECONDS = 8.0
LATEST = 0.4  # the longest lag that is looked for, s
_SWING, _LEAST_SWING = 0.2, 0.03  # rad
_MARGIN = 0.05  # rad kept away from the joint's limits
_SPEED, _ACCELERATION, _MOST_ACCELERATION = 0.5, 0.5, 10.0  # of the joint's limits; rad/s^2
_SLOW, _TURNS = 0.02, 0.1  # rad/s, below which a shaft's direction is uncertain, above which it surely turns
_NEAR = 0.01  # s between the targets of which speeds are differences
_TAPER = 1.0  # s in which it grows and ends


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
        raise RigError(
            f"{joint.label} cannot be identified: its range of {joint.upper - joint.lower:.2f} rad is small."
        )
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
    start = answers.sent_at[0] + LATEST
    known = answers.read_at >= start
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
    return Response(
        lag, gain, _friction(lag, targets, y, current), _spread(y - targets(0.0)), _spread(y - targets(lag))
    )


def _direction(speed: Array) -> Array:
    """The sign of a speed (rad/s), without a jump at rest."""
    return speed / (np.abs(speed) + _SLOW)


def _spread(error: Array) -> float:
    return float(np.std(error))


def _friction(lag: float, targets: Callable[[float], Array], y: Array, current: Array) -> float:
    x = {shift: targets(lag + shift) for shift in (-_NEAR, 0.0, _NEAR)}
    speed, bend = (x[-_NEAR] - x[_NEAR]) / (2.0 * _NEAR), (x[-_NEAR] - 2.0 * x[0.0] + x[_NEAR]) / _NEAR**2
    turns = np.abs(speed) > _TURNS
    terms = np.column_stack((np.sign(speed), speed, bend, y, np.ones_like(y)))[turns]
    return max(0.0, float(np.linalg.lstsq(terms, current[turns], rcond=None)[0][0]))
