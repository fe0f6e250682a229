"""The rest pose of a recorded body from the zero pose of its file: standing, arms out, facing x, in metres.

A zero pose may be usable (the usual T or A pose) or arbitrary (bones along their own axes, as in iClone's files). Then
the most upright frame of the recording is straightened: legs down, trunk up, arms out. For a body that never stands (it
lies, crawls, does a handstand) frames are first rotated until the pelvis is upright, if its limbs have usual names. The
vertical axis is detected from standing and ground contact (`up_axis`), the heading from feet, the unit from size.

With K the rotation of a bone from its zero pose to the rest pose, P that of the file's axes to ours and R the recorded
rotation, the bone rests along K v and moves by P R K^-1, which keeps every joint where the file has it.
"""

from collections import Counter
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from controller.motion.anatomy import SIDES, Anatomy, anatomy, named_anatomy
from controller.motion.clip import Up
from controller.motion.rotations import Array, best_fit, between, conjugate, cross, multiply, normalise, rotate, yaw
from controller.motion.skeleton import ROOT, Skeleton
from controller.motion.up_axis import AXES, TO_OURS, UPRIGHT, up_in_recording

# Units of length, m, and how usual they are: metre, centimetre, millimetre; inch, and the inch / 0.45 of CMU's.
UNITS = {1.0: 1.0, 0.01: 1.0, 0.001: 1.0, 0.0254: 0.15, 0.0254 / 0.45: 0.1}
# Statures, m: of adults by a normal distribution of their logarithm, and the share of others, small children to giants.
STATURE, SPREAD, OTHERS, SMALLEST, TALLEST = 1.70, 0.10, 0.1, 0.75, 2.25
FITS_TOO = 0.04  # times as likely as the likeliest unit: then the file may be in that one
LEG_PER_STATURE = 0.245 + 0.246  # thigh and shank (Winter 2009, fig. 4.1)
SPINE_PER_STATURE = 0.470  # from the hips to the top of the head; gives the size of short-legged characters

FRAMES_TRIED = 24
FRAMES_JUDGED = 200  # at most, for the vertical axis
STANDING = 0.5  # least uprightness of a frame that can be straightened
RAISED = -0.9  # the same for named limbs and an upright pelvis: any bend can be straightened
# A foot bone runs from the ankle down to the toes: this far below the horizontal when the sole is flat, rad.
FOOT_SLOPE = 0.30
KNEE_WEIGHT = 0.3  # of a bent knee, relative to a foot, for the heading
NEARLY = np.radians(10.0)  # a smaller heading counts as straight ahead


@dataclass(frozen=True, eq=False)
class RecordedBody:
    """B bones and T frames in the axes and the unit of a file."""

    bones: tuple[str, ...]
    parent: NDArray[np.int64]  # (B,), parents first
    vector: Array  # of each bone in the zero pose, (B, 3)
    position: Array  # of the root, (T, 3)
    rotation: Array  # of the root and of each bone in the world, (T, 1 + B, 4)


@dataclass(frozen=True, eq=False)
class _Stance:
    """A candidate rest pose: rotations from the zero pose, (1 + B, 4), and its uprightness (the least cosine)."""

    up: Up
    turn: Array
    upright: float
    parts: Anatomy | None


class RestedBody(NamedTuple):
    """A body of B bones that is known by its rest pose, over T frames in our axes."""

    skeleton: Skeleton
    position: Array  # of the root, (T, 3), m
    rotation: Array  # (T, 1 + B, 4)
    unit: float  # of the file, m
    up: Up  # the file's vertical axis
    other_unit: float | None = None  # of the file, m, that fits too


def rest_skeleton(name: str, body: RecordedBody, unit: float | None = None, up: Up | None = None) -> RestedBody:
    """Skeleton and motion of a body with a bone or more; None detects the unit of length, m, or the vertical axis."""
    zero = np.tile([1.0, 0.0, 0.0, 0.0], (1 + len(body.bones), 1))
    stances = [_stance(body, axis, zero) for axis in AXES]
    best = max(stances, key=lambda stance: stance.upright)
    stands = best.upright >= UPRIGHT
    if not stands:
        tried = np.unique(np.linspace(0, len(body.position) - 1, FRAMES_TRIED).astype(int))
        frame = _agreed([_stance(body, axis, body.rotation[frame]) for axis in AXES for frame in tried])
        if frame.upright <= STANDING:
            frame = max((_raised(body, body.rotation[frame]) for frame in tried), key=lambda stance: stance.upright)
        best = _straightened(body, frame) if frame.parts is not None and frame.upright > RAISED else stances[0]
    vector = rotate(best.turn[1:], body.vector)
    length = np.linalg.norm(vector, axis=1)
    unit, other = _unit(body, vector, best.parts) if unit is None else (unit, None)
    skeleton = Skeleton(name, body.bones, body.parent, normalise(vector), length * unit)
    up = up or _up_in_recording(body, best, stands, skeleton, unit)
    world = TO_OURS[up]
    rotation = multiply(multiply(np.broadcast_to(world, body.rotation.shape), body.rotation), conjugate(best.turn))
    return RestedBody(skeleton, rotate(world, body.position) * unit, rotation, unit, up, other)


