"""`motiondeck robot check`: how well a robot follows recordings, one row each."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.canonical.clip_edits import without_reference_pose
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip
from motiondeck.cli.common.tables import show_table
from motiondeck.cli.robot.retarget import SEGMENTS, worse_side
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.words import counted
from sim.models.robot_file import Solver
from sim.robots.carried_findings import SegmentAngle, carried_findings, joint_findings, segment_angles
from sim.robots.fidelity import Carried, carry, floor_measures, joint_measures, shortfall
from sim.robots.limb_directions import LimbDirections, beyond_limits
from sim.robots.robot import Robot, RobotLoader
from sim.robots.verdict import REMEDIES, Finding, summed, verdict_of


def check(robot: Path, files: Sequence[Path], solver: Solver | None, seconds: float | None) -> Iterator[dict[str, Any]]:
    """One row a recording: `clip` and `unread`, or `frames` and `error`, or its `verdict` and measures.

    Of each the first seconds count, or all of it. A pose for reference before the motion is left out; `left_out` says
    how many frames that was.
    """
    load = RobotLoader(robot)
    for file in files:
        try:
            clip, left_out = without_reference_pose(read_clip(file))
            if seconds is not None:
                frames = max(2, int(min(seconds * clip.rate, len(clip))))
                clip = replace(clip, root_position=clip.root_position[:frames], rotation=clip.rotation[:frames])
        except MotiondeckError as error:
            yield {"clip": str(file), "unread": str(error)}
            continue
        try:
            row = {"clip": str(file), "frames": len(clip), "rate": clip.rate, "left_out": left_out}
            yield row | _measured(load, clip, left_out, solver)
        except Exception as error:  # a row that says so is what the table is for
            yield {"clip": str(file), "frames": len(clip), "error": f"{type(error).__name__}: {error}"}


def passes(row: dict[str, Any]) -> bool:
    """Whether a recording was read and carried, and the robot plays it as it is."""
    return "verdict" in row and row["verdict"].ok


def answer(rows: Sequence[dict[str, Any]]) -> str:
    """One line: "5 recordings: 3 play, 1 at a slower tempo, 1 not read"."""
    counts = {"not read": "unread", "failed": "error"}
    found = [f"{count} {words}" for words, key in counts.items() if (count := sum(key in row for row in rows))]
    verdicts = summed(row["verdict"] for row in rows if "verdict" in row)
    return f"{counted(len(rows), 'recording')}: {', '.join(filter(None, (verdicts, *found)))}"


def remarks(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each problem of a recording, then what to do about each kind."""
    found, checks = [], dict[str, None]()
    for row in rows:
        clip = row["clip"]
        if "verdict" not in row:
            found.append(f"{'not read' if 'unread' in row else 'failed'}: {clip}: {row.get('unread') or row['error']}")
            continue
        if row["left_out"]:
            found.append(f"a pose before the motion is left out: {clip}, frames: {row['left_out']}")
        limbs: dict[str, list[str]] = {}  # a phrase for each segment that points further off than the limit, by cause
        for name, off in row.get("limbs_deg", {}).items():
            for phrase in beyond_limits({name: (off["mean"], off["worst"])}):
                best = f"out of reach: {off['best_mean']:.0f} and {off['best_worst']:.0f}"
                limbs.setdefault(off["cause"], []).append(f"{phrase} at {off['worst_at_s']:.2f} s ({best})")
        if limbs or not passes(row):
            found.append(f"{clip}: {row['verdict'].words}")
        found += [f"{clip}: {cause}: {'; '.join(phrases)}" for cause, phrases in limbs.items()]
        checks |= dict.fromkeys((*limbs, *(finding.check for finding in row["verdict"].troubles)))
    return found + [f"{check}: {REMEDIES[check]}" for check in checks]


