"""Opens what a figure is made of: a library of joint motions, and the robot or the rig whose joints play it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from controller.library.motion_library import MotionLibrary, load_library
from hardware.rig.rig_file import load_rig
from motiondeck.export.figure import Figure, figure_of
from motiondeck.export.web_page import drawn_human, write_page
from motiondeck.run.baked_libraries import find_baked
from motiondeck.run.robots.rig_on_deck import robot_of
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library, find_rig
from sim.robots.catalogue import find_robot
from sim.robots.joint_groups import joint_groups
from sim.robots.robot import RobotLoader

RATE = 100.0  # Hz, of a robot; a rig has its own


def open_figure(
    library: str,
    robot: str | None,
    rig: str | None,
    motions: Sequence[str] = (),
    page: Path | None = None,
    *,
    networks: bool = False,
    fixed: bool = False,
) -> Figure:
    """The figure of motions of a library for a robot or a rig; its page is written into a folder, if one is given.

    `networks`, and `fixed` for no page, are as of `figure_of`. MotiondeckError names the library and what is wrong.
    """
    if (robot is None) is (rig is None):
        raise MotiondeckError("name the robot with --robot, or the rig with --rig, whose joints play the motions")
    file, place = find_library(library), find_robot(str(robot)) if rig is None else find_rig(rig)
    loaded, rate = load_library(file), RATE
    try:
        also: dict[str, Any] = {}  # that a page shows
        if not loaded.skeleton.is_rig:
            also["human"], loaded = page and drawn_human(loaded, motions), _baked(file, None if rig else place)
        if rig is None:
            loader = RobotLoader(place)
            also["groups"] = joint_groups(played := loader(loaded.skeleton), loader.file, loaded.skeleton)
        else:
            played, rate = robot_of(place, loaded.skeleton), load_rig(place).rate_hz
        if page is not None:
            return write_page(page, loaded, played, rate, motions, networks=networks, **also)
        given = loaded, played.joints, played.limits, played.rest, rate, motions
        return figure_of(*given, networks=networks, fixed=fixed)
    except MotiondeckError as error:
        raise MotiondeckError(f"{file}: {error}") from None


def _baked(file: Path, robot: Path | None) -> MotionLibrary:
    if robot is None:
        raise MotiondeckError("its motions are those of a human; give the file of one baked for these joints")
    if baked := find_baked(RunSpec(robot=str(robot)), file, robot):
        return baked[0]
    again = f"motiondeck library bake {file.stem} --robot {robot.stem}"
    raise MotiondeckError(f"its motions are those of a human, not yet carried to the joints: {again}")