def _stance(body: RecordedBody, up: Up, pose: Array) -> _Stance:
    """The stance of a pose (1 + B, 4), rotated about the vertical to face x."""
    turn = multiply(TO_OURS[up], pose)
    vector = rotate(turn[1:], body.vector)
    facing = _facing(body, vector)
    if facing is None:
        return _Stance(up, turn, -1.0, None)
    if abs(facing) > NEARLY:
        turn = multiply(yaw(-facing), turn)
        vector = rotate(turn[1:], body.vector)
    parts = anatomy(_as_skeleton(body, vector))
    direction = normalise(vector)
    legs = [parts.first(part, side) for side in SIDES for part in ("thigh", "shank")]
    cosines = [-1.0 if bone is None else -float(direction[bone, 2]) for bone in legs]
    spine = [bone for part in ("trunk", "neck") for bone in parts.all(part)] or parts.all("head")
    if spine:
        cosines.append(float(normalise(vector[spine].sum(axis=0))[2]))
    elif named_anatomy(_as_skeleton(body, vector)) is None:  # without names, arms could be taken for legs
        cosines.append(-1.0)
    return _Stance(up, turn, min(cosines), parts)


def _raised(body: RecordedBody, pose: Array) -> _Stance:
    """The stance of a pose (1 + B, 4), rotated until its pelvis is upright; for usual names only."""
    vector = rotate(pose[1:], body.vector)
    skeleton = _as_skeleton(body, vector)
    parts = named_anatomy(skeleton)
    if parts is None:
        return _Stance("y", pose, -1.0, None)
    start = skeleton.chain @ vector - vector
    left, right = (start[bone] for side in SIDES if (bone := parts.first("thigh", side)) is not None)
    trunk = parts.all("trunk") or parts.all("neck")
    up = normalise(vector[trunk[:1]].sum(axis=0) - 1e-3 * vector[parts.all("thigh")].sum(axis=0))
    across = normalise(left - right)
    ahead = normalise(cross(across, up))
    turn = best_fit(np.stack([ahead, across, cross(ahead, across)]))
    return replace(_stance(body, "z", multiply(np.broadcast_to(turn, pose.shape), pose)), up="y")


def _agreed(stances: list[_Stance]) -> _Stance:
    """The most upright stance with the anatomy of the majority of upright frames."""
    upright = [stance for stance in stances if stance.upright > STANDING and stance.parts is not None]
    votes = Counter(stance.parts for stance in upright)
    if not votes:
        return max(stances, key=lambda stance: stance.upright)
    most = max(votes.values())
    return max((s for s in upright if votes[s.parts] == most), key=lambda stance: stance.upright)


def _as_skeleton(body: RecordedBody, vector: Array) -> Skeleton:
    return Skeleton("", body.bones, body.parent, normalise(vector), np.linalg.norm(vector, axis=1))


def _facing(body: RecordedBody, vector: Array) -> float | None:
    """The heading of a body with bones (B, 3), about z from x, rad; None without two legs."""
    skeleton = _as_skeleton(body, vector)
    sided = _named_across(skeleton, vector)
    if sided is not None:
        return float(np.arctan2(-sided[0], sided[1]))
    legs: list[tuple[float, Array, Array]] = []  # length, start of the thigh, direction ahead
    for branch in skeleton.children(ROOT):
        limb = np.flatnonzero(skeleton.chain[:, branch])
        way = np.flatnonzero(skeleton.chain[max(limb, key=lambda bone: skeleton.chain[bone] @ skeleton.length)])
        if vector[way].sum(axis=0)[2] < 0.0 and len(way) > 1:
            thigh = int(np.argmax(skeleton.length[way][:-1] + skeleton.length[way][1:]))
            long = skeleton.length[way].sum()
            # Feet point ahead, and knees bend so that they do.
            knee = skeleton.rest_direction[way[thigh]] - skeleton.rest_direction[way[thigh + 1]]
            ahead = vector[way[thigh + 2 :]].sum(axis=0) + KNEE_WEIGHT * long * knee
            legs.append((long, vector[way[:thigh]].sum(axis=0), ahead))
    if len(legs) < 2:
        return None
    (length, one, one_points), (_, other, other_points) = sorted(legs, key=lambda leg: -leg[0])[:2]
    across = (one - other)[:2]
    if np.linalg.norm(across) < 1e-3 * length:
        return None
    ahead = np.array([across[1], -across[0]])
    points = (one_points + other_points)[:2]
    pointed = np.linalg.norm(points) > 0.02 * length
    if ahead @ (points if pointed else np.array([1.0, 0.0])) < 0.0:
        ahead = -ahead
    return float(np.arctan2(ahead[1], ahead[0]))


