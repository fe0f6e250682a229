"""Proportions: a calibrated robot's limbs beside those of a human of its height, and implausible findings.

A human's segments are shares of the height (Drillis and Contini 1966, as in Winter, "Biomechanics and Motor Control of
Human Movement", 4th edition, 2009, figure 4.1).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from controller.motion.rotations import Array
from sim.models.kinematic_tree import hinges_between, path_to
from sim.retargeting.robot_limbs import RobotLimbs
from sim.robots.limb_directions import LimbDirections

HUMAN = {"thigh": 0.245, "shank": 0.246, "upper_arm": 0.186, "forearm": 0.146}
BENDS = {"shank": "knee", "forearm": "elbow"}  # the joint at the near end of a segment
# Largest relative difference of twins; ranges of a plausible and of a possible length, in those of a human.
TWINS, ODD, IMPLAUSIBLE = 0.1, (0.6, 1.8), (0.2, 4.0)
ALIKE = 0.25  # largest difference of mirrored twins' ranges, rad
# Plausible height, m, and median range of the joints, rad; else the file has other units.
TALL, TURNS = (0.05, 25.0), (0.15, 12.6)
TWIN_AXES = 0.9  # least cosine between mirrored twins' axes
ODD_FOREARM = 2.8  # arms may end in long hands without a wrist


@dataclass(frozen=True)
class SegmentPair:
    """One segment of both limbs."""

    part: str  # such as "shank"
    body: tuple[str, str]  # of the right and the left one
    hinge: tuple[str, str]  # the joints at their near ends
    axis: Array  # of these joints, standing straight and facing x, shape (2, 3)
    length: Array  # shape (2,), m
    human: float  # the length for a human of the robot's height, m


@dataclass(frozen=True)
class Doubt:
    """An implausible finding."""

    part: str  # its line in the robot file, such as "l_shank"; "" for the whole robot
    words: str
    fatal: bool  # whether a limb is missing or impossible


def segments_of(model: mujoco.MjModel, parts: dict[str, str], limbs: RobotLimbs, height: float) -> list[SegmentPair]:
    """The segments that both limbs of a pair have, for a robot of a height, m."""
    found = []
    for part, share in HUMAN.items():
        pair = [f"{side}_{part}" for side in "rl"]
        if all(name in limbs.segments for name in pair):
            measured = [limbs.segments[name] for name in pair]
            bodies = parts[pair[0]], parts[pair[1]]
            hinges = model.joint(measured[0].joint).name, model.joint(measured[1].joint).name
            axes, lengths = np.array([one.axis for one in measured]), np.array([one.length for one in measured])
            found.append(SegmentPair(part, bodies, hinges, axes, lengths, share * height))
    return found


def limb_doubts(parts: dict[str, str], segments: list[SegmentPair], directions: LimbDirections) -> list[Doubt]:
    """Limbs that do not fit a human's body, or their twins; knees and elbows that `LimbDirections` finds elsewhere."""
    arms = {"r_upper_arm": "right", "l_upper_arm": "left"}
    found = [Doubt("", f"no {side} arm was found ({name})", True) for name, side in arms.items() if name not in parts]
    found += [
        Doubt(f"{s}_shank", "no ankle was found below it", False)
        for s in "rl"
        if {f"{s}_shank"} <= {*parts} and f"{s}_foot" not in parts
    ]
    for segment in segments:
        right, left = segment.length.tolist()
        if abs(right - left) > TWINS * max(right, left):
            found.append(Doubt(f"l_{segment.part}", f"left {left:.3f} m and right {right:.3f} m differ", False))
        for side, length in (("r", right), ("l", left)):
            share = length / segment.human
            most = ODD_FOREARM if segment.part == "forearm" else ODD[1]
            if not ODD[0] <= share <= most:
                words = f"{length:.3f} m long; a human of this height has {segment.human:.3f} m"
                fatal = not IMPLAUSIBLE[0] <= share <= IMPLAUSIBLE[1]
                found.append(Doubt(f"{side}_{segment.part}", words, fatal))
    by_folding = {segment.name: segment.joint for segment in directions.segments}
    for segment in segments:
        for side, hinge in zip("rl", segment.hinge, strict=True):
            other = by_folding.get(f"{side}_{segment.part}")
            if segment.part in BENDS and other is not None and other != hinge:
                bend = BENDS[segment.part]
                words = f"its {bend} is taken to be '{hinge}', but '{other}' folds the limb more"
                found.append(Doubt(f"{side}_{segment.part}", words, True))
    return found + _range_doubts(directions.model, parts, directions.standing)


