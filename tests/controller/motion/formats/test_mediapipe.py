"""Tables of MediaPipe's landmarks that the test writes, in the layouts of scripts, and refused ones."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from controller.motion.clip import ReadingOptions
from controller.motion.formats.joint_arrays import MEDIAPIPE
from controller.motion.formats.mediapipe import read_mediapipe
from controller.motion.formats.reading import read_clip, recordings_below
from motiondeck_base.errors import FileFormatError
from people import moving

MOTION = moving(frames=30, rate=25.0, reach=0.3)
PARTS = {
    **{"hip": "thigh", "knee": "shank", "ankle": "foot", "heel": "foot", "foot_index": "toes end"},
    **{"shoulder": "arm", "elbow": "forearm", "wrist": "hand"},
}


def world():
    """World landmarks (T, 33, 3): y down, z away from the camera, the middle of the hips at the origin."""
    tracks = []
    for name in MEDIAPIPE:
        side, _, part = name.partition("_")
        key = f"{side[0]} {PARTS[part]}" if part in PARTS else f"{side[0]} hand end" if side in "leftright" else "head"
        tracks.append(MOTION.place["head" if part.startswith(("eye", "ear")) else key])
    points = np.stack(tracks, axis=1)
    return (points - 0.5 * (points[:, 23:24] + points[:, 24:25])) * [1.0, -1.0, -1.0]


WORLD = world()
SEEN = np.random.default_rng(0).uniform(0.5, 1.0, (30, 33))
TIME = np.arange(30) / 25.0


def table(tmp_path, head, rows, name="pose.csv"):
    text = "\n".join([",".join(head), *(",".join(str(value) for value in row) for row in rows)]) + "\n"
    (tmp_path / name).write_text(text)
    return tmp_path / name


def wide(tmp_path, column, time=("time_s", 1.0), points=WORLD):
    head = [time[0], *(column(i, a) for i in range(33) for a in "xyz"), *(f"{n}_visibility" for n in MEDIAPIPE)]
    return table(tmp_path, head, np.concatenate([TIME[:, None] * time[1], points.reshape(30, 99), SEEN], axis=1))


def long(tmp_path, names, points=WORLD, extra=()):
    head = ["frame", "t_ms", "lm_id", "x_px", "y_px", "z_norm", "visibility", "presence", "wx_m", "wy_m", "wz_m"]
    rows = [
        [frame, 1000.0 * TIME[frame], names[i], 100.0 * i, 7.0 * frame, -0.1, 0.9, 0.8, *points[frame, i]]
        for frame in range(30)
        for i in range(33)
    ]
    return table(tmp_path, head, [*rows, *extra])


WIDE = [
    (lambda i, a: f"{MEDIAPIPE[i]}_{a}", ("time_s", 1.0)),
    (lambda i, a: f"{MEDIAPIPE[i].upper()}.{a}", ("timestamp_ms", 1000.0)),
    (lambda i, a: f"{a}{i}", ("timestamp", 1000.0)),
    (lambda i, a: f"{a}{i + 1}", ("timestamp", 1.0)),
    (lambda i, a: f"landmark_{i}_{a}", ("t", 1.0)),
    (lambda i, a: f"{MEDIAPIPE[i].upper()}_{a}_3d", ("time", 1.0)),
]


@pytest.mark.parametrize(("column", "time"), WIDE)
def test_a_line_a_frame_has_the_landmarks_where_the_file_has_them(tmp_path, column, time):
    path = wide(tmp_path, column, time)
    points = read_mediapipe(path)
    assert points.labels == MEDIAPIPE
    assert points.rate == pytest.approx(25.0, rel=1e-6)
    turned = np.genfromtxt(path, delimiter=",", skip_header=1)[:, 1:100].reshape(30, 33, 3) * [1.0, -1.0, -1.0]
    assert np.abs(points.position - turned).max() < 1e-9
    assert recordings_below(tmp_path) == [path]


@pytest.mark.parametrize("names", [range(33), range(1, 34), MEDIAPIPE, [n.upper() for n in MEDIAPIPE]])
def test_a_line_a_landmark_has_the_world_landmarks_beside_those_of_the_image(tmp_path, names):
    points = read_mediapipe(long(tmp_path, list(names)))
    assert points.rate == pytest.approx(25.0)
    assert np.abs(points.position - WORLD * [1.0, -1.0, -1.0]).max() < 1e-9


def test_limbs_of_the_body_point_as_in_the_file(tmp_path):
    clip = read_clip(wide(tmp_path, WIDE[0][0]))
    ends = dict(zip(clip.skeleton.bones, np.moveaxis(clip.joints(), 1, 0)[1:], strict=True))
    shank = MOTION.place["l foot"] - MOTION.place["l shank"]
    assert np.abs(ends["lank"] - ends["lkne"] - shank[:, [2, 0, 1]]).max() < 1e-6


def test_frames_in_which_no_person_was_seen_are_bridged(tmp_path):
    gone = WORLD.copy()
    gone[8:10] = 0.0
    gone[15] = np.nan
    points = read_mediapipe(wide(tmp_path, WIDE[0][0], points=gone))
    assert np.flatnonzero(np.isnan(points.position).any(axis=(1, 2))).tolist() == [8, 9, 15]
    assert len(read_clip(wide(tmp_path, WIDE[0][0], points=gone))) == 30


def test_an_axis_that_is_given_is_kept(tmp_path):
    points = read_mediapipe(wide(tmp_path, WIDE[0][0]), ReadingOptions(up="y"))
    assert np.abs(points.position - WORLD).max() < 1e-9


def test_image_coordinates_are_refused_with_the_remedy(tmp_path):
    shares = 0.5 + 0.2 * WORLD
    pixels = np.concatenate([640.0 + 300.0 * WORLD[..., :2], 0.1 * WORLD[..., 2:]], axis=-1)
    for image in (shares, pixels):
        with pytest.raises(FileFormatError, match=r"pose\.csv: image coordinates.*Write pose_world_landmarks"):
            read_clip(wide(tmp_path, WIDE[0][0], points=image))


def test_landmarks_in_metres_away_from_the_origin_are_read(tmp_path):
    away = WORLD + np.array([2.0, 0.4, 3.0])
    moved = read_mediapipe(wide(tmp_path, WIDE[0][0], points=away))
    assert np.abs(moved.position - away * [1.0, -1.0, -1.0]).max() < 1e-9


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("time_s", "frame"), "line 1: no column of times. Add one called time_s"),
        (("\n0.04,", "\nx,"), "line 3: expected a number, found 'x'"),
        (("\n0.04,", "\n0.0,"), "line 3: the time 0 does not come after 0"),
        (("\n0.04,", "\n0.04,0.1,"), "line 3: 134 values, but the first line names 133"),
        (("\n0.04,", "\n0.04,1e9"), "line 3: expected a number"),
    ],
)
def test_a_broken_table_is_one_line(tmp_path, change, said):
    path = wide(tmp_path, WIDE[0][0])
    text = path.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change, 1))
    with pytest.raises(FileFormatError, match=said):
        read_clip(path)


def test_two_people_in_one_frame_are_refused(tmp_path):
    second = [[0, 0.0, 5, 0, 0, 0, 1, 1, 0.1, 0.2, 0.3]]
    with pytest.raises(FileFormatError, match=r"line 992: '5' comes twice in this frame. Write each person alone"):
        read_clip(long(tmp_path, range(33), extra=second))
    stray = [[0, 0.0, 40, 0, 0, 0, 1, 1, 0.1, 0.2, 0.3]]
    with pytest.raises(FileFormatError, match="line 992: '40' is none of MediaPipe's 33 landmarks"):
        read_clip(long(tmp_path, range(33), extra=stray))


@pytest.mark.parametrize("make", [lambda folder: wide(folder, WIDE[0][0]), lambda folder: long(folder, range(33))])
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    changes=st.lists(
        st.tuples(st.integers(0, 9000), st.sampled_from([",", "\n", '"', "nan", "inf", "-", "x", "1e9", "left_hip_x"])),
        min_size=1,
        max_size=6,
    )
)
def test_any_table_is_read_or_refused_in_one_line(tmp_path, make, changes):
    path = make(tmp_path)
    text = path.read_text()
    for at, piece in changes:
        text = text[:at] + piece + text[at + len(piece) :]
    path.write_text(text)
    try:
        clip = read_clip(path)
    except FileFormatError as error:
        message = str(error)
    else:
        message = "pose.csv"
        assert np.isfinite(clip.joints()).all()
    assert "pose.csv" in message
    assert "\n" not in message
