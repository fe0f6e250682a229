"""Training files: a robot's motion in the formats of programs that train tracking policies.

    npz     fps, joint_names, root_pos (T, 3), root_quat (T, 4) w x y z, joint_pos (T, J); the recording's rate
    csv     one row a frame and no heading, as Unitree's retargeted LAFAN1 set: root x y z, quaternion x y z w, joints;
            30 Hz
    mjlab   what mjlab's tracking task reads: fps, joint_pos, joint_vel, body_pos_w, body_quat_w (w x y z),
            body_lin_vel_w, body_ang_vel_w, of every body but the world; 50 Hz
    qpos    fps, qpos (T, nq) and qvel (T, nv) of MuJoCo; the recording's rate

Metres, radians, seconds. Joints and bodies are all of the model, in its order. The root is that of the model's file.
"""

import io
from pathlib import Path
from typing import Any, Literal, get_args

import mujoco
import numpy as np
from numpy.typing import NDArray

from controller.motion.rotations import Array, rotate
from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.files import write_file
from sim.models.formats.urdf_visuals import MOVED_ORIGIN

Format = Literal["npz", "csv", "mjlab", "qpos"]
FORMATS: tuple[Format, ...] = get_args(Format)
RATES: dict[Format, float] = {"csv": 30.0, "mjlab": 50.0}  # Hz; the others keep the recording's


def format_named(name: str) -> Format:
    """The format of a name; UnknownNameError if there is no such format."""
    if name in FORMATS:
        return name
    raise UnknownNameError.among("format", name, FORMATS)


def write_training_file(path: Path, model: mujoco.MjModel, qpos: Array, rate: float, format: Format) -> None:
    """Writes, or replaces, the motion qpos (T, nq), T >= 1, of a robot with a free root; rate in Hz.

    FileFormatError if a joint is a ball and the format has one number a joint, or the file cannot be written.
    """
    if format == "qpos":
        write_file(path, npz_bytes(fps=rate, qpos=qpos, qvel=velocities(model, qpos, rate)))
        return
    if (model.jnt_type[1:] == mujoco.mjtJoint.mjJNT_BALL).any():
        raise FileFormatError(f"{path}: the robot has ball joints, the format one number a joint. Give --format qpos.")
    # Of all joints but the root's; their places in qvel are one earlier.
    names, at = [model.joint(j).name for j in range(1, model.njnt)], model.jnt_qposadr[1:].astype(np.intp)
    root = in_the_files_frame(model, qpos[:, :3], qpos[:, 3:7])
    match format:
        case "csv":
            rows = np.column_stack([root, qpos[:, [4, 5, 6, 3]], qpos[:, at]])
            text = "".join(",".join(f"{value:.8f}" for value in row) + "\n" for row in rows)
            write_file(path, text.encode())
        case "npz":
            arrays = {"root_pos": root, "root_quat": qpos[:, 3:7], "joint_pos": qpos[:, at]}
            write_file(path, npz_bytes(fps=rate, joint_names=np.array(names), **arrays))
        case _:
            write_file(path, npz_bytes(**_tracking(model, qpos, rate, at)))


def velocities(model: mujoco.MjModel, qpos: Array, rate: float) -> Array:
    """MuJoCo's velocities (T, nv) of a motion (T, nq) at a rate, Hz: central differences."""
    found = np.zeros((len(qpos), model.nv))
    for row in range(len(qpos)):
        low, high = max(row - 1, 0), min(row + 1, len(qpos) - 1)
        if high > low:
            mujoco.mj_differentiatePos(model, found[row], (high - low) / rate, qpos[low], qpos[high])
    return found


def in_the_files_frame(model: mujoco.MjModel, position: Array, quaternion: Array) -> Array:
    """The root's origin as in the model's file, shape (T, 3), for that of the loaded model."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, MOVED_ORIGIN)
    if number < 0:
        return position
    first = model.numeric_adr[number]
    return position - rotate(quaternion, np.broadcast_to(model.numeric_data[first : first + 3], position.shape))


def _tracking(model: mujoco.MjModel, qpos: Array, rate: float, at: NDArray[np.intp]) -> dict[str, NDArray[Any]]:
    data, qvel = mujoco.MjData(model), velocities(model, qpos, rate)
    root = int(model.jnt_bodyid[0])
    bodies = np.flatnonzero(model.body_rootid == root)
    shape = (len(qpos), len(bodies))
    place, turn, speed, spin = (np.zeros((*shape, width)) for width in (3, 4, 3, 3))
    for frame in range(len(qpos)):
        data.qpos[:], data.qvel[:] = qpos[frame], qvel[frame]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        place[frame], turn[frame] = data.xpos[bodies], data.xquat[bodies]
        spin[frame] = data.cvel[bodies, :3]
        # MuJoCo's velocity of a body is at the robot's centre of mass.
        speed[frame] = data.cvel[bodies, 3:] + np.cross(spin[frame], place[frame] - data.subtree_com[root])
    origin = in_the_files_frame(model, place[:, 0], turn[:, 0])
    speed[:, 0] += np.cross(spin[:, 0], origin - place[:, 0])
    place[:, 0] = origin
    found = {"joint_pos": qpos[:, at], "joint_vel": qvel[:, at - 1]}
    found |= {"body_pos_w": place, "body_quat_w": turn, "body_lin_vel_w": speed, "body_ang_vel_w": spin}
    return {"fps": np.array([rate])} | {name: array.astype(np.float32) for name, array in found.items()}


def npz_bytes(**arrays: object) -> bytes:
    """An .npz file of arrays."""
    buffer = io.BytesIO()
    kept: dict[str, Any] = {name: np.asarray(array) for name, array in arrays.items()}
    np.savez(buffer, **kept)
    return buffer.getvalue()