def undriven_limbs(
    model: mujoco.MjModel, parts: dict[str, str], segments: Sequence[SegmentPair], undriven: Collection[str]
) -> list[Doubt]:
    """Knees and elbows without actuators, and limbs on ball joints without them."""
    found = [
        Doubt(f"{side}_{segment.part}", f"no actuator of the model drives '{hinge}', so it cannot bend", True)
        for segment in segments
        if segment.part in BENDS
        for side, hinge in zip("rl", segment.hinge, strict=True)
        if hinge in undriven
    ]
    balls = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_BALL]
    for trunk, part in (("pelvis", "shank"), ("chest", "forearm")):
        for limb in (f"{side}_{part}" for side in "rl" if f"{side}_{part}" in parts):
            above = path_to(model, model.body(parts[trunk]).id)
            for body in path_to(model, model.body(parts[limb]).id):
                if body in balls and body not in above:
                    name = model.joint(model.body_jntadr[body]).name
                    words = f"no actuator of the model drives the ball joint '{name}' above it: give it some"
                    found.append(Doubt(limb, words, True))
    return found


def unit_doubts(model: mujoco.MjModel, height: float) -> list[Doubt]:
    """Signs of other units in the file of a robot, whose height is in m."""
    found = []
    if not TALL[0] <= height <= TALL[1]:
        words = "lengths in its file are metres (where only meshes are in mm, with their scale); scale them there"
        found.append(Doubt("", f"it is {height:.2f} m tall: {words}", True))
    hinges = (model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE) & (model.jnt_limited != 0)
    if not hinges.any():
        return found
    turns = float(np.median(np.ptp(model.jnt_range[hinges], axis=1)))
    if turns < TURNS[0]:
        words = 'an MJCF\'s angles are degrees unless it says <compiler angle="radian"/>'
        found.append(Doubt("", f"half of its joints turn by no more than {turns:.2g} rad: {words}", True))
    elif turns > TURNS[1]:
        words = "a URDF's angles are radians, and an MJCF's with <compiler angle=\"radian\"/>"
        found.append(Doubt("", f"half of its joints turn by {turns:.0f} rad or more: {words}", True))
    return found


def _range_doubts(model: mujoco.MjModel, parts: dict[str, str], standing: mujoco.MjData) -> list[Doubt]:
    """Hinges of a left leg or arm whose ranges do not mirror the right one, for a robot `standing` along x."""
    found = []
    for trunk, ends in (("pelvis", ("foot", "shank")), ("chest", ("hand", "forearm"))):
        end = next((end for end in ends if f"r_{end}" in parts and f"l_{end}" in parts), None)
        if end is None:
            continue
        above = model.body(parts[trunk]).id
        pair = [hinges_between(model, above, model.body(parts[f"{side}_{end}"]).id) for side in "rl"]
        for right, left in zip(*pair, strict=len(pair[0]) == len(pair[1])):
            # A mirror across y inverts rotations about x and z.
            same = float(standing.xaxis[left] @ (standing.xaxis[right] * (-1.0, 1.0, -1.0)))
            if abs(same) < TWIN_AXES or not (model.jnt_limited[right] and model.jnt_limited[left]):
                continue
            meant = np.sort(np.sign(same) * model.jnt_range[right])
            if np.abs(model.jnt_range[left] - meant).max() > ALIKE:
                one, other = (model.joint(joint).name for joint in (right, left))
                ranges = "from {:.2f} to {:.2f}, not from {:.2f} to {:.2f} rad".format(*model.jnt_range[left], *meant)
                words = f"'{other}' turns {ranges} as '{one}' does, seen in a mirror; if one of them is wrong, give its"
                found.append(Doubt("", f"{words} lower and upper under [limits.joints.NAME]", False))
    return found
