"""`motiondeck robot tune-walk`: tunes a robot's walk and writes the settings into its file."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
from joblib import delayed

from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck.run.spec.program import first_motion
from motiondeck_base.files import write_file
from motiondeck_base.jobs import Jobs, spread
from motiondeck_base.progress import collected, progress
from motiondeck_base.shipped import find_library
from sim.models.robot_file import WalkSettings, with_walk_table
from sim.physics.playback import usual_push
from sim.physics.walk_trial import Course, Trial, play_course, pushes, walk_trial
from sim.physics.walk_tuning import EDGE, steps, tune_walk
from sim.robots.robot import Robot, load_robot


def tune(file: Path, library: str, motions: list[str], seconds: float, rounds: int, jobs: Jobs) -> dict[str, Any]:
    """Tunes the robot of a file on motions of a library, and writes the settings into the file.

    MotiondeckError if a file or a motion does not exist, the robot has no two feet, or the file cannot be written.
    """
    loaded = load_library(find_library(library))
    robot = load_robot(file, loaded.skeleton)
    impulse = usual_push(robot.model)
    decks = (Deck(loaded, robot.retarget, first_motion(loaded, motion)) for motion in motions)
    played = (play_course(robot, deck.update, seconds, SafetyEnvelope) for deck in decks)
    courses = collected(played, f"playing {', '.join(motions)}", len(motions))

    def walks(tried: Sequence[WalkSettings], first: int) -> list[list[Trial]]:
        tasks = [
            delayed(_walk)(file, library, course, impulse, first + number, settings)
            for settings in tried
            for number, course in enumerate(courses)
        ]
        trials = list(spread(tasks, jobs))
        return [trials[at : at + len(courses)] for at in range(0, len(trials), len(courses))]

    with progress("tuning", steps(rounds)) as tick:
        tuned = tune_walk(robot.walk, walks, seconds * len(courses), rounds, tick)
    write_file(file, with_walk_table(file.read_text(encoding="utf-8"), tuned.settings).encode())
    return {
        "robot": robot.name,
        "file": str(file),
        "motions": motions,
        "seconds": seconds,
        "push_ns": impulse,
        "walk": msgspec.structs.asdict(tuned.settings),
        "edge": tuned.edge,
        "margin": 1.0 - EDGE if tuned.edge > 0.0 else 0.0,
        "walked_m": list(tuned.walked),
        "stood": tuned.stood,
    }


@lru_cache(maxsize=1)
def _loaded(file: Path, library: str) -> Robot:
    return load_robot(file, load_library(find_library(library)).skeleton)


def _walk(file: Path, library: str, course: Course, impulse: float, seed: int, settings: WalkSettings) -> Trial:
    """One trial; the robot is loaded once a process."""
    return walk_trial(_loaded(file, library), course, pushes(impulse, seed), settings)


def report_text(report: dict[str, Any]) -> str:
    """The report as lines of text."""
    walked = ", ".join(f"{name} {far:.1f} m" for name, far in zip(report["motions"], report["walked_m"], strict=True))
    ends = "stood" if report["stood"] else "fell"
    pushes = f"pushes of {report['push_ns']:.2g} N s every 5 s that it was not tuned under"
    lines = [f"{report['robot']} {ends} under {pushes}; in {report['seconds']:g} s it went: {walked}"]
    if report["margin"]:
        lines.append(f"its steps are {report['margin']:.0%} shorter than the longest at which it stood")
    else:
        lines.append("it fell at every pace: more --rounds, or an easier --motion")
    return "\n".join([*lines, f"wrote {report['file']}"])
