"""Groups of joints that layers play on: found on humanoids, or named in a file."""

import msgspec
import mujoco
import numpy as np
import pytest

from motiondeck_base.errors import UnknownNameError
from motiondeck_base.shipped import find_robot
from sim.models.robot_file import read_robot_file
from sim.robots.joint_groups import gaze_gains, joint_groups
from sim.robots.robot import load_robot
from simulated_bodies import human


@pytest.fixture(scope="module", params=["mannequin", "servo20"])
def robot(request):
    file = find_robot(request.param)
    return load_robot(file, human()), read_robot_file(file)


def places(loaded, targets):
    data = mujoco.MjData(loaded.model)
    loaded.layout.place(targets, data.qpos)
    mujoco.mj_kinematics(loaded.model, data)
    return np.hstack([data.xpos, data.xquat])


def moved(loaded, joints):
    """The bodies that move when these joints do."""
    targets = loaded.rest + 0.2 * np.isin(loaded.joints, joints)
    change = np.abs(places(loaded, targets) - places(loaded, loaded.rest)).max(1)
    return {*np.flatnonzero(change > 1e-6).tolist()}


def test_arms_legs_and_head_of_a_humanoid_are_found_and_share_no_joint(robot):
    groups = joint_groups(*robot, human())
    parts = [groups[name] for name in ("arms", "legs", "head")]
    assert all(parts)
    assert len({joint for part in parts for joint in part}) == sum(map(len, parts))
    arms, legs, head = (moved(robot[0], part) for part in parts)
    assert not arms & legs
    assert not head & (arms | legs)
    heights = places(robot[0], robot[0].rest)[:, 2]
    assert int(heights[1:].argmax()) + 1 in head
    assert int(heights[1:].argmin()) + 1 in legs
    if "r_arm" in groups:
        assert {*groups["r_arm"], *groups["l_arm"]} == {*groups["arms"]}
        assert {joint[0] for joint in groups["r_arm"]} == {"r"}


def test_a_head_is_turned_by_the_angle_of_its_gaze(robot):
    loaded, _ = robot
    gains = gaze_gains(loaded, joint_groups(*robot, human()))
    outermost = max(moved(loaded, list(gains)))
    for left, up in ((0.3, 0.0), (0.0, 0.25)):
        turned = [left * gains.get(joint, (0, 0))[0] + up * gains.get(joint, (0, 0))[1] for joint in loaded.joints]
        looks = []
        for targets in (np.zeros(len(turned)), np.array(turned)):
            data = mujoco.MjData(loaded.model)
            loaded.layout.place(targets, data.qpos)
            mujoco.mj_kinematics(loaded.model, data)
            looks.append(data.xmat[outermost].reshape(3, 3))
        x, y, z = (looks[1] @ looks[0].T)[:, 0]  # where what was ahead is now
        assert (np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))) == pytest.approx((left, up), abs=1e-3)


def test_groups_of_the_file_are_kept_and_their_joints_checked(robot):
    loaded, file = robot
    two = loaded.joints[:2]
    named = msgspec.structs.replace(file, groups={"mine": two, "head": two})
    groups = joint_groups(loaded, named, human())
    assert (groups["mine"], groups["head"]) == (two, two)
    with pytest.raises(UnknownNameError, match=r"groups.mine: unknown joint 'neckk'"):
        joint_groups(loaded, msgspec.structs.replace(file, groups={"mine": ("neckk",)}), human())
