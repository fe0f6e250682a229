from copy import deepcopy
from dataclasses import replace
from itertools import islice

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.rotations import multiply, yaw
from controller.motion.skeleton import Pose
from motiondeck_base.errors import MotiondeckError
from sim.physics.loads import loads_of
from sim.physics.physics_model import feet_of
from sim.physics.played_motions import DT, PlayedMotion, endless_poses
from sim.physics.preflight.preflight import Preflight
from sim.physics.preflight.static_checks import ASTRAY, servo_lag
from sim.robots.robot import load_robot
from sim.robots.self_collision import SelfCollision
from sim.robots.verdict import SLOWEST, fastest_passing
from simulated_bodies import ROBOTS, bent_pose, human

SERVO20 = load_robot(ROBOTS / "servo20.toml", human())
MANNEQUIN = load_robot(ROBOTS / "mannequin.toml", human())
COLLISIONS = SelfCollision(SERVO20)


def preflight(robot, root="gantry", **options):
    return Preflight(robot, robot.limits, SafetyEnvelope, root, **options)


def swinging(rate, reach=0.6, robot=SERVO20, seconds=1.5, joint="l_shoulder_pitch"):
    """An arm that swings at `rate` rad/s of phase."""
    at = np.arange(0.0, seconds, DT)
    targets = np.tile(robot.rest, (len(at), 1))
    targets[:, robot.joints.index(joint)] += reach * np.sin(rate * at)
    pose = bent_pose(human())
    return PlayedMotion("swing", True, targets, (pose,) * len(at))


def checks(verdict):
    return {finding.check for finding in verdict.troubles}


def test_a_gentle_swing_passes_and_physics_agrees():
    verdict = preflight(SERVO20).judge(swinging(2.0), simulate=True)
    assert verdict.ok
    assert verdict.passes_at == 1.0
    assert {f.check: f.value for f in verdict.findings}["off target"] < ASTRAY


@pytest.mark.thorough
def test_a_swing_that_is_too_fast_fails_and_passes_at_the_speed_offered():
    judge = preflight(SERVO20)
    played = swinging(25.0, seconds=0.4)
    verdict = judge.judge(played, simulate=True)
    assert {"held back", "off target"} <= checks(verdict)
    assert "l_shoulder_pitch" in {finding.where for finding in verdict.troubles}
    assert verdict.passes_at is not None
    assert SLOWEST < verdict.passes_at < 1.0
    assert judge.judge(played, simulate=True, tempo=verdict.passes_at).ok


def test_no_tempo_mends_a_collision():
    targets = np.tile(SERVO20.rest, (20, 1))
    for name, angle in (("l_hip_roll", -0.8), ("r_hip_roll", 0.8)):
        targets[:, SERVO20.joints.index(name)] = angle
    played = PlayedMotion("crossed", True, targets, (bent_pose(human()),) * 20)
    verdict = preflight(SERVO20).judge(played, simulate=False)
    assert "self-collision" in checks(verdict)
    assert verdict.passes_at is None


def test_a_weak_servo_is_found_out_by_its_torque_and_its_heat():
    weak = replace(SERVO20, servo=type(SERVO20.servo)(torque=0.05, speed=4.8, current=2.3, hottest=30.0))
    verdict = preflight(weak).judge(swinging(2.0), simulate=False)
    assert {"torque", "heat in 10 min"} <= checks(verdict)


