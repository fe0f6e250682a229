from dataclasses import replace

import mujoco
import numpy as np
import pytest

from controller.motion.rotations import from_rotation_vector, multiply
from sim.physics.physics_model import physics_model
from sim.physics.playback import PhysicsPlayback
from sim.physics.recovery import SOFT, TRIES, Phase, Recovery
from sim.robots.robot import Rise, load_robot
from simulated_bodies import ROBOTS, bent_pose, human

DT = 0.005
SERVO20 = load_robot(ROBOTS / "servo20.toml", human())
ROWS = ((0.1, SERVO20.tucked),)


class Lying:
    """A robot at rest in a given place, and the goals of its joints."""

    def __init__(self, rise=SERVO20.rise):
        self.robot = replace(SERVO20, rise=rise)
        self.model = physics_model(self.robot, "free")
        self.data = mujoco.MjData(self.model)
        self.recovery = Recovery(self.robot, self.model, DT)
        self.falling = False  # on demand
        self.goal = self.model.qpos0.copy()

    def put(self, turn, height):
        self.data.qpos[3:7] = multiply(from_rotation_vector(np.array(turn)), self.model.qpos0[3:7])
        self.data.qpos[2] = height

    def go_on(self, seconds, *, held=False):
        """The phases that it goes through, and the goals of its joints, shape (T, J)."""
        phases, goals = [], []
        for _ in range(round(seconds / DT)):
            before, played = self.goal.copy(), self.model.qpos0.copy()
            self.goal[:] = played
            self.recovery.adjust(self.data, before, self.goal, falling=self.falling, held=held)
            phases.append(self.recovery.phase)
            goals.append(self.goal[SERVO20.layout.hinge_qpos].copy())
        return phases, np.array(goals)


def shoulder_of(rows):
    return rows[0][1][SERVO20.joints.index("r_shoulder_pitch")]


@pytest.mark.parametrize(("turn", "side"), [((0, 1.5, 0), "front"), ((0, -1.5, 0), "back"), ((1.4, 0.1, 0), "front")])
def test_it_gets_up_by_the_side_on_which_it_lies(turn, side):
    body = Lying()
    body.put(turn, 0.05)
    body.falling = True
    phases, _ = body.go_on(1.2)
    assert phases[0] is Phase.FALLS
    assert phases[-1] is Phase.RISES
    body.go_on(1.2)
    seconds, joints = getattr(SERVO20.rise, side)[0]
    _, goals = body.go_on(seconds)
    # On its way the first posture is passed.
    assert np.abs(goals - joints).max(axis=1).min() < 0.1


def test_no_joint_jumps_from_one_phase_to_the_next():
    body = Lying()
    body.put((0.0, 1.5, 0.0), 0.05)
    body.falling = True
    _, falling = body.go_on(7.0)
    body.put((0.0, 0.0, 0.0), 0.24)
    body.falling = False
    phases, standing = body.go_on(3.0)
    assert Phase.JOINS in phases
    assert phases[-1] is Phase.PLAYS
    goals = np.concatenate([falling, standing])
    assert np.abs(np.diff(goals, axis=0)).max() < 5.5 * DT


def test_who_stands_gets_its_strength_back_and_its_legs_begin_anew_once():
    body = Lying(Rise(ROWS, ()))
    gain = body.model.actuator_gainprm[:, 0].copy()
    body.put((0.0, 0.0, 0.0), 0.24)
    body.falling = True
    body.go_on(0.3)
    assert np.allclose(body.model.actuator_gainprm[:, 0], SOFT * gain)
    body.falling = False
    began = 0
    for _ in range(round(3.5 / DT)):
        body.go_on(DT)
        began += body.recovery.stands
    assert began == 1
    assert body.recovery.phase is Phase.PLAYS
    assert body.recovery.rises == 1
    assert np.allclose(body.model.actuator_gainprm[:, 0], gain)


def test_who_never_gets_on_its_feet_lies_straight_at_last():
    body = Lying(Rise(ROWS, ROWS))
    body.put((0.0, 1.5, 0.0), 0.05)
    body.falling = True
    phases, goals = body.go_on(4.0 + 1.5 * (1 + TRIES))
    assert phases[-1] is Phase.LIES
    assert np.allclose(goals[-1], SERVO20.rest)
    assert body.recovery.gave_up


