"""The parts of a robot: its bodies by the names of a robot file's table [parts]."""

from collections.abc import Collection, Mapping
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
    """The body of each part of a robot file (`path`, for errors); without a waist the chest is the pelvis.

    UnknownNameError if there is no such part or body. FileFormatError if a necessary part is missing: a leg's, or, of a
    robot without legs, an arm's.
    """
    names = [model.body(index).name for index in range(1, model.nbody)]
    found: dict[str, int] = {}
    for part, body in parts.items():
        if part not in PARTS:
            raise UnknownNameError(f"{path}: parts: {UnknownNameError.among('part', part, PARTS)}")
        if body not in names:
            raise UnknownNameError(f"{path}: parts.{part}: {UnknownNameError.among('body', body, names)}")
        found[part] = names.index(body) + 1
    limb = ("thigh", "shank") if not without_legs(found) else ("upper_arm", "forearm")
    for part in ("pelvis", *(f"{side}_{segment}" for side in SIDES for segment in limb)):
        if part not in found:
            raise FileFormatError(f"{path}: parts.{part} is missing: name the body that is its {part}")
    found.setdefault("chest", found["pelvis"])
    return found


def without_legs(parts: Collection[str]) -> bool:
    """Whether parts are those of an upper body: arms, and nothing of a leg."""
    legs = (f"{side}_{part}" for side in SIDES for part in ("thigh", "shank", "foot"))
    return any(part.endswith("upper_arm") for part in parts) and not any(leg in parts for leg in legs)