def print_rows(rows: list[dict[str, Any]]) -> None:
    """Prints the table, its sums, and a remark for each problem."""
    counts = ("bad", "beyond", "too_fast", "jumps")
    reach = {"past_range": "past"} if any("past_range" in row for row in rows) else {}
    if any("short_worst" in row for row in rows):
        reach = {"short_rms": "short", "short_worst": "worst"}
    degrees = [f"{name.replace('_', ' ')} deg" for name in (*SEGMENTS, "trunk")]
    headings = ("recording", "frames", "bad", "beyond", "fast", "jumps", "changed", *reach.values(), *degrees)
    lines = []
    for row in rows:
        if "altered" in row:
            cells = [str(row["frames"]), *(f"{row[name]:.0f}" for name in counts), f"{100.0 * row['altered']:.1f} %"]
            cells += [f"{row[name]:.0f}" if name == "past_range" else f"{1000.0 * row[name]:.1f}" for name in reach]
            limbs = {name: (off["mean"], off["worst"]) for name, off in row.get("limbs_deg", {}).items()}
            cells += [worse_side(limbs, name) for name in SEGMENTS]
            cells += [f"{row['trunk_deg']['mean']:.0f}/{row['trunk_deg']['worst']:.0f}" if "trunk_deg" in row else ""]
            cells += [f"{1000.0 * row[name]:.1f}" if name in row else "" for name in ("slide", "sunk")]
            lines.append((Path(row["clip"]).name, *cells))
        elif "error" in row:
            lines.append((Path(row["clip"]).name, str(row["frames"]), "ERROR"))
    show_table((*headings, "slide", "sunk"), lines)
    carried = [row for row in rows if "altered" in row]
    sums = ", ".join(f"{name.replace('_', ' ')} {sum(row[name] for row in carried):.0f}" for name in counts)
    frames = sum(row["frames"] for row in carried)
    print(f"{counted(len(carried), 'recording')}, {frames} frames: {sums}")
    for line in remarks(rows):
        print(line)


def _measured(load: RobotLoader, clip: Clip, left_out: int, solver: Solver | None) -> dict[str, Any]:
    file = load.file
    solver = None if file.kind == "mannequin" else solver
    loaded, carried, counts, angles, found = _carried(load, clip, solver)
    measures: dict[str, Any] = counts | shortfall(loaded)
    if file.parts:
        measures["limbs_deg"] = segments = dict[str, dict[str, Any]]()
        for name, off in angles.items():
            at = (left_out + off.worst_at) / clip.rate
            segments[name] = {"mean": off.mean, "worst": off.worst, "worst_at_s": at}
            if off.best is not None:
                segments[name] |= {"cause": off.cause, "best_mean": off.best[0], "best_worst": off.best[1]}
        if loaded.has_legs:
            trunk = _directions(load, loaded).trunk_errors(carried.qpos, carried.limbs)
            measures["trunk_deg"] = {"mean": float(trunk.mean()), "worst": float(trunk.max())}
        measures |= floor_measures(clip, loaded, carried.qpos, file.parts)

    def slower(tempo: float) -> list[Finding]:
        return _carried(load, replace(clip, rate=tempo * clip.rate), solver)[-1]

    return measures | {"verdict": verdict_of(clip.name, found, slower)}


def _directions(load: RobotLoader, robot: Robot) -> LimbDirections:
    return LimbDirections(robot.model, load.file.parts, np.array(load.file.root_rotation))


def _carried(
    load: RobotLoader, clip: Clip, solver: Solver | None
) -> tuple[Robot, Carried, dict[str, float], dict[str, SegmentAngle], list[Finding]]:
    """A clip on the robot, with the measures of its joints, the angles of its limbs, and the findings."""
    robot = load(clip.skeleton, solver, 1.0 / clip.rate)
    carried = carry(clip, robot, SafetyEnvelope)
    counts = joint_measures(clip, robot, carried)
    found, angles = joint_findings(counts), dict[str, SegmentAngle]()
    if load.file.parts:
        directions = _directions(load, robot)
        angles = segment_angles(robot, directions, carried, clip.rate)
        found += carried_findings(robot, directions, carried, angles)
    return robot, carried, counts, angles, found
