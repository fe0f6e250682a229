"""Robot files: what the TOML of a robot may say."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.toml_file import read_toml
from sim.models.rise_settings import RiseSettings
from sim.models.servo_motor import ServoMotor
from sim.models.walk_settings import WalkSettings

Solver = Literal["angles", "ik"]
SOLVERS: tuple[Solver, ...] = ("angles", "ik")


def solver_named(name: str | None) -> Solver | None:
    """The solver of a name, none for none; UnknownNameError if there is no such solver."""
    if name is None:
        return None
    for solver in SOLVERS:
        if name == solver:
            return solver
    raise UnknownNameError.among("solver", name, SOLVERS)


class JointLimit(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """What differs for one joint: rad/s, rad/s^2, rad/s^3; position in rad, in place of the model's range."""

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


class Angle(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A joint that turns as one of the angle solver's does: q = zero + sign * angle, rad."""

    joint: str
    sign: Literal[-1, 1] = 1
    zero: float = 0.0


class RobotFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A robot.

    Attributes:
        name: what it is called.
        kind: a mannequin is built from the skeleton, a humanoid is loaded from its model.
        limits: what its joints may do at most.
        model: the humanoid's MJCF or URDF file, from this file's folder.
        packages: the folder of each package that a URDF's meshes are named by, from this file's folder.
        solver: how poses are carried onto it: by angles of limbs, or by inverse kinematics.
        root_height: of its root above the floor when it stands straight, m; none plays paths at their own scale.
        root_rotation: quaternion of its root body while it stands upright and faces x.
        parts: body part to body of the model, for inverse kinematics and for the feet.
        angles: the angle solver's joints to the model's; none where they have the same names.
        rest: joint positions to rest in, rad; those not named rest at zero.
        servo: what each of its servos can do; without it they are as strong as the model has them.
        walk: how it walks on its own feet.
        rise: how it gets up from the floor.
    """

    name: str
    kind: Literal["mannequin", "humanoid"]
    limits: LimitTable
    model: str | None = None
    packages: dict[str, str] = {}
    solver: Solver = "angles"
    root_height: float | None = None
    root_rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    parts: dict[str, str] = {}
    angles: dict[str, Angle] = {}
    rest: dict[str, float] = {}
    servo: ServoMotor | None = None
    walk: WalkSettings = WalkSettings()
    rise: RiseSettings = RiseSettings()


def read_robot_file(path: Path) -> RobotFile:
    """Reads a robot file.

    Raises:
        FileFormatError: if the file is missing, is no TOML, or a key or a value is none that a robot file has.
    """
    if not path.exists():
        raise FileFormatError(f"{path}: there is no such robot file. Check the name.")
    robot = read_toml(path, RobotFile)
    _check_numbers(path, robot)
    return robot


def _check_numbers(path: Path, robot: RobotFile) -> None:
    """No limit may be zero, negative, infinite or no number."""
    checks = {"limits": robot.limits, **{f"limits.joints.{name}": own for name, own in robot.limits.joints.items()}}
    for place, table in checks.items():
        for key in ("velocity", "acceleration", "jerk"):
            value = getattr(table, key)
            if value is not None and not 0.0 < value < float("inf"):
                raise FileFormatError(f"{path}: {place}.{key} is {value}; it must be a positive number")
    positions = {f"rest.{name}": value for name, value in robot.rest.items()}
    positions |= {f"angles.{name}.zero": angle.zero for name, angle in robot.angles.items()}
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
    for key, value in msgspec.structs.asdict(robot.walk).items():
        if not abs(value) < float("inf"):
            raise FileFormatError(f"{path}: walk.{key} is {value}; it must be a finite number")
    for key, rows in msgspec.structs.asdict(robot.rise).items():
        for number, row in enumerate(rows, start=1):
            if not (row[0] > 0.0 and all(abs(value) < float("inf") for value in row)):
                place = f"{path}: rise.{key}, row {number}: {list(row)}"
                raise FileFormatError(f"{place}; it must be a time above 0 s and five angles in rad")
    if robot.rise.back and not robot.rise.front:
        raise FileFormatError(f"{path}: rise.back ends on the belly: it needs rise.front to get up from there")
    if robot.root_height is not None and not 0.0 < robot.root_height < float("inf"):
        raise FileFormatError(f"{path}: root_height is {robot.root_height}; it must be a positive number of metres")
    if not abs(sum(component**2 for component in robot.root_rotation) - 1.0) < 1e-3:
        raise FileFormatError(f"{path}: root_rotation is {list(robot.root_rotation)}, which is no unit quaternion")
    if (robot.model is None) != (robot.kind == "mannequin"):
        raise FileFormatError(
            f"{path}: model: "
            + (
                "a mannequin is built, not loaded"
                if robot.model
                else f"a robot of kind '{robot.kind}' needs its MJCF or URDF file"
            )
        )
    if robot.kind == "mannequin" and robot.solver == "ik":
        raise FileFormatError(f"{path}: solver: a mannequin plays its skeleton's joints exactly and needs no 'ik'")
