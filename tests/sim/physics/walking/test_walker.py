from dataclasses import replace

import msgspec
import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.deck.deck import Deck
from controller.motion.rotations import conjugate, from_rotation_vector, multiply, to_rotation_vector, yaw
from motiondeck_base.errors import MotiondeckError
from shipped_libraries import shipped
from sim.physics.physics_model import feet_of, physics_model
from sim.physics.playback import PhysicsPlayback
from sim.physics.walking.preview import AHEAD
from sim.physics.walking.state_estimate import Sensors
from sim.physics.walking.walker import Walker, steady_trunk
from sim.robots.robot import load_robot
from simulated_bodies import HUMAN, ROBOTS, bent_pose, human, skeleton_of

DT, LEAN = 0.005, 0.2


def walk(name, motion, seconds, push=(0.0, 0.0, 0.0), at=np.inf, then=None):
    """Walks and is pushed for 0.1 s, or switches to a motion then; the stage at the end."""
    library = shipped()
    robot = load_robot(ROBOTS / f"{name}.toml", library.skeleton)
    deck = Deck(library, robot.retarget, motion)
    stage = PhysicsPlayback(robot, DT, "free", walk=True)
    for tick in range(round(seconds / DT)):
        if then is not None and abs(tick * DT - at) < 0.5 * DT:
            deck.switch(then)
        targets, pose = deck.update(DT)
        stage.push(np.array(push) * (at <= tick * DT < at + 0.1))
        stage.write(np.clip(targets, robot.limits.lower, robot.limits.upper), pose)
        if stage.fell_s is not None:
            break
    return stage


def test_servo20_walks_and_a_push_does_not_fell_it():
    stage = walk("servo20", "walk", 4.5, push=(0.0, 3.0, 0.0), at=3.5)
    assert stage.fell_s is None
    assert stage.travel is not None
    asked, walked = stage.travel
    assert asked > 0.8
    assert 0.5 * asked < walked < 1.1 * asked
    # The way that it reports is the way that the root has gone.
    assert np.hypot(*stage.qpos[:2]) == pytest.approx(walked, rel=0.2)
    assert stage.report()["travel"] == {"asked_m": asked, "walked_m": walked}


@pytest.mark.thorough
def test_a_robot_whose_feet_slip_keeps_the_heading_of_the_motion():
    # The mannequin's standing foot turns at each step: in 25 s by 40 degrees.
    library = shipped()
    robot = load_robot(ROBOTS / "mannequin.toml", library.skeleton)
    deck, stage, off = Deck(library, robot.retarget, "walk"), PhysicsPlayback(robot, DT, "free", walk=True), []
    for _ in range(round(25.0 / DT)):
        targets, pose = deck.update(DT)
        stage.write(np.clip(targets, robot.limits.lower, robot.limits.upper), pose)
        off.append(to_rotation_vector(multiply(stage.qpos[3:7], conjugate(stage.wanted[3:7])))[2])
    assert stage.fell_s is None
    assert abs(np.degrees(np.mean(off[-500:]))) < 10.0


@pytest.mark.thorough
def test_who_stops_walking_after_two_steps_and_boxes_keeps_on_its_feet():
    assert walk("servo20", "walk", 4.2, at=1.0, then="box1").fell_s is None


@pytest.mark.thorough
def test_feet_leave_the_floor_over_their_toes_and_land_on_their_heels():
    library = shipped()
    robot = load_robot(ROBOTS / "servo20.toml", library.skeleton)
    deck, feet = Deck(library, robot.retarget, "walk"), feet_of(robot)
    stage = PhysicsPlayback(robot, DT, "free", walk=True)
    lowest, pitch, raised = np.empty((1000, 2)), np.empty((1000, 2)), 0.004
    for tick in range(len(pitch)):
        targets, pose = deck.update(DT)
        stage.write(np.clip(targets, robot.limits.lower, robot.limits.upper), pose)
        for number, foot in enumerate(feet):
            body = stage.data.body(foot.body)
            frame = body.xmat.reshape(3, 3)
            lowest[tick, number] = (body.xpos + foot.corners @ frame.T)[:, 2].min()
            pitch[tick, number] = -np.arcsin((frame @ foot.axes[:, 0])[2])
    # After the first steps, which are short.
    flies = lowest[600:] > raised
    leaves, lands = ~flies[:-1] & flies[1:], flies[:-1] & ~flies[1:]
    assert stage.fell_s is None
    assert min(leaves.sum(), lands.sum()) >= 4
    assert np.median(pitch[601:][leaves]) > 0.2
    assert np.median(pitch[601:][lands]) < -0.05


