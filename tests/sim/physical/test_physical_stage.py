"""Tests of motions on a robot's own feet, with a post on a narrow foot that swings a heavy arm."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.motion.clip import Clip
from controller.motion.formats.writing import write_clip
from controller.motion.skeleton import Pose
from motiondeck_base.errors import FileFormatError, MotiondeckError
from sim.models.joint_layout import JointLayout
from sim.models.scenery import add_gantry, set_stage
from sim.physical.course import KNOT, STEP, Batch, played
from sim.physical.feedback_fit import fitted_feedback
from sim.physical.files import stood_files
from sim.physical.search import Sampling, Search
from sim.physical.stage import RATE, PhysicalStage
from sim.physics.feedback import HOLD, MOST, SUFFIX, Feedback, PlanFollower
from sim.physics.playback import PhysicsPlayback
from sim.robots.joint_motion import JointMotion
from sim.robots.robot import Robot
from simulated_bodies import bent_pose, human
from small_robots import calibrated, humanoid

POST = """<mujoco><compiler angle="radian"/><option timestep="0.0025" integrator="implicitfast"/><worldbody>
  <body name="post" pos="0 0 0.02"><freejoint/><geom type="box" size=".1 .1 .02" mass="1"/>
    <body name="arm" pos="0 0 .3"><joint name="swing" axis="0 1 0" range="-2 2" damping=".1" armature=".01"/>
      <geom type="capsule" fromto="0 0 0 0 0 .25" size=".02" mass=".6"/></body>
  </body></worldbody>
  <actuator><position name="swing" joint="swing" kp="80" kv="4" forcerange="-30 30"/></actuator></mujoco>"""


def post():
    spec = mujoco.MjSpec.from_string(POST)
    set_stage(spec, 0.3)
    add_gantry(spec, spec.body("post"))
    model = spec.compile()
    layout, rest = JointLayout.of(model), np.zeros(1)
    limits = JointLimits(*(np.full(1, value) for value in (-2.0, 2.0, 10.0, 100.0, 1000.0)))
    return Robot("post", spec, model, layout, limits, rest, rest, lambda pose: rest, 1.0)


MODEL = post().model
BLOWS = -0.5, 1.0  # rad/s
BATCH = Batch(MODEL, 1)


def motion(swing, height=0.02, seconds=0.7):
    count = round(seconds * RATE) + 1
    angles = np.full((count, 1), 0.0) + (swing(np.arange(count) * KNOT)[:, None] if swing else 0.0)
    qpos = np.hstack([np.tile([0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0], (count, 1)), angles])
    return JointMotion("swing", ("swing",), RATE, angles, qpos)


def wave(seconds):
    return 1.15 * np.sin(2.0 * np.pi * 1.2 * seconds)


@pytest.fixture(scope="module")
def stage():
    return PhysicalStage(post(), motion(wave), threads=1)


@pytest.fixture(scope="module")
def found(stage):
    return stage.search()


@pytest.fixture(scope="module")
def hanging():
    """A post that is carried in the air, and falls."""
    return PhysicalStage(post(), motion(None, height=1.0), threads=1)


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=14, max_size=14), st.lists(st.floats(-1.0, 1.0), min_size=14, max_size=14)
)
@settings(max_examples=30)
def test_a_difference_is_what_a_state_was_moved_by(first, second):
    start = BATCH.moved(np.concatenate([MODEL.qpos0, np.zeros(MODEL.nv)]), np.array(first))
    assert BATCH.difference(start, BATCH.moved(start, np.array(second))) == pytest.approx(np.array(second), abs=1e-9)


def test_a_batch_is_simulated_as_mujoco_steps(stage):
    course, data = stage.course, mujoco.MjData(stage.batch.model)
    found = played(stage.batch, course, course.states[0], 0, np.full((2, 3, 1), 0.1))
    data.qpos[:], data.qvel[:] = np.split(course.states[0], [len(data.qpos)])
    for control in course.controls[:3].reshape(-1, 1):
        data.ctrl[:] = control + 0.1
        mujoco.mj_step(stage.batch.model, data)
    assert stage.batch.model.opt.timestep == STEP
    assert found[1, -1] == pytest.approx(np.concatenate([data.qpos, data.qvel]), abs=1e-9)


def test_fits_foretell_what_a_small_change_does(hanging):
    batch, course = hanging.batch, hanging.course
    search, changes = Search(batch, course), np.random.default_rng(0).normal(0.0, 1e-3, 15)
    states = played(batch, course, course.states[0], 0, np.zeros((1, 4, 1)))[0]
    fits = search._fitted(states, np.zeros((4, 1)), 0)
    other = played(batch, course, batch.moved(states[3], changes[:14]), 3, changes[None, None, 14:])[0, 1]
    seen = batch.difference(states[4], other)
    assert np.linalg.norm(fits[3] @ changes - seen) < 0.05 * np.linalg.norm(seen)


def test_the_search_stands_where_the_targets_alone_fall(stage, found):
    assert stage.plain() is not None
    assert found.fell_s is None
    assert len(found.motion) == len(stage.course.states)
    assert found.pose_deg < 20.0
    assert np.abs(found.motion.angles).max() > 0.3  # it still swings


@pytest.mark.thorough
def test_samples_stand_too_and_are_the_same_again(stage):
    found, again = (stage.search(planner=Sampling) for _ in range(2))
    assert found.fell_s is None
    assert 0.0 < found.pose_deg < 20.0
    assert np.abs(found.motion.angles).max() > 0.3
    assert np.array_equal(found.motion.qpos, again.motion.qpos)


def test_what_it_found_is_what_the_targets_do(stage, found):
    course = stage.course
    start = np.concatenate([found.motion.qpos[0], course.states[0, 8:]])
    again = played(stage.batch, course, start, 0, (found.targets - course.targets[: len(found.targets)])[None, :-1])
    assert again[0, :, :8] == pytest.approx(found.motion.qpos, abs=1e-6)


class Still(Search):
    def improve(self, state, now, ahead):
        pass


def test_without_a_plan_it_falls_as_with_the_targets_alone(stage):
    assert stage.search(planner=Still).fell_s == pytest.approx(stage.plain(), abs=0.06)


def test_the_first_planner_that_stands_is_taken_else_the_longest(stage, found):
    class Leans(Search):
        def improve(self, state, now, ahead):
            self.offsets[:] = 1.5

    first, second = (stage.search(planner=planner) for planner in (Still, Leans))
    assert len(stage.best(planners=(Still, Search, None)).motion) == len(found.motion)
    assert None not in (first.fell_s, second.fell_s)
    assert len(first.motion) != len(second.motion)
    longest = max(len(first.motion), len(second.motion))
    assert {len(stage.best(planners=order).motion) for order in ((Still, Leans), (Leans, Still))} == {longest}


def test_a_fall_ends_the_motion_at_its_second(hanging):
    found = hanging.search()
    assert found.fell_s == pytest.approx(np.sqrt(2.0 * 0.5 / 9.81), abs=0.1)
    assert (len(found.motion) - 1) * KNOT >= found.fell_s
    assert len(found.motion) < len(hanging.course.states)


@pytest.mark.thorough
def test_a_recording_becomes_a_training_file_of_what_the_robot_did(tmp_path):
    (tmp_path / "small.xml").write_text(humanoid())
    (tmp_path / "small.toml").write_text(calibrated(tmp_path / "small.xml").to_toml(tmp_path))
    pose = bent_pose(human(), relb=(1.3, 0, 0), lelb=(-1.3, 0, 0))
    place, turn = (np.array([part] * 31) for part in (pose.root_position, pose.rotation))
    write_clip(Clip("stand", human(), 60.0, place, turn), tmp_path / "stand.bvh")
    robot, out = tmp_path / "small.toml", tmp_path / "out"
    stand, broken = stood_files(robot, [tmp_path / "stand.bvh", tmp_path / "none.bvh"], out)
    assert "none.bvh" in str(broken.error)
    assert stand.file == "stand.npz"
    assert (stand.seconds, stand.fell_s) == (pytest.approx(0.5), None)
    written = np.load(out / "stand.npz")
    assert written["fps"] == RATE
    assert written["joint_pos"].shape == (26, 18)


def playback_of(motion, feedback, blow=0.0):
    """A motion as it is played, with a timestep that the search has not; a blow at 0.1 s changes its spin, rad/s."""
    playback, turned = PhysicsPlayback(post(), STEP, "free", feedback=feedback), np.array([[1.0, 0.0, 0.0, 0.0]])
    pose = Pose(np.array([0.0, 0.0, 0.02]), np.array(0.0), turned)
    for tick in range(round((len(motion) - 1) / RATE / STEP)):
        playback.data.qvel[4] += blow if tick == round(0.1 / STEP) else 0.0
        playback.write(motion.angles[round(tick * STEP * RATE)], pose)
    return playback


@pytest.mark.thorough
def test_feedback_stands_blows_that_targets_and_controls_alone_do_not(stage, found):
    feedback, share = fitted_feedback(stage, found)
    alone = replace(feedback, gains=0.0 * feedback.gains)
    for blow in BLOWS:
        fell = [playback_of(found.motion, one, blow).fell_s for one in (feedback, alone, None)]
        assert (fell[0], None in fell[1:]) == (None, False)
    assert 0.5 < share <= 1.0
    assert np.array_equal(fitted_feedback(stage, found)[0].gains, feedback.gains)


@pytest.fixture
def feedback(stage):
    """Feedback that raises the arm when the post is too high."""
    course, gains = stage.course, np.zeros((7, 1, 12))
    gains[:, 0, 0] = 10.0
    return Feedback(("swing",), course.controls[:-1].reshape(-1, 1), course.states[:-1:5], gains)


def test_a_follower_begins_at_its_speed_and_changes_controls_once_a_block_and_by_so_much_at_most(feedback):
    now, data = 0.0, mujoco.MjData(MODEL)
    follower = PlanFollower(post(), feedback, lambda: now)
    follower.start(data)

    def goal(time, rise):
        nonlocal now
        now, at = time, int(time / (HOLD * STEP))
        data.qpos[2] = feedback.states[at, 2] + rise
        wanted = np.concatenate([np.zeros(7), feedback.states[at, 7:8]])  # as it is played
        follower.adjust(data, wanted, 0.0)
        assert wanted[2:7] == pytest.approx(feedback.states[at, 2:7])  # it falls beside the plan
        return wanted[7] - feedback.controls[round(time / STEP), 0]

    assert goal(0.0, 0.5) == pytest.approx(0.0)  # the motion has not begun: it is put in its place
    assert np.concatenate([data.qpos, data.qvel]) == pytest.approx(feedback.states[0])
    assert [goal(0.1, 0.01), goal(0.12, 0.02), goal(0.2, 0.02)] == pytest.approx([0.1, 0.1, 0.2])
    assert goal(0.3, 0.2) == pytest.approx(MOST)
    assert goal(0.4, -0.2) == pytest.approx(-MOST)


def test_another_motion_is_played_as_it_is(feedback, found):
    other = replace(found.motion, angles=found.motion.angles + 0.5)
    goals = [playback_of(other, one).data.ctrl[0] for one in (feedback, None)]
    assert goals[0] == goals[1]


def test_feedback_is_read_for_its_joints_alone_and_a_broken_file_is_named(feedback, tmp_path):
    robot, motion = post(), tmp_path / "swing.npz"
    assert Feedback.beside(motion, robot) is None
    feedback.save(motion.with_suffix(SUFFIX))
    again = Feedback.beside(motion, robot)
    for name in ("controls", "states", "gains"):
        assert getattr(again, name) == pytest.approx(getattr(feedback, name), abs=1e-6)
    assert Feedback.beside(motion, replace(robot, layout=replace(robot.layout, joints=("other",)))) is None
    for broken in ({"gains": feedback.gains[1:]}, {"controls": np.full_like(feedback.controls, np.nan)}):
        replace(feedback, **broken).save(motion.with_suffix(SUFFIX))
        with pytest.raises(FileFormatError, match=r"swing\.feedback.*--physical"):
            Feedback.beside(motion, robot)


def test_one_frame_and_another_rate_are_refused(tmp_path):
    with pytest.raises(MotiondeckError, match="one frame"):
        PhysicalStage(post(), motion(None, seconds=0.0), threads=1)
    with pytest.raises(MotiondeckError, match="30 Hz"):
        list(stood_files(tmp_path / "r.toml", [], tmp_path, "csv"))