def test_a_robot_that_cannot_get_up_stays_as_it_fell():
    body = Lying(None)
    body.put((0.0, 1.5, 0.0), 0.05)
    body.falling = True
    phases, goals = body.go_on(4.0)
    assert set(phases) == {Phase.FALLS}
    assert np.allclose(goals[-1], SERVO20.tucked)


def test_who_is_held_does_not_get_up():
    body = Lying()
    body.put((0.0, 1.5, 0.0), 0.05)
    body.falling = True
    phases, goals = body.go_on(4.0, held=True)
    assert set(phases) == {Phase.FALLS}
    assert np.allclose(goals[-1], SERVO20.tucked)


def test_who_is_held_on_its_way_up_stays_there_and_then_goes_on():
    body = Lying(Rise(ROWS, ()))
    body.put((0.0, 1.5, 0.0), 0.05)
    body.falling = True
    _, rising = body.go_on(1.8)
    assert body.recovery.phase is Phase.RISES
    _, goals = body.go_on(3.0, held=True)
    assert np.array_equal(goals, np.tile(rising[-1], (len(goals), 1)))
    body.put((0.0, 0.0, 0.0), 0.24)
    body.falling = False
    while body.recovery.phase is not Phase.JOINS:
        body.go_on(DT)
    _, joining = body.go_on(0.2)
    _, goals = body.go_on(1.0, held=True)
    assert np.allclose(goals, joining[-1])
    assert body.go_on(1.0)[0][-1] is Phase.PLAYS


def test_it_gets_up_from_where_its_joints_are_and_not_from_where_they_were_to_be():
    """A slow robot that has not come to the tucked pose would jump to it."""
    limits = replace(SERVO20.limits, velocity=np.full(len(SERVO20.joints), 0.05))
    body = Lying()
    body.robot = replace(body.robot, limits=limits)
    body.recovery = Recovery(body.robot, body.model, DT)
    body.put((0.0, 1.5, 0.0), 0.05)
    body.falling = True
    phases, goals = body.go_on(2.0)
    assert phases[-1] is Phase.RISES
    assert np.abs(np.diff(goals, axis=0)).max() < 5.5 * DT


def test_a_body_that_still_moves_does_not_get_up():
    body = Lying()
    body.put((0.0, 1.5, 0.0), 0.05)
    body.data.qvel[0] = 0.5
    body.falling = True
    assert set(body.go_on(2.0)[0]) == {Phase.FALLS}


def test_a_body_that_never_comes_to_rest_gets_up_all_the_same():
    """It stayed where it was for good, and said nothing."""
    body = Lying(Rise(ROWS, ROWS))
    body.put((0.0, 1.5, 0.0), 0.05)
    body.data.qvel[0] = 0.5
    body.falling = True
    phases, _ = body.go_on(7.0)
    assert phases[-1] is Phase.RISES
    assert body.go_on(8.0 * (1 + TRIES))[0][-1] is Phase.LIES


def test_what_one_stage_does_to_its_servos_the_next_does_not_feel():
    """A soft guard, and torque limits at the speed of the last step, were handed on from trial to trial."""
    compiled = physics_model(SERVO20, "free")
    gain, force = compiled.actuator_gainprm.copy(), compiled.actuator_forcerange.copy()
    first = PhysicsPlayback(SERVO20, DT, "free", walk=True, compiled=compiled)
    for tick in range(250):
        first.push(np.array([40.0, 0.0, 0.0]) * (40 <= tick < 60))
        first.write(SERVO20.rest, bent_pose(human()))
    assert first.near_falls
    assert np.array_equal(compiled.actuator_gainprm, gain)
    assert np.array_equal(compiled.actuator_forcerange, force)


@pytest.mark.thorough
@pytest.mark.parametrize("force", [(40.0, 0.0, 0.0), (-40.0, 0.0, 0.0), (0.0, 40.0, 0.0)])
def test_servo20_gets_up_from_a_fall_to_any_side_and_stands(force):
    stage = PhysicsPlayback(SERVO20, DT, "free", walk=True)
    pose = bent_pose(human())
    fallen = []
    for tick in range(round(17.0 / DT)):
        stage.push(np.array(force) * (40 <= tick < 60))
        stage.write(SERVO20.rest, pose)
        fallen.append(stage.fallen)
    assert any(fallen)
    assert not stage.fallen
    assert stage.report()["got_up"] == 1
    assert stage.qpos[2] > 0.9 * 0.24 * 0.88
    assert stage.travel is not None
