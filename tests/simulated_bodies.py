"""Skeletons and poses made up for the simulator's tests."""

import numpy as np
from hypothesis import strategies as st

from controller.motion.rotations import from_rotation_vector, multiply, normalise
from controller.motion.skeleton import Pose, Skeleton
from motiondeck_base.shipped import shipped_configs

ROBOTS = shipped_configs() / "robots"
RIGHT, LEFT, UP, DOWN, AHEAD = (0, -1, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1), (1, 0, 0)

# name, parent, direction in the rest pose, length
HUMAN = (
    ("rhip", -1, RIGHT, 0.09),
    ("rkne", 0, DOWN, 0.45),
    ("rank", 1, DOWN, 0.43),
    ("rfoo", 2, AHEAD, 0.16),
    ("lhip", -1, LEFT, 0.09),
    ("lkne", 4, DOWN, 0.45),
    ("lank", 5, DOWN, 0.43),
    ("lfoo", 6, AHEAD, 0.16),
    ("back", -1, UP, 0.23),
    ("neck", 8, UP, 0.22),
    ("head", 9, UP, 0.19),
    ("rsho", 9, RIGHT, 0.17),
    ("relb", 11, RIGHT, 0.32),
    ("rwri", 12, RIGHT, 0.26),
    ("rhan", 13, RIGHT, 0.07),
    ("lsho", 9, LEFT, 0.17),
    ("lelb", 15, LEFT, 0.32),
    ("lwri", 16, LEFT, 0.26),
    ("lhan", 17, LEFT, 0.07),
)


def skeleton_of(bones, name="made up"):
    names, parents, directions, lengths = zip(*bones, strict=True)
    return Skeleton(name, names, np.array(parents), normalise(np.array(directions, dtype=float)), np.array(lengths))


def human():
    return skeleton_of(HUMAN, "human")


@st.composite
def skeletons(draw):
    """Trees of up to eight bones in any direction, some of no length."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    count = draw(st.integers(1, 8))
    parents = [draw(st.integers(-1, bone - 1)) for bone in range(count)]
    lengths = random.uniform(0.02, 0.6, count) * (random.random(count) > 0.1)
    directions = random.normal(size=(count, 3))
    return skeleton_of([(f"b{i}", parents[i], directions[i], lengths[i]) for i in range(count)])


def random_pose(skeleton, random, reach=np.pi):
    """A pose whose bones are turned from their parents by up to `reach`."""
    bones = len(skeleton)
    axes = normalise(random.normal(size=(1 + bones, 3)))
    turn = from_rotation_vector(axes * random.uniform(0.0, reach, (1 + bones, 1)))
    rotation = turn.copy()
    for bone, parent in enumerate(skeleton.parent):
        rotation[bone + 1] = multiply(rotation[parent + 1], turn[bone + 1])
    return Pose(random.normal(size=3), np.zeros(()), rotation)


def bent_pose(skeleton, **vectors):
    """A pose in which the named bones are turned from their parents by rotation vectors, rad; the others rest."""
    rotation = np.tile([1.0, 0.0, 0.0, 0.0], (1 + len(skeleton), 1))
    for bone, parent in enumerate(skeleton.parent):
        own = from_rotation_vector(np.array(vectors.get(skeleton.bones[bone], (0.0, 0.0, 0.0)), dtype=float))
        rotation[bone + 1] = multiply(rotation[parent + 1], own)
    return Pose(np.array([0.0, 0.0, skeleton.leg_length]), np.zeros(()), rotation)


def smooth_poses(skeleton, random, count, reach=1.2, step=0.03):
    """Poses that wander smoothly: each bone swings about its parent on a few slow waves."""
    bones = len(skeleton)
    waves = random.normal(size=(3, bones, 3))
    phases = random.uniform(0.0, 2.0 * np.pi, (3, bones, 1))
    poses = []
    for frame in range(count):
        swing = sum(waves[k] * np.sin((k + 1) * step * frame + phases[k]) for k in range(3))
        vectors = reach * np.tanh(swing / 2.0)
        poses.append(bent_pose(skeleton, **dict(zip(skeleton.bones, vectors, strict=True))))
    return poses
