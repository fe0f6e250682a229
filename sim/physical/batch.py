"""Many simulations of one robot at once, on all cores (mujoco.rollout), and differences between their states.

A state is MuJoCo's qpos and qvel, n = nq + nv numbers. A difference of two has 2 nv numbers: of positions in the
tangent space of the first one, as of mj_differentiatePos, and of velocities.
"""

import mujoco
import numpy as np
from mujoco.rollout import Rollout

from controller.motion.rotations import Array, conjugate, from_rotation_vector, multiply, to_rotation_vector

STEP = 0.005  # s for which a servo's control is held


class Batch:
    """Simulations of a model with a free root and otherwise hinges and slides."""

    def __init__(self, model: mujoco.MjModel, threads: int) -> None:
        """Args: the model, whose timestep divides STEP; the number of threads."""
        self.model = model
        self._pool, self._data = Rollout(nthread=threads), [mujoco.MjData(model) for _ in range(threads)]
        self._width = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._held = max(1, round(STEP / model.opt.timestep))

    def __call__(self, states: Array, controls: Array) -> Array:
        """The states (B, K, n) after each of K knots of controls (B, K, S, nu), each held for STEP seconds."""
        width, (count, _, steps, joints) = self.model.nq + self.model.nv, controls.shape
        full = np.zeros((count, self._width))
        full[:, 1 : 1 + width] = states  # after the time
        held = np.repeat(controls.reshape(count, -1, joints), self._held, axis=1)
        found, _ = self._pool.rollout(self.model, self._data, full, held)
        last, after = steps * self._held, np.asarray(found, np.float64)
        return after[:, last - 1 :: last, 1 : 1 + width]

    def difference(self, start: Array, end: Array) -> Array:
        """The differences (..., 2 nv) from states (..., n) to others."""
        nq = self.model.nq
        start, end = np.broadcast_arrays(start, end)
        turn, change = to_rotation_vector(multiply(conjugate(start[..., 3:7]), end[..., 3:7])), end - start
        return np.concatenate([change[..., :3], turn, change[..., 7:nq], change[..., nq:]], axis=-1)

    def moved(self, states: Array, changes: Array) -> Array:
        """States (..., n) changed by differences (..., 2 nv)."""
        nq, nv = self.model.nq, self.model.nv
        shape = np.broadcast_shapes(states.shape[:-1], changes.shape[:-1])
        states, changes = (np.broadcast_to(array, (*shape, array.shape[-1])) for array in (states, changes))
        turned = multiply(states[..., 3:7], from_rotation_vector(changes[..., 3:6]))
        rest = states[..., 7:nq] + changes[..., 6:nv], states[..., nq:] + changes[..., nv:]
        return np.concatenate([states[..., :3] + changes[..., :3], turned, *rest], axis=-1)
