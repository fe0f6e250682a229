"""Motion, phase and body from an unseen actor's head and hands, with rivals.

Each actor in turn is a stranger: the recordings of all others are known. The stranger's recordings are strung together,
3.6 s each and begun somewhere in the middle, at tempos of 0.5, 1 and 2, with a jump of the phase, a stall of 0.5 s and
pushes of 0.15 m. Of the points (in the world, on one body) 20 % of the frames are lost, 100 ms in every 2 s are silent,
and 20 mm of noise are added. All ways get the same. Judged by the undisturbed body, and by the frame of the recording
that it was at, carried to the recording that a way names by dynamic time warping of whole bodies.

- *filter*: the product's Bayes filter over the frames of all known recordings (`controller/deck/phase_filter.py`); the
  body is the mean of the eight likeliest recordings at their likeliest frames.
- *clips*: its likeliest recording alone at its likeliest frame, inertialised (0.2 s): clips with phase search.
- *conceptors*: one reservoir that the points drive; the evidence of a motion is the state's distance from the space of
  its conceptor, and each motion reads the body for itself. *W = 0*: without recurrence and time constant. *C = 1*: one
  readout for all motions, which also says which motion it is.
- *completion*: a reservoir that the points drive, as the deck has it (`controller/deck/person_body.py`). *filter and
  completion*: their mean, by the deck's weight, which is what the deck goes by.
- *ridge*: of the points of the last 0.4 s. *clip complete*: the product's command, on the whole stream as a file, so
  that it sees 0.4 s ahead as well (`controller/learning/completion.py`).
- *GRU*: 64 units, trained until its loss on held-out parts no longer falls.
- *nearest*: the mean of the eight moments whose last 0.4 s is nearest.
- *oracle*: a bound for what these points tell. It is told when the motion or the phase changes, gets the points
  without noise and losses, and takes the recording, place and tempo (0.5, 1 or 2) whose points since then, of 0.5 s at
  most, are nearest by the measure of the filter. It tells no body.

With `--points joints` a rig leads the filter: eight of servo20's twenty joints, those of head and arms, are moved by
hand through what the stranger did, 0.05 rad off and with the same losses; stalls and jumps too, but no pushes. And of
all recordings of the stranger `clip complete` finds the other twelve joints.

Figures: mm, mean distance of the joints that are not measured, in the world; the share of frames that are named right;
the share of changes of motion that are named within 0.5 s (for 0.2 s on end); the phase's median error, s; the share of
jumps after which it is within 0.15 s again in 0.3 s. Settings were chosen on the strangers bd and bk (--chosen-on).

    python -m benchmarks body_drives --data DIR [--points six] [--walks] [--chosen-on]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from benchmarks import command
from benchmarks.reservoirs.measured_joints import WALKS
from controller.deck.person_body import PersonBody, body_rows
from controller.deck.person_follower import ARM
from controller.deck.phase_filter import MOVED, PAST, PLACE, RATE, UP, PhaseFilter
from controller.learning.completion import complete_body, complete_joints
from controller.learning.reservoirs.completion_training import learn_completion
from controller.motion.canonical.canonical_body import carried, to_canonical
from controller.motion.canonical.clip_edits import resampled
from controller.motion.clip import Clip, Markers, between_rows, poses_of
from controller.motion.encodings.joint_angles import angles_of as joint_angles
from controller.motion.formats.reading import read_clip
from controller.motion.formats.taught_clip import taught_clip
from controller.motion.rotations import Array, normalise
from controller.networks.reservoirs.reservoir import drive, random_reservoir
from motiondeck_base.shipped import find_robot
from sim.robots.robot import load_robot

CHOSEN_ON = ("bd", "bk")
HAND_LED = 8  # joints of servo20, the first ones
POINTS = {
    "joints": ("head", "rhan", "lhan"),
    "three": ("head", "rhan", "lhan"),
    "six": ("head", "rhan", "lhan", "root", "rank", "lank"),
}
SEGMENTS, SEGMENT_SECONDS = 14, 3.6
NEAREST = 8
LAGS = (0, 3, 6, 9, 12)  # steps
NEURONS, RANK, LEAK, RIDGE, MEMORY = 600, 40, 0.43, 0.01, 0.3  # of the reservoir; s over which evidence is summed
LONGEST = 15  # steps that the oracle compares


@dataclass(frozen=True)
class Recorded:
    """A recording on one body: the joints (T, 20, 3), m, at RATE, and their places relative to the hips (T, 60)."""

    motion: int
    actor: str
    joints: Array
    own: Array
    clip: Clip


@dataclass
class Stream:
    """What a stranger does and what is measured of it, step by step."""

    joints: list[Array] = field(default_factory=list)
    recording: list[int] = field(default_factory=list)
    frame: list[float] = field(default_factory=list)
    event: list[str] = field(default_factory=list)
    measured: Array = field(default_factory=lambda: np.empty(0))


@dataclass(frozen=True)
class Told:
    """What a way says of a stream: joints (T, 20, 3), motions (T,), perhaps recordings, frames and shares (T,)."""

    joints: Array
    motion: Array
    recording: Array | None = None
    frame: Array | None = None
    share: Array | None = None


def read(data: Path, *, walks: bool) -> tuple[list[str], list[Recorded]]:
    """The bones of the body and all recordings on it."""
    if walks:
        paths = [(0, name[:2], data / "cmu" / name[:2] / f"{name}.amc") for name in WALKS]
    else:
        folders = sorted(folder for folder in (data / "hdm05").iterdir() if folder.is_dir())
        paths = [(k, one.name[4:6], one) for k, folder in enumerate(folders) for one in sorted(folder.glob("*.amc"))]
    clips = [resampled(read_clip(path), RATE) for _, _, path in paths]
    skeleton = to_canonical(clips[0]).skeleton
    found: list[Recorded] = []
    for (motion, actor, _), clip in zip(paths, clips, strict=True):
        whole = carried(clip, skeleton)
        joints = whole.joints()
        found.append(Recorded(motion, actor, joints, in_frame(joints, joints[:, 0], -_heading(joints)), whole))
    return ["root", *skeleton.bones], found


def in_frame(joints: Array, origin: Array, turn: Array) -> Array:
    """Joints (T, J, 3) from an origin (T, >= 2) on the ground, turned about the vertical by angles (T,): (T, 3 J)."""
    z = (_plane(joints) - _plane(origin)[:, None]) * np.exp(1j * turn)[:, None]
    return np.stack([z.real, z.imag, joints[..., 2]], axis=-1).reshape(len(joints), -1)


def _plane(places: Array) -> Array:
    return places[..., 0] + 1j * places[..., 1]


def _heading(joints: Array) -> Array:
    return np.angle(_plane(joints[..., 5, :]) - _plane(joints[..., 1, :]))


def disturbed(known: Sequence[Recorded], actor: str, points: Sequence[int], seed: int) -> Stream:
    """The stranger's stream."""
    rng, out, motion = np.random.default_rng(seed), Stream(), -1
    motions = sorted({one.motion for one in known})
    for _ in range(SEGMENTS):
        motion = int(rng.choice([one for one in motions if one != motion or len(motions) == 1]))
        index = int(rng.choice([k for k, one in enumerate(known) if (one.motion, one.actor) == (motion, actor)]))
        source = known[index].joints
        frame, event, tempo = (
            rng.uniform(0.2, 0.6) * len(source),
            "change",
            float(rng.choice([0.5, 1.0, 1.0, 1.0, 2.0])),
        )
        jump, stall = rng.integers(36, 54), rng.integers(66, 78)
        turn, shift = 1.0 + 0j, 0j
        for step in range(round(SEGMENT_SECONDS * RATE)):
            if step == jump:
                frame, event = (frame + rng.uniform(0.3, 0.7) * len(source)) % (len(source) - 1), "jump"
            elif frame > len(source) - 1:
                frame, event = rng.uniform(0.0, 0.1) * len(source), "again"
            low = min(int(frame), len(source) - 2)
            now = (low + 1 - frame) * source[low] + (frame - low) * source[low + 1]
            if event:  # it goes on where it is, the way it faces
                last = out.joints[-1] if out.joints else now
                turn = np.exp(1j * (_heading(last) - _heading(now)))
                shift = _plane(last[0]) - turn * _plane(now[0])
            z = turn * _plane(now) + shift
            out.joints.append(np.stack([z.real, z.imag, now[:, 2]], axis=-1))
            out.recording.append(index)
            out.frame.append(frame)
            out.event.append(event)
            event = ""
            if not stall <= step < stall + 15:
                frame += tempo
    joints = np.array(out.joints)
    for begin in range(60, len(joints) - 12, 90):
        lean = 0.15 * np.sin(np.pi * np.arange(12) / 12)[:, None] * joints[begin : begin + 12, :, 2] / 1.6
        angle = rng.uniform(0.0, 2.0 * np.pi)
        joints[begin : begin + 12, :, 0] += np.cos(angle) * lean
        joints[begin : begin + 12, :, 1] += np.sin(angle) * lean
    out.joints = [*joints]
    out.measured = joints[:, points] + 0.02 * rng.standard_normal((len(joints), len(points), 3))
    out.measured[rng.random(len(joints)) < 0.2] = np.nan
    for begin in range(45, len(joints), 60):
        out.measured[begin : begin + 3] = np.nan
    return out


