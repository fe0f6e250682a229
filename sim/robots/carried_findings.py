"""Findings about how a robot's limbs and trunk point beside a human's, for any motion that was carried onto it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from sim.robots.fidelity import Carried
from sim.robots.limb_causes import Cause, limb_causes
from sim.robots.limb_directions import MEAN_LIMIT, WORST_LIMIT, LimbDirections
from sim.robots.robot import Robot
from sim.robots.verdict import LEGS_LEFT_OUT, Finding, limited

REACH_LIMIT = 25.0  # largest mean angle of a limb that its joints cannot reach, degrees
TRUNK_MEAN, TRUNK_WORST = 8.0, 20.0  # largest angles of the trunk, degrees


@dataclass(frozen=True)
class SegmentAngle:
    """How far a segment of a robot's limb points from the human's."""

    mean: float  # degrees
    worst: float
    worst_at: int  # frame
    cause: Cause | None = None  # None within the limits
    best: tuple[float, float] | None = None  # mean and worst at the best joint angles; None within the limits


def segment_angles(robot: Robot, directions: LimbDirections, carried: Carried, rate: float) -> dict[str, SegmentAngle]:
    """Those of all segments ("l_forearm") of a motion at a rate, Hz."""
    degrees = directions.degrees(carried.qpos, carried.limbs)
    found = {
        segment.name: SegmentAngle(float(off.mean()), float(off.max()), int(off.argmax()))
        for segment, off in zip(directions.segments, degrees.T, strict=True)
    }
    goals = directions.goals(carried.limbs, carried.qpos)
    for cause, best in limb_causes(robot, directions, carried.wanted, carried.played, goals, rate):
        found |= {name: replace(found[name], cause=cause, best=angles) for name, angles in best.items()}
    return found


def carried_findings(
    robot: Robot, directions: LimbDirections, carried: Carried, angles: Mapping[str, SegmentAngle]
) -> list[Finding]:
    """The findings, the worst of each check, of a motion with these angles of its segments."""
    found = limb_findings(angles)
    trunk = directions.trunk_errors(carried.qpos, carried.limbs)
    leaning = float(trunk.mean()), float(np.max(trunk))
    if not robot.has_legs:  # it leans with its waist alone
        return [*found, Finding(LEGS_LEFT_OUT, leaning[0], None, "deg of lean")]
    return [*found, _angle("trunk leans elsewhere", leaning, (TRUNK_MEAN, TRUNK_WORST), "")]


def joint_findings(counts: Mapping[str, float]) -> list[Finding]:
    """Those of the joints, from the counts of `joint_measures`."""
    return [
        limited("out of reach", counts["beyond"], 0.0, "targets"),
        Finding("speed", 100.0 * counts["speed"], 100.0, "%", ok=not counts["too_fast"]),
        limited("jumps", counts["jumps"], 0.0, "times"),
        limited("broken", counts["bad"], 0.0, "", "NaN or infinite" * bool(counts["bad"])),
    ]


def limb_findings(angles: Mapping[str, SegmentAngle]) -> list[Finding]:
    """Those of limbs alone."""
    worst: dict[str, Finding] = {}
    for name, off in angles.items():
        found = _angle("carried wrongly", (off.mean, off.worst), (MEAN_LIMIT, WORST_LIMIT), name)
        if not found.ok and off.cause == "out of reach":
            found = limited("out of reach", off.mean, REACH_LIMIT, "deg", name)
        elif not found.ok and off.cause is not None:
            found = msgspec.structs.replace(found, check=off.cause)
        if found.check not in worst or _share(found) > _share(worst[found.check]):
            worst[found.check] = found
    return [*worst.values()]


def _angle(check: str, angles: tuple[float, float], limits: tuple[float, float], where: str) -> Finding:
    """A mean and a worst angle, degrees, by the one that is nearer to its limit."""
    (mean, worst), (mean_limit, worst_limit) = angles, limits
    value, limit = (mean, mean_limit) if mean / mean_limit >= worst / worst_limit else (worst, worst_limit)
    return limited(check, value, limit, "deg", where)


def _share(finding: Finding) -> float:
    return finding.value / (finding.limit or 1.0)
