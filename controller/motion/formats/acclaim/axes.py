"""What an Acclaim skeleton file holds beyond the tree of bones, and Acclaim's axes in ours.

The format (Acclaim Skeleton File Definition 1.10, M. Schafer 1995) gives all bones in one global frame, y up, x left,
z forward; ours is x forward, y left, z up, which is a cyclic exchange. With C the rotation of a bone's own axes and M
that of its recorded angles, the bone turns by C M C^-1 against its parent.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import IDENTITY, Array, about, multiply
from controller.motion.skeleton import Skeleton

AXES = {"x": np.array([0.0, 1.0, 0.0]), "y": np.array([0.0, 0.0, 1.0]), "z": np.array([1.0, 0.0, 0.0])}


@dataclass(frozen=True, eq=False)
class AcclaimSkeleton:
    """A skeleton and what is needed to read its recordings; lists of 1 + B entries begin with the root.

    Attributes:
        skeleton: B bones, in our axes, m.
        axis: how the axes of each bone's angles stand in the rest pose, shape (1 + B, 4).
        dof: names of each bone's recorded channels in their order, out of rx, ry, rz (the root also tx, ty, tz).
        limits: what each channel can reach, shape (n, 2) per bone, rad (root: m or rad); infinite where none is given.
        root_position: added to all recorded root positions, shape (3,), m.
        length_unit: what one ASF length is, m.
        angle_unit: what one ASF angle is, rad.
        source: the name of the file.
    """

    skeleton: Skeleton
    axis: Array
    dof: tuple[tuple[str, ...], ...]
    limits: tuple[Array, ...]
    root_position: Array
    length_unit: float
    angle_unit: float
    source: str


def from_acclaim(vector: Array | list[float]) -> Array:
    """A vector (..., 3) of ASF's axes (x left, y up, z forward) in ours (x forward, y left, z up)."""
    return np.asarray(vector)[..., [2, 0, 1]]


def turned(turns: Iterable[tuple[str, Array | float]]) -> Array:
    """Quaternions (..., 4) of turns one after another, each about a fixed axis of ASF, x, y or z, by (...) rad."""
    q = IDENTITY
    for axis, angle in turns:
        q = multiply(about(AXES[axis], angle), q)
    return q