def test_a_torque_limit_of_the_model_file_is_judged_and_the_joint_named():
    model = deepcopy(SERVO20.model)
    shoulder = SERVO20.joints.index("l_shoulder_roll")
    model.actuator_forcelimited[:], model.actuator_forcerange[:] = 1, (-50.0, 50.0)
    model.actuator_forcerange[shoulder] = (-0.05, 0.05)
    weak = replace(SERVO20, servo=None, model=model)
    targets = np.tile(weak.rest, (40, 1))
    targets[:, shoulder] += 1.2  # an arm held out
    played = PlayedMotion("hold", True, targets, (bent_pose(human()),) * 40)
    verdict = preflight(weak).judge(played, simulate=False)
    assert verdict.passes_at is None
    (obstacle,) = verdict.obstacles
    assert (obstacle.check, obstacle.where) == ("torque", "l_shoulder_roll")
    assert obstacle.value > 100.0 == obstacle.limit
    assert obstacle.cause.endswith("N m to carry its limb and has 0.05")
    needed = float(obstacle.cause.split()[2])
    assert obstacle.value == pytest.approx(100.0 * needed / 0.05, rel=0.02)


def test_a_soft_servo_is_named_as_the_cause():
    spec = SERVO20.spec.copy()
    servo = next(one for one in spec.actuators if one.name == "l_shoulder_roll")
    servo.set_to_position(kp=0.1, kv=0.01)
    soft = replace(SERVO20, servo=None, spec=spec, model=spec.compile())
    targets = np.tile(soft.rest, (40, 1))
    targets[:, soft.joints.index("l_shoulder_roll")] += 1.2
    played = PlayedMotion("hold", True, targets, (bent_pose(human()),) * 40)
    (obstacle,) = preflight(soft).judge(played, simulate=True).obstacles
    assert (obstacle.check, obstacle.where) == ("off target", "l_shoulder_roll")
    assert "soft" in obstacle.cause
    assert "0.1 N m/rad" in obstacle.cause


def test_joints_that_a_rig_does_not_let_so_far_are_out_of_reach():
    narrow = replace(SERVO20.limits, upper=np.minimum(SERVO20.limits.upper, 0.3))
    verdict = Preflight(SERVO20, narrow, SafetyEnvelope).judge(swinging(1.0, seconds=3.0), simulate=False)
    assert "out of reach" in checks(verdict)


def test_what_is_out_of_reach_for_an_instant_only_is_let_pass():
    played, found = swinging(0.0), {}
    upper = SERVO20.limits.upper.copy()
    upper[3] = SERVO20.rest[3] + 0.01
    limits = replace(SERVO20.limits, upper=upper)
    for samples in (4, 6):
        played.targets[20 : 20 + samples, 3] = upper[3] + 0.3
        found[samples] = Preflight(SERVO20, limits, SafetyEnvelope).judge(played, simulate=False).findings[1]
    assert found[4].ok
    assert found[6].value == pytest.approx(0.3)


def test_poses_go_evenly_from_tick_to_tick():
    from sim.physics.played_motions import poses_at
    from sim.physics.preflight.static_checks import TICK

    turns = 0.02 * np.arange(9)
    poses = tuple(Pose(np.array([0.01 * k, 0.0, 1.0]), turns[k], yaw(turns[k])[None]) for k in range(9))
    played = poses_at(PlayedMotion("go", False, np.zeros((9, 1)), poses), 0.7, TICK)
    x = np.array([pose.root_position[0] for pose in played])
    assert np.allclose(np.diff(x), 0.7 * TICK)
    assert np.allclose([pose.rotation[0] for pose in played], [yaw(float(pose.heading)) for pose in played], atol=1e-6)


@pytest.mark.parametrize("robot", [SERVO20, MANNEQUIN], ids=["servo20", "mannequin"])
def test_on_the_floor_the_legs_carry_what_a_gantry_would(robot):
    played = PlayedMotion("stand", True, np.tile(robot.rest, (4, 1)), (bent_pose(human()),) * 4)
    collisions = SelfCollision(robot)
    hanging = loads_of(robot, played, free=False, collisions=collisions, feet=feet_of(robot))
    standing = loads_of(robot, played, free=True, collisions=collisions, feet=feet_of(robot))
    assert np.allclose(hanging.inertia, 0.0, atol=1e-9)
    knees = [j for j, name in enumerate(robot.joints) if "kne" in name or "ank" in name]
    assert np.abs(standing.gravity[:, knees]).max() > 2.0 * np.abs(hanging.gravity[:, knees]).max()
    if robot is SERVO20:  # the mannequin rests on its heels
        assert standing.balance().min() > 0.0


