"""The robot of a rig alone: a board of dials, or the rig's own model, moved by joint names."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.motion.encodings.joint_angles import JointBody
from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.models.scenery import LABEL
from sim.robots.rig_robot import rig_robot, rows_of

SWING = """<mujoco><worldbody><body name="foot"><geom size=".05"/><body name="arm" pos="0 0 .1">
<joint name="{first}" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 0 0 .3"/>
<body name="hand" pos="0 0 .3"><joint name="roll" axis="0 0 1"/><geom size=".03"/></body></body></body></worldbody>
</mujoco>"""


def robot(tmp_path, joints, model=None, taught=None):
    ones = np.ones(len(joints))
    limits = JointLimits(-ones, ones, ones, ones, ones)
    return rig_robot(tmp_path / "head.toml", joints, limits, model, JointBody.of(taught or joints))


def turned(rig, joint, angle):
    """The world rotation of the body of a joint at an angle, beside that at rest, as a rotation vector, rad."""
    turns = []
    for at in (0.0, angle):
        data, targets = mujoco.MjData(rig.model), np.zeros(len(rig.joints))
        targets[rig.joints.index(joint)] = at
        data.qpos[:] = rig.model.qpos0
        rig.layout.place(targets, data.qpos)
        mujoco.mj_kinematics(rig.model, data)
        turns.append(data.xquat[rig.model.jnt_bodyid[rig.model.joint(joint).id]].copy())
    difference, between = np.zeros(4), np.zeros(3)
    mujoco.mju_negQuat(difference, turns[0])
    mujoco.mju_mulQuat(difference, turns[1], difference)
    mujoco.mju_quat2Vel(between, difference, 1.0)
    return between


def test_a_rig_without_a_model_is_a_board_where_each_pointer_turns_as_its_joint(tmp_path):
    joints = ("pan", "tilt", "eye_left", "eye_right")
    rig = robot(tmp_path, joints)
    assert (rig.name, rig.joints) == ("head", joints)
    for joint in joints:
        assert np.linalg.norm(turned(rig, joint, 0.7)) == pytest.approx(0.7)
    names = {rig.model.site(index).name for index in range(rig.model.nsite)}
    assert names == {LABEL + joint for joint in joints}
    data = mujoco.MjData(rig.model)
    mujoco.mj_kinematics(rig.model, data)
    assert data.geom_xpos[rig.model.geom_bodyid > 0, 2].min() > 0.0


def test_joints_of_the_model_are_moved_by_name_in_the_order_of_the_rig(tmp_path):
    file = tmp_path / "arm.xml"
    file.write_text(SWING.format(first="lift"))
    rig = robot(tmp_path, ("roll", "lift"), "arm.xml")
    assert rig.model.body("foot").pos[2] == pytest.approx(0.05, abs=1e-3)  # the ball stands on the floor
    assert abs(turned(rig, "lift", 0.4)) == pytest.approx([0.0, 0.4, 0.0], abs=1e-6)
    assert abs(turned(rig, "roll", 0.3)) == pytest.approx([0.0, 0.0, 0.3], abs=1e-6)


def test_a_joint_that_the_model_or_the_rig_lacks_is_named(tmp_path):
    file = tmp_path / "arm.xml"
    file.write_text(SWING.format(first="left"))
    with pytest.raises(UnknownNameError, match=r"head.toml: unknown joint of arm.xml 'lift'.*Did you mean left"):
        robot(tmp_path, ("roll", "lift"), "arm.xml")
    with pytest.raises(FileFormatError, match=r"hand\.xml is missing"):
        robot(tmp_path, ("roll",), "hand.xml")
    with pytest.raises(UnknownNameError, match="'grip'"):
        robot(tmp_path, ("pan", "tilt"), taught=("pan", "grip"))


@given(st.lists(st.sampled_from("ab1 _-."), max_size=6).map("".join).filter(bool), st.integers(1, 30))
def test_every_joint_has_one_place_on_the_board(stem, count):
    joints = [f"{stem}{index}" if index % 3 else f"x_{index}" for index in range(count)]
    rows = rows_of(joints)
    assert sorted(name for row in rows for name in row) == sorted(joints)
    assert max(map(len, rows)) <= np.ceil(np.sqrt(count)) + 1


def test_legs_of_three_joints_have_rows_of_their_own():
    legs = [f"leg{leg}_{joint}" for leg in range(6) for joint in ("coxa", "femur", "tibia")]
    assert rows_of(legs) == [tuple(legs[at : at + 3]) for at in range(0, 18, 3)]
