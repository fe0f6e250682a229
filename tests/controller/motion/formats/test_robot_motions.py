"""Motions of robots in the layouts of other programs, which the test writes with numpy, and refused ones."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from controller.motion.clip import ReadingOptions
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.reading import read_clip, recordings_below
from motiondeck_base.errors import FileFormatError
from sim.robots.joint_motion import JointMotion

RNG = np.random.default_rng(4)
ANGLES = 0.8 * np.sin(np.linspace(0.0, 3.0, 40)[:, None] * RNG.uniform(1.0, 3.0, 29) + RNG.uniform(0.0, 6.0, 29))
ROOT = np.concatenate([RNG.normal(size=(40, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (40, 1))], axis=1)
G1 = ["left_hip_pitch_joint", "left_hip_roll_joint", "left_hip_yaw_joint", "left_knee_joint", "left_ankle_pitch_joint"]
SEED = ["Frame", *(f"root_{kind}{axis}" for kind in ("translate", "rotate") for axis in "XYZ")]


def csv(tmp_path, rows, head=None, name="walk.csv"):
    np.savetxt(tmp_path / name, rows, delimiter=",", header=",".join(head or []), comments="", fmt="%.9g")
    if head is None:
        (tmp_path / name).write_text((tmp_path / name).read_text().lstrip("\n"))
    return tmp_path / name


def npz(tmp_path, **arrays):
    np.savez(tmp_path / "walk.npz", **arrays)
    return tmp_path / "walk.npz"


def check(clip, angles=ANGLES, rate=30.0, first=tuple(G1)):
    assert clip.skeleton.is_rig
    assert clip.skeleton.bones[: len(first)] == first
    assert clip.rate == pytest.approx(rate)
    assert np.abs(angles_of(clip.rotation[:, 1:]) - angles).max() < 1e-7


def test_a_table_without_a_heading_is_of_unitrees_g1_at_30_hz(tmp_path):
    path = csv(tmp_path, np.concatenate([ROOT, ANGLES], axis=1))
    check(read_clip(path))
    check(read_clip(path, ReadingOptions(rate=50.0)), rate=50.0)
    assert recordings_below(tmp_path) == [path]


def test_degrees_of_bones_seed_at_120_hz(tmp_path):
    head = [*SEED, *(f"{name}_dof" for name in G1)]
    rows = np.concatenate([np.arange(40)[:, None], 100.0 * ROOT[:, :6], np.degrees(ANGLES[:, :5])], axis=1)
    check(read_clip(csv(tmp_path, rows, head)), ANGLES[:, :5], 120.0)
    with pytest.raises(FileFormatError, match="line 13: frames are missing before this one"):
        read_clip(csv(tmp_path, np.delete(rows, 11, axis=0), head))


def test_what_joint_motion_saves_is_read(tmp_path):
    JointMotion("walk", ("a", "b"), 50.0, ANGLES[:, :2], np.zeros((40, 9))).save(tmp_path / "walk.csv")
    check(read_clip(tmp_path / "walk.csv"), ANGLES[:, :2], 50.0, ("a", "b"))


@pytest.mark.parametrize(
    "arrays",
    [
        {"joint_pos": ANGLES, "body_pos_w": np.zeros((40, 2, 3)), "fps": np.array([50])},
        {"dof_pos": ANGLES, "root_pos": ROOT[:, :3], "root_rot": ROOT[:, 3:], "fps": 50.0},
        {"qpos": np.concatenate([ROOT, ANGLES], axis=1), "fps": 50.0},
        {"qpos": ANGLES, "fps": 50.0},
    ],
)
def test_arrays_of_mjlab_gmr_and_mujoco(tmp_path, arrays):
    check(read_clip(npz(tmp_path, **arrays)), rate=50.0)
    names = np.array([f"j{number}" for number in range(29)])
    check(read_clip(npz(tmp_path, **arrays, joint_names=names)), rate=50.0, first=tuple(names))


def test_names_beside_the_file_or_above_it_are_those_of_its_joints(tmp_path):
    (tmp_path / "joints.txt").write_text("hip\n\nknee\n# lid\nankle\n")
    (tmp_path / "deep" / "er").mkdir(parents=True)
    rows = np.concatenate([ROOT, ANGLES[:, :4]], axis=1)
    check(read_clip(csv(tmp_path / "deep" / "er", rows)), ANGLES[:, [0, 1, 3]], first=("hip", "knee", "ankle"))
    names = np.array(["hip", "knee", "lid", "ankle"])
    path = npz(tmp_path, joint_pos=ANGLES[:, :4], joint_names=names, fps=30)
    check(read_clip(path), ANGLES[:, [0, 1, 3]], first=("hip", "knee", "ankle"))
    renamed = read_clip(path, ReadingOptions(rename={"hip": "l_hip"}))
    assert renamed.skeleton.bones == ("l_hip", "knee", "ankle")


def test_the_order_of_isaac_lab_is_not_taken_for_mujocos(tmp_path):
    """Left and right hip come one after the other there; in MuJoCo's order a leg comes whole."""
    bodies = np.zeros((40, 3, 3))
    bodies[:, 1:, 1] = 0.1, -0.1
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (40, 3, 1))
    with pytest.raises(FileFormatError, match=r"Isaac Lab's order.*Add an array 'joint_names'"):
        read_clip(npz(tmp_path, joint_pos=ANGLES, body_pos_w=bodies, body_quat_w=turns, fps=50))
    bodies[:, 2, 1] = 0.12
    check(read_clip(npz(tmp_path, joint_pos=ANGLES, body_pos_w=bodies, body_quat_w=turns, fps=50)), rate=50.0)


