"""Tests of how the root of a robot is made to float."""

import mujoco
import numpy as np
import pytest

from motiondeck_base.errors import FileFormatError
from sim.models.model_file import read_model
from small_robots import SERVOS, humanoid, urdf


def test_joints_in_place_of_a_free_one_give_way_to_it(tmp_path):
    """Files of planar walkers, or with a slide and a hinge for each axis of the base."""
    rails = "".join(
        f'<joint name="base_{kind}{axis}" type="{kind}" axis="{vector}"/>'
        for kind in ("slide", "hinge")
        for axis, vector in zip("xyz", ("1 0 0", "0 1 0", "0 0 1"), strict=True)
    )
    (tmp_path / "robot.xml").write_text(humanoid(free=rails))
    model = read_model(tmp_path / "robot.xml").compile()
    assert model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE
    assert model.njnt == 1 + len(SERVOS)
    # A rail that is driven is no base that floats.
    driven = humanoid(free=rails, extra='<actuator><motor joint="base_slidex"/></actuator>')
    (tmp_path / "robot.xml").write_text(driven)
    with pytest.raises(FileFormatError, match="hangs from the world by joint 'base_slidex'"):
        read_model(tmp_path / "robot.xml")


def test_rails_on_links_of_their_own_give_way_too(tmp_path):
    """A URDF has one joint a link: its planar base is a chain of links that are nothing else."""
    rails, parent = "", "world"
    limit = '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
    for name, kind, axis in (("x", "prismatic", "1 0 0"), ("z", "prismatic", "0 0 1"), ("y", "continuous", "0 1 0")):
        child = "base" if name == "y" else name
        rails += f'<link name="{parent}"/><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        rails += f'<child link="{child}"/><axis xyz="{axis}"/>{limit}</joint>'
        parent = child
    (tmp_path / "legs.urdf").write_text(urdf().replace('<robot name="legs">', f'<robot name="legs">{rails}'))
    model = read_model(tmp_path / "legs.urdf").compile()
    assert model.jnt_type.tolist() == [int(mujoco.mjtJoint.mjJNT_FREE)] + 6 * [int(mujoco.mjtJoint.mjJNT_HINGE)]


def test_what_holds_a_robot_to_the_world_is_left_out(tmp_path):
    """Scenes for teleoperation weld hands to bodies that are moved by hand, and a stand holds a trunk."""
    ties = (
        '<weld body1="left_fore" body2="target"/><connect body1="trunk" anchor="0 0 0"/>'
        '<weld site1="here" site2="there"/><connect body1="left_fore" body2="right_fore" anchor="0 0 0"/>'
    )
    text = humanoid(extra=f"<equality>{ties}</equality>", trunk='<site name="here"/>')
    things = '<body name="target" mocap="true"><geom size="0.1"/></body><site name="there"/><body name="trunk"'
    (tmp_path / "robot.xml").write_text(text.replace('<body name="trunk"', things, 1))
    model = read_model(tmp_path / "robot.xml").compile()
    assert model.nmocap == 0
    assert model.neq == 1
    assert {model.body(int(body)).name for body in (model.eq_obj1id[0], model.eq_obj2id[0])} == {
        "left_fore",
        "right_fore",
    }
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    assert data.qvel[2] == pytest.approx(-9.81 * data.time, rel=0.1)  # nothing holds it
    assert np.isfinite(data.qpos).all()
