"""Robot files: what the TOML of a robot may say."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Literal

import msgspec

from controller.errors import FileFormatError, UnknownNameError
from sim.servo import Servo


class JointLimit(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What differs for one joint: rad/s, rad/s^2, rad/s^3; position in rad, within what the model allows."""

    velocity: float | None = None
    acceleration: float | None = None
    jerk: float | None = None
    lower: float | None = None
    upper: float | None = None


class LimitTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What every joint may do at most: rad/s, rad/s^2, rad/s^3, and the joints that differ."""

    velocity: float
    acceleration: float
    jerk: float
    joints: dict[str, JointLimit] = {}


class RobotFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A robot.

    Attributes:
        name: what it is called.
        kind: which way poses are carried onto it.
        limits: what its joints may do at most.
        model: its MJCF file, beside this one; a mannequin is built from the skeleton instead.
        root_height: of its root above the floor when it stands straight, m; none plays paths at their own scale.
        rest: joint positions to rest in, rad; those not named rest at zero.
        servo: what each of its servos can do; without it they are as strong as the model has them.
    """

    name: str
    kind: Literal["mannequin", "servo20"]
    limits: LimitTable
    model: str | None = None
    root_height: float | None = None
    rest: dict[str, float] = {}
    servo: Servo | None = None


def read_robot_file(path: Path) -> RobotFile:
    """Reads a robot file.

    Raises:
        FileFormatError: if the file is missing, is no TOML, or a value is of the wrong kind or size.
        UnknownNameError: if a key is none of those a robot file has; it names the nearest.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileFormatError(f"{path}: there is no such robot file") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise FileFormatError(f"{path}: cannot be read as TOML: {error}") from error
    _refuse_unknown(path, "", content, RobotFile)
    limits = content.get("limits")
    if isinstance(limits, dict):
        _refuse_unknown(path, "limits.", limits, LimitTable)
        joints = limits.get("joints")
        for joint, limit in joints.items() if isinstance(joints, dict) else ():
            _refuse_unknown(path, f"limits.joints.{joint}.", limit, JointLimit)
    if isinstance(content.get("servo"), dict):
        _refuse_unknown(path, "servo.", content["servo"], Servo)
    try:
        robot = msgspec.convert(content, RobotFile)
    except msgspec.ValidationError as error:
        raise FileFormatError(f"{path}: {error}") from error
    _check_numbers(path, robot)
    return robot


def _refuse_unknown(path: Path, place: str, table: Any, struct: type[msgspec.Struct]) -> None:
    known = [field.name for field in msgspec.structs.fields(struct)]
    for key in table if isinstance(table, dict) else ():
        if key not in known:
            nearest = UnknownNameError.among("key", key, known)
            raise UnknownNameError(f"{path}: {place}{key}: {nearest} Allowed: {', '.join(known)}.")


def _check_numbers(path: Path, robot: RobotFile) -> None:
    """No limit may be zero, negative, infinite or no number."""
    checks = {"limits": robot.limits, **{f"limits.joints.{name}": own for name, own in robot.limits.joints.items()}}
    for place, table in checks.items():
        for key in ("velocity", "acceleration", "jerk"):
            value = getattr(table, key)
            if value is not None and not 0.0 < value < float("inf"):
                raise FileFormatError(f"{path}: {place}.{key} is {value}; it must be a positive number")
    positions = {f"rest.{name}": value for name, value in robot.rest.items()}
    for name, own in robot.limits.joints.items():
        positions |= {
            f"limits.joints.{name}.{key}": v for key in ("lower", "upper") if (v := getattr(own, key)) is not None
        }
    for place, value in positions.items():
        if not abs(value) < float("inf"):
            raise FileFormatError(f"{path}: {place} is {value}; it must be a number of rad")
    servo = msgspec.structs.asdict(robot.servo) if robot.servo is not None else {}
    for key, value in servo.items():
        if value is not None and not value < float("inf"):
            raise FileFormatError(f"{path}: servo.{key} is {value}; it must be a finite number")
    if robot.root_height is not None and not 0.0 < robot.root_height < float("inf"):
        raise FileFormatError(f"{path}: root_height is {robot.root_height}; it must be a positive number of metres")
    if (robot.model is None) != (robot.kind == "mannequin"):
        raise FileFormatError(
            f"{path}: model: "
            + (
                "a mannequin is built, not loaded"
                if robot.model
                else f"a robot of kind '{robot.kind}' needs its MJCF file"
            )
        )
