"""How far true shafts of servo20 are from the motion: open, led, learned.

Plays every loop of the shipped libraries on the emulated rig in simulated time, and 40 s with a switch every 2 s;
lets one joint jam and holds another by hand; and locks a loop to beats. Errors are those of the emulated servos' own
shafts against the targets of an output without servos, which shows them as the page does; `picture` says how far these
are from a run without a rig. Goals are judged by their differences from tick to tick. Exits with 1 if a bar is missed.
"""

from __future__ import annotations

import argparse
import json
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, astuple, dataclass, field

import numpy as np

from benchmarks.rig._followed import RATE, Array, Course, Stage, Timeline, at_times, lead_of
from benchmarks.simulated_time import EmulatedPort
from controller.deck.deck import Deck

LIBRARIES = ("thesis15", "cmu86")
MODES = ("open", "lead", "learned")
LED, LEARNED = 0.2, 0.12
"""The share of the open loop's error that may be left."""

NO_FARTHER = 1.05
"""Times as far as with lead alone shafts may be from what the deck asks for: a picture may not make up for that."""

UNWOUND = 0.004
"""rad: by so much goals may differ right after a joint was jammed or held."""

ON_BEAT = 0.01
"""s: a beat is met at the shaft."""

SETTLES = 2.0
"""s after a switch from which loops are judged."""

MODELS = ("XL330-M288", "MX-64", "MX-106")
"""Models whose emulated motors have parameters that were identified on real servos."""


def switch_to(motion: str) -> Callable[[Deck, EmulatedPort | None], None]:
    """A command."""
    return lambda deck, port: deck.switch(motion, direct=True) and None


class Judge:
    """Judges the courses of one library and motor."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self._mine = [stage.robot.joints.index(name) for name in stage.config.names]

    def errors(self, course: Course) -> Array:
        """Of the shafts against the picture, of each tick and joint of the rig, rad."""
        return (course.shafts - course.picture)[:, self._mine]

    def off(self, course: Course, reference: Course, lead: float) -> Array:
        """Of the picture against a run without a rig, rad."""
        return (course.picture - at_times(reference, reference.picture, course.deck - lead))[:, self._mine]

    def missed(self, course: Course, lead: float) -> Array:
        """Of the shafts against the deck's own targets, which may ask for more than any limit, rad."""
        return (course.shafts - at_times(course, course.wanted, course.deck - lead))[:, self._mine]

    def beyond(self, course: Course) -> float:
        """The largest part of a limit of speed or acceleration that goals have used."""
        hz, limits = self.stage.config.rate_hz, self.stage.limits
        goals = course.goals[:: round(RATE / hz)]
        speed = np.diff(goals, axis=0) * hz
        change = np.diff(speed, axis=0) * hz
        return max(
            float(np.nanmax(np.abs(speed) / limits.velocity)), float(np.nanmax(np.abs(change) / limits.acceleration))
        )


def spread(errors: Array) -> dict[str, float]:
    """RMS and worst of some errors, mrad."""
    good = errors[np.isfinite(errors).all(axis=1)]
    return {"rms": 1e3 * float(np.sqrt(np.square(good).mean())), "worst": 1e3 * float(np.abs(good).max())}


def tour(stage: Stage, rounds: int) -> tuple[Timeline, float, dict[str, tuple[float, float]]]:
    """A timeline of all loops one after the other, its duration, and when the last round of each is judged, s."""
    timeline, at, judged = list[tuple[float, Callable[[Deck, EmulatedPort | None], None]]](), 0.0, {}
    for motion in stage.loops:
        timeline.append((at, switch_to(motion)))
        at += SETTLES + rounds * stage.seconds(motion)
        judged[motion] = (at - stage.seconds(motion), at)
    return timeline, at + 1.0, judged


def hurry(stage: Stage, seconds: float, seed: int) -> Timeline:
    """A switch every 2 s."""
    rng, here = np.random.default_rng(seed), stage.loops[0]
    timeline = []
    for at in np.arange(2.0, seconds, 2.0):
        here = str(rng.choice([name for name in stage.loops if name != here]))
        timeline.append((float(at), switch_to(here)))
    return timeline


@dataclass
class Result:
    """One library on servos of one model; errors in mrad.

    Attributes:
        errors: by mode and scenario, RMS and worst. `picture` is of the picture against a run without a rig; `asked` of
            the shafts against the deck's own targets, which no limit has changed.
        by_loop: by loop and mode.
        beyond: by mode, the largest part of a limit of speed or acceleration that goals have used.
    """

    library: str
    motor: str
    lag_ms: int
    errors: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict)
    by_loop: dict[str, dict[str, dict[str, float]]] = field(default_factory=dict)
    beyond: dict[str, float] = field(default_factory=dict)
    wound_up_mrad: dict[str, float] = field(default_factory=dict)
    beat_off_ms: float | None = None