def features(measured: Array) -> tuple[Array, Array, Array]:
    """Points from the head, by the smoothed line of the hands, and their velocities; the frame's origin and angle."""
    held = measured.copy()
    for step in range(len(held)):
        if not np.isfinite(held[step]).all():
            held[step] = held[step - 1] if step else np.nan_to_num(held[step])
    line, angles, smooth = _plane(held[:, 2]) - _plane(held[:, 1]), np.empty(len(held)), 0j
    for step, now in enumerate(line):
        smooth = smooth * np.exp(-1.0 / RATE / 0.3) + now
        angles[step] = np.angle(smooth)
    moving = np.zeros_like(held)
    moving[3:] = (held[3:] - held[:-3]) * RATE / 3.0 * 0.2
    places, rates = in_frame(held, held[:, 0], -angles), in_frame(moving, np.zeros((len(held), 2)), -angles)
    return np.concatenate([places[:, 2:], rates], axis=1), held[:, 0], angles


def in_world(rest: Array, origin: Array, angles: Array) -> Array:
    """Joints (T, J, 3) of places (T, 3 J) in a frame."""
    rows = rest.reshape(len(rest), -1, 3)
    z = _plane(rows) * np.exp(1j * angles)[:, None] + _plane(origin)[:, None]
    return np.stack([z.real, z.imag, rows[..., 2]], axis=-1)


