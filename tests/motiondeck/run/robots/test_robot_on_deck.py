"""A robot as it is opened for the deck."""

from contextlib import ExitStack
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from motiondeck.run.robots import robot_on_deck
from motiondeck.run.robots.robot_on_deck import RobotOnDeck, Simulation
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.shipped import find_robot
from sim.models.robot_file import read_robot_file
from sim.robots.joint_groups import joint_groups
from sim.robots.robot import load_robot
from simulated_bodies import bent_pose, human


def test_limbs_are_kept_apart_within_the_limits_of_the_rig(monkeypatch):
    def open_rig(opening, guard, file, robot, rate, *, emulated):
        upper, velocity = robot.rest + 0.2, np.full(len(robot.rest), 0.5)
        rig = SimpleNamespace(output=SimpleNamespace(close=lambda: None))
        return rig, replace(robot.limits, lower=robot.rest - 0.2, upper=upper, velocity=velocity)

    monkeypatch.setattr("motiondeck.run.robots.rig_output.open_rig", open_rig)
    skeleton, rate = human(), 100.0
    spec = RunSpec(robot="servo20", rig="servo20", physics=False, check_collisions=True, rate=rate)
    library: Any = SimpleNamespace(skeleton=skeleton)
    with ExitStack() as opening:
        opened = robot_on_deck.open_robot(opening, spec, library)
        bent = bent_pose(skeleton, rkne=(0.0, -1.0, 0.0), relb=(0.0, 0.0, 1.0))
        targets = [opened.retarget(pose).copy() for pose in (bent_pose(skeleton), *[bent] * 20)]
    assert np.ptp(targets, axis=0).max() > 0.02
    assert (np.abs(np.diff(targets, axis=0)) <= 0.5 / rate + 1e-9).all()
    assert (np.abs(targets - opened.rest) <= 0.2 + 1e-9).all()


def test_a_robot_that_walks_has_layers_on_arms_and_head_alone_and_one_that_only_stands_has_none():
    skeleton, file = human(), find_robot("mannequin")
    stage: Any = SimpleNamespace()
    robot = load_robot(file, skeleton)
    groups = joint_groups(robot, read_robot_file(file), skeleton)

    def refused(root, *, walk):
        simulation = Simulation(robot, stage, root, balance=False, walk=walk)
        own = robot.joints, robot.limits, None, robot.retarget, None, simulation
        return {*RobotOnDeck("mannequin", *own, groups=groups).without_layers}

    assert refused("free", walk=True) == {*groups["legs"], *groups["trunk"]}
    assert {*groups["arms"], *groups["head"]} == {*robot.joints} - refused("free", walk=True)
    assert refused("free", walk=False) == {*robot.joints}
    assert not refused("gantry", walk=False)