def standing(force, seconds):
    """Stands at rest and is pushed for 0.1 s after 0.5 s; the stage at the end."""
    robot = load_robot(ROBOTS / "servo20.toml", human())
    stage = PhysicsPlayback(robot, DT, "free", walk=True)
    pose = bent_pose(human())
    for tick in range(round(seconds / DT)):
        stage.push(force * (100 <= tick < 120))
        stage.write(robot.rest, pose)
        if stage.fell_s is not None:
            break
    return stage


def test_it_stands_where_nothing_moves():
    stage = standing(np.array([0.0, 2.0, 0.0]), seconds=1.5)
    assert stage.fell_s is None
    assert stage.report()["own_steps"] == 0
    assert stage.travel is not None
    assert stage.travel[1] < 0.02


@pytest.mark.thorough
@pytest.mark.parametrize(("force", "steps"), [((10.5, 0.0, 0.0), 1), ((0.0, -12.0, 0.0), 2)])
def test_who_stands_and_is_pushed_hard_takes_a_step_or_two(force, steps):
    stage = standing(np.array(force), seconds=2.5)
    assert stage.fell_s is None
    assert stage.report()["own_steps"] == steps
    assert stage.incidents == []


def shaking(delay):
    """How fast the legs of a robot that stands turn at most by sensors that are so late, s; median over time, rad/s."""
    robot = load_robot(ROBOTS / "servo20.toml", human())
    stage = PhysicsPlayback(robot, DT, "free", walk=True, sensors=Sensors(delay=delay))
    speeds = []
    for _ in range(150):
        stage.write(robot.rest, bent_pose(human()))
        speeds.append(np.abs(stage.data.qvel[6:]).max())
    return np.median(speeds[50:])


@pytest.mark.thorough
def test_what_is_seen_late_does_not_shake_the_legs():
    # An ankle that acts at once on what is late answers its own answer.
    assert shaking(0.01) < 0.3 * shaking(0.0)


@pytest.mark.thorough
def test_who_lies_and_is_put_in_place_stands_by_sensors_too():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    stage = PhysicsPlayback(robot, DT, "free", walk=True, sensors=Sensors())
    for tick in range(600):
        sideways, breaks = 100.0 * (100 <= tick < 140), 1e14 * (tick == 400)
        stage.push(np.array([breaks, sideways, 0.0]))
        stage.write(robot.rest, bent_pose(human()))
        assert tick != 399 or stage.fallen
    assert stage.report()["faults"] == 1
    assert len(stage.near_falls) == 1
    assert not stage.fallen


@pytest.mark.parametrize("turned", [2.0, np.pi, -np.pi])
def test_it_does_not_matter_which_way_in_the_world_it_has_turned(turned):
    robot = load_robot(ROBOTS / "servo20.toml", human())
    model = physics_model(robot, "free")

    def goal_seen_from(heading):
        """Where the joints are to go, of a robot that slid on its feet until it faces a heading, rad."""
        walker = Walker(robot, model, feet_of(robot), DT)
        data = mujoco.MjData(model)
        walker.start(data)
        goal = data.qpos.copy()
        # The feet have not slid equally far.
        for joint, slid in (("r_hip_yaw", 0.02), ("l_hip_yaw", -0.02)):
            data.qpos[model.joint(joint).qposadr] += slid
        data.qpos[3:7] = multiply(yaw(heading), data.qpos[3:7])
        walker.adjust(data, goal, 0.0)
        return goal[7:]

    assert goal_seen_from(turned) == pytest.approx(goal_seen_from(0.0), abs=1e-6)


