"""Robots without legs play the upper body where they stand: a torso on a stand, and arms on wheels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.clip import Clip
from controller.motion.rotations import from_rotation_vector, multiply, yaw
from controller.motion.skeleton import Pose
from sim.physics.playback import PhysicsPlayback
from sim.robots.calibrate import NO_LEGS
from sim.robots.carried_findings import carried_findings, segment_angles
from sim.robots.fidelity import carry
from sim.robots.limb_directions import LimbDirections
from sim.robots.robot import RobotLoader
from sim.robots.verdict import LEGS_LEFT_OUT, RobotVerdict
from simulated_bodies import bent_pose, human
from small_robots import ARM, calibrated

WAIST = '<joint name="waist" axis="0 0 1" range="-1.5 1.5"/><joint name="lean" axis="0 1 0" range="-.3 1"/>'
HEAD = '<body name="head" pos="0 0 .32"><joint name="nod" axis="0 1 0" range="-1 1"/><geom size=".06"/></body>'


def upper_body(base, waist):
    """A torso of 0.5 m with two arms of three hinges each, and a head, on some base."""
    yaws = '<body name="{s}_upper"><joint name="{s}_arm_yaw" axis="0 0 1" range="-2 2"/>'
    arms = "".join(
        ARM.replace('<body name="{s}_upper">', yaws).format(s=s, ay=y) for s, y in (("left", 0.13), ("right", -0.13))
    )
    trunk = f'{waist}<geom type="box" pos="0 0 .15" size=".05 .09 .14"/>{arms}{HEAD}'
    joints = ["waist", "lean"] * bool(waist) + ["nod"]
    joints += [f"{s}_{j}" for s in ("left", "right") for j in ("arm_pitch", "arm_roll", "arm_yaw", "elbow")]
    servos = "".join(f'<position name="{name}" joint="{name}" kp="40"/>' for name in joints)
    return (
        '<mujoco><compiler angle="radian" autolimits="true"/><worldbody>'
        f'<body name="base" pos="0 0 .4">{base}<body name="torso" pos="0 0 .1">{trunk}</body></body></worldbody>'
        f"<actuator>{servos}</actuator></mujoco>"
    )


STAND = '<geom type="cylinder" size=".1 .2" pos="0 0 -.2"/>'
WHEELS = '<freejoint/><geom type="box" size=".2 .15 .1" pos="0 0 -.2"/>' + "".join(
    f'<body name="{x}{y}" pos="{x} {y} -.3"><joint name="{x}{y}" axis="0 1 0"/>'
    '<geom type="cylinder" size=".1 .02" euler="1.5708 0 0"/></body>'
    for x in (-0.15, 0.15)
    for y in (-0.17, 0.17)
)
BODIES = {"on a stand": (STAND, WAIST), "on wheels": (WHEELS, "")}


@pytest.fixture(scope="module", params=BODIES)
def loader(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("upper")
    (folder / "upper.xml").write_text(upper_body(*BODIES[request.param]))
    found = calibrated(folder / "upper.xml")
    assert found.sound, found.doubts
    assert NO_LEGS in [doubt.words for doubt in found.doubts]
    (folder / "upper.toml").write_text(found.to_toml(folder))
    return RobotLoader(folder / "upper.toml")


def moved(seed, frames=24, turn=0.0, lean=0.0):
    """A human whose arms swing, and who walks away, turns and leans."""
    random = np.random.default_rng(seed)
    wave = 0.5 * np.sin(np.linspace(0.0, 3.0, frames))[:, None] * random.uniform(-1.0, 1.0, 3)
    poses = []
    for k, (pitch, out, bend) in enumerate(wave):
        arms = {"relb": (0.2, pitch, 0), "lelb": (-0.2 - abs(out), -pitch, 0)}
        pose = bent_pose(human(), **arms, rwri=(0, -0.8 - bend, 0), lwri=(0, -0.8 + bend, 0))
        heading = turn * k / frames
        about = multiply(yaw(heading), from_rotation_vector(np.array([0.0, lean, 0.0])))
        place = np.array([0.05 * k, 0.02 * k, pose.root_position[2]])
        poses.append(Pose(place, np.array(heading), multiply(about, pose.rotation)))
    return Clip(
        "moved", human(), 60.0, *(np.array([getattr(p, n) for p in poses]) for n in ("root_position", "rotation"))
    )


def findings(loader, clip):
    robot = loader(human(), None, 1.0 / clip.rate)
    carried = carry(clip, robot, SafetyEnvelope)
    directions = LimbDirections(robot.model, loader.file.parts, np.array(loader.file.root_rotation))
    found = carried_findings(robot, directions, carried, segment_angles(robot, directions, carried, clip.rate))
    return robot, carried, directions, found


@settings(max_examples=2)
@given(st.integers(0, 99), st.floats(-6.0, 6.0))
def test_arms_follow_where_the_human_faces_and_the_base_stays(loader, seed, turn):
    clip = moved(seed, turn=turn)
    robot, carried, directions, found = findings(loader, clip)
    assert np.ptp(carried.qpos[:, :7], axis=0).max() == 0.0
    assert carried.qpos[0, 2] == pytest.approx(robot.root_height)
    assert {segment.name for segment in directions.segments} == {
        f"{side}_{part}" for side in "lr" for part in ("upper_arm", "forearm")
    }
    assert directions.degrees(carried.qpos, carried.limbs).mean(axis=0).max() < 4.0
    verdict = RobotVerdict("moved", tuple(found), 1.0)
    assert verdict.words == f"plays, {LEGS_LEFT_OUT}"


def test_the_motion_of_legs_changes_nothing(loader):
    clip = moved(1)
    other = moved(1)
    for bone in ("rkne", "rank", "lkne", "lank"):
        at = 1 + clip.skeleton.index(bone)
        other.rotation[:, at] = multiply(from_rotation_vector(np.array([0.0, 0.7, 0.0])), other.rotation[:, at])
    (_, one, _, _), (_, two, _, _) = findings(loader, clip), findings(loader, other)
    assert one.played == pytest.approx(two.played, abs=1e-6)


def test_a_waist_takes_the_lean_that_it_can(loader):
    robot, carried, _, found = findings(loader, moved(1, lean=0.25))
    lean = {finding.check: finding for finding in found}[LEGS_LEFT_OUT].value
    if "lean" in robot.joints:
        assert carried.played[-1, robot.joints.index("lean")] == pytest.approx(0.25, abs=0.05)
        assert lean < 6.0
    else:
        assert lean == pytest.approx(np.degrees(0.25), abs=3.0)


@pytest.mark.thorough
def test_it_stands_in_physics(loader):
    clip = moved(2)
    robot = loader(human(), None, 0.005)
    stage, pose = PhysicsPlayback(robot, 0.005, "gantry"), Pose(clip.root_position[0], np.array(0.0), clip.rotation[0])
    for _ in range(200):
        stage.write(robot.retarget(pose), pose)
    assert np.abs(stage.measured() - robot.retarget(pose)).max() < 0.1
    assert stage.qpos[:3] == pytest.approx([0.0, 0.0, robot.root_height], abs=0.02)
