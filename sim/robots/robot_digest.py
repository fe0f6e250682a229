"""Digests of what a judgement depends on: of a robot with all its files, and of the code that simulates it."""

import hashlib
import re
from collections.abc import Iterator
from functools import cache
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np

import controller
import sim
from motiondeck_base.errors import MotiondeckError
from sim.models.formats.model_text import file_named, model_kind, readable_urdf, xml_text
from sim.models.robot_file import read_robot_file

_NAMED = re.compile(r"""\bfile(?:name)?\s*=\s*["']([^"']+)["']""")
_FOLDERS = re.compile(r"""\b(?:mesh|asset|texture)dir\s*=\s*["']([^"']+)["']""")


def robot_digest(robot: Path) -> str:
    """The digest, which changes with the contents of any of these files; FileFormatError as of `read_robot_file`."""
    file, digest = read_robot_file(robot), hashlib.sha256(robot.read_bytes())
    if file.model is not None:
        packages = {name: robot.parent / Path(folder).expanduser() for name, folder in file.packages.items()}
        for named in _files(robot.parent / Path(file.model).expanduser(), packages):
            digest.update(named.read_bytes())
    return digest.hexdigest()


@cache
def code_digest(*others: Path) -> bytes:
    """The digest of the code of controller and sim, of other files, and of the versions of MuJoCo and numpy."""
    packages = [sorted(Path(package.__path__[0]).rglob("*.py")) for package in (controller, sim)]
    digest = hashlib.sha256(f"{mujoco.__version__} {np.__version__}".encode())
    for file in (*others, *chain(*packages)):
        digest.update(file.read_bytes())
    return digest.digest()


def _files(model: Path, packages: dict[str, Path]) -> Iterator[Path]:
    """A model file and the files that it names, as far as they are there."""
    if not model.is_file():
        return
    yield model
    try:
        text = readable_urdf(model, packages, visuals=True) if model_kind(model) == "robot" else xml_text(model)
    except MotiondeckError:
        return  # the loader says what is wrong with it
    folders = ["", *_FOLDERS.findall(text)]
    for name in dict.fromkeys(_NAMED.findall(text)):
        found = (file_named((model.parent / folder / name).absolute()) for folder in folders)
        file = next((one for one in found if one.is_file()), None)
        if file is not None and file.suffix.lower() == ".xml" and file != model.absolute():
            yield from _files(file, packages)
        elif file is not None:
            yield file
