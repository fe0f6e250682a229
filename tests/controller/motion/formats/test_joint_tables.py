"""Tables of joint angles: what a column is called says its unit, and files that are read and written stay the same."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from controller.learning.preparation.takes import with_kind
from controller.motion.clip import ReadingOptions
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.reading import read_clip, recordings_below
from controller.motion.formats.taught_clip import taught_clip
from controller.motion.formats.writing import write_clip
from motiondeck_base.errors import FileFormatError

SWING = "time_s,jaw_deg,lid_rad\n0.00,0,0.1\n0.02,90,0.2\n0.04,45,0.3\n"


def angles(clip):
    return angles_of(clip.rotation[:, 1:])


def test_a_column_is_named_as_its_joint_and_its_unit(tmp_path):
    (tmp_path / "swing.csv").write_text(SWING)
    clip = read_clip(tmp_path / "swing.csv")
    assert (clip.skeleton.bones, clip.rate, clip.plays) == (("jaw", "lid"), 50.0, None)
    assert angles(clip) == pytest.approx(np.array([[0.0, 0.1], [np.pi / 2, 0.2], [np.pi / 4, 0.3]]))


def test_other_columns_have_the_unit_of_the_options(tmp_path):
    (tmp_path / "swing.csv").write_text("# plays = loop\nt;pan;tilt\n0;0;1\n0,1;90;1\n")
    with pytest.raises(FileFormatError, match=r"swing\.csv line 2: 'pan' has no unit. Call it pan_deg or"):
        read_clip(tmp_path / "swing.csv")
    clip = read_clip(tmp_path / "swing.csv", ReadingOptions(unit=np.pi / 180))
    assert clip.plays == "loop"
    assert angles(clip)[:, 0] == pytest.approx([0.0, np.pi / 2])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (SWING.replace("90", "x"), "line 3: expected a number, found 'x'"),
        (SWING.replace("90", ""), "line 3: jaw_deg is missing. Fill the gap"),
        (SWING.replace("0.02", "0.00"), "line 3: the time 0 does not come after 0"),
        (SWING.replace("0.2\n", "20\n"), "beyond two turns. Are they degrees"),
        (SWING.replace("lid_rad", "jaw_rad"), "'jaw' would be the name of two"),
        ("time_s,jaw_deg\n", "no frames in it"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path, text, problem):
    (tmp_path / "swing.csv").write_text(text)
    with pytest.raises(FileFormatError, match=problem):
        read_clip(tmp_path / "swing.csv")


def test_arrays_are_columns_too(tmp_path):
    time = np.arange(5) / 20
    np.savez(tmp_path / "swing.npz", time=time, jaw_deg=90 * time, lid_rad=time)
    clip = read_clip(tmp_path / "swing.npz")
    assert (clip.rate, clip.skeleton.bones) == (20.0, ("jaw", "lid"))
    assert angles(clip) == pytest.approx(np.stack([np.pi / 2 * time, time], axis=1))
    np.savez(tmp_path / "swing.npz", time=time, jaw_deg=np.zeros(4))
    with pytest.raises(FileFormatError, match=r"swing\.npz: one number a frame is needed of 'time' and of every joint"):
        read_clip(tmp_path / "swing.npz")
    np.savez(tmp_path / "swing.npz", time=time, jaw_deg=time, lid=time)
    with pytest.raises(FileFormatError, match=r"swing\.npz: 'lid' has no unit"):
        read_clip(tmp_path / "swing.npz")


def test_a_folder_of_recordings_has_them_too(tmp_path):
    (tmp_path / "swing.csv").write_text(SWING)
    (tmp_path / "prices.csv").write_text("day,price\nmonday,3\n")
    assert recordings_below(tmp_path) == [tmp_path / "swing.csv"]


@settings(max_examples=8)
@given(
    values=arrays(np.float64, st.tuples(st.integers(2, 6), st.integers(1, 3)), elements=st.floats(-12.0, 12.0)),
    rate=st.floats(2.5, 1000.0),
    plays=st.sampled_from(["loop", "once"]),
    order=st.permutations([".csv", ".npz", ".clip"]),
)
def test_every_format_comes_back_bit_by_bit(tmp_path_factory, values, rate, plays, order):
    folder = tmp_path_factory.getbasetemp()
    joints = ["jaw", "left_lid", "neck 2"][: values.shape[1]]
    clip = taught_clip("talk", joints, rate, values, plays=plays)
    seen = []
    for number, suffix in enumerate([*order, *order]):
        write_clip(clip, folder / f"{number}{suffix}")
        clip = read_clip(folder / f"{number}{suffix}")
        seen.append(np.round(angles(clip), 12) + 0.0)
        assert (clip.rate, clip.plays, list(clip.skeleton.bones)) == (rate, plays, joints)
    assert all(one.tobytes() == seen[0].tobytes() for one in seen)
    assert seen[0] == pytest.approx(values, abs=1e-12)
    for number, suffix in enumerate(order):
        if suffix == ".csv":
            assert (folder / f"{number}.csv").read_bytes() == (folder / f"{number + 3}.csv").read_bytes()


def test_joints_are_written_in_their_own_formats_only(tmp_path):
    clip = taught_clip("talk", ["jaw"], 50.0, np.zeros((5, 1)))
    with pytest.raises(FileFormatError, match=r"joint angles are written as \.clip or \.csv or \.npz"):
        write_clip(clip, tmp_path / "talk.bvh")


def test_a_motion_that_does_not_say_how_it_plays_is_a_loop_if_it_returns():
    t = np.arange(200)[:, None] / 50
    assert with_kind(taught_clip("wave", ["jaw"], 50.0, np.sin(6 * t))).plays == "loop"
    assert with_kind(taught_clip("reach", ["jaw"], 50.0, t**2 / 8)).plays == "once"
    assert with_kind(taught_clip("reach", ["jaw"], 50.0, t**2 / 8, plays="loop")).plays == "loop"
