import mujoco
import pytest

from benchmarks.robots.walk_conditions import CONDITIONS
from motiondeck_base.errors import MotiondeckError
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

BODY = """<mujoco><worldbody><body name="pelvis" pos="0 0 0.8"><freejoint/>{inertia}<geom size="0.1" mass="10"/>
<body pos="0 0 -0.4"><joint/><geom size="0.05" mass="5"/></body></body></worldbody></mujoco>"""
GIVEN = '<inertial pos="0 0 0" mass="10" diaginertia="0.1 0.1 0.1"/>'


@pytest.mark.parametrize("inertia", ["", GIVEN], ids=["from its geoms", "given"])
def test_a_payload_is_a_tenth_of_the_body_and_above_its_root(inertia):
    spec = mujoco.MjSpec.from_string(BODY.format(inertia=inertia))
    before = spec.copy().compile()
    CONDITIONS["payload 10 %"].alter(spec)
    after = spec.compile()
    assert after.body("pelvis").subtreemass[0] == pytest.approx(1.1 * before.body("pelvis").subtreemass[0])
    at = []
    for model in (before, after):
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        at.append(data.subtree_com[1, 2])
    assert at[1] > at[0] + 0.01


@pytest.mark.parametrize("name", ["servos 20 % weaker", "backlash 1 deg", "bus 20 ms"])
def test_other_servos_are_refused_where_nothing_is_known_of_them(name):
    robot = load_robot(ROBOTS / "mannequin.toml", human())
    with pytest.raises(MotiondeckError, match=r"'mannequin' has no table \[servo\]"):
        CONDITIONS[name].applied(robot)
    assert CONDITIONS["payload 10 %"].applied(robot) is robot
