"""Baked libraries: where they are kept, and when one is played in place of the library that it was made from."""

import os
import sys
from pathlib import Path

from controller.library.motion_library import MotionLibrary, load_library
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.files import digest_of
from motiondeck_base.shipped import shipped_configs, user_cache
from sim.robots.robot_digest import robot_digest


def baked_file(library: Path, robot: Path) -> Path:
    """Where a library that is baked for a robot is kept: beside it, or in the user's cache if it is a shipped one."""
    beside, cached = kept_at(library, robot)
    shipped = library.parent.resolve() == (shipped_configs() / "libraries").resolve()
    return cached if shipped or not os.access(library.parent, os.W_OK) else beside


def find_baked(spec: RunSpec, library: Path, robot: Path) -> tuple[MotionLibrary, Path] | None:
    """The library that is baked for the robot of a run, and its file, if the run can play it; says so in a line.

    It knows no human, so a run that needs one (a free root, another solver, a second robot, collisions, recognition) is
    carried live. So is a library or a robot that has changed since; what to do is said in a line.
    """
    file = next((place for place in kept_at(library, robot) if place.is_file()), None)
    needs = spec.root == "free", spec.solver, spec.follow, spec.check_collisions, spec.recognize, spec.recognizer
    if file is None or any(needs):
        return None
    baked = load_library(file)
    origin, changed = baked.info.baked, ""
    if origin is None or origin.library_digest != digest_of(library):
        changed = f"the library {library.stem}"
    elif origin.robot_digest != robot_digest(robot):
        changed = f"the robot {robot.stem}"
    if changed:
        again = f"Bake it: motiondeck library bake {library} --robot {robot}"
        print(f"{file}: {changed} has changed since it was baked, so it is carried live. {again}", file=sys.stderr)
        return None
    print(f"{baked.info.name} is played as it was baked for {robot.stem} ({file}), without its human", file=sys.stderr)
    return baked, file


def kept_at(library: Path, robot: Path) -> tuple[Path, Path]:
    """Where a baked library may be: beside the library, or in the user's cache."""
    name = f"{library.stem}.{robot.stem}.safetensors"
    return library.parent / name, user_cache() / "baked" / name