_PLAYED: dict[object, Course] = {}


def without_rig(stage: Stage, rounds: int) -> Course:
    """The tour of a run without a rig: played once in a process for all servos with the same limits."""
    limits = tuple(np.asarray(value).tobytes() for value in astuple(stage.limits))
    key = (stage.library.info.name, rounds, limits)
    if key not in _PLAYED:
        timeline, length, _ = tour(stage, rounds)
        _PLAYED[key] = stage.play(stage.loops[0], timeline, length, rigged=False)
    return _PLAYED[key]


def play(library: str, motor: str, seconds: float) -> Result:
    """All that is played of one library with servos of one model."""
    stage = Stage.of(library, motor)
    first = stage.loops[0]
    lags, judge, tables = stage.identify(), Judge(stage), {}
    result = Result(library, motor, round(1e3 * lags[0]))
    for mode in MODES:
        led = None if mode == "open" else lags
        lead = 0.0 if led is None else lead_of(led)
        learned = tables if mode == "learned" else None
        rounds = 6 if learned is not None else 2
        timeline, length, parts = tour(stage, rounds)
        course = stage.play(first, timeline, length, lags=led, learned=learned)
        off = judge.off(course, without_rig(stage, rounds), lead)
        errors, missed, late = judge.errors(course), judge.missed(course, lead), course.deck - lead
        all_of, picture, asked = list[Array](), list[Array](), list[Array]()
        for motion, (begin, end) in parts.items():
            part = (late > begin) & (late < end)
            result.by_loop.setdefault(motion, {})[mode] = spread(errors[part])
            all_of.append(errors[part])
            picture.append(off[part])
            asked.append(missed[part])
        quick = hurry(stage, seconds, 1)
        switched = stage.play(first, quick, seconds, lags=led, learned=learned)
        result.errors[mode] = {
            "loops": spread(np.concatenate(all_of)),
            "switches": spread(judge.errors(switched)[(switched.deck > SETTLES) & (switched.deck < seconds - 0.5)]),
            "picture": spread(np.concatenate(picture)),
            "asked": spread(np.concatenate(asked)),
        }
        result.beyond[mode] = max(judge.beyond(course), judge.beyond(switched))
        print(f"{library}, {motor}: {mode} {json.dumps(result.errors[mode])}", file=sys.stderr, flush=True)
    result.wound_up_mrad, result.beat_off_ms = wound_up(stage, lags, tables), beat_off(stage, lags)
    after = f"wound up {json.dumps(result.wound_up_mrad)} mrad, beats off by {result.beat_off_ms} ms"
    print(f"{library}, {motor}: limits {json.dumps(result.beyond)}, {after}", file=sys.stderr, flush=True)
    return result


def wound_up(stage: Stage, lags: Array, tables: dict[tuple[str, int], Array]) -> dict[str, float]:
    """By how much goals of a jammed and of a held joint differ, once they are free, from those of a run without, mrad.

    That run stops learning when the others begin, and goals are compared before a joint that was not free may learn
    again: so what differs is what was learned of a joint that could not follow.
    """
    motion = stage.loops[-1]
    seconds = stage.seconds(motion)
    rounds = int(np.ceil(3.0 / seconds))
    begins, span = rounds * seconds, rounds * seconds
    jammed, held = (stage.config.names.index(name) for name in ("r_elbow", "l_hip_pitch"))
    there = [0.0]

    def disturb(deck: Deck, port: EmulatedPort | None) -> None:
        if port is None:
            return
        now = begins + span < deck.time < begins + 2.0 * span
        jam, hold = port.bus.devices[jammed], port.bus.devices[held]
        jam.bank.drive.jammed[jam.row] = now
        turn = float(hold.bank.shaft[hold.row])
        if not now:
            there[0] = turn
        # A hand that gives a tenth of a radian for three quarters of the stall torque.
        off = (turn - there[0]) / abs(stage.config.joints[held].pulses_per_radian)
        hold.bank.drive.load[hold.row] = np.clip(7.5 * off, -0.75, 0.75) if now else 0.0

    courses = []
    for each, until in ((disturb, np.inf), (None, begins + span)):
        copied = {key: table.copy() for key, table in tables.items()}
        courses.append(stage.play(motion, [], begins + 3.0 * span, lags=lags, each=each, learned=copied, until=until))
    times = begins + 2.0 * span + np.arange(0.25, 1.25, 1.0 / RATE)  # joints that have yielded are back by then
    said = {}
    for kind, device in (("jammed", jammed), ("held", held)):
        joint = stage.robot.joints.index(stage.config.names[device])
        after, never = (np.interp(times, course.deck, course.goals[:, joint]) for course in courses)
        said[kind] = 1e3 * float(np.abs(after - never).max())
    return said


