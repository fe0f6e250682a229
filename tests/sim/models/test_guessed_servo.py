"""Servos of joints whose files have none: judged by MuJoCo, which lets the limbs hang on them."""

import mujoco
import numpy as np
import pytest

from sim.models.model_file import read_model
from sim.models.scenery import set_stage

ARM = """
<mujoco><compiler angle="radian"/><worldbody><body name="trunk" pos="0 0 1"><freejoint/><geom size="0.1" mass="20"/>
  <body name="upper" pos="0 0.2 0">
    <joint name="pitch" axis="0 1 0"/><joint name="yaw" axis="0 0 1"/>
    <geom type="capsule" fromto="0 0 0 0 0 -{length}" size="{radius}" density="{density}"/>
    <body name="fore" pos="0 0 -{length}">
      <joint name="elbow" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 -{length}" size="{radius}" density="{density}"/>
      <body name="hand" pos="0 0 -{length}">
        <joint name="roll" axis="0 0 1"/>
        <geom type="capsule" fromto="0 0 0 0 0 -{radius}" size="{radius}" density="{density}"/>
      </body>
    </body>
  </body>
</body></worldbody></mujoco>"""


def hung(path, posture, length):
    """The joints of a robot's arm, two seconds after its fixed trunk let it hang on its servos in a posture."""
    path.write_text(ARM.format(length=length, radius=0.15 * length, density=1000.0))
    spec = read_model(path)
    set_stage(spec, 1.0)
    spec.delete(spec.body("trunk").joints[0])
    model = spec.compile()
    data = mujoco.MjData(model)
    goal = np.array([posture[model.actuator(k).name] for k in range(model.nu)])
    data.qpos[[model.jnt_qposadr[j] for j in model.actuator_trnid[:, 0]]] = data.ctrl[:] = goal
    for _ in range(round(2.0 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    assert not any(warning.number for warning in data.warning)
    return data.actuator_length - goal, data.actuator_velocity


@pytest.mark.parametrize("length", [0.03, 0.3, 1.5])
@pytest.mark.parametrize(
    "posture",
    [
        {"pitch": 0.0, "yaw": 1.57, "elbow": -1.57, "roll": 0.0},
        {"pitch": -1.57, "yaw": 0.0, "elbow": 0.0, "roll": 1.0},
        {"pitch": -1.57, "yaw": 1.57, "elbow": -1.57, "roll": 0.5},
    ],
    ids=["elbow bent", "arm held out", "forearm across"],
)
def test_a_limb_does_not_sag_far_in_any_posture(tmp_path, posture, length):
    off, velocity = hung(tmp_path / "arm.xml", posture, length)
    assert np.abs(off).max() < 0.025
    assert np.abs(velocity).max() < 0.01
