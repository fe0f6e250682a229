"""Contact forces: where the floor holds a simulated body, and how hard."""

from __future__ import annotations

import mujoco
import numpy as np

from controller.motion.rotations import Array


def contact_forces(model: mujoco.MjModel, data: mujoco.MjData, out: Array) -> None:
    """Writes where the floor holds the body and how hard, one row (6,) a body part: m and N in the world.

    Args:
        model: what is simulated.
        data: its state.
        out: shape (N, 6); parts beyond N are left out, and rows without one are NaN.
    """
    out[:] = np.nan
    parts: dict[int, int] = {}
    force = np.empty(6)
    for index in range(data.ncon):
        contact = data.contact[index]
        first, second = (int(model.geom_bodyid[geom]) for geom in (contact.geom1, contact.geom2))
        if 0 not in (first, second):
            continue
        row = parts.setdefault(first or second, len(parts))
        if row >= len(out):
            continue
        mujoco.mj_contactForce(model, data, index, force)
        # The frame's x axis, and the force, go from the first geom to the second.
        pushed = (-1.0 if second == 0 else 1.0) * force[:3] @ contact.frame.reshape(3, 3)
        if np.isnan(out[row, 0]):
            out[row] = 0.0
        weight = max(float(np.linalg.norm(pushed)), 1e-9)
        total = out[row, 3:] + pushed
        # The point is the mean of those where it touches, by how hard.
        sums = float(np.linalg.norm(out[row, 3:]))
        out[row, :3] = (sums * out[row, :3] + weight * contact.pos) / (sums + weight)
        out[row, 3:] = total
