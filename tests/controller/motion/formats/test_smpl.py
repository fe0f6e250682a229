"""Files of the SMPL family that the test writes: vectors for rotations, on a body model of the test's own."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from controller.motion.canonical.canonical_body import landmarks_of, to_canonical
from controller.motion.clip import ReadingOptions
from controller.motion.formats.reading import read_clip
from controller.motion.formats.smpl import JOINTS, PARENT, average_joints
from motiondeck_base.errors import FileFormatError

RNG = np.random.default_rng(5)
FRAMES = 30
TIME = np.arange(FRAMES)[:, None, None] / 100.0
POSE = 0.4 * RNG.normal(size=(1, 22, 3)) * np.sin(6.0 * TIME + RNG.uniform(0.0, 6.0, (1, 22, 3)))
POSE[:, 0] *= 0.3
TRANS = np.stack([np.linspace(0.0, 1.5, FRAMES), np.zeros(FRAMES), np.full(FRAMES, 1.2)], axis=1)
TO_Z_UP = Rotation.from_euler("x", 90, degrees=True)  # of the model's axes: its up, y, becomes z


def amass(width=156, key="mocap_framerate", **more):
    """AMASS: the root turns the model's axes into a world with z up."""
    pose = POSE.copy()
    pose[:, 0] = (TO_Z_UP * Rotation.from_rotvec(POSE[:, 0])).as_rotvec()
    poses = np.zeros((FRAMES, width))
    poses[:, :66] = pose.reshape(FRAMES, 66)
    return {"poses": poses, "trans": TRANS, "betas": np.zeros(16), "gender": np.array("neutral"), key: 100.0} | more


def split(arrays):
    """The same as SMPL-X releases part it."""
    poses = arrays.pop("poses")
    return arrays | {"root_orient": poses[:, :3], "pose_body": poses[:, 3:66], "mocap_frame_rate": 100.0}


def save(tmp_path, arrays, name="walk.npz"):
    np.savez(tmp_path / name, **arrays)
    return tmp_path / name


def expected(joints, root=TO_Z_UP):
    """Joints (T, 22, 3) with z up, by scipy: the template turned joint by joint, then moved by trans."""
    turn = [root * Rotation.from_rotvec(POSE[:, 0])]
    place = [joints[0] + TRANS]
    for joint in range(1, 22):
        above = PARENT[joint]
        place.append(place[above] + turn[above].apply(joints[joint] - joints[above]))
        turn.append(turn[above] * Rotation.from_rotvec(POSE[:, joint]))
    return np.stack(place, axis=1)


def check(clip, joints):
    """In our axes x is forward: the model's z, which AMASS's world has as -y, and z is up; the whole may be turned."""
    world = expected(joints)
    ours = clip.joints()
    for joint in range(22):
        off = np.linalg.norm(ours - world[:, joint, None], axis=-1).max(axis=0).min()
        assert off < 1e-6, JOINTS[joint]


@pytest.mark.parametrize("width", [66, 72, 156, 165])
def test_all_widths_of_poses_are_the_same_22_joints(tmp_path, width):
    clip = read_clip(save(tmp_path, amass(width)))
    check(clip, average_joints("SMPL-X" if width == 165 else "SMPL"))
    assert (clip.rate, len(clip)) == (100.0, FRAMES)
    assert set(landmarks_of(clip.skeleton).lacking) == set()


def test_the_parts_of_smpl_x_are_the_same_motion(tmp_path):
    one = read_clip(save(tmp_path, amass(165)))
    other = read_clip(save(tmp_path, split(amass(165)), "split.npz"))
    assert np.allclose(one.joints(), other.joints(), atol=1e-9)


def test_a_person_of_average_proportions_stands_as_high_as_people_do(tmp_path):
    own = to_canonical(read_clip(save(tmp_path, amass())))
    legs, arms = (
        own.skeleton.length[[own.skeleton.index(b) for b in bones]].sum()
        for bones in (("lkne", "lank"), ("lelb", "lwri"))
    )
    assert 0.75 < legs < 0.95
    assert 0.55 < arms / legs < 0.75


def model(tmp_path, **change):
    """A body model: joints are weighted sums of vertices, vertices are moved by shapes."""
    regressor = RNG.dirichlet(np.full(40, 0.05), size=24)
    joints = average_joints("SMPL") * 1.1
    vertices = np.linalg.lstsq(regressor[:22], joints, rcond=None)[0]
    shapes = 0.01 * RNG.normal(size=(40, 3, 16))
    arrays = {"J_regressor": regressor, "v_template": vertices, "shapedirs": shapes} | change
    np.savez(tmp_path / "model.npz", **arrays)
    return tmp_path / "model.npz", arrays


