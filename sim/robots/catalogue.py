"""The catalogue of robots, MuJoCo Menagerie: its models are downloaded, and calibrated when a robot is first named."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from motiondeck_base import shipped
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.files import write_file
from sim.models.robot_file import read_robot_file


def find_robot(name: str | Path) -> Path:
    """The file of a robot: as `shipped.find_robot`, or of a robot of the catalogue, which is kept in the user's cache.

    MotiondeckError if there is none (it offers the nearest names), or one cannot be downloaded or calibrated.
    """
    try:
        return shipped.find_robot(name)
    except UnknownNameError:
        if str(name) not in (known := _names()):
            own = [file.stem for file in (shipped.shipped_configs() / "robots").glob("*.toml")]
            raise UnknownNameError.among("robot", str(name), [*sorted(own), *known]) from None
    folder = shipped.user_cache() / "robots"
    file = folder / f"{name}.toml"
    if not file.is_file() or not Path(str(read_robot_file(file).model)).is_file():
        from sim.robots.calibrate import calibrate

        found = calibrate(model_file(str(name)))
        folder.mkdir(parents=True, exist_ok=True)
        write_file(file, found.to_toml(folder).encode())
        print(f"{name} is calibrated, with guessed speeds: edit {file}", file=sys.stderr)
        for doubt in found.doubts:
            print(f"{name}: {doubt.part or 'warning'}: {doubt.words}", file=sys.stderr)
    return file


def model_file(model: str) -> Path:
    """The file of a model: a path, or a catalogue name, which is downloaded; MotiondeckError if there is neither."""
    if Path(model).exists() or "/" in model or Path(model).suffix:
        return Path(model)
    menagerie, names = menagerie_package(), _names()
    UnknownNameError.check("robot", model, names, f"there is no file {model}, and ")
    entry = menagerie.get(model)
    try:
        return Path(entry.xml(entry.default_model))
    except (menagerie.MenagerieError, OSError) as error:
        raise MotiondeckError(f"{model}: cannot be downloaded ({error}). Check the network, or give a file") from None


def menagerie_package() -> Any:
    """The package of MuJoCo Menagerie; raises a MotiondeckError if it is not installed."""
    try:
        return import_module("mujoco_menagerie")
    except ImportError:
        raise MotiondeckError('the catalogue of robots is an extra: pip install "motiondeck[menagerie]"') from None


def _names() -> list[str]:
    try:
        return [robot.name for robot in menagerie_package().robots()]
    except MotiondeckError:
        return []
