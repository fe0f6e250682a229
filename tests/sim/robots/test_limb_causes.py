"""Tests of the best that a limb can do within its joints' ranges, and of why limbs point elsewhere."""

import numpy as np
import pytest

from sim.retargeting.human_limbs import LIMBS
from sim.robots.calibrate import standing_human
from sim.robots.limb_causes import ReachableLimb, limb_causes
from sim.robots.limb_directions import LimbDirections, degrees_between
from sim.robots.robot import load_robot
from simulated_bodies import human
from small_robots import SERVOS, calibrated, humanoid

LID = '<body name="lid" pos="0 0 0.3"><joint name="lid" axis="0 1 0"/><geom size="0.02"/></body>'
# The right elbow follows the left knee: what bends them together is no closed form.
FOLLOWS = '<equality><joint joint1="right_elbow" joint2="right_arm_pitch" polycoef="0.1 -0.5 0 0 0"/></equality>'


def loaded(folder, extra=""):
    (folder / "small.xml").write_text(humanoid(extra=extra))
    calibration = calibrated(folder / "small.xml")
    (folder / "small.toml").write_text(calibration.to_toml(folder))
    robot = load_robot(folder / "small.toml", human(), "ik")
    return robot, LimbDirections(robot.model, calibration.parts, calibration.root_rotation)


def random_poses(robot, count, seed=4):
    random = np.random.default_rng(seed)
    lower, upper = robot.limits.lower, robot.limits.upper
    return lower + random.uniform(0.05, 0.95, (count, len(lower))) * (upper - lower)


def pointing(robot, directions, joints):
    qpos, found = robot.model.qpos0.copy(), []
    for q in joints:
        robot.layout.place(q, qpos)
        found.append(directions(qpos))
    return np.array(found)


@pytest.mark.thorough
@pytest.mark.parametrize("extra", ["", FOLLOWS], ids=["free", "a joint that follows"])
def test_what_the_robot_itself_does_is_in_reach(tmp_path, extra):
    robot, directions = loaded(tmp_path, extra)
    goals = pointing(robot, directions, random_poses(robot, 12))
    for limb in directions.limbs:
        rows = [directions.segments.index(segment) for segment in limb]
        best = ReachableLimb(robot, directions, limb).best(goals[:, rows])
        assert degrees_between(best, goals[:, rows]).max() < 1.5


def test_what_is_found_is_within_reach_and_no_grid_of_angles_is_better(tmp_path):
    """Of an arm of two servos and an elbow, for directions that it cannot take."""
    robot, directions = loaded(tmp_path)
    random = np.random.default_rng(1)
    (limb,) = (limb for limb in directions.limbs if limb[0].name == "r_upper_arm")
    rows = [directions.segments.index(segment) for segment in limb]
    goals = random.normal(size=(20, 2, 3))
    goals /= np.linalg.norm(goals, axis=2)[:, :, None]
    best = ReachableLimb(robot, directions, limb).best(goals)
    own = [robot.joints.index(f"right_{name}") for name in ("arm_pitch", "arm_roll", "elbow")]
    grid = np.stack(
        np.meshgrid(*(np.linspace(robot.limits.lower[j], robot.limits.upper[j], 14) for j in own)), axis=-1
    ).reshape(-1, 3)
    joints = np.tile(robot.rest, (len(grid), 1))
    joints[:, own] = grid
    tried = pointing(robot, directions, joints)[:, rows]
    alike = np.einsum("tsi,gsi->tg", goals, tried).max(axis=1)
    found = np.einsum("tsi,tsi->t", best, goals)
    assert (found >= alike - 1e-3).all()
    assert (found <= alike + 0.15).all()  # a grid as fine as this comes close to the best
    assert found.min() < 1.5


def seen(directions, limbs):
    return limbs[:, [LIMBS.index(segment.name) for segment in directions.segments]]


def test_a_limb_is_out_of_reach_held_back_or_carried_wrongly(tmp_path):
    robot, directions = loaded(tmp_path)
    right = np.tile(random_poses(robot, 1), (9, 1))
    own, limbs = pointing(robot, directions, right), np.zeros((9, len(LIMBS), 3))
    for k, segment in enumerate(directions.segments):
        limbs[:, LIMBS.index(segment.name)] = own[:, k]
    assert limb_causes(robot, directions, right, right, seen(directions, limbs), 30.0) == []
    wrong = right.copy()
    elbow = SERVOS.index("right_elbow")
    wrong[:, elbow] += (
        -1.2 if wrong[0, elbow] > np.mean([robot.limits.lower[elbow], robot.limits.upper[elbow]]) else 1.2
    )
    ((held, best),) = limb_causes(robot, directions, right, wrong, seen(directions, limbs), 30.0)
    assert held == "held back"
    assert best["r_forearm"][1] < 1.5
    ((carried, _),) = limb_causes(robot, directions, wrong, wrong, seen(directions, limbs), 30.0)
    assert carried == "carried wrongly"
    # A knee that bends forwards is out of reach: halfway there with a straight leg is the best.
    limbs[:, LIMBS.index("l_thigh")], limbs[:, LIMBS.index("l_shank")] = [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]
    halfway = right.copy()
    halfway[:, [SERVOS.index(f"left_{name}") for name in ("hip_yaw", "hip_roll", "hip_pitch", "knee")]] = [
        0,
        0,
        -0.785,
        0,
    ]
    ((cannot, best),) = limb_causes(robot, directions, halfway, halfway, seen(directions, limbs), 30.0)
    assert cannot == "out of reach"
    assert best["l_shank"][0] > 30.0
    # Next to so much, a little more is no mistake of the retargeter.
    for more, cause in ((0.25, "out of reach"), (0.9, "carried wrongly")):
        halfway[:, SERVOS.index("left_knee")] = more
        assert limb_causes(robot, directions, halfway, halfway, seen(directions, limbs), 30.0)[0][0] == cause


def test_an_arm_of_three_joints_shares_what_it_cannot_reach(tmp_path):
    """Fists before the chin: an arm on the wrong side of shoulder and hand would have its hand there too."""
    robot, directions = loaded(tmp_path)
    solver = robot.retarget.solver
    for inwards in (0.4, 0.7, 1.0):
        goals = standing_human()
        for side, left in (("r", -1.0), ("l", 1.0)):
            for part, way in (("upper_arm", (0.4, 0.3 * left, -0.9)), ("forearm", (0.5, -inwards * left, 0.7))):
                goals[LIMBS.index(f"{side}_{part}")] = way / np.linalg.norm(way)
        solver.reset()
        there = pointing(robot, directions, [solver(goals, np.array([0.0, 0.0, 1.0]))])
        wanted = seen(directions, goals[None])
        for limb in directions.limbs:
            rows = [directions.segments.index(segment) for segment in limb]
            best = ReachableLimb(robot, directions, limb).best(wanted[:, rows])
            short = degrees_between(there[:, rows], wanted[:, rows]) - degrees_between(best, wanted[:, rows])
            assert short.mean() < 5.0
