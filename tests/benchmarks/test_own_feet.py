"""Knees, heels and pushes of a walk are measured by what a leg does, and humanoids of a seed differ."""

import mujoco
import numpy as np
import pytest

from benchmarks.robots.own_feet_measure import HumanLegs, beside, knee_of
from benchmarks.robots.random_humanoids import random_humanoid
from controller.motion.skeleton import Pose
from simulated_bodies import human

STANDS = np.zeros((400, 2), dtype=bool)
STANDS[:200, 0] = STANDS[200:, 1] = True


def measured(**changes):
    """Right, then left foot stand for a second each; knees of 30 degrees, as the human's, and level soles."""
    rows = {"bend": np.full((400, 2), np.radians(30.0)), "pitch": np.zeros((400, 2)), "load": STANDS.astype(float)}
    rows |= {"work": np.zeros((400, 2)), "human": rows["bend"].copy(), "foot": np.full((400, 2), 0.2), "stands": STANDS}
    return beside(**(rows | changes))


def test_knees_count_while_their_foot_alone_carries_the_body():
    bend = np.where(STANDS, np.radians(50.0), 2.0)
    found = measured(bend=bend)
    assert found["knee"] == pytest.approx(50.0)
    assert found["human_knee"] == pytest.approx(30.0)
    assert found["off"] == pytest.approx(20.0)
    both = measured(bend=bend, load=np.full((400, 2), 0.5))
    assert both["knee"] is None
    assert both["off"] is None


def test_a_heel_is_how_far_a_sole_is_pitched_as_it_leaves_the_floor():
    pitch, foot = np.zeros((400, 2)), np.full((400, 2), 0.2)
    pitch[190:200, 0] = 0.4
    pitch[200:, 0] = 1.0
    foot[199, 0] += 0.5
    found = measured(pitch=pitch, foot=foot)
    assert found["heel"] == pytest.approx(np.degrees(0.4))
    assert found["human_heel"] == pytest.approx(np.degrees(0.5))


def test_only_work_of_a_foot_that_touches_pushes():
    assert measured(work=np.full((400, 2), 1e-4))["push"] == pytest.approx(100.0 * 400 * 1e-4)


def test_the_bend_of_a_humans_knee_is_that_of_its_bones():
    skeleton = human()
    legs, rotation = HumanLegs(skeleton), np.tile((1.0, 0.0, 0.0, 0.0), (1 + len(skeleton), 1))
    legs.add(Pose(np.array([0.0, 0.0, 0.9]), np.zeros(()), rotation))
    before = legs.rows[-1][0]
    shanks = [1 + skeleton.index(name) for name in ("rank", "lank")]
    rotation[shanks] = np.cos(0.3), 0.0, np.sin(0.3), 0.0
    legs.add(Pose(np.array([0.0, 0.0, 0.9]), np.zeros(()), rotation))
    assert np.abs(legs.rows[-1][0] - before) == pytest.approx(0.6, abs=0.05)


@pytest.mark.parametrize("seed", [1, 2])
def test_knees_of_random_humanoids_are_straight_where_they_begin(seed):
    model = mujoco.MjModel.from_xml_string(random_humanoid(seed))
    knee = knee_of(model, 1, int(model.body("left_foot").id))
    assert knee is not None
    assert model.joint(knee[0]).name == "left_knee_pitch"
    assert knee[1] == pytest.approx(0.0, abs=0.02)
    assert random_humanoid(seed) == random_humanoid(seed) != random_humanoid(seed + 1)
