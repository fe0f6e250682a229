"""Contact forces of the floor on a simulated body."""

from __future__ import annotations

import mujoco
import numpy as np

from controller.motion.rotations import Array


def contact_forces(model: mujoco.MjModel, data: mujoco.MjData, out: Array) -> None:
    """Writes point (m) and force (N) of the floor's contact with each body part into out (N, 6), in the world.

    Parts beyond N are left out; rows without a part are NaN.
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
        # The point is the mean of the contacts, weighted by force.
        sums = float(np.linalg.norm(out[row, 3:]))
        out[row, :3] = (sums * out[row, :3] + weight * contact.pos) / (sums + weight)
        out[row, 3:] = total