HOLED = np.where(np.arange(29) == 3, np.nan, ANGLES)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda p: csv(p, np.concatenate([ROOT, ANGLES[:, :12]], axis=1)),
            "12 numbers|19 numbers a frame .*joints.txt",
        ),
        (
            lambda p: csv(p, np.concatenate([ROOT, np.degrees(ANGLES)], axis=1)),
            "beyond two turns.*in degrees. Write rad",
        ),
        (lambda p: npz(p, joint_pos=ANGLES), "no rate"),
        (lambda p: npz(p, joint_pos=ANGLES[0], fps=30), r"angles of shape \(29,\), expected \(frames, joints\)"),
        (lambda p: npz(p, joint_pos=HOLED, fps=30), "frame 0 lacks an angle. Fill the gap"),
        (lambda p: npz(p, joint_pos=ANGLES, joint_names=np.array(["a"] * 29), fps=30), "'a' would be the name of two"),
        (lambda p: csv(p, np.full((3, 36), 1e9)), r"line 1: expected a number, found '1e\+09'|beyond two turns"),
    ],
)
def test_what_is_no_motion_of_a_robot_is_one_line(tmp_path, make, said):
    path = make(tmp_path)
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_options_of_bodies_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match="fixed units and axes: omit the options"):
        read_clip(npz(tmp_path, joint_pos=ANGLES, fps=30), ReadingOptions(unit=0.01))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.booleans(),
    st.lists(
        st.tuples(st.integers(0, 3000), st.sampled_from([",", "\n", '"', "nan", "-", ";", "\t", "1e300", "Frame"])),
        max_size=6,
    ),
)
def test_any_table_of_a_robot_is_read_or_refused_in_one_line(tmp_path, seed, changes):
    head = [*SEED, *(f"{name}_dof" for name in G1)]
    rows = np.concatenate([np.arange(40)[:, None], ROOT[:, :6], ANGLES[:, :5]], axis=1)
    path = csv(tmp_path, rows, head) if seed else csv(tmp_path, np.concatenate([ROOT, ANGLES], axis=1))
    text = path.read_text()
    for at, piece in changes:
        text = text[:at] + piece + text[at + len(piece) :]
    path.write_text(text)
    try:
        clip = read_clip(path)
    except FileFormatError as error:
        message = str(error)
    else:
        message = "walk.csv"
        assert np.isfinite(clip.rotation).all()
    assert "walk.csv" in message
    assert "\n" not in message
