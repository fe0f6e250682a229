"""Transitions between all ordered pairs of motions: the thesis's morphing and the deck's switching side by side.

The thesis ramps mu from 0 to 1 over RAMP frames inside the network (eqs 3.7, 3.16); the deck starts the target where it
resembles the body most and turns the bones there (`controller/deck/joins/transition.py`). For each pair the joints'
peak velocity, acceleration and jerk during the transition are divided by the larger of both motions' own peaks: 1 means
no brisker than what was recorded. Joints are seen relative to the root, with its height, from a place in the world that
does not turn: where only one motion turns, a body that goes on smoothly jerks as seen from its own heading.
"""

from dataclasses import dataclass, replace
from itertools import chain
from math import inf

import numpy as np
from joblib import delayed
from threadpoolctl import threadpool_limits

from controller.deck.deck import Deck
from controller.deck.performance import Joining
from controller.learning.evaluation.failure_rates import Tick, gathered
from controller.learning.measures.self_test import Judge, distances
from controller.learning.training_set import TrainingSet
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.bone_directions import FIRST_BONE, HEIGHT, TURN_RATE
from controller.motion.encodings.motion_matching import LOST_MM, joint_features
from controller.motion.rotations import Array, rotate, yaw
from controller.motion.skeleton import Posture
from controller.networks.clip.network import ClipPlayer
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.jobs import ALONE, Jobs

RAMP = 120
LONGEST = 3600
AFTER = 12

METHODS = ("morph", "deck", "crossfade", "cut", "clip player")
"""The thesis's mu ramp; the deck's default; the deck with a cross-fade, without a fade, and playing the recordings."""

JOININGS: dict[str, Joining] = {"crossfade": "crossfade", "cut": "cut"}


@dataclass(frozen=True)
class MeasuredTransition:
    """One transition; peaks over the larger of both motions' own."""

    source: str
    target: str
    method: str  # one of METHODS
    frames: int  # of the transition
    velocity: float
    acceleration: float
    jerk: float
    bone_error: float  # largest |length / true length - 1| of a bone on the way
    failed: bool  # whether another motion than the target played afterwards
    reason: str  # why, or ""


def all_crossings(
    library: MotionLibrary, syllabus: TrainingSet, *, jobs: Jobs = ALONE, tick: Tick = lambda: None
) -> list[MeasuredTransition]:
    """All ordered pairs with all methods; one switch per pair, at a random moment of the source.

    `syllabus` has the frames that the library's network learned, to judge by; `tick` is called after each source.
    MotiondeckError if the motions were taught on a rig: they have no bones to be judged by.
    """
    if library.skeleton.is_rig:
        raise MotiondeckError(
            f"library '{library.info.name}' holds the joint angles of a rig, and transitions are judged by where the "
            "joints of a body go. How closely a rig follows a switch is in the report of: motiondeck play --json"
        )
    peaks = {name: _own_peaks(syllabus, frames, syllabus.loops[name]) for name, frames in syllabus.frames.items()}
    tasks = (delayed(_from)(source, library, syllabus, syllabus.judge, peaks) for source in syllabus.frames)
    return list(chain.from_iterable(gathered(tasks, jobs, tick)))


def _from(
    source: str, library: MotionLibrary, syllabus: TrainingSet, judge: Judge, peaks: dict[str, Array]
) -> list[MeasuredTransition]:
    crossings, motions = [], list(syllabus.frames)
    recorded = replace(library, network=ClipPlayer(syllabus.frames, syllabus.loops))
    # The thesis morphs within a reservoir that runs by itself.
    methods = METHODS if library.network.as_autonomous is not None else METHODS[1:]
    with threadpool_limits(1):
        for target in motions:
            if target == source:
                continue
            rng = np.random.default_rng([motions.index(source), motions.index(target)])
            # A one-shot has come to its end.
            begin = RAMP + int(rng.integers(RAMP)) if judge.loops[source] else len(syllabus.frames[source])
            after = 2 * len(syllabus.frames[target]) if judge.loops[target] else len(syllabus.frames[target]) + RAMP
            for method in methods:
                played = recorded if method == "clip player" else library
                if method == "morph":
                    run, start, end = _morphed(library, source, target, begin, after)
                else:
                    run, start, end = _switched(played, source, target, begin, after, JOININGS.get(method))
                crossings.append(_measured(source, target, method, run, start, end, judge, peaks))
    return crossings


