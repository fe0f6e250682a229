"""Hands of robots whose wrists can turn: they point as the human's, and leave the arm as it is."""

import mujoco
import numpy as np
import pytest

from controller.motion.rotations import rotate
from sim.robots.robot import RobotLoader
from simulated_bodies import bent_pose, human
from small_robots import calibrated, full_humanoid


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hands")

    def of(**kind):
        path = folder / f"{'_'.join(map(str, kind.values()))}.xml"
        path.write_text(full_humanoid(**kind))
        path.with_suffix(".toml").write_text(calibrated(path).to_toml(folder))
        return RobotLoader(path.with_suffix(".toml"))

    return of


def settled(load, pose):
    """The robot's state when it has settled in a pose."""
    robot = load(human(), None, 0.01)
    data = mujoco.MjData(robot.model)
    for _ in range(100):
        robot.place(robot.retarget(pose), pose, data.qpos)
    mujoco.mj_kinematics(robot.model, data)
    return robot, data


def off(robot, data, pose, side):
    """Degrees between the hand of the robot, which hangs in its model, and the human's."""
    bone = human().bones.index(f"{side[0]}han")
    last = max(b for b in range(robot.model.nbody) if robot.model.body(b).name.startswith(f"{side}_wrist"))
    there = data.xmat[last].reshape(3, 3) @ [0.0, 0.0, -1.0]
    return np.degrees(np.arccos(there @ rotate(pose.rotation[1 + bone], human().rest_direction[bone])))


@pytest.mark.parametrize(
    "kind", [{"wrist": "yaw pitch roll", "fingers": False}, {"wrist": "pitch roll", "fingers": True}]
)
def test_hands_point_as_the_humans_and_arms_stay_as_they_are(load, kind):
    loader, straight = load(**kind), bent_pose(human())
    bent = bent_pose(human(), rhan=(0, 0.7, 0.5), lhan=(0.2, -0.6, 0.3))
    robot, data = settled(loader, bent)
    assert max(off(robot, data, bent, side) for side in ("right", "left")) < 8.0
    own = [index for index, name in enumerate(robot.joints) if "wrist" not in name]
    assert robot.retarget(bent)[own] == pytest.approx(settled(loader, straight)[0].retarget(straight)[own], abs=1e-6)
