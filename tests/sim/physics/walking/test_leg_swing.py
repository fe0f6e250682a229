import mujoco
import numpy as np
import pytest

from controller.motion.rotations import from_matrix
from sim.models.kinematic_tree import path_to
from sim.models.robot_file import WalkSettings
from sim.physics.physics_model import feet_of, physics_model
from sim.physics.walking.capture_point import planned_capture_point
from sim.physics.walking.gait import Gait
from sim.physics.walking.momentum import leg_swing, legs_carry
from sim.physics.walking.steps import swing_path
from sim.physics.walking.whole_body import WholeBody
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, human
from walking_soles import go_after, walking_soles

DT, PREVIEW, OMEGA, CARRIED = 0.002, 1.2, 4.0, 0.005
SETTINGS = WalkSettings(share=0.9, width=0.2, roll=0.5)


def new_gait():
    gait = Gait(SETTINGS, 1.0, 0.25, np.array([1.0, -1.0]), 0.44)
    gait.start(np.zeros(2), 0.0, np.zeros(2))
    return gait


def walking(seconds=6.0):
    """Each tick of a walk: planned capture point, pressure that it is planned for, soles, gait and time."""
    gait = new_gait()
    for now, _ in go_after(gait, walking_soles(seconds, DT, length=0.5, step=0.5), DT, PREVIEW):
        times, knots = gait.course(now)
        pressure = np.array([np.interp(now, times, knots[:, axis]) for axis in range(2)])
        planned = planned_capture_point(times, knots, now, OMEGA)[:2]
        soles = gait.places.copy()
        if gait.step is not None:
            begun, _, share = gait.swing(now)
            soles[gait.step.foot] = begun + swing_path(share)[0] * (gait.step.place - begun)
        yield planned, pressure, soles, gait, now


def test_with_the_shift_the_pressure_is_where_it_is_planned_while_legs_swing():
    """xi' = omega (xi - p - s), with s from how the soles are seen to speed up."""
    capture, pressure, soles, arms = [], [], [], []
    for planned, at, places, gait, now in walking():
        shift, _, arm = leg_swing(now, OMEGA, CARRIED, gait)
        capture.append(planned + shift)
        pressure.append(at)
        soles.append(places.sum(axis=0))
        arms.append(arm)
    runs = np.gradient(np.array(capture), DT, axis=0)
    arm = -CARRIED * np.gradient(np.gradient(np.array(soles), DT, axis=0), DT, axis=0)
    steady = slice(1000, -600)
    # Where a foot leaves, lands, or begins to slow down, the plan has a corner.
    assert np.quantile(np.hypot(*(arm - arms)[steady].T), 0.9) < 1e-3
    off = np.hypot(*(runs - OMEGA * (np.array(capture) - pressure - arm))[steady].T)
    assert np.median(off) < 0.01
    assert np.quantile(off, 0.9) < 0.05
    still = np.hypot(*(runs - OMEGA * (np.array(capture) - pressure))[steady].T)
    assert np.quantile(still, 0.9) > 0.2


def test_a_longer_step_moves_the_shift_as_much_as_it_says():
    checked = 0
    for tick, (_, _, _, gait, now) in enumerate(walking(4.0)):
        if gait.step is None or tick % 50:
            continue
        shift, along, _ = leg_swing(now, OMEGA, CARRIED, gait)
        # All that is to come goes along.
        for step in gait.coming:
            step.place = step.place + np.array([0.01, 0.0])
        moved = leg_swing(now, OMEGA, CARRIED, gait)[0] - shift
        assert moved == pytest.approx([0.01 * along, 0.0], abs=1e-9)
        checked += 1
    assert checked > 10


def test_who_stands_moves_nothing():
    gait = new_gait()
    gait.advance(0.1, [], PREVIEW)
    shift, along, arm = leg_swing(0.1, OMEGA, CARRIED, gait)
    assert not shift.any()
    assert not arm.any()
    assert along == 0.0


@pytest.mark.parametrize("name", ["servo20", "mannequin"])
def test_legs_carry_what_their_masses_do_that_turn_about_the_hip(name):
    robot = load_robot(ROBOTS / f"{name}.toml", human())
    model, feet = physics_model(robot, "free"), feet_of(robot)
    data = mujoco.MjData(model)
    robot.layout.place(robot.rest, data.qpos)
    mujoco.mj_forward(model, data)
    body, turns = WholeBody(robot, model, feet, 0.005, 15.0), [from_matrix(foot.axes.T) for foot in feet]
    body.plan.qpos[:] = data.qpos
    mujoco.mj_kinematics(model, body.plan)
    goal = data.qpos.copy()
    goal[2] -= robot.walk.bend * goal[2]
    places = [body.sole(body.plan, foot) for foot in range(2)]
    root = int(model.jnt_bodyid[0])
    body.settle(goal, places, turns, data.subtree_com[root, :2])
    before = body.plan.qpos.copy()
    carried = legs_carry(model, body, goal, places, turns, data.subtree_com[root, :2])
    assert np.array_equal(body.plan.qpos, before)
    data.qpos[:] = before
    mujoco.mj_forward(model, data)
    centre = data.subtree_com[root]
    # The leg turns about the hip, the other one about its sole; the rest moves so that the centre of mass stays.
    moves = np.zeros(model.nbody)
    moves[root:] = 1.0
    for foot in range(2):
        leg, sole = path_to(model, body.bodies[foot])[1:], places[foot][2]
        moves[leg] = (data.xipos[leg, 2] - sole) / (data.xpos[leg[0], 2] - sole)
    swings = np.zeros(model.nbody)
    leg = path_to(model, body.bodies[0])[1:]
    swings[leg] = 1.0 - moves[leg]
    back = model.body_mass @ swings / (model.body_mass @ moves)
    spins = np.einsum("bik,bk->bi", data.ximat.reshape(-1, 3, 3) ** 2, model.body_inertia)[leg, :2].sum(axis=0)
    turned = (model.body_mass * (centre[2] - data.xipos[:, 2])) @ (swings - back * moves)
    turned += spins.mean() / (data.xpos[leg[0], 2] - places[0][2])
    assert carried == pytest.approx(turned, rel=0.33)