def test_torque_grows_with_the_square_of_the_tempo():
    loads = loads_of(SERVO20, swinging(4.0), free=False, collisions=COLLISIONS, feet=feet_of(SERVO20))
    moved = [loads.torque(tempo) - loads.torque(0.0) - tempo * loads.damping for tempo in (1.0, 2.0)]
    assert np.allclose(moved[1], 4.0 * moved[0])


def test_a_robot_that_leans_too_far_falls_in_both_ways():
    pose = bent_pose(human(), rkne=(0.0, -0.5, 0.0), lkne=(0.0, -0.5, 0.0))
    targets = np.clip(SERVO20.retarget(pose), SERVO20.limits.lower, SERVO20.limits.upper)
    played = PlayedMotion("lean", True, np.tile(targets, (60, 1)), (pose,) * 60)
    verdict = preflight(SERVO20, "free").judge(played, simulate=True)
    assert {"off balance", "falls"} <= checks(verdict)
    assert verdict.passes_at is None


@pytest.mark.thorough
@pytest.mark.parametrize(
    "rotation", [(1.0, 0.0, 0.0, 0.0), (np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0)], ids=["up", "lying"]
)
def test_who_stands_still_or_is_down_already_cannot_fall(rotation):
    upright = bent_pose(human())
    pose = Pose(upright.root_position, upright.heading, multiply(np.array(rotation), upright.rotation))
    played = PlayedMotion("still", True, np.tile(SERVO20.rest, (40, 1)), (pose,) * 40)
    judge = preflight(SERVO20, "free")
    loads = loads_of(SERVO20, played, free=False, collisions=COLLISIONS, feet=feet_of(SERVO20))
    assert {f.check: f.ok for f in judge.static.standing(loads, 1.0)}["off balance"]
    assert {f.check: f.ok for f in judge.simulated(played, 1.0)}["falls"]


def test_a_robot_that_walks_is_judged_by_how_it_stands_and_how_far_it_goes(monkeypatch):
    monkeypatch.setattr("sim.physics.preflight.preflight.FALL_SECONDS", 1.0)
    pose = bent_pose(human())
    played = PlayedMotion("still", True, np.tile(SERVO20.rest, (40, 1)), (pose,) * 40)
    found = {f.check: f for f in preflight(SERVO20, "free", walk=True).simulated(played, 1.0)}
    assert found["falls"].value == 1.0
    assert 0.0 < found["capture point off"].value < 20.0
    assert found["robot goes"].value < 0.02
    weak = replace(SERVO20, servo=msgspec.structs.replace(SERVO20.servo, torque=0.1))
    with pytest.raises(MotiondeckError, match="cannot stand on one leg"):
        list(preflight(weak, "free", walk=True).simulated(played, 1.0))


def test_a_robot_that_falls_while_it_is_to_walk_is_told_so_with_the_time(monkeypatch):
    monkeypatch.setattr("sim.physics.preflight.preflight.FALL_SECONDS", 4.0)
    played = PlayedMotion("still", True, np.tile(SERVO20.rest, (40, 1)), (bent_pose(human()),) * 40)
    late = replace(SERVO20, servo=msgspec.structs.replace(SERVO20.servo, latency=0.3))
    found = {f.check: f for f in preflight(late, "free", walk=True).simulated(played, 1.0)}
    assert not found["falls"].ok
    assert 0.5 < found["falls"].value < found["falls"].limit
    assert not found["capture point off"].ok


def test_round_after_round_a_loop_goes_on_where_it_was():
    angle = np.linspace(0.0, 0.5, 51)
    circle = [
        Pose(np.array([np.sin(a), 1.0 - np.cos(a), 0.9]), np.array(a), np.array([[np.cos(a / 2), 0, 0, np.sin(a / 2)]]))
        for a in angle[:-1]
    ]
    poses = list(islice(endless_poses(circle), 300))
    for k in (49, 50, 120, 299):
        a = 0.01 * k
        assert np.allclose(poses[k].root_position, [np.sin(a), 1.0 - np.cos(a), 0.9], atol=1e-3)
        assert np.allclose(poses[k].rotation, [[np.cos(a / 2), 0, 0, np.sin(a / 2)]], atol=1e-9)