@dataclass(frozen=True)
class Lesson:
    """One known recording at a tempo: features (T, C), the body in their frame (T, 60), and the motion."""

    given: Array
    body: Array
    motion: int


def lessons(known: Sequence[Recorded], points: Sequence[int], seed: int) -> list[Lesson]:
    """Every known recording at three tempos, with the noise and losses of the stream."""
    rng, found = np.random.default_rng(seed), []
    for one in known:
        for tempo in (0.5, 1.0, 2.0):
            at = np.arange(0.0, len(one.joints) - 1.0, tempo)
            low = at.astype(int)
            share = (at - low)[:, None, None]
            joints = (1.0 - share) * one.joints[low] + share * one.joints[low + 1]
            measured = joints[:, points] + 0.02 * rng.standard_normal((len(joints), len(points), 3))
            lost = rng.random(len(joints)) < 0.2
            lost[0] = False
            measured[lost] = np.nan
            given, origin, angles = features(measured)
            found.append(Lesson(given, in_frame(joints, origin, -angles), one.motion))
    return found


def ridge(x: Array, y: Array, gamma: float) -> Array:
    """W with [x, 1] W = y, (C + 1, D)."""
    rows = np.column_stack([x, np.ones(len(x))])
    return np.linalg.solve(rows.T @ rows + gamma * len(x) * np.eye(rows.shape[1]), rows.T @ y)


def with_one(x: Array) -> Array:
    return np.column_stack([x, np.ones(len(x))])


def by_filter(known: Sequence[Recorded], points: Sequence[int], stream: Stream, motions: int) -> dict[str, Told]:
    """The product's filter, and its likeliest clip."""
    clips = PhaseFilter(
        [one.joints[:, points] for one in known], [_heading(one.joints) for one in known], [False] * len(known)
    )
    of, steps = np.array([one.motion for one in known]), len(stream.joints)
    mean, single = np.zeros((2, steps, *stream.joints[0].shape))
    motion, recording, frame = np.zeros((3, steps), dtype=int)
    shares = np.empty(steps)
    offset, shown = np.zeros(stream.joints[0].shape), -1
    last = stream.measured[np.isfinite(stream.measured).all((1, 2))][0]
    for step, measured in enumerate(stream.measured):
        clips.step(measured)
        last = np.where(np.isfinite(measured), measured, last)
        evidence, shares[step] = clips.evidence, clips.share
        motion[step] = np.bincount(of, evidence, minlength=motions).argmax()
        best = np.argsort(np.where(of == motion[step], evidence, 0.0))[::-1][:NEAREST]
        poses = []
        for clip in best:
            at = round(clips.place(int(clip)).frame)
            pose = known[clip].joints[min(max(at, 0), len(known[clip].joints) - 1)]
            seen, wanted = _plane(pose[points]), _plane(last)
            turn = np.exp(1j * np.angle((np.conj(seen - seen.mean()) * (wanted - wanted.mean())).sum()))
            z = turn * (_plane(pose) - seen.mean()) + wanted.mean()
            poses.append(np.stack([z.real, z.imag, pose[:, 2]], axis=-1))
        weight = evidence[best] / max(float(evidence[best].sum()), 1e-300)
        mean[step] = np.tensordot(weight, np.array(poses), 1)
        recording[step], frame[step] = best[0], round(clips.place(int(best[0])).frame)
        changed = best[0] != shown or (step > 0 and abs(int(frame[step] - frame[step - 1])) > 4)
        offset = single[step - 1] - poses[0] if changed and step else offset * np.exp(-1.0 / RATE / 0.2)
        shown, single[step] = best[0], poses[0] + offset
    return {"filter": Told(mean, motion, recording, frame, shares), "clips": Told(single, motion, recording, frame)}


