"""A retargeted clip: a robot's joint angles and root over time, as .csv or .clip."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.motion.clip import Clip, Plays, poses_of
from controller.motion.formats.joint_tables import ROOT_COLUMNS
from controller.motion.formats.taught_clip import save_taught_clip, taught_clip
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import write_file
from sim.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class JointMotion:
    """T frames of a robot with J joints."""

    name: str
    joints: tuple[str, ...]
    rate: float  # frames per second, Hz
    angles: Array  # shape (T, J), rad, within the robot's position limits
    qpos: Array  # the robot in each frame as MuJoCo has it, shape (T, nq)

    @property
    def root(self) -> Array:
        """Position (m) and quaternion (w, x, y, z) of the robot's root, shape (T, 7)."""
        return self.qpos[:, :7]

    def __len__(self) -> int:
        return len(self.angles)

    def save(self, path: str | Path, plays: Plays = "loop") -> None:
        """Writes it as .csv (time, root and every joint, one line a frame) or as .clip (the joints alone).

        A .clip can be played with `motiondeck play FILE --rig RIG` or learned with `motiondeck learn FILE`; it says
        whether the motion is a loop or ends in a pose. FileFormatError for another ending, or if it cannot be written.
        """
        path = Path(path)
        if (ending := path.suffix.lower()) not in (".csv", ".clip"):
            raise FileFormatError(f"{path}: joint motions are written as .csv or .clip. Name the file so.")
        if ending == ".csv":
            columns = ("time", *ROOT_COLUMNS, *self.joints)  # s, m, quaternion, rad
            rows = np.column_stack([np.arange(len(self)) / self.rate, self.root, self.angles])
            lines = [",".join(columns), *(",".join(f"{value:.9g}" for value in row) for row in rows), ""]
            write_file(path, "\n".join(lines).encode())
        else:
            save_taught_clip(taught_clip(self.name, self.joints, self.rate, self.angles), path, plays)


def retargeted(robot: Robot, clip: Clip, given: Array | None = None) -> JointMotion:
    """Retargets a clip to a robot of the clip's skeleton and rate, within its limits of position, not of speed.

    With `given` angles (T, J), rad, these are placed instead, and only the root is found.
    """
    state = robot.rest_qpos
    if robot.footing is not None:
        robot.footing.stance.flat.learn(clip)
    angles, qpos = np.empty((len(clip), len(robot.joints))), np.empty((len(clip), robot.model.nq))
    for frame, pose in enumerate(poses_of(clip)):
        wanted = robot.retarget(pose)  # it also turns the pelvis
        np.clip(wanted if given is None else given[frame], robot.limits.lower, robot.limits.upper, out=angles[frame])
        robot.place(angles[frame], pose, state)
        qpos[frame] = state
    return JointMotion(clip.name, robot.joints, clip.rate, angles, qpos)
