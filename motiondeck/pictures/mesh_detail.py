"""Meshes with no more detail than a picture shows: a robot of 400 000 triangles is drawn from a quarter of them."""

from __future__ import annotations

import copy

import mujoco
import numpy as np


def with_less_detail(model: mujoco.MjModel, finest: float) -> mujoco.MjModel:
    """A copy of a model, to be drawn only, whose meshes show nothing finer than so many metres.

    Vertices within one cell of a grid become one of them, and triangles without an area go (Rossignac and Borrel 1993).
    """
    drawn = copy.copy(model)
    for mesh in range(drawn.nmesh):
        first, count = drawn.mesh_vertadr[mesh], drawn.mesh_vertnum[mesh]
        start, end = drawn.mesh_faceadr[mesh], drawn.mesh_faceadr[mesh] + drawn.mesh_facenum[mesh]
        cells = np.floor(drawn.mesh_vert[first : first + count] / finest).astype(np.int64)
        _, chosen, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        faces = chosen[cell.ravel()][drawn.mesh_face[start:end]]
        a, b, c = faces.T
        kept = (a != b) & (b != c) & (a != c)
        left = int(kept.sum())
        if left == 0:  # smaller than a cell as a whole
            continue
        drawn.mesh_face[start : start + left] = faces[kept]
        for corners in (drawn.mesh_facenormal, drawn.mesh_facetexcoord):
            corners[start : start + left] = corners[start:end][kept]
        drawn.mesh_facenum[mesh] = left
    return drawn
