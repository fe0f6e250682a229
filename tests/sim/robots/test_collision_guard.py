"""The collision guard: whatever is asked of the joints, no limb is sent into another."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.skeleton import Pose
from sim.models.overlaps import OVERLAP
from sim.robots.robot import load_robot
from sim.robots.self_collision import CollisionGuard, SelfCollision
from simulated_bodies import ROBOTS, human
from small_robots import calibrated, humanoid

DT = 0.01
POSE = Pose(np.zeros(3), np.array(0.0), np.tile([1.0, 0.0, 0.0, 0.0], (17, 1)))


def robot_file(folder):
    """A robot file that the calibration has written for a model it did not know."""
    (folder / "small.xml").write_text(humanoid())
    (folder / "small.toml").write_text(calibrated(folder / "small.xml").to_toml(folder))
    return folder / "small.toml"


@pytest.fixture(scope="module", params=["servo20", "mannequin", "calibrated"])
def robot(request, tmp_path_factory):
    if request.param == "calibrated":
        return load_robot(robot_file(tmp_path_factory.mktemp("small")), human())
    return load_robot(ROBOTS / f"{request.param}.toml", human())


def guarded(robot):
    """A guard, and a list whose last entry is what is asked of the joints."""
    asked = [robot.rest]
    return CollisionGuard(replace(robot, retarget=lambda pose: asked[-1]), DT), asked


def played(guard, ticks):
    """The targets after a number of ticks."""
    return [guard(POSE) for _ in range(ticks)][-1]


def depth_at(robot, collisions, targets):
    qpos = robot.model.qpos0.copy()
    robot.layout.place(targets, qpos)
    return collisions(qpos)[0]


def colliding(robot, collisions, seed=0):
    """Targets within the limits in which the robot runs into itself."""
    rng, limits = np.random.default_rng(seed), robot.limits
    for _ in range(1000):
        targets = robot.rest + rng.uniform(0.2, 1.0) * (rng.uniform(limits.lower, limits.upper) - robot.rest)
        if depth_at(robot, collisions, targets) > 3.0 * OVERLAP:
            return targets
    raise AssertionError("it never does")


def test_what_does_not_collide_passes(robot):
    guard, asked = guarded(robot)
    toward = np.clip(robot.rest + 0.05, robot.limits.lower, robot.limits.upper)
    for k in range(1, 20):
        asked.append(robot.rest + 0.01 * k * (toward - robot.rest))
        assert np.array_equal(guard(POSE), asked[-1])
    assert not guard.kept_apart


def test_limbs_are_kept_apart_and_counted_and_come_free_again(robot):
    guard, asked = guarded(robot)
    collisions = SelfCollision(robot)
    bad = colliding(robot, collisions)
    asked.append(bad)
    for _ in range(400):
        targets = guard(POSE)
        assert depth_at(robot, collisions, targets) <= OVERLAP
    assert sum(guard.kept_apart.values()) > 0
    assert all(" and " in pair for pair in guard.kept_apart)
    asked.append(robot.rest)
    assert played(guard, 400) == pytest.approx(robot.rest)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**31), st.lists(st.integers(1, 30), min_size=1, max_size=4))
def test_whatever_is_asked_targets_are_apart_finite_and_no_faster_than_allowed(robot, seed, spells):
    guard, asked = guarded(robot)
    collisions, rng = SelfCollision(robot), np.random.default_rng(seed)
    before = guard(POSE)
    for spell in spells:
        asked.append(rng.uniform(robot.limits.lower - 1.0, robot.limits.upper + 1.0))
        asked[-1][rng.random(len(robot.rest)) < 0.05] = np.nan
        for _ in range(spell):
            targets = guard(POSE)
            assert depth_at(robot, collisions, targets) <= OVERLAP
            assert (np.abs(targets - before) <= robot.limits.velocity * DT + 1e-12).all()
            before = targets


def test_other_limbs_go_on_while_two_are_held():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    guard, asked = guarded(robot)
    joint = {name: index for index, name in enumerate(robot.joints)}
    legs = [joint["r_hip_roll"], joint["l_hip_roll"]]
    crossed = [robot.rest.copy(), robot.rest.copy()]
    crossed[0][legs] = robot.limits.lower[legs[0]], robot.limits.upper[legs[1]]
    crossed[1][legs] = robot.limits.upper[legs[0]], robot.limits.lower[legs[1]]
    collisions = SelfCollision(robot)
    asked.append(max(crossed, key=lambda targets: depth_at(robot, collisions, targets)))
    held = played(guard, 300)
    assert guard.kept_apart
    assert np.abs(held[legs] - asked[-1][legs]).max() > 0.1
    asked.append(asked[-1].copy())
    asked[-1][joint["head_pan"]] += 0.3
    targets = played(guard, 300)
    assert np.array_equal(targets[legs], held[legs])
    assert targets[joint["head_pan"]] == pytest.approx(asked[-1][joint["head_pan"]])
