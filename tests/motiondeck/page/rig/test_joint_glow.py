"""Joints that glow, without a browser."""

import mujoco
import numpy as np
import pytest

from motiondeck.page.rig.servo_look import JointGlow, ServoLook
from motiondeck.page.web.private_page import PrivatePage
from waiting import free_port

ARM = """<mujoco><worldbody><body pos="0 0 1"><joint name="shoulder"/><geom size=".1"/>
<body pos=".3 0 0"><joint name="elbow"/><geom size=".1"/></body></body></worldbody></mujoco>"""


@pytest.fixture
def page():
    page = PrivatePage(free_port(), "test")
    yield page
    page.stop()


def test_a_ball_stands_where_a_servo_is_not_well_and_goes_when_it_is(page):
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    glow = JointGlow(page, model, ["elbow", "no such joint", "shoulder"], height=1.0)
    well, hot = ServoLook("ok", "ok"), ServoLook("warn", "is getting hot")
    glow.mark([well, hot, well], data, np.zeros(2))
    assert glow.balls is None
    glow.mark([hot, hot, well], data, np.zeros(2))
    glow.show(data, np.array([0.1, 0.2]))
    assert glow.balls.batched_positions == pytest.approx(np.array([[0.2, -0.2, 1.0]]))
    glow.mark([well, hot, well], data, np.zeros(2))
    assert glow.balls is None
