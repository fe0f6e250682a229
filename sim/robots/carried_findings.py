"""Findings about how a robot's limbs and trunk point beside a human's, for any motion that was carried onto it."""

from collections.abc import Mapping

import numpy as np

from controller.motion.rotations import Array
from sim.retargeting.footing import FixedBase
from sim.robots.limb_causes import limb_causes
from sim.robots.limb_directions import MEAN_LIMIT, WORST_LIMIT, LimbDirections
from sim.robots.robot import Robot
from sim.robots.verdict import LEGS_LEFT_OUT, Finding

REACH_LIMIT = 25.0  # largest mean angle of a limb that its joints cannot reach, degrees
TRUNK_MEAN, TRUNK_WORST = 8.0, 20.0  # largest angles of the trunk, degrees


def carried_findings(
    robot: Robot, directions: LimbDirections, limbs: Array, wanted: Array, played: Array, qpos: Array, rate: float
) -> list[Finding]:
    """The findings, the worst of each check, for T frames at a rate, Hz.

    `limbs` are the human's (T, 16, 3), as of `human_lines`; `wanted` and `played` retargeted and played joints (T, J),
    rad, and `qpos` (T, nq) the robot that plays them.
    """
    degrees, trunk = directions.degrees(qpos, limbs), directions.trunk_errors(qpos, limbs)
    goals = directions.goals(limbs, qpos)
    causes = {
        name: limb.cause for limb in limb_causes(robot, directions, wanted, played, goals, rate) for name in limb.best
    }
    names = [segment.name for segment in directions.segments]
    off = dict(zip(names, degrees.T, strict=True))
    found = limb_findings({name: (float(one.mean()), float(one.max())) for name, one in off.items()}, causes)
    leaning = float(trunk.mean()), float(np.max(trunk))
    if isinstance(robot.footing, FixedBase):  # it leans with its waist alone
        return [*found, Finding(LEGS_LEFT_OUT, leaning[0], None, "deg of lean")]
    return [*found, _angle("trunk leans elsewhere", leaning, (TRUNK_MEAN, TRUNK_WORST), "")]


def limb_findings(off: Mapping[str, tuple[float, float]], causes: Mapping[str, str]) -> list[Finding]:
    """Those of limbs alone, from the mean and worst angle of each segment, degrees, and the cause of a limb's."""
    worst: dict[str, Finding] = {}
    for name, angles in off.items():
        found = _angle("carried wrongly", angles, (MEAN_LIMIT, WORST_LIMIT), name)
        if not found.ok and causes.get(name, found.check) == "out of reach":
            found = Finding("out of reach", angles[0], REACH_LIMIT, "deg", name, ok=angles[0] <= REACH_LIMIT)
        elif not found.ok:
            found = _angle(causes.get(name, found.check), angles, (MEAN_LIMIT, WORST_LIMIT), name)
        if found.check not in worst or _share(found) > _share(worst[found.check]):
            worst[found.check] = found
    return [*worst.values()]


def _angle(check: str, angles: tuple[float, float], limits: tuple[float, float], where: str) -> Finding:
    """A mean and a worst angle, degrees, by the one that is nearer to its limit."""
    (mean, worst), (mean_limit, worst_limit) = angles, limits
    value, limit = (mean, mean_limit) if mean / mean_limit >= worst / worst_limit else (worst, worst_limit)
    return Finding(check, value, limit, "deg", where, ok=value <= limit)


def _share(finding: Finding) -> float:
    return finding.value / (finding.limit or 1.0)