def _named_across(skeleton: Skeleton, vector: Array) -> Array | None:
    """From the right thigh to the left one, horizontally, shape (2,); None without usual names."""
    parts = named_anatomy(skeleton)
    if parts is None:
        return None
    start = (skeleton.chain @ vector) - vector
    left, right = (start[bone] for side in SIDES if (bone := parts.first("thigh", side)) is not None)
    across = (left - right)[:2]
    apart = float(np.linalg.norm(across)) > 1e-3 * float(skeleton.length.sum())
    return across if apart else None


def _straightened(body: RecordedBody, stance: _Stance) -> _Stance:
    """The stance with legs down, trunk up and arms out; other bones move with their parents."""
    parts = stance.parts
    assert parts is not None
    vector = rotate(stance.turn[1:], body.vector)
    more = np.tile([1.0, 0.0, 0.0, 0.0], (1 + len(vector), 1))  # additional rotation of each bone
    trunk = parts.all("trunk")
    spine = vector[trunk].sum(axis=0) if trunk else np.zeros(3)
    down, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    flat = np.array([np.cos(FOOT_SLOPE), 0.0, -np.sin(FOOT_SLOPE)])
    for bone, (part, side) in enumerate(zip(parts.part, parts.side, strict=True)):
        carried = more[body.parent[bone] + 1]
        out = np.array([0.0, 1.0 if side == "left" else -1.0, 0.0])
        goal = {"thigh": down, "shank": down, "trunk": up, "foot": flat, "upper arm": out, "forearm": out}.get(part)
        start = vector[bone]
        if part in ("trunk", "foot"):
            # A back keeps its curve and a foot its toes: each rotates as one, at its first bone.
            first = parts.all(part, side)[0]
            start = spine if part == "trunk" else vector[first]
            goal = goal if body.parent[bone] == body.parent[first] else None
        if goal is not None:
            carried = multiply(between(normalise(rotate(carried, start)), goal), carried)
        more[bone + 1] = carried
    return _Stance(stance.up, multiply(more, stance.turn), 1.0, parts)


def _up_in_recording(body: RecordedBody, rest: _Stance, stands: bool, skeleton: Skeleton, unit: float) -> Up:
    spine = [] if rest.parts is None else rest.parts.all("trunk")
    if rest.parts is None or not spine:
        return rest.up
    along = rotate(body.rotation[:, np.array(spine) + 1], body.vector[spine]).sum(axis=1)
    some = slice(None, None, 1 + len(along) // FRAMES_JUDGED)
    turned = multiply(body.rotation[some], conjugate(rest.turn))
    joints = skeleton.joints(body.position[some] * unit, turned)
    limbs = [1 + bone for bone, part in enumerate(rest.parts.part) if part != "other"]
    return up_in_recording(rest.up, stands, along, body.position * unit, joints[:, limbs], skeleton.leg_length)


def _unit(body: RecordedBody, vector: Array, parts: Anatomy | None) -> tuple[float, float | None]:
    """The unit in which the body, by its legs or by its trunk and head, is a person, and another that fits."""
    skeleton = _as_skeleton(body, vector)
    legs = [] if parts is None else [*parts.all("thigh"), *parts.all("shank")]
    spine = [] if parts is None else [bone for part in ("trunk", "neck", "head") for bone in parts.all(part)]
    stature = float(skeleton.length[legs].sum()) / 2.0 / LEG_PER_STATURE
    if stature > 0.0 and spine:
        up_to = skeleton.chain[np.ix_(spine, spine)] @ skeleton.length[spine]
        stature = max(stature, float(up_to.max()) / SPINE_PER_STATURE)
    if stature == 0.0:
        ends = skeleton.chain @ vector
        stature = float(np.ptp(np.vstack([ends, np.zeros(3)]), axis=0).max())

    found = sorted(UNITS, key=lambda unit: _likelihood(stature * unit) * UNITS[unit], reverse=True)
    best, other = (_likelihood(stature * unit) * UNITS[unit] for unit in found[:2])
    if best == 0.0:  # no person's size: the nearest
        size = max(stature, 1e-12)
        return min(UNITS, key=lambda unit: abs(np.log(size * unit / STATURE)) - np.log(UNITS[unit])), None
    return found[0], found[1] if other > FITS_TOO * best else None


def _likelihood(stature: float) -> float:
    """How likely a person of this stature, m, is."""
    if not SMALLEST < stature < TALLEST:
        return 0.0
    adults = np.exp(-0.5 * (np.log(stature / STATURE) / SPREAD) ** 2) / (SPREAD * np.sqrt(2.0 * np.pi))
    return float((1.0 - OTHERS) * adults + OTHERS / np.log(TALLEST / SMALLEST))
