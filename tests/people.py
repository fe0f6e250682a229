"""A person who moves, made up for tests of file formats: where the joints are is computed here with scipy alone.

Axes are those of most files: x to the person's left, y up, z forward; m, degrees nowhere.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

# Joint, parent, where it stands against its parent when the person stands with the arms out.
JOINTS = (
    ("hips", None, (0.0, 0.0, 0.0)),
    ("spine", "hips", (0.0, 0.10, 0.0)),
    ("chest", "spine", (0.0, 0.20, 0.0)),
    ("neck", "chest", (0.0, 0.22, 0.0)),
    ("head", "neck", (0.0, 0.10, 0.02)),
    ("head end", "head", (0.0, 0.18, 0.0)),
    *(
        joint
        for side, out in (("l", 1.0), ("r", -1.0))
        for joint in (
            (side + " thigh", "hips", (out * 0.09, -0.05, 0.0)),
            (side + " shank", side + " thigh", (0.0, -0.42, 0.01)),
            (side + " foot", side + " shank", (0.0, -0.40, -0.01)),
            (side + " toes", side + " foot", (0.0, -0.06, 0.14)),
            (side + " toes end", side + " toes", (0.0, 0.0, 0.06)),
            (side + " collar", "chest", (out * 0.03, 0.17, 0.0)),
            (side + " arm", side + " collar", (out * 0.14, 0.02, 0.0)),
            (side + " forearm", side + " arm", (out * 0.28, 0.0, 0.0)),
            (side + " hand", side + " forearm", (out * 0.25, 0.0, 0.0)),
            (side + " hand end", side + " hand", (out * 0.09, 0.0, 0.0)),
        )
    ),
)
KEYS = tuple(key for key, _, _ in JOINTS)
PARENT = {key: parent for key, parent, _ in JOINTS}
OFFSET = {key: np.array(offset) for key, _, offset in JOINTS}
CANONICAL = {
    side + end: f"{side} {key}"
    for side in "lr"
    for end, key in (
        ("hip", "thigh"),
        ("kne", "shank"),
        ("ank", "foot"),
        ("foo", "toes"),
        ("sho", "arm"),
        ("elb", "forearm"),
        ("wri", "hand"),
    )
}


@dataclass(frozen=True)
class Motion:
    """T frames: rate in Hz, where the hips are (T, 3), how each joint turns against its parent, and where all are."""

    rate: float
    root: np.ndarray
    turn: dict[str, Rotation]
    place: dict[str, np.ndarray]
    world: dict[str, Rotation]


def moving(frames=25, rate=60.0, seed=0, reach=0.5, offset=None):
    """Somebody who walks to and fro and moves all limbs, smoothly."""
    offset = offset or OFFSET
    draw = np.random.default_rng(seed)
    time = np.arange(frames) / rate
    root = np.stack([0.3 * np.sin(time), 0.94 + 0.03 * np.cos(5.0 * time), 1.2 * time], axis=1)
    turn = {}
    for key in KEYS:
        size = 0.0 if key.endswith(" end") else reach * (0.4 if key in ("hips", "spine", "chest") else 1.0)
        wave = draw.normal(0.0, 0.5, 3) * np.sin(draw.uniform(2.0, 8.0) * time[:, None] + draw.uniform(0.0, 6.0))
        turn[key] = Rotation.from_rotvec(size * wave)
    place, world = {}, {}
    for key in KEYS:
        above = PARENT[key]
        if above is None:
            place[key], world[key] = root, turn[key]
        else:
            place[key] = place[above] + world[above].apply(offset[key])
            world[key] = world[above] * turn[key]
    return Motion(rate, root, turn, place, world)


def in_our_axes(track):
    """Positions (T, 3) with x left and y up, as we have them: x forward, y left, z up."""
    return track[:, [2, 0, 1]]


def farthest(joints, track):
    """How far the joint of a clip (T, J, 3) that is nearest to a track (T, 3) ever is from it."""
    return float(np.linalg.norm(joints - track[:, None], axis=-1).max(axis=0).min())


def check_person(clip, motion, tolerance=1e-6, lacking=()):
    """Every joint of the person is a joint of the clip, and the canonical landmarks are the right ones."""
    from controller.motion.canonical.canonical_body import to_canonical

    joints = clip.joints()
    for key, track in motion.place.items():
        if key not in lacking:
            assert farthest(joints, in_our_axes(track)) < tolerance, key
    own = to_canonical(clip)
    ends = dict(zip(own.skeleton.bones, np.moveaxis(own.joints(), 1, 0)[1:], strict=True))
    directions = {bone: ends[bone] - (ends | {"root": own.root_position})[_above(own, bone)] for bone in ends}
    for bone, key in CANONICAL.items():
        start = _above(own, bone)
        if key in lacking or start not in CANONICAL:
            continue
        line = in_our_axes(motion.place[key] - motion.place[CANONICAL[start]])
        cosine = (
            (line * directions[bone]).sum(-1)
            / np.linalg.norm(line, axis=-1)
            / np.linalg.norm(directions[bone], axis=-1)
        )
        assert np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).max() < 0.1, bone


def _above(clip, bone):
    parent = clip.skeleton.parent[clip.skeleton.bones.index(bone)]
    return "root" if parent < 0 else clip.skeleton.bones[parent]
