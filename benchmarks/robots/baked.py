"""How far baked motions are from those that are carried live, in joints, limbs and feet.

Each motion is played from its beginning by two decks at 200 Hz, through the safety envelope: one carries the human
library to the robot in every tick, the other plays the library that was baked for it. A loop is compared in its second
round, a one-shot from its start to its end. Printed are for each motion

- the difference of the joints' angles: mean, 95 % and the worst, degrees;
- the angle from the robot's limbs to the human's in the world, live and baked: the mean over limbs, and that of the
  worst limb, degrees, by the landmarks of `robot check`, which neither way of carrying knows;
- the mean speed of the soles while the human's feet stand, mm/s, and how deep anything is in the floor, mm.

With --write the table of several runs is put into a page of the docs.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.clip import Clip
from controller.motion.posture import Pose
from controller.motion.rotations import Array
from sim.models.robot_file import RobotFile
from sim.robots.fidelity import SIDES, floor_measures, lines_for
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import Robot, RobotLoader

RATE = 200.0
_BETWEEN = re.compile(r"(<!-- baked, by benchmarks baked -->\n).*?(<!-- end of baked -->)", re.S)


@dataclass(frozen=True)
class Played:
    """A motion on a robot: T ticks."""

    angles: Array  # of the joints after the envelope, shape (T, J), rad
    qpos: Array  # shape (T, nq)
    poses: list[Pose]  # of the deck


def play(library: MotionLibrary, robot: Robot, motion: str, ticks: int) -> Played:
    """Plays a motion from its beginning."""
    deck, envelope = Deck(library, robot.retarget, motion), SafetyEnvelope(robot.limits, 1.0 / RATE)
    angles, qpos, poses = [], [], []
    state = robot.model.qpos0.copy()
    for tick in range(ticks):
        targets, pose = deck.update(1.0 / RATE)
        if tick == 0:
            envelope.start(np.clip(targets, robot.limits.lower, robot.limits.upper))
        safe = envelope(targets)
        robot.place(safe, pose, state)
        angles.append(safe.copy())
        qpos.append(state.copy())
        poses.append(pose)
    return Played(np.array(angles), np.array(qpos), poses)


def compare(library: MotionLibrary, baked: MotionLibrary, loader: RobotLoader, motion: str) -> dict[str, float]:
    """The row of one motion."""
    info = next(one for one in library.info.motions if one.name == motion)
    ticks = round(info.frames / library.info.rate * RATE)
    first, ticks = (ticks, 2 * ticks) if info.plays == "loop" else (0, ticks)
    live_robot, baked_robot = loader(library.skeleton, None, 1.0 / RATE), loader(baked.skeleton, None, 1.0 / RATE)
    ways = {
        "live": play(library, live_robot, motion, ticks),
        "baked": play(baked, baked_robot, motion, ticks),
    }
    live, other = ways["live"].angles[first:], ways["baked"].angles[first:]
    off = np.degrees(np.abs(live - other))
    row = {"mean": float(off.mean()), "p95": float(np.quantile(off, 0.95)), "worst": float(off.max())}
    row["worst_joint"] = live_robot.joints[int(off.max(axis=0).argmax())]  # pyright: ignore
    poses = ways["live"].poses[first:]
    place, rotation = np.array([pose.root_position for pose in poses]), np.array([pose.rotation for pose in poses])
    clip = Clip(motion, library.skeleton, RATE, place, rotation)
    for way, played in ways.items():
        row |= {
            f"{way}_{name}": value for name, value in judge(clip, live_robot, loader.file, played.qpos[first:]).items()
        }
    return row


def judge(clip: Clip, robot: Robot, file: RobotFile, qpos: Array) -> dict[str, float]:
    """Limbs and feet of a robot that plays a clip."""
    directions = LimbDirections(robot.model, file.parts, np.array(file.root_rotation))
    limbs = [mean for mean, _ in directions.errors(qpos, lines_for(robot, clip)).values()]
    feet = {s: robot.model.body(file.parts[f"{s}_foot"]).id for s, _ in SIDES if f"{s}_foot" in file.parts}
    floor = floor_measures(clip, robot, qpos, feet)
    return {
        "limbs_deg": float(np.mean(limbs)),
        "worst_limb_deg": max(limbs),
        "slide_mm_s": 1e3 * floor["slide"],
        "sunk_mm": 1e3 * floor["sunk"],
    }
