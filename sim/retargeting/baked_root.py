"""Places the root of a robot whose motions were carried to it beforehand: where it was, footing included."""

from controller.motion.encodings.robot_joints import RootPath
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from sim.retargeting.footing import Footing


class BakedRoot(Footing):
    """Places the root on its own path, pose by pose."""

    def __init__(self) -> None:
        self._path = RootPath()

    def reset(self, dt: float | None = None) -> None:
        """Resets the place."""
        self._path.reset()

    def heading(self, human: float) -> float:
        """Where the robot faces, rad; the human's heading is not known."""
        return self._path.heading

    def place(self, pose: Pose, qpos: Array) -> None:
        """Writes the root's position and rotation into qpos (nq,)."""
        qpos[:7] = self._path(pose)
