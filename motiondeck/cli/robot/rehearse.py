"""`motiondeck robot rehearse`: finds joint targets with which a robot does a motion on a free root, and judges them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from controller.library.motion_library import load_library
from motiondeck_base.errors import UnknownNameError
from motiondeck_base.files import check_folder
from motiondeck_base.progress import progress
from motiondeck_base.shipped import find_library, find_robot
from sim.physics.played_motions import DT, load_sampled_robot, play_motions
from sim.physics.rehearsal.plant import Plant, Variation, variations
from sim.physics.rehearsal.rehearse import rehearse
from sim.physics.rehearsal.verdict import Repeat, repeated
from sim.physics.rehearsal.wanted_motion import WantedMotion, wanted_motion
from sim.robots.joint_motion import JointMotion, check_ending
from sim.robots.robot import Robot

# What may be wrong with robot and floor at most, and how many robots that are off rehearse at once.
WORST, BODIES = Variation(strength=0.85, friction=0.7, off=0.02), 6
COURSES = 24
# So many seeds belong to a rehearsal; it is judged by errors of the last ones, which it does not rehearse with.
SEEDS = 1_000_000
# A motion that is kept this often can be played without a gantry.
OFTEN = 0.9


def rehearsed(
    robot: str, motion: str, library: str, out: Path, tempo: float, rounds: int, generations: int, tries: int, seed: int
) -> dict[str, Any]:
    """Rehearses a motion, writes it, and says how often it is kept with errors that the robot did not rehearse with.

    Raises:
        MotiondeckError: if a file or the motion does not exist, or the result cannot be written.
    """
    check_ending(out)
    check_folder(out)
    loaded = load_library(find_library(library))
    if motion not in loaded.network.motions:
        raise UnknownNameError.among("motion", motion, loaded.network.motions)
    body = load_sampled_robot(find_robot(robot), loaded.skeleton)
    played = next(iter(play_motions(loaded, body, [motion])))
    wanted = wanted_motion(body, played, tempo, rounds)
    plant = Plant(body, wanted.qpos[0], os.cpu_count() or 1)
    plant.put(variations(BODIES, SEEDS * seed, WORST))
    with progress(f"rehearsing {motion}", generations) as tick:
        found = rehearse(
            body, wanted, plant, COURSES, generations, seed, lambda cost: tick(f"rehearsing {motion}: {cost:.2f}")
        )
    JointMotion(motion, body.joints, 1.0 / DT, found.targets, found.qpos).save(out, "loop" if played.loop else "once")
    with progress("trying it", 2 * tries) as tick:
        done = {
            name: _tried(body, targets, wanted, variations(1 + tries, SEEDS * (seed + 1) - 2 * tries, WORST)[1:], tick)
            for name, targets in (("as played", wanted.targets), ("rehearsed", found.targets))
        }
    return {
        "robot": body.name,
        "motion": motion,
        "tempo": tempo,
        "seconds": len(wanted) * DT,
        "tries": tries,
        "asked_m": float(np.hypot(*(wanted.qpos[-1, :2] - wanted.qpos[0, :2]))),
        **{name.replace(" ", "_"): _said(repeats) for name, repeats in done.items()},
        "file": str(out),
    }


def _tried(robot: Robot, targets: np.ndarray, wanted: WantedMotion, varied: list[Variation], tick: Any) -> list[Repeat]:
    done = []
    for variation in varied:
        done.append(repeated(robot, targets, wanted, variation))
        tick()
    return done


def _said(repeats: list[Repeat]) -> dict[str, Any]:
    means = {name: float(np.mean([getattr(one, name) for one in repeats])) for name in ("joints_deg", "tilt_deg")}
    height, went = (float(np.mean([getattr(one, name) for one in repeats])) for name in ("height", "went"))
    return {"kept": sum(one.kept for one in repeats), **means, "height_percent": 100.0 * height, "went_m": went}


def words(report: dict[str, Any]) -> str:
    """The report in a few lines."""
    tries = report["tries"]
    lines = [f"{report['motion']}, {report['seconds']:.1f} s, {tries} times, with errors it did not rehearse with:"]
    for name in ("as_played", "rehearsed"):
        row = report[name]
        lines.append(
            f"  {name.replace('_', ' '):<10} kept to the end {row['kept']} of {tries}; joints {row['joints_deg']:.0f}, "
            f"trunk {row['tilt_deg']:.0f} degrees off, root {row['height_percent']:.0f} % of its height; "
            f"went {row['went_m']:.2f} of {report['asked_m']:.2f} m"
        )
    kept = report["rehearsed"]["kept"] / max(tries, 1)
    lines.append("it can do without a gantry" if kept >= OFTEN else "it should stay on the gantry")
    return "\n".join([*lines, f"wrote {report['file']}"])
