"""Opens what a figure is made of: a library of joint motions, and the robot or the rig whose joints play it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from controller.library.motion_library import MotionLibrary, load_library
from hardware.rig.rig_file import load_rig
from motiondeck.export.figure import Figure, figure_of
from motiondeck.run.baked_libraries import find_baked
from motiondeck.run.robots.rig_on_deck import rig_limits
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library, find_rig
from sim.robots.catalogue import find_robot
from sim.robots.robot import RobotLoader

RATE = 100.0  # Hz, of a robot; a rig has its own


def open_figure(library: str, robot: str | None, rig: str | None, motions: Sequence[str] = ()) -> Figure:
    """The figure of motions of a library for a robot or a rig; MotiondeckError names the library and what is wrong."""
    if (robot is None) is (rig is None):
        raise MotiondeckError("name the robot with --robot, or the rig with --rig, whose joints play the motions")
    file = find_library(library)
    loaded = load_library(file)
    try:
        if rig is not None:
            config = load_rig(find_rig(rig))
            limits = rig_limits(config)
            rest = np.clip(0.0, limits.lower, limits.upper)
            return figure_of(loaded, config.names, limits, rest, config.rate_hz, motions)
        assert robot is not None, "one of both"
        return _on_robot(loaded, file, find_robot(robot), motions)
    except MotiondeckError as error:
        raise MotiondeckError(f"{file}: {error}") from None


def _on_robot(library: MotionLibrary, file: Path, robot: Path, motions: Sequence[str]) -> Figure:
    if not library.skeleton.is_rig:
        baked = find_baked(RunSpec(robot=str(robot)), file, robot)
        if baked is None:
            again = f"motiondeck library bake {file.stem} --robot {robot.stem}"
            raise MotiondeckError(f"its motions are those of a human, not yet carried to the joints: {again}")
        library = baked
    fitted = RobotLoader(robot)(library.skeleton)
    return figure_of(library, fitted.joints, fitted.limits, fitted.rest, RATE, motions)