@pytest.mark.thorough
def test_a_tilted_trunk_does_not_turn_the_sole_that_lands():
    # A sole that lands turned against the trunk's tilt keeps the trunk tilted under the next step too.
    library = shipped()
    robot = load_robot(ROBOTS / "servo20.toml", library.skeleton)
    model, feet = physics_model(robot, "free"), feet_of(robot)
    deck = Deck(library, robot.retarget, "walk")
    walker, data, goal = Walker(robot, model, feet, DT), mujoco.MjData(model), np.zeros(model.nq)
    seen, off_level, raised = mujoco.MjData(model), [], []
    for tick in range(350):
        targets, pose = deck.update(DT)
        robot.place(targets, pose, goal)
        if tick == 0:
            data.qpos[:] = goal
            walker.start(data)
        walker.adjust(data, goal, float(pose.heading))
        # It is where it is to be, but leans to its left.
        data.qpos[:] = goal
        seen.qpos[:] = goal
        data.qpos[3:7] = multiply(from_rotation_vector(np.array([-np.radians(8.0), 0.0, 0.0])), goal[3:7])
        mujoco.mj_kinematics(model, seen)
        # Seen from ahead: over heel and toe the soles roll by themselves.
        left = np.array([-np.sin(pose.heading), np.cos(pose.heading), 0.0])
        up = [seen.xmat[model.body(foot.body).id].reshape(3, 3) @ foot.axes[:, 2] for foot in feet]
        off_level.append(np.degrees(abs(np.arcsin(up[0] @ left) - np.arcsin(up[1] @ left))))
        raised.append(np.ptp([seen.xpos[model.body(foot.body).id][2] for foot in feet]) > 0.01)
    assert sum(raised) > 30
    assert np.mean(np.array(off_level)[raised]) < 2.0


def leaning(direction, ticks=30):
    """How far a standing mannequin leans against where its capture point stays off, in half lengths of the sole."""
    robot = load_robot(ROBOTS / "mannequin.toml", human())
    robot = replace(robot, walk=msgspec.structs.replace(robot.walk, lean=LEAN))
    model, feet = physics_model(robot, "free"), feet_of(robot)
    walker, data, seen = Walker(robot, model, feet, DT), mujoco.MjData(model), mujoco.MjData(model)
    robot.layout.place(robot.rest, data.qpos)
    walker.start(data)
    mujoco.mj_forward(model, data)
    stood, goal = data.subtree_com[model.jnt_bodyid[0]].copy(), data.qpos.copy()
    # A tenth of the root's height: it does not step for that.
    data.qvel[:2] = 0.1 * data.qpos[2] * np.sqrt(9.81 / stood[2]) * np.array(direction)
    for _ in range(ticks):
        goal = data.qpos.copy()
        walker.adjust(data, goal, 0.0)
    assert walker.own_steps == 0
    seen.qpos[:] = goal
    mujoco.mj_forward(model, seen)
    leant = (stood - seen.subtree_com[model.jnt_bodyid[0]])[:2] @ direction
    return float(leant) / (0.5 * float(np.ptp(feet[0].corners @ feet[0].axes, axis=0)[0]))


def test_ankles_lean_less_far_to_a_side_than_ahead():
    # Soles are longer than wide, and a stiff foot that is asked for more tips over its edge.
    assert 0.5 * LEAN < leaning((0.0, 1.0)) < 1.1 * LEAN < 1.4 * LEAN < leaning((1.0, 0.0))


def test_who_is_off_for_long_leans_as_far_as_that_takes():
    # On a slope the weight comes back over the middle of the sole, away from an edge.
    assert leaning((0.0, 1.0), ticks=800) > 2.0 * LEAN


def test_arms_that_would_throw_the_robot_over_swing_less():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    model = physics_model(robot, "free")
    walker, data, goal = Walker(robot, model, feet_of(robot), DT), mujoco.MjData(model), model.qpos0.copy()
    arms = [model.joint(f"{side}_shoulder_pitch").qposadr[0] for side in "lr"]
    robot.layout.place(robot.rest, goal)
    data.qpos[:] = goal
    walker.start(data)
    lag, swung = round(AHEAD / DT), []
    swings = 1.2 * np.sin(8.0 * np.pi * DT * np.arange(lag + 100))
    for angle in swings:
        goal[arms] = angle
        played = goal.copy()
        walker.adjust(data, played, 0.0)
        swung.append(played[arms[0]])
    assert np.abs(swung[lag + 50 :]).max() < 0.6 * np.abs(swings).max()


def test_a_fall_is_seen_coming():
    stage = standing(np.array([25.0, 0.0, 0.0]), seconds=2.5)
    assert stage.fell_s is not None
    assert stage.near_falls[0] < stage.fell_s - 0.1
    assert all(incident.startswith("the robot is about to fall") for incident in stage.incidents)
    assert len(stage.incidents) == len(stage.near_falls) > 0
    assert stage.fallen


