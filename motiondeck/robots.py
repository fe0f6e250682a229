# pyright: strict
"""Robots: clips carried onto a robot's joints, one or many."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from controller.motion.clip import Clip
from motiondeck.recordings import the_clip
from motiondeck_base.jobs import Jobs
from sim.models.mannequin.mannequin import reference_body
from sim.models.robot_file import read_robot_file, solver_named
from sim.robots.catalogue import find_robot
from sim.robots.joint_motion import JointMotion, retargeted
from sim.robots.retarget_files import RetargetedFile
from sim.robots.retarget_files import retarget_files as carry_files
from sim.robots.robot import load_robot as load_robot_for

__all__ = ["JointMotion", "RetargetedFile", "Robot", "load_robot", "retarget_files"]


@dataclass(frozen=True)
class Robot:
    """A robot and its file; made by `load_robot`.

    `solver` is how motions are carried onto it, "angles" or "ik"; it overrides its file.
    """

    file: Path
    name: str
    solver: str | None = None

    @property
    def model(self) -> Path | None:
        """Its MJCF or URDF model; None for a mannequin, which is built from a skeleton."""
        model = read_robot_file(self.file).model
        return self.file.parent / model if model is not None else None

    @property
    def joints(self) -> tuple[str, ...]:
        """The names of its joints; a mannequin's are those of the skeleton that it is built for."""
        return load_robot_for(self.file, reference_body()).joints

    def retarget(self, clip: Clip) -> JointMotion:
        """A clip carried onto the robot, frame by frame: joint angles within its position limits, and its root.

        MotiondeckError if the clip's skeleton lacks what the robot needs; it names the bones.
        """
        clip = the_clip(clip)
        robot = load_robot_for(self.file, clip.skeleton, solver_named(self.solver), 1.0 / clip.rate)
        return retargeted(robot, clip)


def load_robot(name: str | Path, solver: Literal["angles", "ik"] | None = None) -> Robot:
    """A shipped robot by its name ("mannequin", "servo20"), or one of your own by the path of its file (.toml).

    MotiondeckError if there is no such robot or solver (it names the nearest), or the file is wrong.
    """
    file = find_robot(name)
    return Robot(file, read_robot_file(file).name, solver_named(solver))


def retarget_files(
    paths: Iterable[str | Path],
    robot: Robot,
    out: str | Path,
    format: Literal["npz", "csv", "mjlab", "qpos"] = "npz",
    jobs: str = "-1",
) -> Iterator[RetargetedFile]:
    """Carries recordings, and folders of them, onto a robot: a motion file of each, for training.

    Yields the result of each as soon as it is done: the file, the angles between the robot's limbs and the human's,
    and, if the robot cannot do it, why. Called again it continues where it was stopped, and repeats a recording only if
    it has changed. In a script call it under `if __name__ == "__main__":`. MotiondeckError if a path does not exist,
    two recordings would be written to one file, or `out` holds motions of another robot, solver or format.

    Args:
        out: the folder for the files.
        jobs: how many processes, "-1" for one per core, or a Dask cluster, "dask://HOST:PORT", that sees the folders.
    """
    yield from carry_files(
        robot.file, [Path(path) for path in paths], Path(out), format, solver_named(robot.solver), Jobs.parse(jobs)
    )
