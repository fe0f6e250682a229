"""`motiondeck robot check`: how well a robot follows recordings, one row each."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.canonical.clip_edits import without_reference_pose
from controller.motion.clip import Clip
from controller.motion.formats.reading import FORMATS, read_clip, recordings_below
from motiondeck.cli.common.tables import show_table
from motiondeck_base.counted import counted
from motiondeck_base.errors import MotiondeckError
from sim.models.robot_file import Solver
from sim.retargeting.robot_parts import SIDES
from sim.robots.carried_findings import REACH_LIMIT, TRUNK_MEAN, TRUNK_WORST, segment_angles
from sim.robots.fidelity import carry, floor_measures, joint_measures, shortfall
from sim.robots.limb_causes import Cause
from sim.robots.limb_directions import LimbDirections, beyond_limits
from sim.robots.robot import RobotLoader
from sim.robots.verdict import REMEDIES, fastest_passing

MUST_BE_ZERO = {
    "bad": "targets that are NaN or infinite",
    "beyond": "targets beyond a joint's range",
    "too_fast": "steps faster than a joint may go",
    "jumps": "a joint jumps where the human does not",
}
OUT_OF_REACH: Cause = "out of reach"
HELD_BACK: Cause = "held back"
WHY: dict[str, str] = {
    OUT_OF_REACH: "because the joints cannot reach",
    HELD_BACK: "because limits of speed hold joints back",
    "carried wrongly": "though joints could turn there ([parts] of the robot file may be wrong)",
}
NAMED = 3  # recordings that the verdict names


def recordings(paths: Sequence[Path]) -> list[Path]:
    """The recordings among some files and in some folders, sorted; MotiondeckError if there are none."""
    found: list[Path] = []
    for path in paths:
        if not path.exists():
            raise MotiondeckError.missing(path, "file or folder")
        found += recordings_below(path) if path.is_dir() else [path]
    if not found:
        raise MotiondeckError(f"{', '.join(map(str, paths))}: no recordings ({', '.join(sorted(FORMATS))}) there")
    return found


def check(robot: Path, files: Sequence[Path], solver: Solver | None, seconds: float | None) -> Iterator[dict[str, Any]]:
    """One row a recording: `clip`, and `unread`, or its `frames` and `error` or the measures of `sim.robots.fidelity`.

    Of each the first seconds count, or all of it. A pose for reference before the motion is left out; `left_out` says
    how many frames that was.
    """
    load = RobotLoader(robot)
    for file in files:
        try:
            clip, left_out = without_reference_pose(read_clip(file))
            clip = _shortened(clip, seconds)
        except MotiondeckError as error:
            yield {"clip": str(file), "unread": str(error)}
            continue
        try:
            row = {"clip": str(file), "frames": len(clip), "rate": clip.rate, "left_out": left_out}
            yield row | _measured(load, clip, left_out, solver)
        except Exception as error:  # a row that says so is what the table is for
            yield {"clip": str(file), "frames": len(clip), "error": f"{type(error).__name__}: {error}"}


def faults(row: dict[str, Any]) -> list[str]:
    """Why a recording fails the check; nothing if it passes."""
    if "unread" in row:
        return ["cannot be read"]
    if "error" in row:
        return ["cannot be carried onto the robot"]
    found = [words for name, words in MUST_BE_ZERO.items() if row[name]]
    found += ["the trunk leans elsewhere"] * bool(_leaning(row))
    return found + [f"limbs point elsewhere {WHY[cause]}" for cause in off_limits(row) if _fails(row, cause)]


def _fails(row: dict[str, Any], cause: str) -> bool:
    """Whether limbs that point elsewhere for a cause fail the check."""
    far = (off["mean"] > REACH_LIMIT for off in row["limbs_deg"].values() if off.get("cause") == cause)
    return cause != OUT_OF_REACH or any(far)


def _leaning(row: dict[str, Any]) -> str:
    """A phrase for a trunk beyond its limits, or nothing."""
    off = row.get("trunk_deg", {"mean": 0.0, "worst": 0.0})
    within = off["mean"] <= TRUNK_MEAN and off["worst"] <= TRUNK_WORST
    return (
        ""
        if within
        else f"the trunk leans elsewhere, {off['mean']:.0f} degrees on average, {off['worst']:.0f} at worst"
    )


def verdict(rows: Sequence[dict[str, Any]]) -> str:
    """One line: PASSED, or FAILED with the number of recordings for each reason."""
    found = [faults(row) for row in rows]
    failed = [words for words in found if words]
    if not failed:
        short = sum(OUT_OF_REACH in off_limits(row) for row in rows)
        beside = f"; in {short}, limbs point elsewhere {WHY[OUT_OF_REACH]}" if short else ""
        return f"PASSED: {len(rows)} of {counted(len(rows), 'recording')}{beside}"
    reasons = Counter(reason for words in failed for reason in words)
    counts = "; ".join(f"{reason}: {count}" for reason, count in reasons.most_common())
    names = [Path(row["clip"]).name for row, words in zip(rows, found, strict=True) if words]
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"FAILED: {len(failed)} of {counted(len(rows), 'recording')} ({', '.join(names[:NAMED])}{more}). {counts}"


def off_limits(row: dict[str, Any]) -> dict[str, list[str]]:
    """A phrase for each segment of a row that points further off than the limit, by cause."""
    found: dict[str, list[str]] = {}
    for name, off in row.get("limbs_deg", {}).items():
        for phrase in beyond_limits({name: (off["mean"], off["worst"])}):
            best = f"out of reach: {off['best_mean']:.0f} and {off['best_worst']:.0f}"
            found.setdefault(off["cause"], []).append(f"{phrase} at {off['worst_at_s']:.2f} s ({best})")
    return found


def remarks(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each problem of a recording, then what to do about each kind."""
    found, causes = [], set[str]()
    for row in rows:
        clip = row["clip"]
        if "unread" in row or "error" in row:
            found.append(
                f"{'not read' if 'unread' in row else 'failed'}: {clip}: {row.get('unread', row.get('error'))}"
            )
            continue
        if row["left_out"]:
            found.append(f"a pose before the motion is left out: {clip}, frames: {row['left_out']}")
        found += [f"fails: {clip}: {row[name]:.0f} x {words}" for name, words in MUST_BE_ZERO.items() if row[name]]
        found += [f"fails: {clip}: {words}"] if (words := _leaning(row)) else []
        for cause, phrases in off_limits(row).items():
            causes.add(cause)
            kind = "fails" if _fails(row, cause) else "passes"
            slower = f"; {_slower(row['tempo'])}" if cause == HELD_BACK else ""
            found.append(f"{kind}: {clip}: limbs point elsewhere, {cause}: {'; '.join(phrases)}{slower}")
    return found + [f"{cause}: {what}" for cause, what in REMEDIES.items() if cause in causes]


