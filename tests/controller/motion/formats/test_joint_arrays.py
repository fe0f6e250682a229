"""Arrays of joints that the test writes, in the orders of data sets and estimators, and refused ones."""

import contextlib
import pickle

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from controller.motion.canonical.body_doubts import doubts
from controller.motion.canonical.canonical_body import is_canonical
from controller.motion.clip import ReadingOptions
from controller.motion.formats.joint_arrays import MEDIAPIPE, read_joint_arrays
from controller.motion.formats.reading import read_clip
from controller.motion.formats.smpl import JOINTS
from motiondeck_base.errors import FileFormatError
from people import CANONICAL, in_our_axes, moving

MOTION = moving(frames=60, rate=20.0)
SIDES = {"left": "l", "right": "r"}
PARTS = {
    **{"hip": "thigh", "knee": "shank", "ankle": "foot", "foot": "toes", "toe": "toes end", "collar": "collar"},
    **{"shoulder": "arm", "elbow": "forearm", "wrist": "hand", "index": "hand end", "heel": "foot"},
}
MIDDLE = {"pelvis": "hips", "spine1": "spine", "spine2": "chest", "spine3": "chest", "spine": "chest"}
COCO = (
    "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow right_elbow left_wrist "
    "right_wrist left_hip right_hip left_knee right_knee left_ankle right_ankle"
)
HUMAN36M = (
    "pelvis right_hip right_knee right_ankle left_hip left_knee left_ankle spine neck nose head left_shoulder "
    "left_elbow left_wrist right_shoulder right_elbow right_wrist"
)


def place(name):
    """Where a joint of this name is, (T, 3)."""
    side, _, part = name.partition("_")
    key = f"{SIDES[side]} {PARTS[part]}" if side in SIDES and part in PARTS else MIDDLE.get(name, name)
    return MOTION.place.get(key, MOTION.place["head"])


def joints(names):
    return np.stack([place(name) for name in names], axis=1)


HUMANML = joints(JOINTS)


def npy(tmp_path, array, name="000001.npy"):
    np.save(tmp_path / name, array)
    return tmp_path / name


def npz(tmp_path, **arrays):
    np.savez(tmp_path / "walk.npz", **arrays)
    return tmp_path / "walk.npz"


def check_body(clip):
    """Hips are where the person has them, in our axes, and limbs point as they do there; one length a limb."""
    assert is_canonical(clip.skeleton)
    assert doubts(clip) == []
    found = dict(zip(clip.skeleton.bones, np.moveaxis(clip.joints(), 1, 0)[1:], strict=True))
    there = {joint: in_our_axes(MOTION.place[key]) for joint, key in CANONICAL.items()}
    for side in "lr":
        assert np.abs(found[side + "hip"] - there[side + "hip"]).max() < 1e-5
        for start, end in (("hip", "kne"), ("kne", "ank"), ("sho", "elb"), ("elb", "wri")):
            limb, truth = (joints[side + end] - joints[side + start] for joints in (found, there))
            assert np.abs(limb - truth).max() < 1e-5, (side, end)


def features(position):
    """HumanML3D's features of joints (T, J, 3) and any heading, by its definition, with scipy; (T - 1, 8 J + 87)."""
    root, heading = position[:, 0], 0.3 * np.sin(np.arange(len(position)) / 9.0)
    heading -= heading[0]
    into = Rotation.from_rotvec(np.outer(2.0 * heading, [0.0, 1.0, 0.0]))  # the quaternion (cos a, 0, sin a, 0)
    local = np.stack([into[t].apply(position[t] - [root[t, 0], 0.0, root[t, 2]]) for t in range(len(position))])
    speed = np.stack([into[t + 1].apply(root[t + 1] - root[t]) for t in range(len(position) - 1)])
    head = np.stack([np.diff(heading), speed[:, 0], speed[:, 2], root[:-1, 1]], axis=1)
    rest = np.zeros((len(position) - 1, 6 * (len(position[0]) - 1) + 3 * len(position[0]) + 4))
    return np.concatenate([head, local[:-1, 1:].reshape(len(head), -1), rest], axis=1)


def test_joints_of_humanml3d_are_read(tmp_path):
    path = npy(tmp_path, HUMANML.astype(np.float32))
    points = read_joint_arrays(path)
    assert np.abs(points.position - np.load(path)).max() < 1e-5  # 0.01 mm
    assert (points.rate, points.labels) == (20.0, JOINTS)
    check_body(read_clip(path))


def test_features_of_humanml3d_are_the_joints_from_the_first_place_on(tmp_path):
    centred = HUMANML - HUMANML[:1, :1] * [1.0, 0.0, 1.0]
    found = features(centred)
    assert found.shape == (59, 263)
    assert np.abs(read_joint_arrays(npy(tmp_path, found)).position - centred[:-1]).max() < 1e-9


@pytest.mark.parametrize("key", ["joints", "keypoints3d", "keypoints3d_optim", "joints3d"])
@pytest.mark.parametrize(("names", "scale"), [(COCO, 100.0), (HUMAN36M, 1.0), (HUMAN36M, 1000.0)])
def test_the_order_of_17_joints_is_found_by_the_limbs(tmp_path, names, scale, key):
    points = read_joint_arrays(npz(tmp_path, **{key: scale * joints(names.split()), "fps": 60.0}))
    assert points.labels == tuple(names.split())
    assert np.abs(points.position - joints(names.split())).max() < 1e-9
    assert points.rate == 60.0


