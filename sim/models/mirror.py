"""How the hinges of a model turn when left and right are exchanged."""

from pathlib import Path

import mujoco
import numpy as np

from controller.motion.canonical.clip_edits import twin_of
from motiondeck_base.errors import FileFormatError

_ALONG = 0.95  # least cosine between an axis and the mirrored axis of its twin


def mirror_signs(path: Path) -> dict[str, int]:
    """The sign of each joint by name, where its axis in the zero pose is the mirrored one of its twin, or against it.

    A mirror across the plane y = 0 takes the axis (x, y, z) of a turn to (-x, y, -z). FileFormatError if there is no
    such model.
    """
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise FileFormatError(f"{path}: cannot be read as a model: {' '.join(str(error).split())[:200]}") from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    hinges = [number for number in range(model.njnt) if model.jnt_type[number] == mujoco.mjtJoint.mjJNT_HINGE]
    axes = {model.joint(number).name: data.xaxis[number] for number in hinges}
    along = {
        name: float(axis @ (axes.get(twin_of(name), 0.0 * axis) * [-1.0, 1.0, -1.0])) for name, axis in axes.items()
    }
    return {name: int(np.sign(cosine)) for name, cosine in along.items() if abs(cosine) > _ALONG}
