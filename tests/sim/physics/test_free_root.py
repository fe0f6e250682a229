import re

import mujoco
import numpy as np
import pytest

from controller.motion.rotations import multiply, rotate
from motiondeck_base.errors import MotiondeckError
from shipped_libraries import shipped
from sim.models.feet import find_feet
from sim.models.surface import LowestPoint
from sim.physics.physics_model import feet_of, physics_model
from sim.physics.playback import PhysicsPlayback
from sim.physics.recovery import has_fallen
from sim.robots.robot import load_robot
from simulated_bodies import HUMAN, ROBOTS, bent_pose, human, skeleton_of
from small_robots import calibrated, full_humanoid, humanoid

NAMES = ["mannequin", "servo20"]
DT = 0.005


def load(name):
    return load_robot(ROBOTS / f"{name}.toml", human())


def leaning(angle):
    """A pose that leans forward as a whole, so that it must fall."""
    return bent_pose(human(), rkne=(0.0, -angle, 0.0), lkne=(0.0, -angle, 0.0))


@pytest.mark.parametrize("name", NAMES)
def test_two_flat_feet_are_found_on_the_ground(name):
    robot = load(name)
    feet = feet_of(robot)
    assert len(feet) == 2
    data = mujoco.MjData(robot.model)
    robot.layout.place(robot.rest, data.qpos)
    mujoco.mj_kinematics(robot.model, data)
    for foot in feet:
        assert np.allclose(foot.axes.T @ foot.axes, np.eye(3), atol=1e-9)
        assert np.linalg.det(foot.axes) == pytest.approx(1.0)
        assert np.ptp((foot.corners @ foot.axes)[:, 2]) < 1e-9
        body = robot.model.body(foot.body).id
        sole = data.xpos[body] + data.xmat[body].reshape(3, 3) @ foot.sole
        assert sole[2] < 0.1 * float(data.qpos[2])
    sides = [data.xpos[robot.model.body(foot.body).id, 1] for foot in feet]
    assert min(sides) < 0.0 < max(sides)


def test_feet_of_rounded_solids_stand_on_their_flat_soles_and_not_on_their_toes():
    skeleton = shipped("cmu86").skeleton
    robot = load_robot(ROBOTS / "mannequin.toml", skeleton)
    down, model = (0.0, 0.6, 0.0), physics_model(robot, "free")
    data = mujoco.MjData(model)
    robot.layout.place(robot.retarget(bent_pose(skeleton, ltoes=down, rtoes=down)), data.qpos)
    mujoco.mj_kinematics(model, data)
    frames = [(foot, data.body(foot.body)) for foot in feet_of(robot)]
    # One leg is a little longer than the other.
    data.qpos[2] -= min((at.xpos + foot.corners @ at.xmat.reshape(3, 3).T)[:, 2].min() for foot, at in frames) + 0.01
    mujoco.mj_forward(model, data)
    touching = data.contact.geom[:, 1]
    assert {model.body(body).name for body in model.geom_bodyid[touching]} == {"rfoot"}
    assert set(model.geom_type[touching].tolist()) == {int(mujoco.mjtGeom.mjGEOM_BOX)}


def test_a_column_has_no_two_feet():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body pos='0 0 1'><freejoint/><geom type='box' size='.1 .1 1'/></body></worldbody></mujoco>"
    )
    assert len(find_feet(model, model.qpos0)) < 2


def test_the_gantry_lets_go_of_a_free_root_only():
    robot = load("servo20")
    held = {root: physics_model(robot, root).eq_active0[0] for root in ("gantry", "fixed", "free")}
    assert held == {"gantry": 1, "fixed": 1, "free": 0}
    with pytest.raises(MotiondeckError, match="root 'string': choose gantry"):
        physics_model(robot, "string")


def without_servos(folder, text):
    """A robot calibrated from a model file whose joints have no servos."""
    (folder / "small.xml").write_text(re.sub("<actuator>.*</actuator>", "", text))
    found = calibrated(folder / "small.xml")
    (folder / "small.toml").write_text(found.to_toml(folder))
    return load_robot(folder / "small.toml", human())


@pytest.mark.thorough
@pytest.mark.parametrize(
    "text",
    [
        humanoid(),
        full_humanoid(fingers=False),
        full_humanoid(fingers=False, lying=True),
        full_humanoid(fingers=False, ankle="pitch"),
    ],
    ids=["10 kg", "27 kg", "y up", "no ankle roll"],
)
def test_feet_stay_where_they_are_while_a_robot_that_can_walk_stands(tmp_path, text):
    robot = without_servos(tmp_path, text)
    stage, pose = PhysicsPlayback(robot, DT, "free", walk=True), bent_pose(human())
    foot = feet_of(robot)[0].body
    for tick in range(round(2.0 / DT)):
        stage.write(robot.rest, pose)
        if tick == 20:
            place = stage.data.body(foot).xpos.copy()
    assert stage.fell_s is None
    assert np.linalg.norm(stage.data.body(foot).xpos - place) < 0.015


