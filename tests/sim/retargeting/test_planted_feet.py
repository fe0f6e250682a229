"""Tests of planted feet: what stands keeps its distance and its direction, and what steps goes its way."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_inverse_kinematics import DT, UP, solver_of, standing

from controller.motion.skeleton import Pose
from sim.models.model_file import read_model
from sim.retargeting.human_limbs import LIMBS
from sim.retargeting.inverse_kinematics import LimbSolver
from sim.retargeting.limb_finder import FEET
from sim.retargeting.planted_feet import PlantedFeet
from sim.retargeting.robot_limbs import RobotLimbs
from sim.robots.body_matching import match
from small_robots import SERVOS, humanoid

UPRIGHT = Pose(np.zeros(3), np.zeros(()), np.array([[1.0, 0.0, 0.0, 0.0]]))


@pytest.fixture(scope="module")
def limbs(tmp_path_factory):
    path = tmp_path_factory.mktemp("planted") / "small.xml"
    path.write_text(humanoid())
    model = read_model(path).compile()
    found = match(path, model)
    return RobotLimbs(path, model, found.parts, found.root_rotation, tuple(SERVOS))


def straddling(angle):
    """Limbs of a body whose legs are spread by an angle, rad, on either side."""
    directions = standing()
    for side, left in (("r", -1.0), ("l", 1.0)):
        rows = [LIMBS.index(f"{side}_{part}") for part in ("thigh", "shank")]
        directions[rows] = [0.0, left * np.sin(angle), -np.cos(angle)]
    return directions


def planted_feet(limbs, standing, planted=None, rolled=(0.5, 0.5), heights=(0, 0)):
    """Planted feet, and the stance of the human that they look at, which a test changes from tick to tick."""
    stance: Any = SimpleNamespace(
        begun=True, standing=standing, planted=planted or standing, rolled=rolled, heights=heights, leg=1.0
    )
    return PlantedFeet(stance, limbs, 0.5, DT), stance


def spread(limbs, standing, planted=None):
    """How far the soles are apart (T,), m, while the human spreads its legs with feet that stand so much."""
    solver: LimbSolver = solver_of(limbs)[0]
    feet, stance = planted_feet(limbs, standing, planted)
    apart, q = [], solver.q
    for k in range(80):
        stance.begun = k == 0
        feet(UPRIGHT, solver.q, np.eye(3))
        q = solver(straddling(0.1 * min(max(k - 30, 0) / 40.0, 1.0)), UP, feet)
        limbs.place(q)
        apart.append(np.linalg.norm(limbs.feet_apart()[:2]))
    return np.array(apart), q


def test_feet_that_stand_keep_their_distance_where_legs_would_spread_them(limbs):
    held, free = spread(limbs, [1.0, 1.0])[0], spread(limbs, [1.0, 0.0])[0]
    assert np.ptp(free[30:]) > 0.03
    assert np.ptp(held[30:]) < 0.25 * np.ptp(free[30:])


def test_a_foot_that_steps_goes_as_without_them(limbs):
    apart, q = spread(limbs, [1.0, 0.0])
    solver = solver_of(limbs)[0]
    alone = solver.q
    for _ in range(80):
        alone = solver(straddling(0.1), UP)
    limbs.place(alone)
    assert apart[-1] == pytest.approx(np.linalg.norm(limbs.feet_apart()[:2]), abs=0.01)
    assert q == pytest.approx(alone, abs=0.15)


def test_a_sole_that_rolls_from_heel_to_ball_stays_where_it_is(limbs):
    """The vector between the feet changes its ends, and what is held goes along with them."""
    solver = solver_of(limbs)[0]
    (feet, stance), places = planted_feet(limbs, [1.0, 1.0], rolled=[0.0, 0.0]), []
    for k in range(60):
        stance.begun, stance.rolled = k == 0, [min(k / 40.0, 1.0), 0.0]
        feet(UPRIGHT, solver.q, np.eye(3))
        q = solver(straddling(0.05), UP, feet)
        limbs.place(q)
        ankles = [limbs.data.xpos[limbs.vectors.body[end, -1]] for end in (0, 1)]
        places.append(ankles[1] - ankles[0])
    assert np.ptp(np.array(places)[10:], axis=0).max() < 0.004


def test_a_sole_turns_slowly_to_where_the_leg_points_when_it_is_let_go(limbs):
    """Let go at once, it would turn while it still touches the floor."""
    solver = solver_of(limbs)[0]
    (feet, stance), shares = planted_feet(limbs, [1.0, 1.0], rolled=[1.0, 1.0]), []
    for k in range(60):
        stance.begun, stance.planted = k == 0, [1.0, 1.0 if k < 30 else 0.0]
        feet(UPRIGHT, solver.q, np.eye(3))
        shares.append(feet.turned.copy())
    right, left = np.array(shares).T
    assert left[29] > 0.99
    assert left[30 + round(0.05 / DT)] > 0.7
    assert right[-1] > 0.99


@pytest.mark.parametrize(("lifted", "bends"), [(0.1, True), (0.4, False)])
def test_only_for_a_foot_near_the_floor_the_leg_that_stands_bends(limbs, lifted, bends):
    """The human's right foot is higher than that of a robot whose limbs point as the human's do."""
    solver = solver_of(limbs)[0]
    (feet, stance), stands = planted_feet(limbs, [0.0, 1.0], heights=[lifted, 0.0]), standing()
    for side in "rl":
        for part, ahead in (("thigh", 0.3), ("shank", -0.3)):
            stands[LIMBS.index(f"{side}_{part}")] = [np.sin(ahead), 0.0, -np.cos(ahead)]
    for k in range(80):
        stance.begun = k == 0
        feet(UPRIGHT, solver.q, np.eye(3))
        q = solver(stands, UP, feet)
    assert (abs(q[SERVOS.index("left_knee")] - 0.6) > 0.03) == bends


def test_the_vector_between_the_feet_is_no_limb(limbs):
    solver = solver_of(limbs)[0]
    solver(standing(), UP)
    assert FEET in solver.names
    assert FEET not in solver.shortfall()