def angles_of(recordings: Sequence[Recorded]) -> tuple[tuple[str, ...], list[Array]]:
    """Servo20's joints, and of each recording the heights (T, 20, 3) that stand for their angles."""
    robot, found = load_robot(find_robot("servo20"), recordings[0].clip.skeleton, dt=1.0 / RATE), []
    for one in recordings:
        angles = np.array([robot.retarget(pose).copy() for pose in poses_of(one.clip)])
        found.append(ARM * angles[..., None] * [0.0, 0.0, 1.0])
    return robot.joints, found


def completed_joints(joints: Sequence[str], known: Sequence[Array], own: Sequence[Array]) -> tuple[float, float]:
    """Mean errors of the other joints of a stranger's recordings, degrees: by `clip complete`, and by their mean."""
    clips, stranger = ([taught_clip("one", joints, RATE, one[..., 2] / ARM) for one in each] for each in (known, own))
    rest = np.concatenate(known)[:, HAND_LED:, 2].mean(0)
    whole = np.concatenate(
        [
            joint_angles(one.rotation[:, 1:])
            for one in (complete_joints(clip, joints[:HAND_LED], clips) for clip in stranger)
        ]
    )
    truth = np.concatenate(own)[..., 2]
    off = np.abs(whole[:, HAND_LED:] - truth[:, HAND_LED:] / ARM), np.abs(rest - truth[:, HAND_LED:]) / ARM
    return float(np.degrees(off[0].mean())), float(np.degrees(off[1].mean()))


def by_angles(known: Sequence[Recorded], courses: Sequence[Array], measured: Array, motions: int) -> dict[str, Told]:
    """The product's filter on a rig's joints."""
    still = [np.zeros(len(course)) for course in courses]
    clips = PhaseFilter(courses, still, [False] * len(known))
    of = np.array([one.motion for one in known])
    motion, recording, frame = np.zeros((3, len(measured)), dtype=int)
    for step, heights in enumerate(measured):
        clips.step(heights)
        motion[step] = np.bincount(of, clips.evidence, minlength=motions).argmax()
        recording[step] = np.where(of == motion[step], clips.evidence, 0.0).argmax()
        frame[step] = round(clips.place(int(recording[step])).frame)
    return {"filter": Told(np.full((len(measured), 20, 3), np.nan), motion, recording, frame)}


def led_by_hand(stream: Stream, angles: Sequence[Array], seed: int) -> Array:
    """What a rig measures of a stream, as heights, with its losses."""
    places = zip(stream.recording, stream.frame, strict=True)
    rows = [between_rows(angles[k][..., 2], np.arange(len(angles[k])), np.array([frame]))[0] for k, frame in places]
    measured = np.zeros((len(rows), HAND_LED, 3))
    measured[..., 2] = np.array(rows) + ARM * 0.05 * np.random.default_rng(seed).standard_normal((len(rows), HAND_LED))
    measured[~np.isfinite(stream.measured[:, 0, 0])] = np.nan
    return measured


def by_conceptors(
    learned: Sequence[Lesson], stream: Stream, motions: int, *, recurrent: bool, seed: int
) -> dict[str, Told]:
    """The driven reservoir with a conceptor for each motion, and with one readout."""
    given = np.concatenate([one.given for one in learned])
    middle, spread = given.mean(0), given.std(0)
    reservoir = random_reservoir(
        NEURONS,
        given.shape[1],
        spectral_radius=0.9 if recurrent else 0.0,
        input_scale=0.7 / np.sqrt(given.shape[1]),
        bias_scale=0.5,
        leak=LEAK if recurrent else 1.0,
        rng=np.random.default_rng(seed),
    )
    asked, origin, angles = features(stream.measured)
    first = round(RATE)
    signals = [
        (np.concatenate([x[:1].repeat(first, 0), x]) - middle) / spread for x in (*(o.given for o in learned), asked)
    ]
    *driven, states = (one[first:] for one in drive(reservoir, signals))
    x, body = np.concatenate(driven), np.concatenate([one.body for one in learned])
    of = np.concatenate([np.full(len(one.body), one.motion) for one in learned])
    # Readouts see the points too, not only the neurons.
    beside, given = np.column_stack([states, signals[-1][first:]]), np.column_stack([x, (given - middle) / spread])
    whole = with_one(beside) @ ridge(given, np.column_stack([body, np.eye(motions)[of]]), RIDGE)
    told = {"C = 1": Told(in_world(whole[:, : body.shape[1]], origin, angles), whole[:, body.shape[1] :].argmax(1))}
    cost, read = np.empty((motions, len(states))), np.empty((motions, len(states), body.shape[1]))
    for motion in range(motions):
        own = x[of == motion]
        mean = own.mean(0)
        _, singular, rows = np.linalg.svd(own - mean, full_matrices=False)
        off, left = states - mean, (singular[RANK:] ** 2).sum() / len(own)
        inside = off @ rows[:RANK].T
        within = np.square(inside / (singular[:RANK] / np.sqrt(len(own)))).mean(1)
        cost[motion] = (np.square(off).sum(1) - np.square(inside).sum(1)) / left + within + np.log(left)
        read[motion] = with_one(beside) @ ridge(given[of == motion], body[of == motion], RIDGE)
    keep = np.exp(-1.0 / RATE / MEMORY)
    for step in range(1, len(states)):
        cost[:, step] = keep * cost[:, step - 1] + (1.0 - keep) * cost[:, step]
    share = np.exp(-2.0 * (cost - cost.min(0)))
    share /= share.sum(0)
    body_told = in_world(np.einsum("mt,mtd->td", share, read), origin, angles)
    return {"conceptors": Told(body_told, cost.argmin(0)), **told}