@given(st.floats(SLOWEST, 3.0), st.floats(0.11, 3.0), st.floats(1.01, 1.3))
def test_the_fastest_tempo_that_passes_is_found(border, tempo, within):
    tried = []

    def passes(at):
        tried.append(at)
        return at <= border

    found = fastest_passing(passes, tempo, within)
    scanned = max(at for at in np.geomspace(SLOWEST, tempo, 500) if at <= border)
    assert found is not None
    assert scanned / within * 0.99 <= found <= border
    assert all(SLOWEST <= at <= tempo for at in tried)
    assert len(tried) <= 2 + np.log2(np.log(30.0) / np.log(within))


@given(st.lists(st.booleans(), min_size=2, max_size=40))
def test_of_tempos_that_pass_with_gaps_between_them_one_at_an_upper_end_is_found(passing):
    def passes(at):
        return passing[min(int((at - SLOWEST) / (1.0 - SLOWEST) * len(passing)), len(passing) - 1)]

    found = fastest_passing(passes, 1.0, 1.02)
    if found is None:
        assert not passing[0]
    else:
        assert passes(found)
        assert found * 1.02 >= 1.0 or not all(passes(at) for at in np.linspace(found, found * 1.02, 50))


def test_where_nothing_passes_none_is_offered():
    assert fastest_passing(lambda tempo: False, 1.0, 1.02) is None


def test_a_play_that_is_astray_ends_early_and_with_the_same_verdict():
    judge = preflight(SERVO20)
    for rate in (2.0, 25.0):
        played = swinging(rate, seconds=0.8)
        whole, _, _ = judge.play(played, 1.0, "gantry")
        cut, _, _ = judge.play(played, 1.0, "gantry", until=ASTRAY)
        assert (cut > ASTRAY) == (whole > ASTRAY)
        assert cut < whole if rate == 25.0 else cut == whole


@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=30))
def test_a_servo_lags_only_by_what_it_needs_beyond_its_voltage(drive):
    lag = servo_lag(np.array(drive)[:, None], 0.01)
    assert lag[0] >= 0.0
    assert lag[0] <= 0.01 * sum(max(d - 1.0, 0.0) for d in drive) + 1e-12
    if max(drive) <= 1.0:
        assert lag[0] == 0.0


def test_the_rest_pose_collides_with_nothing():
    qpos = np.zeros(SERVO20.model.nq)
    SERVO20.place(SERVO20.rest, bent_pose(human()), qpos)
    assert COLLISIONS(qpos) == (0.0, "")


def test_what_was_judged_before_changes_neither_verdicts_nor_how_motions_are_sampled():
    """The slope of standing feet in one motion must not affect another."""

    def judged(first):
        robot = load_robot(ROBOTS / "servo20.toml", human())
        judge = preflight(robot)
        for played in first:
            judge.judge(played, simulate=False)
        retarget = deepcopy(robot.retarget, {id(robot.model): robot.model})
        stands = (bent_pose(human()),) * 20
        targets = np.array([np.clip(retarget(pose), robot.limits.lower, robot.limits.upper) for pose in stands])
        return targets, judge.judge(PlayedMotion("stand", True, targets, stands), simulate=True)

    tiptoe = bent_pose(human(), lfoo=(0.0, 0.6, 0.0), rfoo=(0.0, 0.6, 0.0))
    targets, verdict = judged([])
    same, again = judged([PlayedMotion("tiptoe", True, np.tile(SERVO20.rest, (100, 1)), (tiptoe,) * 100)])
    assert np.array_equal(targets, same)
    assert verdict == again
