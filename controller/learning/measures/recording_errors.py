"""Measures what a finished library plays against the recording itself, before that was prepared for learning.

Each motion runs free from its start: a loop for three rounds, a one-shot until it holds its end. The landmarks of the
canonical body are compared at the recorded frames, seen from the hips: their middle above the origin of the floor, the
line through them along y. Heights are not aligned, so an error of the floor counts. What is played is scaled by the
ratio of leg lengths. It is compared on the library's body, which the deck plays, and on the recording's own.

The frames of a loop within SEAM seconds of its seam are left out, because the mismatch there is the recording's own. A
one-shot may be LATE seconds late from STOPS seconds before its end on, because it comes to rest there.
"""

from dataclasses import dataclass

import numpy as np

from controller.deck.motion_generator import MotionGenerator
from controller.library.motion_library import MotionLibrary
from controller.library.recording_error import Errors, RecordingError
from controller.motion.canonical.canonical_body import CANONICAL_BONES, carried, landmark_places, to_canonical
from controller.motion.clip import Clip, between_rows, runs, walked_clip
from controller.motion.rotations import Array, Flags, Indices, normalise
from controller.motion.skeleton import JAEGER_PARENT, Skeleton
from motiondeck_base.errors import FileFormatError

ROUNDS = 3
HELD = 2.0  # s after the end of a one-shot
SEAM = 0.4  # s, but at most a quarter of the loop
STOPS, LATE = 0.5, 0.35  # s
SHORTEST = 0.02  # m: shorter bones point nowhere
STANDS, NEAR_GROUND, STANDS_FOR = 0.15, 0.05, 0.1  # of a foot: slower, m/s, as near to its lowest, m, as long, s
SHARE = 0.95

PARENT = 1 + np.array(JAEGER_PARENT)
JOINT = {bone: 1 + index for index, bone in enumerate(CANONICAL_BONES)}
HIPS = [JOINT["lhip"], JOINT["rhip"]]
LEGS = [JOINT[side + end] for side in "lr" for end in ("kne", "ank")]


@dataclass(frozen=True)
class RecordedPart:
    """The landmarks of the learned part of a recording."""

    places: Array  # shape (T, 20, 3), m
    known: Flags  # which the recording has, shape (20,)
    since: Array  # of each frame, s since the start of the motion, shape (T,)
    first: float  # start and end of the motion in the recording, s
    end: float
    loop: bool
    body: Skeleton

    @property
    def seconds(self) -> float:
        """Duration of a round, or of a one-shot."""
        return self.end - self.first


def recorded_part(
    clip: Clip, first: float, end: float, *, loop: bool, body: Skeleton | None = None
) -> RecordedPart | None:
    """The part of a recording from `first` to `end`, s, on a body (default: canonical); None for rigs, or no legs."""
    if clip.skeleton.is_rig:
        return None
    near = 0.01  # of a frame
    frames = slice(int(np.ceil(first * clip.rate - near)), int(np.ceil(end * clip.rate - near)))
    part = Clip(clip.name, clip.skeleton, clip.rate, clip.root_position[frames], clip.rotation[frames])
    try:
        places, known = landmark_places(part)
        body = body or to_canonical(part).skeleton
    except FileFormatError:
        return None
    since = np.arange(frames.start, frames.start + len(part)) / clip.rate - first
    return RecordedPart(places, known, since, first, end, loop, body)


def recording_error(library: MotionLibrary, motion: str, recorded: RecordedPart) -> RecordingError:
    """The error of a motion's free run against its recording."""
    rate, seconds = library.info.rate, recorded.seconds
    wanted, since = recorded.places, recorded.since
    lasts = (ROUNDS * seconds if recorded.loop else seconds + HELD) + 2.0 / rate
    frames = MotionGenerator(library, motion).frames(lasts, rate)
    run = walked_clip(motion, library.skeleton, library.encoding.decode(frames), rate)
    played, own = (landmark_places(clip)[0] for clip in (run, carried(run, recorded.body)))
    played, own = (places * (_leg_length(wanted) / _leg_length(places)) for places in (played, own))
    if recorded.loop:
        when = np.concatenate([since + turn * seconds for turn in range(ROUNDS)])
        target = np.tile(wanted, (ROUNDS, 1, 1))
        phase = when % seconds
        kept = np.minimum(phase, seconds - phase) >= min(SEAM, 0.25 * seconds)
    else:
        when, target, kept = since, wanted.copy(), np.full(len(since), True)
        for frame in map(int, np.flatnonzero(since >= seconds - STOPS)):
            target[frame] = _nearest_late(recorded, frame, _at(own, since[frame : frame + 1] * rate))
    ours, own_body, theirs = (_from_hips(x[kept]) for x in (_at(played, when * rate), _at(own, when * rate), target))
    at = recorded.first + when[kept] % seconds
    bones = _pointing(recorded)
    held = None
    if not recorded.loop:
        held = float(_angles(_from_hips(played[-1:]), _from_hips(wanted[-1:]), bones).max())
    joints = np.flatnonzero(recorded.known[1:])
    off, own_off = (_apart(places, theirs, recorded) for places in (ours, own_body))
    return RecordingError(
        from_s=recorded.first,
        to_s=recorded.end,
        held_degrees=held,
        own_body_mm=float(np.quantile(own_off, SHARE)),
        mm=_errors(off, joints, at),
        degrees=_errors(_angles(ours, theirs, bones), bones, at),
        **_feet(_at(played, since * rate), wanted, recorded),
    )


