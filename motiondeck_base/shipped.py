"""The shipped robots, rigs, libraries and stage files, how a name becomes a file, and the folders of the user."""

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.words import near_names

_MADE_BY = {
    "robot": "Make one from an MJCF or URDF: motiondeck robot calibrate MODEL --out FILE.toml",
    "rig": "How to make one: the page 'Your first rig'",
    "library": "Learn one from recordings: motiondeck learn RECORDING... --out FILE.safetensors",
    "stage": "What it holds: the page 'On a stage'",
}


def shipped_configs(name: str = "configs") -> Path:
    """The folder of the shipped configuration, or `name`: inside an installed package, or at the root of a checkout."""
    package = Path(__file__).resolve().parent
    for folder in (package / name, package.parent / name):
        if folder.is_dir():
            return folder
    raise MotiondeckError(f"the installation is incomplete: no '{name}' in {package}. Install motiondeck again.")


def user_cache() -> Path:
    """The folder for what can be made anew, such as the robot files of the catalogue; it need not exist."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "motiondeck"


def state_folder() -> Path:
    """The user's folder for what is kept from run to run; it need not exist."""
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "motiondeck"


def _find(kind: str, folder: str, suffix: str, name: str | Path, also: Sequence[str] = ()) -> Path:
    """The file of a robot, rig, library or stage: the path itself, else the shipped one of this name.

    A path has the suffix or names a folder. MotiondeckError if there is no such file; it offers the nearest names, also
    of other words without a file that were meant.
    """
    path = Path(name)
    is_path = path.suffix == suffix or len(path.parts) > 1
    if path.suffix == suffix and path.is_file():
        return path
    shipped = {file.stem: file for file in sorted((shipped_configs() / folder).glob(f"*{suffix}"))}
    if not is_path and str(name) in shipped:
        return shipped[str(name)]
    if path.is_file():
        raise MotiondeckError(f"{name}: not a {kind} file, which ends in {suffix}. {_MADE_BY[kind]}")
    if is_path:
        near = near_names(path.stem, sorted(other.stem for other in path.parent.glob(f"*{suffix}")))
        hint = f". Did you mean {' or '.join(str(path.with_name(one + suffix)) for one in near)}?" if near else ""
        raise MotiondeckError(f"{name}: there is no such file{hint}")
    raise UnknownNameError.among(kind, str(name), [*also, *shipped])


find_robot = partial(_find, "robot", "robots", ".toml")
find_rig = partial(_find, "rig", "rigs", ".toml")
find_library = partial(_find, "library", "libraries", ".safetensors")
find_stage = partial(_find, "stage", "stages", ".toml")
