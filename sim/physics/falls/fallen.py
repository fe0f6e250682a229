"""When a robot counts as fallen."""

from __future__ import annotations

import numpy as np

from controller.motion.rotations import Array, conjugate, rotate

# A robot has fallen when its root is lower than this share of the height at which it is played, or when it leans over
# by so much more than it is played, rad.
FALLEN_HEIGHT = 0.6
FALLEN_TILT = 1.0


def has_fallen(qpos: Array, played: Array, standing: Array) -> bool:
    """Whether a root at qpos (>= 7,) is too low or leans too far, compared with the commanded one (>= 7,).

    `standing` is the rotation of a root that is upright, a quaternion: not every model has z up.
    """
    up = rotate(conjugate(standing), np.array([0.0, 0.0, 1.0]))
    upright = rotate(np.stack([qpos[3:7], played[3:7]]), up)[:, 2]
    lean, played_lean = np.arccos(np.clip(upright, -1.0, 1.0))
    return bool(qpos[2] < FALLEN_HEIGHT * played[2] or lean > played_lean + FALLEN_TILT)
