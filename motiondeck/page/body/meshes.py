"""Simplifies meshes of model files and shades them smoothly except at edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Triangles = tuple[NDArray[np.float32], NDArray[np.uint32]]

CREASE = np.radians(40.0)
"""Where a surface turns by more than this from one triangle to the next is an edge, rad."""


def thinned(mesh: Triangles, most: int) -> Triangles:
    """A mesh of at most `most` triangles: vertices in one cell of a grid become their mean, in ever larger cells."""
    vertices, faces = mesh
    cells = 60
    while len(faces) > most and cells > 2:
        low = mesh[0].min(axis=0)
        size = max(float((mesh[0].max(axis=0) - low).max()), 1e-9) / cells
        grid = ((mesh[0] - low) / size).astype(np.int64) @ np.array([1, 1 << 10, 1 << 20])
        _, place, count = np.unique(grid, return_inverse=True, return_counts=True)
        sums = [np.bincount(place, mesh[0][:, axis], len(count)) for axis in range(3)]
        vertices = (np.stack(sums, axis=1) / count[:, None]).astype(np.float32)
        corners = place[mesh[1]]
        # Each begins with its lowest corner. Of those with the same front one is enough, of those without an area none.
        turned = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(corners, turned, axis=1).T
        _, first = np.unique((a * len(count) + b) * len(count) + c, return_index=True)
        first = np.sort(first)
        faces = corners[first[(a[first] != b[first]) & (b[first] != c[first]) & (c[first] != a[first])]].astype(
            np.uint32
        )
        cells = int(cells / 1.25)
    return vertices, faces


def creased(mesh: Triangles) -> Triangles:
    """The same mesh with separate vertices on both sides of its edges.

    A page shades a corner by the mean direction of the triangles that share it: so what is round looks round, and what
    is sharp sharp.
    """
    place, corners = np.unique(mesh[0], axis=0, return_inverse=True)
    faces = corners.reshape(-1)[mesh[1].astype(np.int64)]
    sides = place[faces]
    across = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]).astype(np.float64)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    # Sides that two triangles share follow each other when sorted by their ends.
    begin, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    ends = np.minimum(begin, end) * len(place) + np.maximum(begin, end)
    order = np.argsort(ends, kind="stable")
    same = ends[order[:-1]] == ends[order[1:]]
    one, other = order[:-1][same], order[1:][same]
    round_ = (across[one // 3] * across[other // 3]).sum(axis=1) > np.cos(CREASE)
    one, other = one[round_], other[round_]
    # A side begins at the corner of its number, and ends at the next corner of its triangle.
    after = np.arange(len(begin)).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    facing = begin[one] == begin[other]
    joined = np.concatenate(
        [
            np.column_stack([one, np.where(facing, other, after[other])]),
            np.column_stack([after[one], np.where(facing, after[other], other)]),
        ]
    )
    links = coo_array((np.ones(len(joined)), joined.T), shape=(len(begin), len(begin)))
    count, shared = connected_components(links, directed=False)
    vertices = np.empty((count, 3), dtype=np.float32)
    vertices[shared] = place[begin]
    return vertices, shared.reshape(-1, 3).astype(np.uint32)