def test_a_robot_whose_file_has_no_servos_stands_on_those_it_is_given(tmp_path):
    robot = without_servos(tmp_path, humanoid())
    stage, pose = PhysicsPlayback(robot, DT, "free"), bent_pose(human())
    for _ in range(round(2.0 / DT)):
        stage.write(robot.rest, pose)
    assert stage.fell_s is None
    assert rotate(stage.qpos[3:7], np.array([0.0, 0.0, 1.0]))[2] > np.cos(0.05)
    assert np.abs(stage.data.qvel).max() < 0.05
    forces = np.empty((6, 6))
    stage.contact_forces(forces)
    held = forces[np.isfinite(forces[:, 0])]
    assert len(held) == 2, "its feet"
    weight = 9.81 * stage.model.body_mass.sum()
    assert held[:, 3:].sum(axis=0) == pytest.approx([0.0, 0.0, weight], abs=0.05 * weight)
    assert np.abs(held[:, 2]).max() < 0.01, "on the floor"


def test_a_fixed_root_stays_where_it_was_first():
    robot = load("servo20")
    output = PhysicsPlayback(robot, DT, "fixed")
    pose = bent_pose(human())
    for step in range(40):
        pose.root_position[0] = 0.01 * step
        output.write(robot.rest, pose)
    assert abs(output.qpos[0]) < 0.01


@pytest.mark.parametrize("name", NAMES)
def test_a_free_robot_starts_on_the_floor_and_falls_where_it_cannot_stand(name):
    robot = load(name)
    output = PhysicsPlayback(robot, DT, "free")
    pose = leaning(0.5)
    targets = np.clip(robot.retarget(pose), robot.limits.lower, robot.limits.upper)
    output.write(targets, pose)
    mujoco.mj_kinematics(output.model, output.data)
    assert abs(LowestPoint(output.model)(output.data)) < 0.02
    wanted = np.empty_like(output.wanted)
    robot.place(targets, pose, wanted)
    wanted[:2] = output.qpos[:2]  # a free root has no goal along the ground
    assert output.wanted == pytest.approx(wanted)
    output.clock = lambda: 100.0 + float(output.data.time)
    for _ in range(500):
        output.write(targets, pose)
    assert output.fell_s is not None
    assert 100.1 < output.fell_s < 102.4
    assert output.fallen
    assert output.report()["fell_s"] == output.fell_s


@pytest.mark.thorough
@pytest.mark.parametrize("name", NAMES)
def test_with_balance_it_stands_where_it_would_fall_and_when_it_is_pushed(name):
    robot = load(name)
    output = PhysicsPlayback(robot, DT, "free", balance=True)
    pose = leaning(0.5)
    targets = np.clip(robot.retarget(pose), robot.limits.lower, robot.limits.upper)
    weight = float(robot.model.body_mass.sum()) * 9.81
    for tick in range(600):
        output.push(np.array([0.0, 0.15 * weight, 0.0]) * (200 <= tick < 220))
        output.write(targets, pose)
    assert output.fell_s is None
    assert output.report()["balance"] is True
    assert output.report()["faults"] == 0


@pytest.mark.parametrize(
    ("side", "towards"), [("back", (1, 0)), ("left", (0, -1)), ("front", (-1, 0)), ("right", (0, 1))]
)
def test_a_push_from_a_side_gives_the_body_its_impulse_away_from_it(side, towards):
    robot, pose = load("servo20"), bent_pose(human())
    turned = PhysicsPlayback(robot, DT, "free")
    pose.heading[...] = heading = 0.7
    turned.model.opt.gravity[:] = 0.0  # nothing but the push
    turned.write(robot.rest, pose)
    mass, before = float(robot.model.body_mass.sum()), momentum(turned)
    turned.push_from(side, 0.1 * mass)
    for _ in range(round(0.2 / DT)):
        turned.write(robot.rest, pose)
    away = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]) @ towards
    assert np.allclose((momentum(turned) - before)[:2] / mass, 0.1 * away, atol=0.01)


def momentum(output):
    """Of the whole body, kg m/s."""
    mujoco.mj_subtreeVel(output.model, output.data)
    return output.model.body_mass.sum() * output.data.subtree_linvel[0]


def test_what_is_fixed_cannot_be_pushed():
    with pytest.raises(MotiondeckError, match="fixed root cannot be pushed"):
        PhysicsPlayback(load("servo20"), DT, "fixed").push_from("left", 0.1)


def test_only_a_free_robot_with_two_feet_can_balance():
    with pytest.raises(MotiondeckError, match="root is gantry need not balance"):
        PhysicsPlayback(load("servo20"), DT, "gantry", balance=True)
    one_leg = skeleton_of([bone for bone in HUMAN if bone[0] in ("rhip", "rkne", "rank", "rfoo")])
    robot = load_robot(ROBOTS / "mannequin.toml", one_leg)
    with pytest.raises(MotiondeckError, match="has 1 feet"):
        PhysicsPlayback(robot, DT, "free", balance=True)


def test_a_fall_is_seen_from_what_is_played():
    upright = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    lying = np.array([0.0, 0.0, 0.2, np.cos(0.7), np.sin(0.7), 0.0, 0.0])
    for standing in (np.array([1.0, 0.0, 0.0, 0.0]), np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])):
        up, down = (np.concatenate([root[:3], multiply(root[3:], standing)]) for root in (upright, lying))
        assert not has_fallen(up, up, standing)
        assert not has_fallen(down, down, standing)
        assert has_fallen(down, up, standing)
        leaning = np.concatenate([upright[:3], down[3:]])
        assert has_fallen(leaning, up, standing)