def by_window(learned: Sequence[Lesson], stream: Stream, motions: int) -> dict[str, Told]:
    """Ridge regression on the last 0.4 s, and the moments whose last 0.4 s are nearest."""

    def past(given: Array) -> Array:
        return np.concatenate([given[np.maximum(np.arange(len(given)) - lag, 0)] for lag in LAGS], axis=1)

    x, body = np.concatenate([past(one.given) for one in learned]), np.concatenate([one.body for one in learned])
    of = np.concatenate([np.full(len(one.body), one.motion) for one in learned])
    asked, origin, angles = features(stream.measured)
    middle, spread = x.mean(0), x.std(0)
    x, y = (x - middle) / spread, (past(asked) - middle) / spread
    told = with_one(y) @ ridge(x, np.column_stack([body, np.eye(motions)[of]]), 0.01)
    apart = np.square(y).sum(1)[:, None] + np.square(x).sum(1) - 2.0 * y @ x.T
    best = np.argpartition(apart, NEAREST, axis=1)[:, :NEAREST]
    share = 1.0 / np.maximum(np.take_along_axis(apart, best, axis=1), 1e-6)
    share /= share.sum(1, keepdims=True)
    mean, votes = np.einsum("tk,tkd->td", share, body[best]), np.einsum("tk,tkm->tm", share, np.eye(motions)[of][best])
    return {
        "ridge": Told(in_world(told[:, : body.shape[1]], origin, angles), told[:, body.shape[1] :].argmax(1)),
        "nearest": Told(in_world(mean, origin, angles), votes.argmax(1)),
    }


def by_completion(known: Sequence[Recorded], points: Sequence[int], stream: Stream) -> dict[str, Told]:
    """The command `clip complete`, which names no motion."""
    body = known[0].clip.skeleton
    labels = [("root", *body.bones)[point] for point in points]
    markers = Markers(tuple(labels), RATE, stream.measured, "z", "stream")
    whole = complete_body(markers, labels, [one.clip for one in known], body)
    return {"clip complete": Told(whole.joints(), np.full(len(whole), -1))}


def by_person(
    known: Sequence[Recorded], labels: Sequence[str], points: Sequence[int], stream: Stream, filtered: Told
) -> dict[str, Told]:
    """The product's completion as the points arrive, and its mean with the filter's body."""
    body, joints = known[0].clip.skeleton, filtered.joints.copy()
    courses = [(one.joints[:, points], body_rows(body, one.joints, _heading(one.joints))) for one in known]
    person = PersonBody(labels, courses, learn_completion)
    for step, measured in enumerate(stream.measured):
        if (rows := person.step(measured)) is not None:
            ends = body.chain @ (normalise(rows[2:]) * body.length[:, None])
            joints[step] = rows[1] + np.concatenate([np.zeros((1, 3)), ends])
    assert filtered.share is not None
    weight = filtered.share[:, None, None]
    mean = weight * joints + (1.0 - weight) * filtered.joints
    return {"completion": Told(joints, filtered.motion), "filter and completion": Told(mean, filtered.motion)}


