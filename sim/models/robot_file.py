"""Robot files: the TOML description of a robot, every key with its checks."""

import re
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.toml_file import read_toml
from sim.models.servo_motor import Positive, ServoMotor

Row = tuple[float, float, float, float, float, float]
"""Duration, s, and the bends of hips, knees, ankles, shoulders and elbows of a human in that pose, rad
(`robot.Bends`)."""


class RiseSettings(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Poses of getting up; the table [rise]: `front` from the belly to a crouch, `back` from the back onto the belly.

    The rest pose follows. Without poses the robot stays down.
    """

    front: tuple[Row, ...] = ()
    back: tuple[Row, ...] = ()


class WalkSettings(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Settings of walking, the table [walk]; heights and lengths in heights of the root, times in s."""

    share: float = 0.7  # of the length of the motion's steps
    longest: float = 0.6  # step, from foot to foot
    fastest: float = 2.2  # mean speed of a swinging foot, heights a second: quicker steps become shorter
    slowest: float = 3.3  # duration of a swing, in sqrt(height / g): slower ones stand on both feet first
    width: float = 0.36  # least distance between the soles
    bend: float = 0.08  # lowering of the root
    lift: float = 0.08  # of a swinging sole
    double_support: float = 0.04  # least time on both feet between two steps
    roll: float = 0.3  # way of the centre of pressure along the sole during a step, in lengths of the sole
    ahead: float = 0.8  # gain of a landing foot on the error of the capture point, forwards
    aside: float = 0.5  # the same sideways
    ankle: float = 0.9  # gain of the centre of mass on the remaining error
    # Largest shift of the centre of mass to a side, in half lengths of the sole (ahead 0.8): beyond the half width of
    # the sole a stiff ankle lifts the foot onto its edge.
    lean: float = 0.28
    upright: float = 0.6  # share of the trunk's tilt that the swinging foot compensates
    feed_forward: float = 0.6  # share of gravity's torques that the servos of the legs get in advance
    toe: float = 0.3  # pitch over the toes at leaving, for the longest step, rad
    heel: float = 0.15  # the same over the heel at landing


Solver = Literal["angles", "ik"]
SOLVERS: tuple[Solver, ...] = ("angles", "ik")


def solver_named(name: str | None) -> Solver | None:
    """The solver of a name, or None for None; UnknownNameError for another name."""
    if name is None or name in SOLVERS:
        return name
    raise UnknownNameError.among("solver", name, SOLVERS)


_Rate = Annotated[float, msgspec.Meta(ge=1e-3, le=1e9)]  # with a lower one an approach would never end
_Jerk = Annotated[float, msgspec.Meta(ge=1e-3, le=1e12)]
_Height = Annotated[float, msgspec.Meta(ge=1e-3, le=1e3)]


class JointLimit(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Limits of one joint: rad/s, rad/s^2, rad/s^3; positions, rad, and torque, N m, in place of the model's."""

    velocity: _Rate | None = None
    acceleration: _Rate | None = None
    jerk: _Jerk | None = None
    lower: float | None = None
    upper: float | None = None
    torque: Positive | None = None


class LimitTable(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """Limits of all joints, rad/s, rad/s^2, rad/s^3, and of the joints that differ."""

    velocity: _Rate
    acceleration: _Rate
    jerk: _Jerk
    joints: dict[str, JointLimit] = {}


class Angle(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A joint that plays an angle of the angle solver: q = zero + sign * angle, rad."""

    joint: str
    sign: Literal[-1, 1] = 1
    zero: float = 0.0


class RobotFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A robot."""

    name: str
    kind: Literal["mannequin", "humanoid"]  # built from the skeleton, or loaded from its model
    limits: LimitTable
    model: str | None = None  # the humanoid's MJCF or URDF file, relative to this file's folder
    packages: dict[str, str] = {}  # the folder of each ROS package that its URDF names, relative to this file's folder
    solver: Solver = "angles"  # of the retargeting: angles of limbs, or inverse kinematics
    # Of the standing root, m; scales the human's path. Without it paths are not scaled.
    root_height: _Height | None = None
    root_rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)  # of the root upright and facing x
    parts: dict[str, str] = {}  # body part to body of the model, for inverse kinematics and for the feet
    angles: dict[str, Angle] = {}  # the angle solver's joints to the model's; empty where they have the same names
    masses: dict[str, Positive] = {}  # of bodies, kg, in place of the model's
    rest: dict[str, float] = {}  # joint positions of the rest pose, rad; other joints rest at zero
    groups: dict[str, tuple[str, ...]] = {}  # joints that layers play on, by the name of their group
    servo: ServoMotor | None = None  # without it the model's own limits hold
    walk: WalkSettings = WalkSettings()
    rise: RiseSettings = RiseSettings()


def read_robot_file(path: Path) -> RobotFile:
    """Reads a robot file; FileFormatError if it is missing or not TOML, or a key or a value is not allowed."""
    if not path.exists():
        raise FileFormatError(f"{path}: there is no such robot file. Check the name.")
    robot = read_toml(path, RobotFile)
    for key, rows in (("front", robot.rise.front), ("back", robot.rise.back)):
        for number, row in enumerate(rows, start=1):
            if not row[0] > 0.0:
                place = f"{path}: rise.{key}, row {number}: {list(row)}"
                raise FileFormatError(f"{place}; it must be a time above 0 s and five angles in rad")
    if robot.rise.back and not robot.rise.front:
        raise FileFormatError(f"{path}: rise.back ends on the belly: it needs rise.front to get up from there")
    if not abs(sum(component**2 for component in robot.root_rotation) - 1.0) < 1e-3:
        raise FileFormatError(f"{path}: root_rotation is {list(robot.root_rotation)}, which is no unit quaternion")
    if (robot.model is None) != (robot.kind == "mannequin"):
        needs = f"a robot of kind '{robot.kind}' needs its MJCF or URDF file"
        raise FileFormatError(f"{path}: model: {'a mannequin is built, not loaded' if robot.model else needs}")
    if robot.kind == "mannequin" and robot.masses:
        raise FileFormatError(f"{path}: masses: those of a mannequin follow from its skeleton")
    if robot.kind == "mannequin" and robot.solver == "ik":
        raise FileFormatError(f"{path}: solver: a mannequin plays its skeleton's joints exactly and needs no 'ik'")
    return robot


def with_walk_table(text: str, settings: WalkSettings) -> str:
    """The text of a robot file with these settings as its table [walk], up to an empty line, a table or the end."""
    lines = [f"{name} = {value:.3g}" for name, value in msgspec.structs.asdict(settings).items()]
    table = "\n".join(["[walk]", *lines]) + "\n"
    there = re.search(r"^\[walk\][^\n]*\n(?:[^\[\n][^\n]*(?:\n|\Z))*", text, re.MULTILINE)
    if there is None:
        return f"{text.rstrip()}\n\n{table}"
    after = text[there.end() :]
    return text[: there.start()] + table + ("\n" if after else "") + after