def beat_off(stage: Stage, lags: Array) -> float | None:
    """How late shafts meet beats, ms: by the shift at which they are nearest to the motion at the beats' phase.

    None for a library without a phase, which cannot be locked.
    """
    motion = stage.loops[0]
    if stage.library.network.as_phase_network is None:
        return None
    period = stage.seconds(motion) / 2.0 * 0.93
    beats = [(float(at), lambda deck, port: deck.beat()) for at in np.arange(1.0, 20.0, period)]
    timeline = [(0.5, lambda deck, port: deck.lock("beat", 0.0, 2)), *beats]
    plain = stage.play(motion, [], 3.0 * stage.seconds(motion), rigged=False)
    phases = np.mod(plain.deck / stage.seconds(motion), 1.0)
    late = plain.deck > 1.0
    order = np.argsort(phases[late])
    by_phase, poses = phases[late][order], plain.picture[late][order]
    course = stage.play(motion, timeline, 20.0, lags=lags)
    good = (course.deck > 14.0) & (course.deck < 19.5)
    times, shafts = course.deck[good], course.shafts[good]
    shifts = np.arange(-0.12, 0.12, 0.001)
    # Beats fall on phase 0 and on half a round: which of both is the lock's choice.
    off = {}
    for half in (0.0, 0.5):
        for shift in shifts.tolist():
            phase = np.mod((times - 1.0 - shift) / (2.0 * period) + half, 1.0)
            meant = np.column_stack([np.interp(phase, by_phase, column, period=1.0) for column in poses.T])
            off[half, shift] = float(np.nanmean(np.square(shafts - meant)))
    return 1e3 * min(off, key=lambda key: off[key])[1]


def judged(found: list[Result]) -> list[str]:
    """What misses its bar; of both libraries together, by model of the servos."""
    missed = []
    for motor in dict.fromkeys(one.motor for one in found):
        mine = [one for one in found if one.motor == motor]
        for scenario in ("loops", "switches"):
            rms = {mode: np.sqrt(np.mean([one.errors[mode][scenario]["rms"] ** 2 for one in mine])) for mode in MODES}
            for mode, bar in (("lead", LED), ("learned", LEARNED)):
                left = rms[mode] / rms["open"]
                print(f"{motor}: {mode} leaves {left:.3f} of {rms['open']:.1f} mrad in {scenario}", file=sys.stderr)
                if left > bar:
                    missed.append(f"{motor}: {mode} leaves {left:.3f} of the open loop in {scenario}")
    for one in found:
        where = f"{one.library}, {one.motor}"
        learned, led = (one.errors[mode]["asked"]["rms"] for mode in ("learned", "lead"))
        if learned > NO_FARTHER * led:
            missed.append(f"{where}: learned is {learned:.1f} mrad off what is asked, lead {led:.1f}")
        for mode in MODES:
            if one.beyond[mode] > 1.0 + 1e-6:
                missed.append(f"{where}: goals of {mode} use {one.beyond[mode]:.3f} of a limit")
        for kind, by in one.wound_up_mrad.items():
            if by > 1e3 * UNWOUND:
                missed.append(f"{where}: goals of the {kind} joint differ by {by:.1f} mrad afterwards")
        if one.beat_off_ms is not None and abs(one.beat_off_ms) > 1e3 * ON_BEAT:
            missed.append(f"{where}: beats are {one.beat_off_ms:.0f} ms off at the shaft")
    return missed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--libraries", nargs="*", default=LIBRARIES)
    parser.add_argument("--motors", nargs="*", default=MODELS, help="models of the 20 servos")
    parser.add_argument("--seconds", type=float, default=40.0, help="of switches")
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    jobs = [(library, motor, arguments.seconds) for library in arguments.libraries for motor in arguments.motors]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        found = [*pool.map(play, *zip(*jobs, strict=True))]
    missed = judged(found)
    print(json.dumps({"results": [asdict(one) for one in found], "missed": missed}, indent=1))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