def _morphed(library: MotionLibrary, source: str, target: str, begin: int, after: int) -> tuple[Array, int, int]:
    """The channels of a run with a transition, and the frames where it begins and ends."""
    network = library.network.twin()
    autonomous = network.as_autonomous
    assert autonomous is not None, "only a network that runs by itself is morphed"
    run = np.empty((begin + RAMP + after, network.channels))
    network.cue(source, 0)
    with np.errstate(all="ignore"):
        for frame in run[:begin]:
            network.advance(frame)
        on_the_way = autonomous.morph(source, target)
        for step, frame in enumerate(run[begin : begin + RAMP], start=1):
            on_the_way.advance(step / RAMP, frame)
        on_the_way.settle()
        for frame in run[begin + RAMP :]:
            network.advance(frame)
    return run, begin, begin + RAMP


def _switched(
    library: MotionLibrary, source: str, target: str, begin: int, after: int, joining: Joining | None
) -> tuple[Array, int, int]:
    # Only the body is measured, so any vector serves as joints.
    deck = Deck(library, lambda pose: pose.root_position, source, joining=joining)
    dt = 1.0 / library.info.rate
    shown = [deck.posture]
    for _ in range(begin):
        deck.update(dt)
        shown.append(deck.posture)
    deck.switch(target)
    end = begin
    while len(shown) < end + after:
        deck.update(dt)
        shown.append(deck.posture)
        if not deck.settled and len(shown) < begin + LONGEST:
            end = len(shown)
    return _channels(library, shown), begin, end


def _channels(library: MotionLibrary, postures: list[Posture]) -> Array:
    """Height, turn rate and bone directions of postures as channels; other channels stay zero."""
    out = np.zeros((len(postures), library.encoding.channels))
    out[:, HEIGHT] = [float(posture.height) for posture in postures]
    out[:, TURN_RATE] = [float(posture.turn_rate) for posture in postures]
    rotation = np.stack([posture.rotation for posture in postures])
    bones = rotate(rotation[:, 1:], library.skeleton.rest_direction).reshape(len(out), -1)
    out[:, FIRST_BONE : FIRST_BONE + bones.shape[1]] = bones
    return out


def _measured(
    source: str, target: str, method: str, run: Array, start: int, end: int, judge: Judge, peaks: dict[str, Array]
) -> MeasuredTransition:
    if not np.isfinite(run).all():
        return MeasuredTransition(source, target, method, end - start, inf, inf, inf, inf, True, "the network ran away")
    # As the thesis shows it: vectors as they are, with shortened bones.
    skeleton = judge.encoding.skeleton
    vectors = run[:, FIRST_BONE : FIRST_BONE + 3 * len(skeleton)].reshape(len(run), -1, 3)
    joints = skeleton.chain @ (vectors * skeleton.length[:, None])
    seen = 1e3 * np.concatenate([joints.reshape(len(run), -1), run[:, [HEIGHT]]], axis=1)
    seen = _unturned(seen, run[:, TURN_RATE], judge.rate)
    ratios = _peaks(seen[max(0, start - 3) : end + AFTER]) / np.maximum(peaks[source], peaks[target])
    length = np.linalg.norm(vectors[start:end], axis=-1)
    why = _failure(target, run[end:], judge)
    velocity, acceleration, jerk = ratios.tolist()
    error = float(np.abs(length - 1.0).max())
    return MeasuredTransition(source, target, method, end - start, velocity, acceleration, jerk, error, bool(why), why)


def _failure(target: str, run: Array, judge: Judge) -> str:
    """Why the motion after a transition was not the target, or ""."""
    if judge.loops[target] or not judge.holds:
        return judge(target, run).reason
    away = float(distances(joint_features(judge.encoding, run[-1:]), judge.features(target)[-1])[0])
    return f"holds a pose {away:.0f} mm away from the last one" if away > LOST_MM else ""


def _own_peaks(syllabus: TrainingSet, frames: Array, loops: bool) -> Array:
    """The peaks of a motion as recorded, for a loop over its end too."""
    if loops:
        frames = np.concatenate([frames, frames[:4]])
    features = joint_features(syllabus.encoding, frames)
    return _peaks(_unturned(features, frames[:, TURN_RATE], syllabus.rate))


def _unturned(features: Array, turn_rate: Array, rate: float) -> Array:
    """Features as `joint_features` gives them, seen from a place that does not turn; turn_rate (T,) in rad/s."""
    heading = yaw(np.cumsum(turn_rate) / rate)[:, None]
    joints = rotate(heading, features[:, :-1].reshape(len(features), -1, 3))
    return np.concatenate([joints.reshape(len(features), -1), features[:, -1:]], axis=1)


def _peaks(features: Array) -> Array:
    """The largest speed, acceleration and jerk of a joint, in mm and frames, shape (3,)."""
    joints = np.concatenate([features, np.zeros((len(features), 2))], axis=1).reshape(len(features), -1, 3)
    return np.array([np.linalg.norm(np.diff(joints, n=n, axis=0), axis=-1).max() for n in (1, 2, 3)])
