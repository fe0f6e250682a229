"""The body of the thesis: the 19 bones of Jaeger's patterns, with a rest pose."""

import numpy as np

from controller.motion.rotations import Array
from controller.motion.skeleton import ROOT, Skeleton

# Bone, parent, and direction in the rest pose: arms out sideways, legs down, feet forward. Order and tree are those of
# Jaeger's patterns, which have no rest pose.
_TREE: tuple[tuple[str, str, tuple[float, float, float]], ...] = (
    ("rhip", "root", (0.0, -1.0, 0.0)),
    ("rkne", "rhip", (0.0, 0.0, -1.0)),
    ("rank", "rkne", (0.0, 0.0, -1.0)),
    ("rfoo", "rank", (1.0, 0.0, 0.0)),
    ("lhip", "root", (0.0, 1.0, 0.0)),
    ("lkne", "lhip", (0.0, 0.0, -1.0)),
    ("lank", "lkne", (0.0, 0.0, -1.0)),
    ("lfoo", "lank", (1.0, 0.0, 0.0)),
    ("back", "root", (0.0, 0.0, 1.0)),
    ("neck", "back", (0.0, 0.0, 1.0)),
    ("head", "neck", (0.0, 0.0, 1.0)),
    ("rsho", "neck", (0.0, -1.0, 0.0)),
    ("relb", "rsho", (0.0, -1.0, 0.0)),
    ("rwri", "relb", (0.0, -1.0, 0.0)),
    ("rhan", "rwri", (0.0, -1.0, 0.0)),
    ("lsho", "neck", (0.0, 1.0, 0.0)),
    ("lelb", "lsho", (0.0, 1.0, 0.0)),
    ("lwri", "lelb", (0.0, 1.0, 0.0)),
    ("lhan", "lwri", (0.0, 1.0, 0.0)),
)
JAEGER_BONES = tuple(bone for bone, _, _ in _TREE)
JAEGER_PARENT = tuple(ROOT if parent == "root" else JAEGER_BONES.index(parent) for _, parent, _ in _TREE)
JAEGER_REST = tuple(rest for _, _, rest in _TREE)


def thesis_skeleton(lengths: Array, name: str = "jaeger") -> Skeleton:
    """The skeleton of the thesis with the given lengths of its 19 bones, shape (19,), m."""
    return Skeleton(name, JAEGER_BONES, np.array(JAEGER_PARENT), np.array(JAEGER_REST), np.asarray(lengths, np.float64))
