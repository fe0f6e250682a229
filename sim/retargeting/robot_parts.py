"""The parts of a robot: what a robot file says which of its bodies are thighs, shanks, feet and so on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import mujoco

from motiondeck_base.errors import FileFormatError, UnknownNameError

SIDES = ("r", "l")
PARTS = (
    "pelvis",
    "chest",
    "head",
    *(f"{side}_{part}" for side in SIDES for part in ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")),
)


def bodies_of_parts(path: Path, model: mujoco.MjModel, parts: Mapping[str, str]) -> dict[str, int]:
    """The body of each part; a robot without a waist has its chest in the pelvis.

    Args:
        path: the robot file, for errors.
        model: the robot.
        parts: part to body, as the robot file names them.

    Raises:
        UnknownNameError: if there is no such part or body.
        FileFormatError: if a part is missing that every robot needs.
    """
    names = [model.body(index).name for index in range(1, model.nbody)]
    found: dict[str, int] = {}
    for part, body in parts.items():
        if part not in PARTS:
            raise UnknownNameError(f"{path}: parts: {UnknownNameError.among('part', part, PARTS)}")
        if body not in names:
            raise UnknownNameError(f"{path}: parts.{part}: {UnknownNameError.among('body', body, names)}")
        found[part] = names.index(body) + 1
    for part in ("pelvis", "r_thigh", "r_shank", "l_thigh", "l_shank"):
        if part not in found:
            raise FileFormatError(f"{path}: parts.{part} is missing: name the body that is its {part}")
    found.setdefault("chest", found["pelvis"])
    return found