def by_oracle(known: Sequence[Recorded], points: Sequence[int], stream: Stream) -> dict[str, Told]:
    """The nearest points, undisturbed, since the last change, of which it is told."""
    steps = len(stream.joints)
    since = np.arange(steps) - np.maximum.accumulate([k if event else 0 for k, event in enumerate(stream.event)])
    asked = np.array(stream.joints)[:, points]
    of = np.concatenate([np.full(len(one.joints), k) for k, one in enumerate(known)])
    frame = np.concatenate([np.arange(len(one.joints)) for one in known])
    rows = np.concatenate([one.joints[:, points] for one in known])
    flat, every = rows.reshape(len(rows), -1), np.arange(len(rows))
    best, found = np.full(steps, np.inf), np.zeros(steps, dtype=int)

    def seen(past: Sequence[Array]) -> tuple[NDArray[np.complex64], NDArray[np.float32]]:
        """Places about their middle and changes, x + i y and heights, of points now, a step ago, ...; weighed."""
        flat = [(_plane(one) - _plane(one).mean(1, keepdims=True)) / PLACE for one in past]
        up = [one[..., 2] / PLACE for one in past]
        for now, before in zip(past[:-PAST], past[PAST:], strict=True):
            flat.append((_plane(now) - _plane(before)) / MOVED)
            up.append((now - before)[..., 2] / MOVED)
        heights = np.sqrt(UP) * np.concatenate(up, axis=1)
        return np.concatenate(flat, axis=1).astype(np.complex64), heights.astype(np.float32)

    for tempo, long in product((0.5, 1.0, 2.0), range(1, LONGEST + 1)):
        now = np.flatnonzero(since >= long - 1 if long == LONGEST else since == long - 1)
        back = [tempo * lag for lag in range(long)]
        ends = np.flatnonzero(frame >= back[-1])
        past = [between_rows(flat, every, ends - lag).reshape(-1, *asked.shape[1:]) for lag in back]
        (q, g), (z, h) = seen(past), seen([asked[now - lag] for lag in range(long)])
        error = np.square(np.abs(q)).sum(1) + np.square(g).sum(1) - 2.0 * np.abs(z @ np.conj(q).T) - 2.0 * h @ g.T
        error += (np.square(np.abs(z)).sum(1) + np.square(h).sum(1))[:, None]
        least = error.min(1, initial=np.inf)
        nearer = least < best[now]
        best[now[nearer]], found[now[nearer]] = least[nearer], ends[error[nearer].argmin(1)]
    recording = of[found]
    motion = np.array([one.motion for one in known])[recording]
    return {"oracle": Told(np.full((steps, *stream.joints[0].shape), np.nan), motion, recording, frame[found])}


