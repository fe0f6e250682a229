import mujoco
import numpy as np
import pytest

from sim.physics.physics_model import feet_of, physics_model
from sim.physics.walking.state_estimate import Estimate, ExactState, Sensors
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human

DT = 0.005
DOWN = np.array([0.0, 0.0, -9.81])


@pytest.fixture(scope="module")
def robot():
    return load_robot(ROBOTS / "servo20.toml", human())


def swaying(robot, model, seconds, shift=0.0):
    """States of a body that sways over one foot, which stands: qpos and qvel a tick, DT apart."""
    data, rows = mujoco.MjData(model), []
    robot.layout.place(robot.rest, data.qpos)
    foot = feet_of(robot)[0]
    body = int(model.body(foot.body).id)
    ankle = [int(model.joint(foot.body[:2] + name).dofadr[0]) for name in ("ankle_pitch", "ankle_roll", "hip_pitch")]
    for k in range(round(seconds / DT)):
        data.qvel[:] = 0.0
        data.qvel[ankle] = 0.4 * np.sin(6.0 * k * DT + np.arange(3))
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        jacobian = np.empty((6, model.nv))
        mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], data.xpos[body], body)
        # The root moves so that the foot does not.
        data.qvel[:6] = np.linalg.solve(jacobian[:, :6], -jacobian[:, 6:] @ data.qvel[6:])
        rows.append((data.qpos + np.array([shift, shift, *np.zeros(model.nq - 2)]), data.qvel.copy()))
        mujoco.mj_integratePos(model, data.qpos, data.qvel, DT)
    return foot, body, rows


def speeds_and_trunks(robot, sensors, shift=0.0):
    """The speed of the centre of mass, m/s, and the trunk's way ahead, as they are and estimated, (2, T, 2, 3)."""
    model = physics_model(robot, "free")
    foot, body, rows = swaying(robot, model, 1.5, shift)
    soles = lambda data, _: (data.xpos[body] + data.xmat[body].reshape(3, 3) @ foot.sole, body)  # noqa: E731
    exact, estimate = ExactState(model, DOWN), Estimate(model, DOWN, sensors, soles, DT)
    data, seen = mujoco.MjData(model), []
    for data.qpos[:], data.qvel[:] in rows:
        pair = [senses.see(data, np.array([1.0, 0.0])) for senses in (exact, estimate)]
        seen.append([(state.subtree_linvel[1].copy(), state.xmat[1, ::3].copy()) for state in pair])
    return np.array(seen).swapaxes(0, 1)


def speeds(robot, sensors, shift=0.0):
    """The speed of the centre of mass, as it is and as it is estimated, shapes (T, 3), m/s."""
    return speeds_and_trunks(robot, sensors, shift)[:, :, 0]


PERFECT = Sensors(angle=0.0, speed=0.0, tilt=0.0, level=0.0, turn=0.0, drift=0.0, shake=0.0, pull=0.0, delay=0.0)


def test_perfect_sensors_tell_the_speed_wherever_the_robot_is(robot):
    true, seen = speeds(robot, PERFECT)
    assert np.ptp(true[:, 0]) > 0.05
    assert np.allclose(true[100:], seen[100:], atol=3e-3)
    assert np.allclose(seen, speeds(robot, PERFECT, shift=7.0)[1])


def test_noise_and_constant_errors_of_usual_sensors_leave_two_centimetres_a_second(robot):
    true, seen = speeds(robot, Sensors(delay=0.0))
    assert 1e-3 < np.sqrt(np.square(true - seen)[100:].mean()) < 0.02


def test_gyroscope_and_joint_speeds_smooth_the_posture_without_delay(robot):
    true, seen = speeds_and_trunks(robot, Sensors(level=0.0, drift=0.0, delay=0.0))[:, 100:, 1]
    assert np.ptp(true[:, 2]) > 0.1
    off = (seen - true)[:, 2]
    assert np.sqrt(np.square(off).mean()) < 0.4 * Sensors.tilt
    # A trunk that is seen later than it moves would be off along its speed.
    assert abs(np.polyfit(np.gradient(true[:, 2], DT), off, 1)[0]) < 0.5 * DT


def test_on_a_slope_down_is_where_gravity_points(robot):
    model = physics_model(robot, "free")
    data = mujoco.MjData(model)
    robot.layout.place(robot.rest, data.qpos)
    lean = np.radians(3.0)
    senses = ExactState(model, 9.81 * np.array([0.0, -np.sin(lean), -np.cos(lean)]))
    up = senses.see(data, np.array([0.5, 0.5])).xmat[1].reshape(3, 3)[:, 2]
    assert up == pytest.approx([0.0, -np.sin(lean), np.cos(lean)])


def test_who_is_put_elsewhere_is_seen_there_at_once(robot):
    model = physics_model(robot, "free")
    foot, body, rows = swaying(robot, model, 0.1)
    soles = lambda data, _: (data.xpos[body] + data.xmat[body].reshape(3, 3) @ foot.sole, body)  # noqa: E731
    estimate, data = Estimate(model, DOWN, PERFECT, soles, DT), mujoco.MjData(model)
    for data.qpos[:], data.qvel[:] in rows:
        data.qpos[3:7] = [np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0]  # it lies, and slides
        data.qvel[:3] = 2.0
        estimate.see(data, np.array([1.0, 0.0]))
    data.qpos[:], data.qvel[:] = rows[0][0], 0.0
    estimate.start()
    seen = estimate.see(data, np.array([1.0, 0.0]))
    assert np.allclose(seen.qpos[3:], data.qpos[3:], atol=1e-9)
    assert np.allclose(seen.qvel[:3], data.qvel[:3], atol=1e-9)
