"""Sampling planners of others in place of the physical stage's search: judo (pip install --no-deps judo-rai).

Judo 0.1 (RAI Institute, MIT licence) is written after MuJoCo MPC, which has no wheels: predictive sampling, MPPI and
the cross-entropy method, which plan nodes of a linear spline over the horizon. They plan here what the search plans,
offsets of the same targets over the same horizon, for its costs per knot and with its rollouts, so that only the
planners differ. Their settings are judo's own but for the numbers below.
"""

# pyright: reportMissingImports=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# (judo need not be installed.)

from __future__ import annotations

from typing import Any

import numpy as np

from controller.motion.rotations import Array
from sim.physical.course import Batch, CarriedCourse, played
from sim.physical.search import MOVES, Search

ROLLOUTS, NODES = 64, 8  # a move, which cost about what the search's do; and nodes over 0.56 s
SIGMA = 0.03  # of samples, rad


def planner_of(name: str, joints: int) -> Any:
    """Judo's planner "ps", "mppi" or "cem" for offsets of so many joints."""
    from judo.optimizers import cem, mppi, ps

    if name == "ps":
        return ps.PredictiveSampling(ps.PredictiveSamplingConfig(ROLLOUTS, NODES, sigma=SIGMA), joints)
    if name == "mppi":
        return mppi.MPPI(mppi.MPPIConfig(ROLLOUTS, NODES, sigma=SIGMA), joints)
    settings = cem.CrossEntropyMethodConfig(ROLLOUTS, NODES, sigma_min=SIGMA, sigma_max=2.0 * SIGMA, num_elites=8)
    return cem.CrossEntropyMethod(settings, joints)


class SampledSearch(Search):
    """Improves the offsets of a course by a planner of judo."""

    def __init__(self, planner: str, batch: Batch, course: CarriedCourse) -> None:
        super().__init__(batch, course)
        self._optimizer = planner_of(planner, course.targets.shape[1])

    def improve(self, state: Array, now: int, ahead: int) -> None:
        """As `Search.improve`: one plan of the sampled offsets."""
        last = min(now + ahead, len(self._course.states) - 1)
        nodes = np.linspace(now, last - 1, NODES)
        share = np.maximum(1.0 - np.abs(np.arange(now, last)[:, None] - nodes) / max(nodes[1] - nodes[0], 1e-9), 0.0)
        share /= share.sum(axis=1, keepdims=True)
        nominal = np.array([np.interp(nodes, np.arange(now, last), plan) for plan in self.offsets[now:last].T]).T
        sampled = self._optimizer.sample_control_knots(nominal)
        tries = share @ sampled
        costs = self._costs(played(self._batch, self._course, state, now, tries), tries, now)
        costs = np.minimum(costs, 1e9) / (last - now)
        self.offsets[now:last] = share @ self._optimizer.update_nominal_knots(sampled, -costs)
        self.offsets[last : last + MOVES] = self.offsets[last - 1]
