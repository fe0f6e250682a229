"""Robots of the benchmark `world`: published ones with their joints named by hand, and two that are written here."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmarks.robots.published_models import MODELS


@dataclass(frozen=True)
class Limbs:
    """Names of the hinges of both limbs of a kind; {} is the side."""

    centre: tuple[str, ...]  # that meet in the hip or shoulder, the first one on the trunk
    middle: str  # knee or elbow
    end: str | None  # ankle or wrist; None for an arm that ends in its forearm


@dataclass(frozen=True)
class WorldRobot:
    """A robot and its limbs; the sides are right and left."""

    name: str
    sides: tuple[str, str]
    leg: Limbs
    arm: Limbs


def _limbs(prefix: str, names: str) -> Limbs:
    """Of "hip hip hip > knee > ankle"."""
    centre, middle, *end = ([prefix + name for name in part.split()] for part in names.split(">"))
    return Limbs(tuple(centre), middle[0], end[0][0] if end else None)


_HIPS, _SHOULDERS = "hip_pitch_joint hip_roll_joint hip_yaw_joint", "shoulder_pitch_joint shoulder_roll_joint"
_OWN = _limbs("{}_", "hip_yaw hip_roll hip_pitch > knee > ankle"), _limbs("{}_", "arm_pitch arm_roll arm_yaw > elbow")
ROBOTS = (
    WorldRobot(
        "unitree_g1",
        ("right", "left"),
        _limbs("{}_", f"{_HIPS} > knee_joint > ankle_pitch_joint"),
        _limbs("{}_", f"{_SHOULDERS} shoulder_yaw_joint > elbow_joint > wrist_pitch_joint"),
    ),
    WorldRobot(
        "fourier_gr1",
        ("r", "l"),
        _limbs("{}_leg_", "hip_roll hip_yaw hip_pitch > knee_pitch > ankle_pitch"),
        _limbs("{}_", "shoulder_pitch shoulder_roll shoulder_yaw > elbow_pitch > wrist_pitch"),
    ),
    WorldRobot(
        "unitree_h1",
        ("right", "left"),
        _limbs("{}_leg_", "hip_yaw_joint hip_roll_joint hip_pitch_joint > knee_joint > ankle_joint"),
        _limbs("{}_", f"{_SHOULDERS} shoulder_yaw_joint > elbow_joint"),
    ),
    WorldRobot(
        "talos",
        ("right", "left"),
        _limbs("leg_{}_", "1_joint 2_joint 3_joint > 4_joint > 5_joint"),
        _limbs("arm_{}_", "1_joint 2_joint 3_joint > 4_joint > 6_joint"),
    ),
    WorldRobot(
        "servo20",
        ("r", "l"),
        _limbs("{}_", "hip_yaw hip_roll hip_pitch > knee > ankle_pitch"),
        _limbs("{}_", "shoulder_pitch shoulder_roll > elbow"),
    ),
    WorldRobot("no_waist", ("right", "left"), *_OWN),
    WorldRobot("ball_forearm", ("right", "left"), *_OWN),
)


def model_of(robot: WorldRobot, models: Path, written: Path) -> Path | None:
    """Its model: one of a folder of unpacked packages, or written into another folder; None for a shipped robot."""
    if robot.name in ("no_waist", "ball_forearm"):
        path = written / f"{robot.name}.xml"
        path.write_text(written_robot(robot.name))
        return path
    return next((models / model.file for model in MODELS if model.name == robot.name), None)


def written_robot(name: str) -> str:
    """An MJCF, 1.4 m tall.

    `no_waist`: hips and shoulders are on one rigid trunk. `ball_forearm`: the waist yaws, rolls and pitches, and a
    forearm collides as a ball at its elbow alone; what can be seen of it does not collide.
    """
    waist = name == "ball_forearm"

    def capsule(length: float, radius: float, collides: bool = True) -> str:
        seen = "" if collides else ' contype="0" conaffinity="0"'
        return f'<geom type="capsule" fromto="0 0 0 0 0 {-length}" size="{radius}"{seen}/>'

    def hinges(prefix: str, kinds: str) -> str:
        axes = {"yaw": "0 0 1", "roll": "1 0 0", "pitch": "0 1 0"}
        ends = {"hip_pitch": "-2.2 1", "hip_roll": "-.8 .8", "hip_yaw": "-1 1", "arm_pitch": "-3.1 2.5"}
        return "".join(
            f'<joint name="{prefix}_{kind}" axis="{axes[kind]}" range="{ends.get(_kind(prefix, kind), "-2.2 2.2")}"/>'
            for kind in kinds.split()
        )

    limbs = {"leg": "", "arm": ""}
    for side, left in (("left", 1), ("right", -1)):
        limbs["leg"] += (
            f'<body name="{side}_thigh" pos="0 {0.09 * left} -.06">{hinges(f"{side}_hip", "yaw roll pitch")}'
            f'{capsule(0.3, 0.05)}<body name="{side}_shank" pos="0 0 -.33"><joint name="{side}_knee" axis="0 1 0" '
            f'range="0 2.5"/>{capsule(0.28, 0.04)}<body name="{side}_foot" pos="0 0 -.33"><joint name="{side}_ankle" '
            'axis="0 1 0" range="-1 1"/>'
            f'<joint name="{side}_ankle_roll" axis="1 0 0" range="-.6 .6"/>'
            '<geom type="box" pos=".05 0 -.04" size=".1 .04 .02"/></body></body></body>'
        )
        fore = f'<geom size=".04"/>{capsule(0.2, 0.03, False)}' if waist else capsule(0.22, 0.03)
        limbs["arm"] += (
            f'<body name="{side}_upper" pos="0 {0.2 * left} .36">{hinges(f"{side}_arm", "pitch roll yaw")}'
            f'{capsule(0.2, 0.035)}<body name="{side}_fore" pos="0 0 -.24"><joint name="{side}_elbow" axis="0 -1 0" '
            f'range="0 2.5"/>{fore}</body></body>'
        )
    upper = (
        f'<geom type="box" pos="0 0 .22" size=".08 .14 .17"/>{limbs["arm"]}<body name="head" pos="0 0 .42"><joint '
        'name="neck_yaw" axis="0 0 1" range="-1.5 1.5"/><geom pos="0 0 .1" size=".09"/></body>'
    )
    if waist:
        upper = f'<body name="chest" pos="0 0 .05">{hinges("waist", "yaw roll pitch")}{upper}</body>'
    return (
        f'<mujoco model="{name}"><compiler angle="radian" autolimits="true"/><worldbody><body name="pelvis" '
        f'pos="0 0 .8"><freejoint/><geom type="box" size=".07 .09 .06"/>{limbs["leg"]}{upper}</body></worldbody>'
        "</mujoco>"
    )


def _kind(prefix: str, kind: str) -> str:
    return f"{prefix.split('_')[-1]}_{kind}"
