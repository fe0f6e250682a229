"""What a robot file says of a joint or a body holds for targets, physics, preflight and page alike."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck_base.errors import FileFormatError, UnknownNameError
from sim.physics.physics_model import physics_model
from sim.physics.playback import PhysicsPlayback
from sim.physics.played_motions import DT, PlayedMotion
from sim.physics.preflight.preflight import Preflight
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, bent_pose, human
from small_robots import calibrated, humanoid

ELBOW = "left_elbow"  # from 0 to 2.5 rad in the model


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    """Loads the small humanoid with these lines at the end of its robot file, and with others in its model."""

    def loaded(own="", text=humanoid):
        folder = tmp_path_factory.mktemp("own")
        (folder / "small.xml").write_text(text())
        (folder / "small.toml").write_text(calibrated(folder / "small.xml").to_toml(folder) + own)
        return load_robot(folder / "small.toml", human())

    return loaded


def held(robot, seconds=0.5, **targets):
    """A motion that goes to targets and stays there."""
    count = round(seconds / DT)
    rows = np.tile(robot.rest, (count, 1))
    for joint, target in targets.items():
        rows[:, robot.joints.index(joint)] = target
    return PlayedMotion("held", False, rows, (bent_pose(human()),) * count)


def in_physics(robot, joint, target, ticks=150):
    stage, pose, goals = PhysicsPlayback(robot, 0.005), bent_pose(human()), robot.rest.copy()
    goals[robot.joints.index(joint)] = target
    for _ in range(ticks):
        stage.write(goals, pose)
    return float(stage.measured()[robot.joints.index(joint)])


def judged(robot, played, simulate=True):
    verdict = Preflight(robot, robot.limits, SafetyEnvelope).judge(played, simulate=simulate)
    return {finding.check: finding for finding in verdict.findings}


def on_the_page(robot):
    """The model that a page draws: it gets the text of it."""
    return mujoco.MjSpec.from_string(robot.spec.to_xml()).compile()


@pytest.mark.parametrize("units", ["radian", pytest.param("degree", marks=pytest.mark.thorough)])
def test_a_wider_range_is_one_for_all(load, units):
    def text():
        model = humanoid()
        if units == "degree":
            model = model.replace('angle="radian" ', "").replace('"0 2.5"', '"0 143.2394488"')
            for short in ('"-1 1"', '"-2 1"', '"0 2.4"', '"-1.2 1.2"', '"-.8 .8"', '"-3.5 2.5"', '"-2 2"'):
                model = model.replace(short, '"-114.6 114.6"')
        return model

    robot = load(f"[limits.joints.{ELBOW}]\nlower = -1.19\n", text)
    at = robot.joints.index(ELBOW)
    assert (robot.limits.lower[at], robot.limits.upper[at]) == pytest.approx((-1.19, 2.5))
    assert in_physics(robot, ELBOW, -1.19) == pytest.approx(-1.19, abs=0.05)  # 0.0 if only targets were told
    found = judged(robot, held(robot, **{ELBOW: -1.19}))
    assert found["out of reach"].ok
    assert found["off target"].ok, found["off target"]
    for model in (robot.model, physics_model(robot), robot.drawn, on_the_page(robot)):
        assert model.joint(ELBOW).range == pytest.approx([-1.19, 2.5], abs=1e-6)


def test_a_narrower_range_holds_the_body_too(load):
    robot = load(f"[limits.joints.{ELBOW}]\nupper = 1.0\n")
    assert in_physics(load(), ELBOW, 1.3) == pytest.approx(1.3, abs=0.02)
    assert in_physics(robot, ELBOW, 1.3) < 1.2  # MuJoCo's limits are soft
    assert judged(robot, held(robot, **{ELBOW: 2.0}), simulate=False)["out of reach"].value == pytest.approx(1.0)


def test_a_speed_of_ones_own_is_that_of_the_servo_too(load):
    servo = "[servo]\ntorque = 8.0\nspeed = 3.0\ncurrent = 2.0\n"
    slow, fast = load(servo), load(f"[limits.joints.{ELBOW}]\nvelocity = 9.0\n{servo}")
    at = slow.joints.index(ELBOW)
    assert slow.limits.velocity == pytest.approx(3.0)  # no target is faster than the servo, whatever [limits] guesses
    assert fast.limits.velocity[at] == 9.0
    for robot, passes in ((slow, False), (fast, True)):
        seconds = np.arange(0.0, 0.8, DT)
        played = held(robot, 0.8)
        played.targets[:, at] = 1.2 - np.cos(6.0 * seconds)  # up to 6 rad/s
        found = judged(robot, played)
        assert found["held back"].ok == found["off target"].ok == passes
        assert found["servo lag"].ok
    assert np.delete(fast.motors.speed, at) == pytest.approx(3.0)


@pytest.mark.parametrize("servo", ["", "[servo]\ntorque = 8.0\nspeed = 6.0\ncurrent = 2.0\n"])
def test_a_torque_of_ones_own_is_what_the_servo_has(load, servo):
    joint, out = "left_arm_roll", 1.3
    for torque, holds in ((0.05, False), (8.0, True)):
        robot = load(f"[limits.joints.{joint}]\ntorque = {torque}\n{servo}")
        at = robot.joints.index(joint)
        assert (abs(in_physics(robot, joint, out) - out) < 0.2) == holds
        found = judged(robot, held(robot, **{joint: out}))
        assert found["torque"].ok == found["off target"].ok == holds
        for model in (robot.model, physics_model(robot), on_the_page(robot)):
            assert model.actuator_forcerange[at].tolist() == [-torque, torque]


def test_a_torque_of_ones_own_replaces_a_joints_own_limit(load):
    def text():
        return humanoid().replace('name="left_elbow"', 'name="left_elbow" actuatorfrcrange="-1 1"', 1)

    for own, most in (("", 1.0), (f"[limits.joints.{ELBOW}]\ntorque = 3.0\n", 3.0)):
        robot = load(own, text)
        assert robot.strength[robot.joints.index(ELBOW)] == most
        model = physics_model(robot)
        data = mujoco.MjData(model)
        data.ctrl[:] = 100.0
        mujoco.mj_forward(model, data)
        assert data.joint(ELBOW).qfrc_actuator[0] == pytest.approx(most)


def test_a_mass_of_ones_own_is_carried_and_shown(load):
    light, heavy = load(), load("[masses]\nleft_fore = 3.0\n")
    body = light.model.body("left_fore")
    for model in (heavy.model, physics_model(heavy), on_the_page(heavy)):
        own = model.body("left_fore")
        assert own.mass[0] == pytest.approx(3.0, rel=1e-4)
        assert own.inertia == pytest.approx(body.inertia * 3.0 / body.mass[0], rel=1e-3)
    assert heavy.model.body_mass.sum() == pytest.approx(light.model.body_mass.sum() - body.mass[0] + 3.0, rel=1e-6)
    weak = [replace(robot, servo=None) for robot in (light, heavy)]
    needs = [judged(robot, held(robot, left_arm_roll=1.3), simulate=False)["torque"].value for robot in weak]
    assert needs[1] - needs[0] == pytest.approx((3.0 - body.mass[0]) * 9.81 * 0.225 * np.sin(1.3), rel=0.1)


@pytest.mark.thorough
def test_what_follows_a_joint_goes_as_far_as_it(load):
    def text():
        lid = '<body pos="0 0 0.3"><joint name="lid" axis="0 1 0" range="0 1"/><geom size="0.02"/></body>'
        extra = f'<equality><joint joint1="lid" joint2="{ELBOW}"/></equality>'
        return humanoid(trunk=lid, extra=extra)

    robot = load(f"[limits.joints.{ELBOW}]\nlower = -1.0\n", text)
    assert in_physics(robot, ELBOW, -1.0) == pytest.approx(-1.0, abs=0.05)


@pytest.mark.parametrize(
    ("own", "error", "complaint"),
    [
        (f"[limits.joints.{ELBOW}]\nlower = 2.0\nupper = 1.0\n", FileFormatError, "lower must be less than upper"),
        (f"[limits.joints.{ELBOW}]\nlower = 2.6\n", FileFormatError, "lower must be less than upper"),
        (f"[limits.joints.{ELBOW}]\ntorque = 0.0\n", FileFormatError, r"limits\.joints\.left_elbow\.torque"),
        ("[limits.joints.left_ellbow]\nupper = 1.0\n", UnknownNameError, r"limits\.joints: .*mean left_elbow"),
        ("[masses]\nleft_for = 1.0\n", UnknownNameError, r"masses: .*mean left_fore"),
        ("[masses]\nleft_fore = -1.0\n", FileFormatError, r"masses"),
    ],
)
def test_what_cannot_be_is_refused_with_its_place(load, own, error, complaint):
    with pytest.raises(error, match=complaint):
        load(own)


def test_a_mannequin_has_no_masses_of_its_own(tmp_path):
    text = (ROBOTS / "mannequin.toml").read_text()
    (tmp_path / "m.toml").write_text(text.replace("[limits]", "masses.head = 3.0\n[limits]", 1))
    with pytest.raises(FileFormatError, match="follow from its skeleton"):
        load_robot(tmp_path / "m.toml", human())