def print_rows(rows: list[dict[str, Any]]) -> None:
    """Prints the table, its sums, and a remark for each problem."""
    counts, segments = ("bad", "beyond", "too_fast", "jumps"), ("thigh", "shank", "upper_arm", "forearm")
    reach = {"past_range": "past"} if any("past_range" in row for row in rows) else {}
    if any("short_worst" in row for row in rows):
        reach = {"short_rms": "short", "short_worst": "worst"}
    degrees = [f"{name.replace('_', ' ')} deg" for name in (*segments, "trunk")]
    headings = ("recording", "frames", "bad", "beyond", "fast", "jumps", "changed", *reach.values(), *degrees)
    lines = []
    for row in rows:
        if "altered" in row:
            cells = [str(row["frames"]), *(f"{row[name]:.0f}" for name in counts), f"{100.0 * row['altered']:.1f} %"]
            cells += [f"{row[name]:.0f}" if name == "past_range" else f"{1000.0 * row[name]:.1f}" for name in reach]
            cells += [_degrees(row.get("limbs_deg", {}), name) for name in segments]
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


def _degrees(limbs: dict[str, dict[str, float]], segment: str) -> str:
    """Mean and worst angle of a segment, of the side where it is worse: "4/12"."""
    both = [limbs[name] for name in (f"r_{segment}", f"l_{segment}") if name in limbs]
    return f"{max(one['mean'] for one in both):.0f}/{max(one['worst'] for one in both):.0f}" if both else ""


def _slower(tempo: float | None) -> str:
    """A phrase for the fastest tempo at which joints are fast enough."""
    return "no tempo would do" if tempo is None else f"at tempo {tempo:.2f} none is held back"


def _measured(load: RobotLoader, clip: Clip, left_out: int, solver: Solver | None) -> dict[str, Any]:
    file = load.file
    solver = None if file.kind == "mannequin" else solver
    loaded = load(clip.skeleton, solver, 1.0 / clip.rate)
    carried = carry(clip, loaded, SafetyEnvelope)
    measures: dict[str, Any] = joint_measures(clip, loaded, carried) | shortfall(loaded)
    if file.parts:
        directions = LimbDirections(loaded.model, file.parts, np.array(file.root_rotation))
        measures["limbs_deg"] = segments = dict[str, dict[str, Any]]()
        for name, off in segment_angles(loaded, directions, carried, clip.rate).items():
            at = (left_out + off.worst_at) / clip.rate
            segments[name] = {"mean": off.mean, "worst": off.worst, "worst_at_s": at}
            if off.best is not None:
                segments[name] |= {"cause": off.cause, "best_mean": off.best[0], "best_worst": off.best[1]}
        if loaded.has_legs:
            trunk = directions.trunk_errors(carried.qpos, carried.limbs)
            measures["trunk_deg"] = {"mean": float(trunk.mean()), "worst": float(trunk.max())}
        feet = {
            side: loaded.model.body(file.parts[f"{side}_foot"]).id for side in SIDES if f"{side}_foot" in file.parts
        }
        measures |= floor_measures(clip, loaded, carried.qpos, feet)
        if any(off.get("cause") == HELD_BACK for off in segments.values()):
            measures["tempo"] = _fast_enough(load, directions, clip, solver)
    return measures


def _fast_enough(load: RobotLoader, directions: LimbDirections, clip: Clip, solver: Solver | None) -> float | None:
    """The fastest tempo at which limbs point elsewhere only because joints cannot reach, found by carrying; or None."""

    def does(tempo: float) -> bool:
        slow = replace(clip, rate=tempo * clip.rate)
        robot = load(slow.skeleton, solver, 1.0 / slow.rate)
        found = segment_angles(robot, directions, carry(slow, robot, SafetyEnvelope), slow.rate)
        return all(off.cause in (None, OUT_OF_REACH) for off in found.values())

    return fastest_passing(does, 1.0)


def _shortened(clip: Clip, seconds: float | None) -> Clip:
    if seconds is None:
        return clip
    frames = max(2, int(min(seconds * clip.rate, len(clip))))
    return replace(clip, root_position=clip.root_position[:frames], rotation=clip.rotation[:frames])
