"""Tests of motions for training: each format is read back as its readers do, with MuJoCo's kinematics of the model."""

import mujoco
import numpy as np
import pytest

from controller.motion.clip import Clip
from motiondeck_base.errors import FileFormatError, UnknownNameError
from motiondeck_base.shipped import find_robot
from sim.robots.joint_motion import retargeted
from sim.robots.robot import load_robot
from sim.robots.training_files import format_named, write_training_file
from simulated_bodies import human, smooth_poses
from small_robots import SERVOS, calibrated, humanoid

RATE = 50.0
LID = '<body name="lid" pos="0 0 0.3"><joint name="lid" axis="0 1 0"/><geom size="0.02"/></body>'
FOLLOWS = '<equality><joint joint1="lid" joint2="left_knee" polycoef="0.1 -0.5 0 0 0"/></equality>'


def swinging(count=30):
    poses = smooth_poses(human(), np.random.default_rng(3), count, reach=0.2)
    path = np.array([pose.root_position for pose in poses]) + np.arange(count)[:, None] * [0.01, 0.002, 0.0]
    return Clip("swing", human(), RATE, path, np.array([pose.rotation for pose in poses]))


def loaded(folder, text):
    """The model as its file has it, and the robot that plays it."""
    (folder / "small.xml").write_text(text)
    file = folder / "small.toml"
    file.write_text(calibrated(folder / "small.xml").to_toml(folder))
    return mujoco.MjModel.from_xml_path(str(folder / "small.xml")), load_robot(file, human(), dt=1.0 / RATE)


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """A robot with a joint that follows another, and its motion."""
    model, robot = loaded(tmp_path_factory.mktemp("robot"), humanoid(trunk=LID, extra=FOLLOWS, servos=[*SERVOS, "lid"]))
    return model, robot, retargeted(robot, swinging())


def written(tmp_path, moved, format):
    _, robot, motion = moved
    path = tmp_path / "motion.npz"
    write_training_file(path, robot.model, motion.qpos, RATE, format)
    return path


def bodies(model, qpos):
    """Where all bodies but the world are and how they are turned, as mj_forward has it, frame by frame."""
    data, places, turns = mujoco.MjData(model), [], []
    for q in qpos:
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        places.append(data.xpos[1:].copy())
        turns.append(data.xquat[1:].copy())
    return np.array(places), np.array(turns)


def played(moved):
    """Where the bodies are while the robot plays; beside its own it has a gantry, the last one."""
    model, robot, motion = moved
    places, turns = bodies(robot.model, motion.qpos)
    return places[:, : model.nbody - 1], turns[:, : model.nbody - 1]


def test_mjlab_reads_positions_that_its_joints_give(tmp_path, moved):
    model, (places, turns) = moved[0], played(moved)
    read = np.load(written(tmp_path, moved, "mjlab"))
    assert set(read) == {
        "fps", "joint_pos", "joint_vel", "body_pos_w", "body_quat_w", "body_lin_vel_w", "body_ang_vel_w"
    }  # fmt: skip
    assert read["fps"] == [RATE]
    assert read["joint_pos"].shape == (30, model.njnt - 1)
    qpos = np.concatenate([read["body_pos_w"][:, 0], read["body_quat_w"][:, 0], read["joint_pos"]], axis=1)
    there, turned = bodies(model, qpos)
    assert np.abs(there - read["body_pos_w"]).max() < 1e-6
    assert np.abs(np.abs(np.einsum("tbi,tbi->tb", turned, read["body_quat_w"])) - 1.0).max() < 1e-6
    assert np.abs(places - read["body_pos_w"]).max() < 1e-6
    assert np.abs(np.abs(np.einsum("tbi,tbi->tb", turns, read["body_quat_w"])) - 1.0).max() < 1e-6
    follower, leader = (model.joint(name).qposadr[0] - 7 for name in ("lid", "left_knee"))
    assert read["joint_pos"][:, follower] == pytest.approx(0.1 - 0.5 * read["joint_pos"][:, leader], abs=1e-6)


