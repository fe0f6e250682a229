"""Learned correction: what shafts are still off after the lead is learned by motion and phase while it plays.

Iterative learning control (Bristow, Tharayil and Alleyne, "A survey of iterative learning control", 2006) with the
phase of the motion in the place of time: a correction c of each joint over the phase, a periodic cubic B-spline, is
added to the targets, and each measured error e of the shaft at phase p changes it by

    c_i <- c_i + w (g e - u - r (c_i - (c_(i-1) + c_(i+1)) / 2)),    w = B_i(p) per sample: 1 in a round
    c_(i-1) <- c_(i-1) + w u

Targets pass an envelope of their own without the correction: this is the picture, from which e is measured. What the
limits of speed and acceleration refuse of a correction, u, moves a knot ahead in each round, to where a joint can still
begin earlier; what the ends of its range refuse is taken back. So nothing winds up at limits.

A joint learns nothing from the half second around a moment in which it was not free to follow: it yields, stands still
while its target moves, is far off, hot or silent, or the run is not following. Corrections fade as motions change.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from controller.deck.interfaces import JointLimits
from controller.deck.locks.phase_lock import LoopPlace
from controller.loop.lead import Delay
from controller.loop.safety.compiled_envelope import safety_envelope
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import Array, Flags, Indices

SPACING = 0.03  # between the knots of a correction, s of the motion
LARGEST = 0.15  # a correction is never larger, rad
GAIN, SMOOTHING = 0.4, 0.3  # g and r: the shares of an error, and of a correction's roughness, that a round takes away
FADES = 0.3  # s in which a correction fades in or out
DOUBT = 0.5  # an error counts if the joint was free for so long before and after it, s
TOO_FAR = 0.2  # a joint that is farther off is not free, rad
_STILL, _MOVES, _OVER = 0.25, 0.1, 0.15  # a shaft slower than a share of its target's speed; rad/s; averaged over s
_OLDEST = 0.2  # s; older measurements are left out
_BACK = 0.5  # of the rate at which jerk changes acceleration: how fast a refused goal comes back
_SLOWEST = 0.2  # tempo
_OCTAVE = math.log(1.25)  # between tempos that are learned apart
_MOST = 256  # motions, at tempos of their own
_JUMP = 0.05  # s of the motion: a phase that is farther from where it goes has jumped

Key = tuple[str, int]  # a motion, and the class of its tempo


@dataclass(slots=True)
class _Voice:
    """A correction that is heard with a weight."""

    key: Key
    phase: float
    rate: float  # rounds a second
    weight: float = 0.0
    heard: bool = True  # whether it is that of the present motion


class _Sample(NamedTuple):
    """What an error changes once it counts."""

    time: float
    key: Key
    phase: float
    rounds: float  # since the sample before
    change: Array
    moved: Array  # ahead


@dataclass
class Correction:
    """Corrects targets of J joints."""

    # Where the deck is, with its present tempo; None where nothing is to be corrected.
    place: Callable[[], LoopPlace | None]
    delays: Array  # from the deck to the envelope, shape (J,), s
    lead: float  # from the deck to the shafts, s
    limits: JointLimits
    dt: float  # s from tick to tick
    tables: dict[Key, Array] = field(default_factory=dict)  # the spline of each motion and tempo, shape (knots, J), rad

    def __post_init__(self) -> None:
        joints = len(self.delays)
        self._wanted, self._added, self._refused = np.zeros(joints), np.zeros(joints), np.zeros(2 * joints)
        self._back = np.exp(-_BACK * self.limits.jerk / self.limits.acceleration * self.dt)
        self._off = np.zeros(joints), np.zeros(joints)  # of goals from their aims in the last two ticks, rad
        self._to_envelope = Delay(self.delays, self.dt)
        self._to_shafts = Delay(np.tile(self.lead - self.delays, 2), self.dt)
        self._plain = safety_envelope(self.limits, self.dt)
        self._voices: list[_Voice] = []
        self._gain = 0.0
        self._follows, self._followed = False, False  # whether joints do in this tick, and did in the one before
        self._ticks = 0
        # The picture of the last ticks, what was refused of the correction that shafts have then (in all, and by limits
        # of speed and acceleration), and where the deck was; and the errors that still wait to count.
        rows = math.ceil((self.lead + _OLDEST) / self.dt) + 2
        self._shown, self._places = np.zeros((rows, 3, joints)), [_NOWHERE] * rows
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
        total = np.zeros(len(self._wanted))
        for one in self._voices:
            taps, weights = _spline(one.phase, len(table := self.tables[one.key]))
            total += _smooth(one.weight) * (weights @ table[taps])
        self._wanted = self._to_envelope(total)

    def follow(self, targets: Array, envelope: SafetyEnvelope) -> Array:
        """The safe targets (J,), rad, of a tick in which the joints follow targets (J,), corrected."""
        if not self._followed:
            self._plain.restart(np.full(len(targets), True), envelope.position - self._added)
            self._plain.changed = envelope.changed  # so that targets which limits change are counted
            self._off = np.zeros(len(targets)), np.zeros(len(targets))
        self._follows, self._gain = True, min(self._gain + self.dt / FADES, 1.0)
        wanted, shown = _smooth(self._gain) * self._wanted, self._plain(targets)
        aim = shown + wanted
        # Refused goals come back to their aim smoothly: one that rushed would be late when the aim turns round.
        off, before = self._off
        safe = envelope(aim + self._back * (2.0 * off - self._back * before), near=True)
        self._off = safe - aim, off
        self._added = safe - shown
        reachable = np.clip(aim, self.limits.lower, self.limits.upper)
        self._refused[:] = np.concatenate([aim - safe, reachable - safe])
        return safe

    def added(self) -> Array:
        """What is in the safe targets of this tick, shape (J,), rad; joints that do not follow now do not learn."""
        if not self._follows:
            self._doubted[:] = self._now
            gain = max(self._gain - self.dt / FADES, 0.0)
            self._added = self._added * (_smooth(gain) / _smooth(self._gain) if gain else 0.0)
            self._gain = gain
        self._follows, self._followed = False, self._follows
        return self._added

    def end_tick(self, shown: Array) -> None:
        """Ends a tick in which the picture shows `shown`, shape (J,), rad."""
        self._ticks += 1
        row = self._ticks % len(self._places)
        self._shown[row] = shown, *self._to_shafts(self._refused).reshape(2, -1)
        self._places[row], self._place = self._place, _NOWHERE

    def learn(self, measured: Array, age: float, free: Flags) -> None:
        """Takes measured positions (J,), rad, that are `age` s old, of joints that are free to follow or not."""
        if not 0.0 <= age < _OLDEST or self._ticks < len(self._places):
            return
        (meant, refused, moved), _ = self._at(age)
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
            self._samples.append(_Sample(now, key, phase, rate * passed, GAIN * error - refused, moved))
        while self._samples and self._samples[0].time < now - DOUBT:
            self._count(self._samples.pop(0))

    @property
    def _now(self) -> float:
        return self._ticks * self.dt

    def _at(self, ago: float) -> tuple[Array, tuple[Key, float, float]]:
        """What was shown and refused some time ago, before the present tick, and the place of the deck then."""
        behind = max(0.0, ago / self.dt - 1.0)
        tick, share = self._ticks - int(behind), behind % 1.0
        newer, older = (one % len(self._places) for one in (tick, tick - 1))
        key, phase, rate = self._places[newer]
        shown = self._shown[newer] + share * (self._shown[older] - self._shown[newer])
        return shown, (key, (phase - share * self.dt * rate) % 1.0, rate)

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
            self.tables[key] = np.zeros((max(8, round(place.seconds / SPACING)), len(self._wanted)))
        voice = _Voice(key, place.phase, place.tempo / place.seconds)
        self._voices.append(voice)
        return voice

    def _count(self, sample: _Sample) -> None:
        """Lets an error count, for the joints that were free around it."""
        table = self.tables[sample.key]
        taps, weights = _spline(sample.phase, len(table))
        share = (weights * min(1.0, sample.rounds * len(table)))[:, None]
        free = self._doubted < sample.time - DOUBT
        rough = table[taps] - 0.5 * (table[taps - 1] + table[(taps + 1) % len(table)])
        table[taps] += np.where(free, share * (sample.change - SMOOTHING * rough), 0.0)
        table[taps - 1] += np.where(free, share * sample.moved, 0.0)
        np.clip(table, -LARGEST, LARGEST, out=table)


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


def _spline(phase: float, knots: int) -> tuple[Indices, Array]:
    """The four knots around a phase in [0, 1), and their weights: the uniform cubic B-spline."""
    at = phase * knots
    first = math.floor(at)
    t = at - first
    weights = np.array([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]) / 6.0
    return (first + np.arange(-1, 3)) % knots, weights
