"""Skeletons for tests: random trees, and a small body with hips, a chest with two arms, and a head."""

import numpy as np

from controller.motion.clip import Clip
from controller.motion.rotations import normalise
from controller.motion.skeleton import Skeleton
from simulated_bodies import human

SMALL = (
    ("rhip", -1, (0, -1, 0), 0.1),
    ("rleg", 0, (0, 0, -1), 0.8),
    ("rfoo", 1, (1, 0, 0), 0.2),
    ("lhip", -1, (0, 1, 0), 0.12),
    ("lleg", 3, (0, 0, -1), 0.8),
    ("chest", -1, (0, 0, 1), 0.5),
    ("head", 5, (0, 0, 1), 0.2),
    ("rarm", 5, (0, -1, 0), 0.6),
    ("larm", 5, (0, 1, 0), 0.6),
)


def small_body(scale=1.0):
    bones, parent, rest, length = zip(*SMALL, strict=True)
    return Skeleton("small", bones, np.array(parent), np.array(rest, dtype=float), scale * np.array(length))


def random_body(rng, bones):
    parent = np.array([int(rng.integers(-1, bone)) for bone in range(bones)])
    names = tuple(f"bone{bone}" for bone in range(bones))
    return Skeleton("random", names, parent, normalise(rng.normal(size=(bones, 3))), rng.uniform(0.05, 0.5, bones))


def random_clip(rng, skeleton, frames):
    rotation = normalise(rng.normal(size=(frames, 1 + len(skeleton), 4)))
    return Clip("random", skeleton, 60.0, rng.normal(size=(frames, 3)), rotation)


def turned(angle, axis=1):
    q = np.zeros((len(angle), 4))
    q[:, 0], q[:, 1 + axis] = np.cos(0.5 * angle), np.sin(0.5 * angle)
    return q


def waving(rate, seconds, hertz=1.0, still=0.0, ends=False):
    """A standing body that swings arms and legs; with `ends` it bows once; before and after it stands still."""
    body = human()
    t = np.arange(round(rate * seconds)) / rate
    swing = 0.5 * np.sin(2.0 * np.pi * hertz * t) if not ends else 1.2 * (0.5 - 0.5 * np.cos(np.pi * t / t[-1]))
    pause = np.zeros(round(rate * still))
    swing = np.concatenate([pause, swing, pause + swing[-1]])
    rotation = np.tile([1.0, 0.0, 0.0, 0.0], (len(swing), 1 + len(body), 1))
    for bones, sign in ((("lkne", "lank", "lfoo"), 1.0), (("rkne", "rank", "rfoo"), 1.0 if ends else -1.0)):
        for bone in bones:
            rotation[:, 1 + body.index(bone)] = turned(sign * swing)
    for bone in ("relb", "rwri", "rhan"):
        rotation[:, 1 + body.index(bone)] = turned(0.8 * swing, axis=2)
    place = np.zeros((len(swing), 3))
    place[:, 2] = 0.9
    return Clip("wave", body, rate, place, rotation)