def test_points_of_a_camera_are_turned_over_and_its_body_read(tmp_path):
    camera = joints(MEDIAPIPE) * [1.0, -1.0, -1.0]
    check_body(read_clip(npz(tmp_path, joints=camera, fps=20.0)))


def test_names_in_the_file_win_over_the_order(tmp_path):
    shuffled = np.random.default_rng(2).permutation(22)
    names = np.array(JOINTS)[shuffled]
    check_body(read_clip(npz(tmp_path, joints=HUMANML[:, shuffled], joint_names=names, fps=20)))


def test_unseen_joints_are_bridged(tmp_path):
    seen = HUMANML.copy()
    seen[10:12, 5] = np.nan
    points = read_joint_arrays(npz(tmp_path, joints=seen, fps=20))
    assert np.array_equal(np.isnan(points.position[..., 0]), np.isnan(seen[..., 0]))
    assert len(read_clip(npz(tmp_path, joints=seen, fps=20))) == 60


def test_a_rate_that_is_given_is_that_of_an_array_without_one(tmp_path):
    path = npy(tmp_path, joints(COCO.split()))
    assert read_joint_arrays(path, ReadingOptions(rate=60.0)).rate == 60.0
    assert read_clip(path, ReadingOptions(rate=60.0)).rate == 60.0


def test_unit_axis_and_names_can_be_given(tmp_path):
    path = npz(tmp_path, joints=HUMANML, fps=20, joint_names=np.array(["k" * (i + 1) for i in range(22)]))
    names = dict(zip(["k" * (i + 1) for i in range(22)], JOINTS, strict=True))
    points = read_joint_arrays(path, ReadingOptions(unit=0.5, up="y", rename=names))
    assert points.labels == JOINTS
    assert points.up == "y"
    assert np.allclose(points.position, 0.5 * HUMANML)


@pytest.mark.parametrize(
    ("name", "array", "said"),
    [
        ("a.npy", np.zeros((5, 17, 3)), r"no rate. Save .npz with arrays 'joints' and 'fps', or give rate in a recipe"),
        ("a.npy", np.zeros((5, 22, 3)), "SMPL, limbs change their length by"),
        ("a.npy", np.zeros((263,)), r"joints of shape \(263,\), expected \(frames, joints, 3\)"),
        ("a.npy", np.zeros((5, 66)), r"joints of shape \(5, 66\)"),
        ("a.npy", np.full((5, 22, 3), np.nan), "no joint has a position"),
        ("a.npy", np.array(["one"]), r"cannot be read \(could not convert"),
        ("a.npy", np.random.default_rng(0).normal(size=(50, 263)), "limbs change their length by .*joint_names"),
        ("a.npz", {"joints": HUMANML}, "no rate .*Add an array 'fps'"),
        ("a.npz", {"joints": HUMANML[:, :9], "fps": 20}, "9 joints without names; known are 22 .SMPL., "),
        ("a.npz", {"joints": np.zeros((2, 60, 22, 3)), "fps": 20}, "Save each person alone"),
        ("a.npz", {"joints": HUMANML, "fps": 20, "joint_names": np.array(JOINTS[:21])}, "21 joint_names for 22 joints"),
        ("a.npz", {"joints": HUMANML, "fps": "fast"}, "array 'fps' cannot be read"),
        ("a.npz", {"numbers": HUMANML}, "this .npz is no motion of a body.*or joints"),
    ],
)
def test_what_cannot_be_read_is_one_line_with_the_remedy(tmp_path, name, array, said):
    path = tmp_path / name
    np.savez(path, **array) if isinstance(array, dict) else np.save(path, array)
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(path)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


class Bomb:
    """An object whose unpickling would raise."""

    def __reduce__(self):
        return (pytest.fail, ("a pickle was loaded",))


@pytest.mark.parametrize("name", ["dance.pkl", "hmr4d_results.pt", "a.npy", "a.npz"])
def test_pickles_are_never_loaded(tmp_path, name):
    path = tmp_path / name
    bomb = np.array([Bomb()], dtype=object)
    if name == "a.npz":
        np.savez(path, joints=bomb, fps=20)
    elif name == "a.npy":
        np.save(path, bomb)
    else:
        path.write_bytes(pickle.dumps(Bomb()))
    with pytest.raises(FileFormatError, match=r"objects, which are never loaded.*Save (its arrays|it again)"):
        read_clip(path)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from([(60, 22, 3), (60, 263), (60, 17, 3)]),
    st.lists(st.tuples(st.integers(0, 10**6), st.sampled_from([np.nan, np.inf, -1e30, 1e5, 0.0])), max_size=40),
)
def test_any_numbers_in_an_array_are_read_or_refused(tmp_path, shape, changes):
    array = (HUMANML if shape[1] == 22 else features(np.tile(HUMANML, (2, 1, 1))[:61])).copy()
    array = array if array.shape == shape else joints(COCO.split())
    for at, value in changes:
        array.flat[at % array.size] = value
    with contextlib.suppress(FileFormatError):
        clip = read_clip(npz(tmp_path, joints=array, fps=20) if shape[1] == 17 else npy(tmp_path, array))
        assert np.isfinite(clip.joints()).all()