def by_gru(
    learned: Sequence[Lesson], stream: Stream, motions: int, seed: int, hidden: int = 64
) -> tuple[dict[str, Told], dict[int, float]]:
    """A gated recurrent unit (Cho et al. 2014) with linear outputs, by Adam on windows of 1 s.

    Every tenth window is held out; it ends when their loss has not fallen for 1500 of at most 8000 batches of 48, the
    rate halved every 1500. Also the loss of those after each 1000 batches.
    """
    rng, first = np.random.default_rng(seed), learned[0]
    given, body = np.concatenate([one.given for one in learned]), np.concatenate([one.body for one in learned])
    of = np.concatenate([np.full(len(one.body), one.motion) for one in learned])
    middle, spread, level, size = given.mean(0), given.std(0), body.mean(0), body.std()
    x = with_one((given - middle) / spread).astype(np.float32)
    y = np.column_stack([(body - level) / size, 2.0 * np.eye(motions)[of]]).astype(np.float32)
    inputs, outputs, steps = x.shape[1], y.shape[1], 30
    u = rng.standard_normal((inputs, 3 * hidden)) / np.sqrt(inputs)
    w = rng.standard_normal((hidden, 3 * hidden)) / np.sqrt(hidden)
    v = rng.standard_normal((hidden + 1, outputs)) * 0.1
    u, w, v = (one.astype(np.float32) for one in (u, w, v))
    moments = [np.zeros((2, *one.shape), np.float32) for one in (u, w, v)]
    starts = rng.permutation(len(x) - steps)
    curve: dict[int, float] = {}
    held, kept, trained = starts[::10], (np.inf, u.copy(), w.copy(), v.copy(), 0), np.delete(starts, np.s_[::10])

    def run(rows: Array, h: Array) -> tuple[Array, list[tuple[Array, ...]]]:
        states, tape = [], []
        for a in rows @ u:
            b = h @ w
            gates = 1.0 / (1.0 + np.exp(-a[:, : 2 * hidden] - b[:, : 2 * hidden]))
            z, r = gates[:, :hidden], gates[:, hidden:]
            c = np.tanh(a[:, 2 * hidden :] + r * b[:, 2 * hidden :])
            tape.append((h, z, r, c, b[:, 2 * hidden :]))
            h = (1.0 - z) * h + z * c
            states.append(h)
        return np.array(states), tape

    def loss(at: Array) -> float:
        rows = at[None] + np.arange(steps)[:, None]
        states, _ = run(x[rows], np.zeros((len(at), hidden), np.float32))
        return float(np.square(states @ v[:-1] + v[-1] - y[rows])[10:].mean())

    for batch in range(1, 8001):
        at = rng.choice(trained, 48)
        rows = at[None] + np.arange(steps)[:, None]
        half = rng.integers(0, 48, 24)  # half of them change to another place on the way, as in a jump
        rows[15:, :24] = rows[:15, half]
        states, tape = run(x[rows], np.zeros((48, hidden), np.float32))
        error = (states @ v[:-1] + v[-1] - y[rows]) / (48 * steps)
        flat, every = error.reshape(-1, outputs), np.empty((steps, 48, 3 * hidden), np.float32)
        dv = np.concatenate([states.reshape(-1, hidden).T @ flat, flat.sum(0)[None]])
        dw, back = np.zeros_like(w), np.zeros((48, hidden), np.float32)
        wanted = error @ v[:-1].T
        for t in reversed(range(steps)):
            h, z, r, c, b = tape[t]
            back = back + wanted[t]
            dc = back * z * (1.0 - c * c)
            dz, dr = back * (c - h) * z * (1.0 - z), dc * b * r * (1.0 - r)
            every[t] = np.concatenate([dz, dr, dc], axis=1)
            gates = np.concatenate([dz, dr, dc * r], axis=1)
            dw += h.T @ gates
            back = back * (1.0 - z) + gates @ w.T
        du = x[rows].reshape(-1, inputs).T @ every.reshape(-1, 3 * hidden)
        rate = 2e-3 * 0.5 ** (batch / 1500.0)
        for value, slope, (m1, m2) in zip((u, w, v), (du, dw, dv), moments, strict=True):
            m1 += 0.1 * (slope - m1)
            m2 += 0.001 * (np.square(slope) - m2)
            value -= rate * (m1 / (1.0 - 0.9**batch)) / (np.sqrt(m2 / (1.0 - 0.999**batch)) + 1e-8)
        if batch % 100 == 0:
            now = loss(held[:400])
            if batch % 1000 == 0:
                curve[batch] = now
            if now < kept[0]:
                kept = (now, u.copy(), w.copy(), v.copy(), batch)
            elif batch - kept[4] >= 1500:
                break
    _, u, w, v, _ = kept
    asked, origin, angles = features(stream.measured)
    states, _ = run(with_one((asked - middle) / spread)[:, None], np.zeros((1, hidden)))
    told = states[:, 0] @ v[:-1] + v[-1]
    joints = in_world(told[:, : first.body.shape[1]] * size + level, origin, angles)
    return {"GRU": Told(joints, told[:, first.body.shape[1] :].argmax(1))}, curve


def warped(one: Recorded, other: Recorded) -> Array:
    """The frame of another recording for each frame of one, by dynamic time warping of whole bodies."""
    apart = np.linalg.norm(one.own[:, None] - other.own[None], axis=2)
    rows, columns = apart.shape
    total = np.full((rows + 1, columns + 1), np.inf)
    total[0, 0] = 0.0
    for i in range(rows):
        for j in range(columns):
            total[i + 1, j + 1] = apart[i, j] + min(total[i, j], total[i, j + 1], total[i + 1, j])
    place, visits, i, j = np.zeros(rows), np.zeros(rows), rows, columns
    while i and j:
        place[i - 1] += j - 1
        visits[i - 1] += 1
        ways = total[i - 1, j - 1], total[i - 1, j], total[i, j - 1]
        step = int(np.argmin(ways))
        i, j = i - (step < 2), j - (step != 1)
    return place / np.maximum(visits, 1)


def within(ok: Array, begin: int, end: int, steps: int, run: int) -> bool:
    """Whether something is true for `run` steps on end, from at most `steps` after `begin` on."""
    return any(ok[at : at + run].all() for at in range(begin, min(begin + steps + 1, end - run + 1)))