def test_a_body_model_gives_the_joints_of_the_person(tmp_path):
    path, arrays = model(tmp_path)
    betas = RNG.normal(size=16)
    clip = read_clip(save(tmp_path, amass(betas=betas)), ReadingOptions(skeleton=path))
    shaped = arrays["v_template"] + np.einsum("vxk,k->vx", arrays["shapedirs"][..., :10], betas[:10])
    check(clip, (arrays["J_regressor"] @ shaped)[:22])


def test_a_world_with_y_up_is_seen_from_the_body(tmp_path):
    arrays = split(amass(165))
    arrays["root_orient"] = POSE[:, 0]
    arrays["fps"] = np.array(30.0)
    del arrays["mocap_frame_rate"], arrays["mocap_framerate"]
    arrays["global_orient"], arrays["body_pose"] = (
        arrays.pop("root_orient"),
        arrays.pop("pose_body").reshape(FRAMES, 21, 3),
    )
    arrays["transl"] = arrays.pop("trans")[:, [0, 2, 1]]
    clip = read_clip(save(tmp_path, arrays))
    assert clip.rate == 30.0
    assert np.allclose(clip.root_position[:, 2], 1.2 - 0.35)


def test_the_scaling_of_aist_is_taken_out_of_the_path(tmp_path):
    arrays = {"smpl_poses": POSE.reshape(FRAMES, 66), "smpl_trans": TRANS[:, [0, 2, 1]], "fps": 60}
    scaled = arrays | {"smpl_trans": 93.5 * arrays["smpl_trans"], "smpl_scaling": np.array([93.5])}
    one, other = read_clip(save(tmp_path, arrays)), read_clip(save(tmp_path, scaled, "scaled.npz"))
    assert np.allclose(one.joints(), other.joints(), atol=1e-9)


class Trap:
    def __reduce__(self):
        return (pytest.fail, ("a pickle was loaded",))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"trans": None}, r"no motion of a body: it holds poses, betas, gender, mocap_framerate"),
        ({"poses": None}, "no motion of a body"),
        ({"mocap_framerate": None}, "no rate .* Add an array 'fps'"),
        ({"mocap_framerate": 0.0}, "a rate of 0 frames per second"),
        ({"poses": np.zeros((FRAMES, 60))}, r"rotations \(30, 60\)"),
        ({"poses": np.zeros((0, 156)), "trans": np.zeros((0, 3))}, r"rotations \(0, 156\)"),
        ({"trans": np.zeros((FRAMES - 1, 3))}, r"trans \(29, 3\)"),
        ({"poses": np.full((FRAMES, 156), np.nan)}, "frame 0 holds a number that is no angle"),
        ({"trans": np.full((FRAMES, 3), np.inf)}, "frame 0 holds"),
        ({"poses": np.array("text")}, "array 'poses' cannot be read"),
        (
            {"poses": np.array([Trap()], dtype=object)},
            "'poses' cannot be read .it holds Python objects, which are never",
        ),
    ],
)
def test_a_broken_file_is_one_line(tmp_path, change, said):
    arrays = {name: value for name, value in (amass() | change).items() if value is not None}
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(save(tmp_path, arrays))
    assert "walk.npz" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"J_regressor": np.zeros((24, 3))}, "do not belong together"),
        ({"J_regressor": np.zeros((5, 40))}, "a model of 5 joints"),
        ({"v_template": np.full((40, 3), np.nan)}, "more than 10 m away"),
    ],
)
def test_a_broken_model_is_one_line(tmp_path, change, said):
    path, _ = model(tmp_path, **change)
    with pytest.raises(FileFormatError, match=f"model.npz: .*{said}"):
        read_clip(save(tmp_path, amass()), ReadingOptions(skeleton=path))


def test_other_arrays_and_other_files_are_no_motion(tmp_path):
    with pytest.raises(FileFormatError, match="it holds weights, bias"):
        read_clip(save(tmp_path, {"weights": np.zeros(3), "bias": np.zeros(1)}))
    (tmp_path / "text.npz").write_text("no zip")
    with pytest.raises(FileFormatError, match=r"text\.npz: this is no \.npz file"):
        read_clip(tmp_path / "text.npz")
