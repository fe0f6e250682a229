"""Learned correction: what shafts are still off after the lead is learned by motion and phase while it plays.

Iterative learning control (Bristow, Tharayil and Alleyne, "A survey of iterative learning control", 2006) with the
phase of the motion in the place of time: a correction c of each joint over the phase, a periodic cubic B-spline, is
added to the targets, and each measured error e of the shaft at phase p changes it by

    c_i <- (1 - r w) c_i + g w e,    w = B_i(p) per sample, which sums up to 1 in a round.

A joint learns nothing from the half second around a moment in which it was not free to follow: it yields, stands
still while its target moves, is far off, hot or silent, is held back by the envelope, or the run is not following.
Corrections fade in and out as motions change, and pass the envelope with the targets.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.deck.locks.lock import LoopPlace
from controller.loop.lead import Delay
from controller.motion.rotations import Array

SPACING = 0.03
"""Between the knots of a correction, s of the motion."""

LARGEST = 0.15
"""A correction is never larger, rad."""

GAIN, LEAK = 0.5, 0.005
"""g and r: the share of an error that a round corrects, and of a correction that it forgets."""

FADES = 0.3
"""How long a correction takes to fade in or out, s."""

DOUBT = 0.5
"""An error counts if the joint was free for so long before and after it, s."""

TOO_FAR = 0.2
"""A joint that is farther off is not free, rad."""

_STILL, _MOVES, _OVER = 0.25, 0.1, 0.15  # a shaft slower than a share of its target's speed; rad/s; averaged over s
_CHANGED, _AROUND = 0.005, 0.1  # rad, s; around a target that the envelope has changed by more nothing is learned
_OLDEST = 0.2  # s; older measurements are left out
_FASTEST = 0.95  # of its speed limit, at which a joint has nothing in reserve
_SLOWEST = 0.2  # tempo
_OCTAVE = math.log(1.25)  # between tempos that are learned apart
_MOST = 256  # motions, at tempos of their own
_JUMP = 0.05  # s of the motion: a phase that is farther from where it goes has jumped

Key = tuple[str, int]
"""A motion, and the class of its tempo."""


@dataclass(slots=True)
class _Voice:
    """A correction that is heard with a weight."""

    key: Key
    phase: float
    rate: float  # rounds a second
    weight: float = 0.0
    heard: bool = True  # whether it is that of the present motion


class _Sample(NamedTuple):
    """An error that does not count yet."""

    time: float
    key: Key
    phase: float
    rounds: float  # since the sample before
    error: Array


@dataclass
class Correction:
    """Corrects targets of J joints."""

    # Where the deck is, with its present tempo; None where nothing is to be corrected.
    place: Callable[[], LoopPlace | None]
    delays: Array  # from the deck to the envelope, shape (J,), s
    lead: float  # from the deck to the shafts, s
    velocity: Array  # speed limits, shape (J,), rad/s
    dt: float  # s from tick to tick
    tables: dict[Key, Array] = field(default_factory=dict)  # the spline of each motion and tempo, shape (knots, J), rad

    def __post_init__(self) -> None:
        joints = len(self.delays)
        self._present, self._wanted = np.zeros(joints), np.zeros(joints)
        self._delay = Delay(self.delays, self.dt)
        self._voices: list[_Voice] = []
        self._gain = 0.0
        self._asked: Array | None = None  # targets that are followed in this tick, rad
        self._ticks = 0
        # The picture of the last ticks, where the deck was then, and the errors that still wait to count.
        rows = math.ceil((self.lead + _OLDEST + _AROUND) / self.dt) + 2
        self._shown, self._places = np.zeros((rows, joints)), [_NOWHERE] * rows
        self._held_back = np.zeros((rows, joints), dtype=np.bool_)
        self._place = _NOWHERE
        self._samples: list[_Sample] = []
        self._doubted = np.zeros(joints)  # when each joint was last not free, s
        self._before: tuple[float, Array] | None = None
        self._speeds = np.zeros((2, joints))  # squared, of the picture and of the shafts, averaged

    def update(self) -> None:
        """Takes where the deck is after an update, and what is to be corrected there."""
        place = self.place()
        voice = self._move_voices(place)
        alone = voice is not None and place is not None and place.alone
        self._place = (voice.key, voice.phase, voice.rate) if voice is not None and alone else _NOWHERE
        total = np.zeros(len(self._present))
        for one in self._voices:
            taps, weights = _spline(one.phase, len(table := self.tables[one.key]))
            total += _smooth(one.weight) * (weights @ table[taps])
        self._wanted = self._delay(total)

    def corrected(self, targets: Array) -> Array:
        """The targets (J,), rad, of a tick in which the joints follow."""
        self._asked = targets + self._fade(1.0)
        return self._asked

    def added(self, safe: Array) -> Array:
        """What is in the safe targets (J,), rad, of this tick; joints that do not follow now do not learn."""
        if self._asked is None:
            self._doubted[:] = self._now
            self._fade(-1.0)
        else:
            self._held_back[(self._ticks + 1) % len(self._places)] = np.abs(safe - self._asked) > _CHANGED
        self._asked = None
        return self._present

    def end_tick(self, shown: Array) -> None:
        """Ends a tick in which the picture shows `shown`, shape (J,), rad."""
        self._ticks += 1
        row = self._ticks % len(self._places)
        self._shown[row], self._places[row], self._place = shown, self._place, _NOWHERE

    def learn(self, measured: Array, age: float, free: NDArray[np.bool_]) -> None:
        """Takes measured positions (J,), rad, that are `age` s old, of joints that are free to follow or not."""
        if not 0.0 <= age < _OLDEST or self._ticks < len(self._places):
            return
        meant, _ = self._at(age)
        error, now = meant - measured, self._now
        doubted = ~(free & (np.abs(error) < TOO_FAR))
        last, self._before = self._before, (now, np.stack([meant, measured]))
        passed = now - last[0] if last is not None else 0.0
        if last is None or not 0.0 < passed < DOUBT:
            self._doubted[:] = now
            return
        speeds = np.square((self._before[1] - last[1]) / passed)
        self._speeds += (speeds - self._speeds) * -math.expm1(-passed / _OVER)
        wanted, shaft = self._speeds
        self._doubted[doubted | ((wanted > _MOVES**2) & (shaft < _STILL**2 * wanted))] = now
        _, (key, phase, rate) = self._at(self.lead + age)
        if rate > 0.0:
            middle, span = self._ticks - round((self.lead + age) / self.dt), round(_AROUND / self.dt)
            around = np.arange(middle - span, min(middle + span, self._ticks) + 1)
            held_back = np.logical_or.reduce(self._held_back[around % len(self._places)])
            error[held_back | (speeds[0] > np.square(_FASTEST * self.velocity))] = np.nan
            self._samples.append(_Sample(now, key, phase, rate * passed, error))
        while self._samples and self._samples[0].time < now - DOUBT:
            self._count(self._samples.pop(0))

    @property
    def _now(self) -> float:
        return self._ticks * self.dt

    def _at(self, ago: float) -> tuple[Array, tuple[Key, float, float]]:
        """What the picture showed some time ago, before the present tick, and the place of the deck then."""
        behind = max(0.0, ago / self.dt - 1.0)
        tick, share = self._ticks - int(behind), behind % 1.0
        newer, older = (one % len(self._places) for one in (tick, tick - 1))
        key, phase, rate = self._places[newer]
        shown = self._shown[newer] + share * (self._shown[older] - self._shown[newer])
        return shown, (key, (phase - share * self.dt * rate) % 1.0, rate)

    def _fade(self, way: float) -> Array:
        self._gain = min(max(self._gain + way * self.dt / FADES, 0.0), 1.0)
        self._present = _smooth(self._gain) * self._wanted
        return self._present

    def _move_voices(self, place: LoopPlace | None) -> _Voice | None:
        """Moves the voices on to where the deck is; the one of the present motion, if it has one."""
        present, step = None, self.dt / FADES
        for voice in self._voices:
            voice.phase = (voice.phase + voice.rate * self.dt) % 1.0
            if place is not None and voice.heard and _goes_on(voice, place):
                voice.phase, voice.rate, present = place.phase, place.tempo / place.seconds, voice
        if present is None and place is not None and place.loop and place.tempo > _SLOWEST:
            present = self._new_voice(place)
        for voice in self._voices:
            voice.heard = voice is present
            voice.weight = min(1.0, voice.weight + step) if voice is present else voice.weight - step
        self._voices = [voice for voice in self._voices if voice.weight > 0.0]
        return present

    def _new_voice(self, place: LoopPlace) -> _Voice | None:
        key = place.motion, round(math.log(place.tempo) / _OCTAVE)
        if key not in self.tables:
            if len(self.tables) >= _MOST:
                return None
            self.tables[key] = np.zeros((max(8, round(place.seconds / SPACING)), len(self._present)))
        voice = _Voice(key, place.phase, place.tempo / place.seconds)
        self._voices.append(voice)
        return voice

    def _count(self, sample: _Sample) -> None:
        """Lets an error count, for the joints that were free around it."""
        table = self.tables[sample.key]
        taps, weights = _spline(sample.phase, len(table))
        share = (weights * min(1.0, sample.rounds * len(table)))[:, None]
        learned = (1.0 - LEAK * share) * table[taps] + GAIN * share * sample.error
        free = (self._doubted < sample.time - DOUBT) & np.isfinite(learned)
        table[taps] = np.where(free, np.clip(learned, -LARGEST, LARGEST), table[taps])


_NOWHERE: tuple[Key, float, float] = (("", 0), 0.0, 0.0)


def _goes_on(voice: _Voice, place: LoopPlace) -> bool:
    """Whether a deck still plays what a voice corrects, and has not jumped."""
    if voice.key[0] != place.motion or place.tempo <= _SLOWEST:
        return False
    off = (place.phase - voice.phase + 0.5) % 1.0 - 0.5
    alike = abs(math.log(place.tempo) / _OCTAVE - voice.key[1]) < 0.75
    return alike and abs(off) * place.seconds < _JUMP


def _smooth(weight: float) -> float:
    return weight * weight * (3.0 - 2.0 * weight)


def _spline(phase: float, knots: int) -> tuple[NDArray[np.int64], Array]:
    """The four knots around a phase in [0, 1), and their weights: the uniform cubic B-spline."""
    at = phase * knots
    first = math.floor(at)
    t = at - first
    weights = np.array([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]) / 6.0
    return (first + np.arange(-1, 3)) % knots, weights