def distances(played: Clip, phase: Array, recorded: RecordedPart) -> Array:
    """How far joints of poses at phases (T,), 0 to 1, are from the recording's there, seen from the hips; mm.

    Shape (T, joints); what is played has legs as long as the recorded ones.
    """
    since = recorded.since
    wanted = _at(recorded.places, np.interp(phase * recorded.seconds, since, np.arange(len(since))))
    places = landmark_places(played)[0]
    places *= _leg_length(recorded.places) / _leg_length(places)
    return _apart(_from_hips(places), _from_hips(wanted), recorded)


def _apart(ours: Array, theirs: Array, recorded: RecordedPart) -> Array:
    """How far the recorded joints but the root are from each other, mm."""
    return 1000.0 * np.linalg.norm(ours - theirs, axis=-1)[:, 1 + np.flatnonzero(recorded.known[1:])]


def _leg_length(places: Array) -> float:
    lengths = np.linalg.norm(places[:, LEGS] - places[:, PARENT[np.array(LEGS) - 1]], axis=-1)
    return float(np.median(lengths, axis=0).sum())


def _at(places: Array, frame: Array) -> Array:
    """Places between frames, linearly; the first and the last beyond."""
    rows = between_rows(places.reshape(len(places), -1), np.arange(len(places)), frame)
    return rows.reshape(len(frame), *places.shape[1:])


def _from_hips(places: Array) -> Array:
    left, right = (places[:, hip] for hip in HIPS)
    middle, across = 0.5 * (left + right), left - right
    turn = np.arctan2(-across[:, 0], across[:, 1])
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
    x, y = (places[..., axis] - middle[:, axis, None] for axis in (0, 1))
    return np.stack([cos * x + sin * y, cos * y - sin * x, places[..., 2]], axis=-1)


def _nearest_late(recorded: RecordedPart, frame: int, played: Array) -> Array:
    """The recorded landmarks (20, 3) up to LATE seconds before a frame that are nearest to played ones (1, 20, 3)."""
    some = _at(recorded.places, frame - np.arange(0.0, LATE / np.diff(recorded.since[:2])[0], 0.25))
    off = np.linalg.norm(_from_hips(some) - _from_hips(played), axis=-1)[:, recorded.known]
    return some[off.mean(axis=1).argmin()]


def _pointing(recorded: RecordedPart) -> Indices:
    """The bones whose directions the recording has, without those at the root, which may lie anywhere in the pelvis."""
    lengths = np.median(np.linalg.norm(recorded.places[:, 1:] - recorded.places[:, PARENT], axis=-1), axis=0)
    return np.flatnonzero(recorded.known[1:] & recorded.known[PARENT] & (lengths > SHORTEST) & (PARENT > 0))


def _angles(ours: Array, theirs: Array, bones: Indices) -> Array:
    """Angles between bones, shape (T, bones), degrees."""
    lines = [places[:, 1 + bones] - places[:, PARENT[bones]] for places in (ours, theirs)]
    one, other = map(normalise, lines)
    return np.degrees(2.0 * np.arcsin(np.clip(np.linalg.norm(one - other, axis=-1) / 2.0, 0.0, 1.0)))


def _errors(off: Array, bones: Indices, at: Array) -> Errors:
    frame, joint = np.unravel_index(int(off.argmax()), off.shape)
    median, p95, worst = float(np.median(off)), float(np.quantile(off, SHARE)), float(off.max())
    where = CANONICAL_BONES[bones[joint]]
    return Errors(median=median, p95=p95, worst=worst, joint=where, worst_at_s=float(at[frame]))


def _feet(played: Array, wanted: Array, recorded: RecordedPart) -> dict[str, float]:
    """Height and slide of standing feet, mm, in the first round where it is in time; empty if none stands."""
    in_time = recorded.since < recorded.seconds - (0.0 if recorded.loop else STOPS)
    heights: list[Array] = []
    slides: tuple[list[Array], list[Array]] = ([], [])
    step = np.diff(recorded.since[:2])[0]
    for side in "lr":
        foot = JOINT[f"{side}foo"] if recorded.known[JOINT[f"{side}foo"]] else JOINT[f"{side}ank"]
        track = wanted[:, foot]
        slow = np.linalg.norm(np.gradient(track, step, axis=0), axis=-1) < STANDS
        stands = slow & in_time & (track[:, 2] < np.quantile(track[:, 2], 0.05) + NEAR_GROUND)
        for start, end in runs(stands):
            if (end - start) * step < STANDS_FOR:
                continue
            heights.append(1000.0 * (played[start:end, foot, 2] - track[start:end, 2]))
            for kept, places in zip(slides, (played, wanted), strict=True):
                way = places[start:end, foot, :2]
                kept.append(1000.0 * np.linalg.norm(way - way.mean(axis=0), axis=-1))
    if not heights:
        return {}
    height = np.concatenate(heights)
    farthest = np.abs(height).argsort()[int(SHARE * (len(height) - 1))]
    slide, recorded_slide = (float(np.quantile(np.concatenate(kept), SHARE)) for kept in slides)
    return {"floor_mm": float(height[farthest]), "slide_mm": slide, "recorded_slide_mm": recorded_slide}
