"""From bone directions to bone rotations: what marker positions leave open is settled the same way every time.

A direction fixes two of a bone's three angles. The third, the twist, follows this rule:

- the root is turned so that the bones that hang from it fit best;
- a bone swings the shortest way from where its parent carries it;
- a bone with several children is then twisted about itself so that they fit best (a chest follows the shoulders).
"""

from __future__ import annotations

import numpy as np

from controller.mocap.skeleton import ROOT, Skeleton
from controller.rotations import Array, about, best_fit, between, cross, dot, multiply, rotate


def orient(skeleton: Skeleton, direction: Array) -> Array:
    """Rotations of the root and of each bone that turn the rest pose into the given directions.

    Args:
        skeleton: with B bones.
        direction: unit vectors of the bones, shape (..., B, 3).

    Returns:
        Unit quaternions, shape (..., 1 + B, 4), with rotate(result[..., 1:, :], rest_direction) == direction.
    """
    rest = skeleton.rest_direction
    rotation = np.empty((*direction.shape[:-2], 1 + len(skeleton), 4))
    first = skeleton.children(ROOT)
    rotation[..., 0, :] = best_fit(np.einsum("...bi,bj->...ij", direction[..., first, :], rest[first]))
    for bones in skeleton.levels:
        carried = rotation[..., skeleton.parent[bones] + 1, :]
        swing = between(rotate(carried, rest[bones]), direction[..., bones, :])
        rotation[..., bones + 1, :] = multiply(swing, carried)
        for bone in bones:
            children = skeleton.children(bone)
            if len(children) > 1:
                turned = rotation[..., bone + 1, :]
                axis = direction[..., bone, :]
                twist = _twist(axis, rotate(turned[..., None, :], rest[children]), direction[..., children, :])
                rotation[..., bone + 1, :] = multiply(about(axis, twist), turned)
    return rotation


def _twist(axis: Array, start: Array, goal: Array) -> Array:
    """The angle about axis (..., 3) that best turns vectors start onto goal, shapes (..., n, 3)."""
    around = axis[..., None, :]
    across = start - dot(start, around)[..., None] * around
    return np.arctan2(dot(cross(around, across), goal).sum(-1), dot(across, goal).sum(-1))