def test_mjlabs_speeds_are_those_of_its_positions(tmp_path, moved):
    read = np.load(written(tmp_path, moved, "mjlab"))
    inner = slice(2, -2)
    joint_vel = np.gradient(read["joint_pos"].astype(float), 1.0 / RATE, axis=0)
    assert np.abs(joint_vel - read["joint_vel"])[inner].max() < 1e-3
    speed = np.gradient(read["body_pos_w"].astype(float), 1.0 / RATE, axis=0)
    fastest = np.abs(speed).max()
    assert np.abs(speed - read["body_lin_vel_w"])[inner].max() < 0.02 * fastest
    # A turn of q over the time between two frames, in the world.
    before, after = read["body_quat_w"][:-2].astype(float), read["body_quat_w"][2:].astype(float)
    spin = np.zeros((*before.shape[:2], 3))
    for frame, body in np.ndindex(before.shape[:2]):
        turn, conjugate = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(conjugate, before[frame, body])
        mujoco.mju_mulQuat(turn, after[frame, body], conjugate)
        mujoco.mju_quat2Vel(spin[frame, body], turn, 2.0 / RATE)
    assert np.abs(spin - read["body_ang_vel_w"][1:-1])[2:-2].max() < 0.02 * np.abs(spin).max()


def test_a_row_of_csv_is_root_quaternion_with_w_last_and_joints(tmp_path, moved):
    rows = np.loadtxt(written(tmp_path, moved, "csv"), delimiter=",")
    there, _ = bodies(moved[0], np.concatenate([rows[:, :3], rows[:, [6, 3, 4, 5]], rows[:, 7:]], axis=1))
    assert np.abs(there - played(moved)[0]).max() < 1e-6


def test_npz_names_its_joints(tmp_path, moved):
    model, read = moved[0], np.load(written(tmp_path, moved, "npz"))
    qpos = np.zeros((30, model.nq))
    qpos[:, :3], qpos[:, 3:7] = read["root_pos"], read["root_quat"]
    for column, name in enumerate(read["joint_names"]):
        qpos[:, model.joint(name).qposadr[0]] = read["joint_pos"][:, column]
    assert read["fps"] == RATE
    assert np.abs(bodies(model, qpos)[0] - played(moved)[0]).max() < 1e-6


def test_qpos_goes_from_frame_to_frame_by_qvel(tmp_path, moved):
    _, robot, motion = moved
    read = np.load(written(tmp_path, moved, "qpos"))
    assert np.array_equal(read["qpos"], motion.qpos)
    for frame in (5, 17):
        q = motion.qpos[frame - 1].copy()
        mujoco.mj_integratePos(robot.model, q, read["qvel"][frame], 2.0 / RATE)
        assert q == pytest.approx(motion.qpos[frame + 1], abs=1e-9)


def test_a_root_whose_origin_was_moved_is_written_where_its_file_has_it(tmp_path):
    """The base is on the floor and the pelvis a fixed body above it: the robot is played from the pelvis."""
    text = humanoid().replace("<freejoint/>", "")
    text = text.replace(
        '<body name="trunk" pos="0 0 0.5">', '<body name="base"><freejoint/><body name="trunk" pos="0.1 0 0.5">'
    )
    text = text.replace("</body>\n    </worldbody>", "</body></body></worldbody>")
    model, robot = loaded(tmp_path, text)
    moved = model, robot, retargeted(robot, swinging())
    rows = np.loadtxt(written(tmp_path, moved, "csv"), delimiter=",")
    there, _ = bodies(model, np.concatenate([rows[:, :3], rows[:, [6, 3, 4, 5]], rows[:, 7:]], axis=1))
    assert np.abs(there[:, 1:] - played(moved)[0][:, 1:]).max() < 1e-6
    read = np.load(written(tmp_path, moved, "mjlab"))
    assert np.abs(read["body_pos_w"] - there).max() < 1e-6
    speed = np.gradient(read["body_pos_w"][:, 0].astype(float), 1.0 / RATE, axis=0)
    assert np.abs(speed - read["body_lin_vel_w"][:, 0])[2:-2].max() < 0.03


def test_ball_joints_go_into_qpos_only(tmp_path):
    robot = load_robot(find_robot("mannequin"), human(), dt=1.0 / RATE)
    qpos = retargeted(robot, swinging(3)).qpos
    with pytest.raises(FileFormatError, match=r"walk\.csv.*ball joints.*--format qpos"):
        write_training_file(tmp_path / "walk.csv", robot.model, qpos, RATE, "csv")
    write_training_file(tmp_path / "walk.npz", robot.model, qpos, RATE, "qpos")
    assert np.load(tmp_path / "walk.npz")["qvel"].shape == (3, robot.model.nv)


def test_a_motion_of_one_frame_stands_still(tmp_path, moved):
    _, robot, motion = moved
    write_training_file(tmp_path / "one.npz", robot.model, motion.qpos[:1], RATE, "mjlab")
    assert not np.load(tmp_path / "one.npz")["body_lin_vel_w"].any()


def test_a_format_that_is_none_is_named():
    with pytest.raises(UnknownNameError, match=r"unknown format 'mjlabs'.*mjlab"):
        format_named("mjlabs")
