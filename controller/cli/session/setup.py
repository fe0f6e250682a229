"""What `play`, `replay` and `rig play` do alike before a run: names become files, and mistakes are found at once."""

from __future__ import annotations

from pathlib import Path

from controller.cli.session.robot_on_deck import RobotSetup
from controller.library.motion_library import MotionLibrary
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_rig, find_robot

EMULATED = "emulated"


def check_seconds(seconds: float | None) -> None:
    """Refuses a length of time that cannot be; None is no limit.

    Raises:
        MotiondeckError: if it is not above 0 and below 1e8 s.
    """
    if seconds is not None and not 0.0 < seconds < 1e8:
        raise MotiondeckError(f"--seconds {seconds:g} is not a length of time above 0")


def first_motion(library: MotionLibrary, motion: str | None) -> str:
    """What a library plays first: the given motion, else `walk`, else its first one.

    Raises:
        UnknownNameError: if the library has no such motion; it names the nearest.
    """
    names = library.network.motions
    if motion is not None and motion not in names:
        raise UnknownNameError.among("motion", motion, names)
    return motion or ("walk" if "walk" in names else names[0])


def robot_setup(
    robot: str,
    rig: str | None,
    *,
    physics: bool = True,
    root: str = "gantry",
    balance: bool = False,
    solver: str | None = None,
    keep_apart: bool = False,
) -> RobotSetup:
    """A robot and its rig by their names or files.

    Args:
        robot: a shipped robot, or a robot file.
        rig: a shipped rig, a rig file, "emulated" for emulated servos of the robot, or None.
        physics, root, balance, solver, keep_apart: as in `RobotSetup`.

    Raises:
        MotiondeckError: if there is no such robot or rig; it names the nearest.
    """
    file = find_robot(robot)
    return RobotSetup(file, _rig_file(rig, robot), rig == EMULATED, physics, root, balance, solver, keep_apart)


def _rig_file(rig: str | None, robot: str) -> Path | None:
    """The rig file; for emulated servos the one with the robot's own name."""
    if rig is None:
        return None
    if rig != EMULATED:
        return find_rig(rig)
    try:
        return find_rig(Path(robot).stem)
    except MotiondeckError:
        raise MotiondeckError(
            f"there is no rig for robot '{Path(robot).stem}' to be emulated. Try: --rig emulated --robot servo20"
        ) from None