def test_only_a_free_robot_with_two_feet_can_walk():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    with pytest.raises(MotiondeckError, match="needs a free root, not gantry: give --root free"):
        PhysicsPlayback(robot, DT, walk=True)
    with pytest.raises(MotiondeckError, match="leave --balance"):
        PhysicsPlayback(robot, DT, "free", balance=True, walk=True)
    one_leg = skeleton_of([bone for bone in HUMAN if bone[0] in ("rhip", "rkne", "rank", "rfoo")])
    with pytest.raises(MotiondeckError, match="has 1 feet"):
        PhysicsPlayback(load_robot(ROBOTS / "mannequin.toml", one_leg), DT, "free", walk=True)


def test_a_robot_that_cannot_stand_on_one_leg_is_refused_with_the_joint():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    assert robot.servo is not None
    weak = replace(robot, servo=msgspec.structs.replace(robot.servo, torque=0.5))
    with pytest.raises(
        MotiondeckError, match=r"cannot stand on one leg.*_(hip|ankle)_\w+ needs [\d.]+ N m and has 0\.5"
    ):
        PhysicsPlayback(weak, DT, "free", walk=True)


@pytest.mark.parametrize("share", [0.85, 1.2])
def test_a_robot_whose_ankles_are_softer_than_its_weight_leans_is_refused(share):
    """Legs that give way only in the ankles are an inverted pendulum, which W h has to hold."""
    robot = load_robot(ROBOTS / "mannequin.toml", human())
    model = physics_model(robot, "free")
    data = mujoco.MjData(model)
    robot.layout.place(robot.rest, data.qpos)
    mujoco.mj_forward(model, data)
    weight, ankles = 9.81 * model.body_subtreemass[1], [model.body(foot.body).id for foot in feet_of(robot)]
    for actuator, joint in enumerate(model.actuator_trnid[:, 0]):
        high = data.subtree_com[1, 2] - data.xanchor[joint, 2]
        holds = share * weight * high if model.jnt_bodyid[joint] in ankles else 1e6
        model.actuator_gainprm[actuator, 0], model.actuator_biasprm[actuator, 1] = holds, -holds
    if share > 1.0:
        Walker(robot, model, feet_of(robot), DT)
    else:
        with pytest.raises(MotiondeckError, match=r"gives way under its weight on one leg.* 0\.[89]\d? times as stiff"):
            Walker(robot, model, feet_of(robot), DT)


def test_a_robot_without_ankles_is_refused():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    model = physics_model(robot, "free")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)

    def as_shank(foot):
        """The same foot, of one piece with the shank."""
        shank = foot.body.replace("foot", "shank")
        below = data.xpos[model.body(foot.body).id] - data.xpos[model.body(shank).id]
        return replace(foot, body=shank, corners=foot.corners + below)

    with pytest.raises(MotiondeckError, match=r"'servo20' has no ankle above '._shank'"):
        Walker(robot, model, [as_shank(foot) for foot in feet_of(robot)], DT)


@pytest.mark.thorough
@pytest.mark.parametrize(("motion", "seconds"), [("waltz", 8.0), ("box3", 20.0)])
def test_a_robot_without_a_waist_keeps_on_its_feet_where_the_humans_chest_sways_and_twists(motion, seconds):
    assert walk("servo20", motion, seconds).fell_s is None


@given(st.floats(-0.8, 0.8), st.floats(-3.0, 3.0))
def test_a_walking_trunk_sways_and_twists_only_so_far_and_bows_as_it_is_played(angle, heading):
    def steadied(axis):
        upright = from_rotation_vector(np.array([0.3, 0.2, 0.1]))
        played = multiply(yaw(heading), from_rotation_vector(angle * np.eye(3)[axis]))
        trunk = steady_trunk(multiply(played, upright), upright, heading)
        seen = multiply(yaw(-heading), multiply(trunk, conjugate(upright)))
        return to_rotation_vector(seen)[axis]

    assert steadied(1) == pytest.approx(angle, abs=1e-9)
    assert steadied(2) == pytest.approx(np.clip(angle, -0.1, 0.1), abs=1e-9)
    if abs(np.sin(angle)) <= 0.05:
        assert steadied(0) == pytest.approx(angle, abs=1e-9)
    else:
        assert 0.05 < np.sign(angle) * steadied(0) < 0.08
