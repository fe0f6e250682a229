"""A body from three points, a rig from one joint: nearer than the mean of what was learned, whoever and how fast."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bodies import waving
from command_line import invoked
from controller.motion.formats.reading import read_clip
from controller.motion.formats.writing import bvh_text
from motiondeck_base.errors import MotiondeckError

POINTS = ("head", "rhan", "lhan")


def completed(*arguments):
    said = invoked("clip", "complete", *arguments)
    assert said.exception is None
    return said.stdout


def refused(*arguments):
    said = invoked("clip", "complete", *arguments).exception
    assert isinstance(said, MotiondeckError)
    return str(said)


def table(path, rate, points):
    """Points (T, 3) by name as a table, written by hand; an empty cell where one was not seen."""
    head = ",".join(["time_s", *(f"{name}.{axis}" for name in points for axis in "xyz")])
    rows = np.concatenate([*points.values()], axis=1)
    cells = [
        ",".join([f"{n / rate:.6f}", *("" if np.isnan(x) else f"{x:.6f}" for x in row)]) for n, row in enumerate(rows)
    ]
    path.write_text("\n".join([head, *cells, ""]))


@pytest.fixture
def whole(tmp_path):
    """Someone who waves, at two tempos, as recordings to learn from."""
    folder = tmp_path / "like"
    folder.mkdir()
    for hertz in (0.8, 1.2):
        (folder / f"wave{hertz}.bvh").write_text(bvh_text(waving(60.0, 4.0, hertz)))
    return folder


@pytest.fixture
def trackers(tmp_path):
    """Head and hands of the same at a tempo between, elsewhere and facing elsewhere; noisy, with gaps; the truth."""
    clip, rng = waving(50.0, 4.0, 1.0), np.random.default_rng(3)
    joints = clip.joints() @ Rotation.from_euler("z", 2.0).as_matrix().T + [3.0, -1.0, 0.0]
    names = ("root", *clip.skeleton.bones)
    seen = {name: joints[:, names.index(name)] + 0.005 * rng.standard_normal((len(clip), 3)) for name in POINTS}
    for place in seen.values():
        place[rng.random(len(place)) < 0.2] = np.nan
    table(tmp_path / "trackers.csv", clip.rate, seen)
    return tmp_path / "trackers.csv", names, joints


def test_a_body_from_head_and_hands(tmp_path, whole, trackers):
    file, names, joints = trackers
    said = completed(file, tmp_path / "body.bvh", "--like", whole)
    assert "200 frames of 19 bones, learned from 2 recordings" in said
    found = read_clip(tmp_path / "body.bvh")
    ankles = [("root", *found.skeleton.bones).index(name) for name in ("lank", "rank")]
    truth = joints[:, [names.index(name) for name in ("lank", "rank")]]
    off = np.linalg.norm(found.joints()[:, ankles] - truth, axis=-1).mean()
    still = np.linalg.norm(truth - truth.mean(0), axis=-1).mean()
    assert off < 0.3 * still


def test_of_a_whole_recording_the_named_points_are_used(tmp_path, whole):
    clip = waving(50.0, 2.0, 1.0)
    (tmp_path / "wave.bvh").write_text(bvh_text(clip))
    completed(tmp_path / "wave.bvh", tmp_path / "body.bvh", "--like", whole, "--from", "head,lhan,rhan")
    found = read_clip(tmp_path / "body.bvh")
    assert np.linalg.norm(found.joints()[:, 0] - clip.joints()[:, 0], axis=-1).max() < 0.05


def test_a_taller_person_has_a_body_of_that_height_and_moves_alike(tmp_path, whole, trackers):
    _, names, joints = trackers
    seen = {name: joints[:, names.index(name)] for name in POINTS}
    table(tmp_path / "own.csv", 50.0, seen)
    table(tmp_path / "tall.csv", 50.0, {name: 1.2 * place for name, place in seen.items()})
    high = np.ptp(joints[0, :, 2])  # it stands in the rest pose
    completed(tmp_path / "own.csv", tmp_path / "own.bvh", "--like", whole)
    completed(tmp_path / "tall.csv", tmp_path / "tall.bvh", "--like", whole, "--height", 1.2 * high)
    own, tall = (read_clip(tmp_path / name).joints() for name in ("own.bvh", "tall.bvh"))
    assert np.linalg.norm(tall - 1.2 * own, axis=-1).max() < 0.01


def test_all_joints_of_a_rig_from_one(tmp_path):
    like = tmp_path / "like"
    like.mkdir()
    t = np.arange(120) / 60.0
    for file, w in ((like / "slow.csv", 5.5), (like / "fast.csv", 7.5), (tmp_path / "asked.csv", 6.5)):
        both = [f"{at:.4f},{np.sin(w * at):.6f},{0.5 * np.cos(w * at):.6f}" for at in t]
        file.write_text("\n".join(["time_s,neck_rad,jaw_rad", *both, ""]))
    completed(tmp_path / "asked.csv", tmp_path / "all.csv", "--like", like, "--from", "neck")
    neck, jaw = np.loadtxt(tmp_path / "all.csv", delimiter=",", skiprows=2)[:, 1:].T
    assert neck == pytest.approx(np.sin(6.5 * t), abs=1e-5)
    truth = 0.5 * np.cos(6.5 * t)
    assert np.abs(jaw - truth)[12:-12].mean() < 0.2 * np.abs(truth).mean()


@pytest.mark.parametrize(
    ("points", "more", "says"),
    [
        (("head", "rhan"), (), "twin on the right"),
        (("head", "rhan", "lham"), (), "'lham'"),
        (POINTS, ("--from", "head,rhan,lank"), "'lank'"),
    ],
)
def test_points_that_do_not_do_are_refused_by_name(tmp_path, whole, points, more, says):
    table(tmp_path / "t.csv", 50.0, {name: np.full((20, 3), 1.0 + k) for k, name in enumerate(points)})
    assert says in refused(tmp_path / "t.csv", tmp_path / "out.bvh", "--like", whole, *more)


def test_a_point_that_is_never_seen_and_recordings_of_another_kind_are_refused(tmp_path, whole):
    gone = {name: np.full((20, 3), np.nan if name == "head" else 1.0 + k) for k, name in enumerate(POINTS)}
    table(tmp_path / "t.csv", 50.0, gone)
    assert "head is never seen" in refused(tmp_path / "t.csv", tmp_path / "out.bvh", "--like", whole)
    (tmp_path / "nod.csv").write_text("time_s,neck_rad\n0,0\n0.1,0.1\n0.2,0\n")
    assert "recordings of rigs alone" in refused(tmp_path / "nod.csv", tmp_path / "out.csv", "--like", whole)
