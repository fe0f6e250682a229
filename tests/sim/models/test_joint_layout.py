import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.motion.rotations import from_rotation_vector, normalise, to_rotation_vector
from motiondeck_base.errors import FileFormatError
from sim.models.joint_layout import JointLayout, nearest_turn
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human

ROBOT = """
<mujoco model="tiny"><worldbody><body name="root">{free}<geom size="0.1"/>
  <body name="arm"><joint name="arm" {joint}/><geom size="0.1"/></body>
</body></worldbody><actuator>{servo}</actuator></mujoco>
"""


def tiny(free="<freejoint/>", joint='type="hinge"', servo='<position name="arm" joint="arm"/>'):
    return mujoco.MjModel.from_xml_string(ROBOT.format(free=free, joint=joint, servo=servo))


@pytest.fixture(scope="module")
def model():
    return build_mannequin(human()).compile()


@given(st.integers(0, 2**32 - 1))
def test_what_is_placed_is_read_back(model, seed):
    layout = JointLayout.of(model)
    random = np.random.default_rng(seed)
    # Up to three quarters of a turn: past the half turn the short way round would read otherwise.
    axes = normalise(random.normal(size=(19, 3)))
    targets = (axes * random.uniform(0.0, 1.5 * np.pi, (19, 1))).ravel()
    qpos, read = np.zeros(model.nq), np.empty_like(targets)
    layout.place(targets, qpos)
    layout.read(qpos, near=targets, out=read)
    assert np.allclose(read, targets, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_the_nearest_turn_is_the_same_rotation_and_no_further_away(seed):
    random = np.random.default_rng(seed)
    near = random.normal(size=(5, 3)) * 3.0
    short = to_rotation_vector(from_rotation_vector(random.normal(size=(5, 3)) * 2.0))
    long = nearest_turn(short, near)
    same = np.abs(np.sum(from_rotation_vector(short) * from_rotation_vector(long), axis=-1))
    assert np.allclose(same, 1.0)
    assert np.all(np.linalg.norm(long - near, axis=1) <= np.linalg.norm(short - near, axis=1) + 1e-12)


def test_a_hinge_is_its_own_angle():
    model = tiny()
    qpos = np.zeros(model.nq)
    JointLayout.of(model).place(np.array([0.7]), qpos)
    assert qpos[7] == 0.7


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"free": ""}, "'tiny'.*not a free joint"),
        ({"joint": 'type="slide"'}, "actuator 'arm' drives no hinge"),
        ({"joint": 'type="ball"'}, "'arm' has not x, y, z"),
        ({"joint": 'type="ball"', "servo": '<position name="y" joint="arm" gear="0 1 0"/>'}, "'y' has not x, y, z"),
    ],
)
def test_a_robot_that_does_not_fit_is_refused_by_name(change, complaint):
    with pytest.raises(FileFormatError, match=complaint):
        JointLayout.of(tiny(**change))
