"""Skeletons for tests: random trees, and a small body with hips, a chest with two arms, and a head."""

import numpy as np

from controller.mocap.clip import Clip
from controller.mocap.skeleton import Skeleton
from controller.rotations import normalise

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