def judged(
    told: Told, stream: Stream, recordings: Sequence[Recorded], known: Sequence[Recorded], rest: Sequence[int]
) -> Array:
    """mm, share named, share named in time, error of the phase, s, and the share of jumps that are back in time."""
    joints = np.array(stream.joints)
    mm = 1e3 * np.linalg.norm(told.joints[:, rest] - joints[:, rest], axis=-1).mean()
    right = told.motion == np.array([recordings[index].motion for index in stream.recording])
    changes = [step for step, event in enumerate(stream.event) if event == "change"]
    soon = [within(right, a, b, round(0.5 * RATE), 6) for a, b in zip(changes, [*changes[1:], len(right)], strict=True)]
    error, back = np.full(len(right), np.nan), [np.nan]
    if told.recording is not None and told.frame is not None:
        tables: dict[tuple[int, int], Array] = {}
        for step in np.flatnonzero(right):
            pair = stream.recording[step], int(told.recording[step])
            if pair not in tables:
                tables[pair] = warped(recordings[pair[0]], known[pair[1]])
            true = np.interp(stream.frame[step], np.arange(len(tables[pair])), tables[pair])
            error[step] = (told.frame[step] - true) / RATE
        jumps = [step for step, event in enumerate(stream.event) if event == "jump"]
        back = [within(np.abs(error) < 0.15, step, len(right), round(0.3 * RATE), 3) for step in jumps]
    known_error = np.abs(error[np.isfinite(error)])
    return np.array(
        [mm, right.mean(), np.mean(soon), np.median(known_error) if len(known_error) else np.nan, np.mean(back)]
    )


def main(
    data: Annotated[Path, typer.Option(help="The folder with the recordings.")],
    points: Annotated[str, typer.Option(help="three (head, hands), six (also root, feet) or joints.")] = "three",
    walks: Annotated[bool, typer.Option("--walks", help="CMU's walks instead of HDM05's seven motions.")] = False,
    chosen_on: Annotated[bool, typer.Option("--chosen-on", help="The actors that settings were chosen on.")] = False,
    gru: Annotated[bool, typer.Option(help="Train the GRU too, some minutes for each actor.")] = True,
    seed: Annotated[int, typer.Option(help="Of the streams and networks.")] = 51,
) -> None:
    bones, recordings = read(data, walks=walks)
    seen = [bones.index(name) for name in POINTS[points]]
    rest = [joint for joint in range(len(bones)) if joint not in seen]
    motions = 1 + max(one.motion for one in recordings)
    actors = sorted({one.actor for one in recordings})
    rows: dict[str, list[Array]] = {}
    losses: dict[str, dict[int, float]] = {}
    with threadpool_limits(1):
        for actor in actors if walks else [one for one in actors if (one in CHOSEN_ON) == chosen_on]:
            stream = disturbed(recordings, actor, seen, seed)
            known = [one for one in recordings if one.actor != actor]
            if points == "joints":
                joints, whole = angles_of(recordings)
                others = [one for one, other in zip(whole, recordings, strict=True) if other.actor != actor]
                own = [one for one, other in zip(whole, recordings, strict=True) if other.actor == actor]
                print(
                    "{}: clip complete {:.1f} degrees, the mean {:.1f}".format(
                        actor, *completed_joints(joints, others, own)
                    )
                )
                heights = [one[:, :HAND_LED] for one in whole]
                led = by_angles(
                    known, [one[:, :HAND_LED] for one in others], led_by_hand(stream, heights, seed), motions
                )["filter"]
                rows.setdefault("filter", []).append(judged(led, stream, recordings, known, rest))
                continue
            learned = lessons(known, seen, seed)
            told = by_filter(known, seen, stream, motions)
            told |= by_conceptors(learned, stream, motions, recurrent=True, seed=seed)
            for name, one in by_conceptors(learned, stream, motions, recurrent=False, seed=seed).items():
                told["W = 0" if name == "conceptors" else "W = 0, C = 1"] = one
            told |= by_window(learned, stream, motions) | by_completion(known, seen, stream)
            told |= by_person(known, POINTS[points], seen, stream, told["filter"])
            told |= by_oracle(known, seen, stream)
            if gru:
                told |= (found := by_gru(learned, stream, motions, seed))[0]
                losses[actor] = found[1]
            for name, one in told.items():
                rows.setdefault(name, []).append(judged(one, stream, recordings, known, rest))
    print("| way | mm (actors) | named | named in 0.5 s | phase, s | back in 0.3 s |\n|---|---|---|---|---|---|")
    for name, each in rows.items():
        mm, named, soon, phase, back = np.mean(each, axis=0)
        spread = f"{min(one[0] for one in each):.0f}-{max(one[0] for one in each):.0f}"
        timed = [f"{phase:.2f}", f"{100 * back:.0f} %"] if np.isfinite(phase) else ["", ""]
        shares = [f"{100 * named:.0f} %", f"{100 * soon:.0f} %"] if named else ["", ""]
        far = f"{mm:.0f} ({spread})" if np.isfinite(mm) else ""
        print(f"| {name} | {far} | {' | '.join([*shares, *timed])} |")
    for actor, curve in losses.items():
        fallen = ", ".join(f"{batch}: {loss:.5f}" for batch, loss in curve.items())
        print(f"GRU without {actor}, loss of held-out windows after batches: {fallen}")


if __name__ == "__main__":
    command.run("body_drives", main, __doc__)
