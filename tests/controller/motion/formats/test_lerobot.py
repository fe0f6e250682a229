"""Episodes of LeRobot's datasets: the joints that info.json names, in the unit that the options say."""

import json
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from controller.motion.clip import ReadingOptions
from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.reading import read_clip, recordings_below
from motiondeck_base.errors import FileFormatError, MotiondeckError

parquet = pytest.importorskip("pyarrow.parquet")
DEGREES = ReadingOptions(unit=np.pi / 180.0)
NAMES = ["shoulder_pan.pos", "elbow_flex.pos", "gripper.pos"]


def dataset(folder, episodes, *, names=NAMES, state="observation.state", fps=30, file="file-000"):
    """A dataset as LeRobot writes it, its episodes (T, C) in one file."""
    import pyarrow

    lengths = [len(one) for one in episodes]
    table = {
        state: [row for one in episodes for row in np.asarray(one, np.float32).tolist()],
        "timestamp": np.concatenate([np.arange(n, dtype=np.float32) / fps for n in lengths]),
        "frame_index": np.concatenate([np.arange(n) for n in lengths]),
        "episode_index": np.repeat(np.arange(len(lengths)), lengths),
    }
    (folder / "meta").mkdir(parents=True, exist_ok=True)
    (folder / "data" / "chunk-000").mkdir(parents=True, exist_ok=True)
    image = {"dtype": "video", "shape": [480, 640, 3], "names": ["height", "width", "channel"], "info": {"fps": 30}}
    own = {"dtype": "float32", "shape": [3], "names": names}
    info = {"codebase_version": "v3.0", "fps": fps, "features": {"observation.images.front": image, state: own}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    path = folder / "data" / "chunk-000" / f"{file}.parquet"
    parquet.write_table(pyarrow.table(table), path)
    return path


def swing(frames, by=1.0):
    return by * np.outer(np.sin(np.linspace(0.0, 3.0, frames)), [30.0, -60.0, 10.0])


def test_an_episode_of_version_3(tmp_path):
    path = dataset(tmp_path, [swing(40)])
    clip = read_clip(path, DEGREES)
    assert (clip.skeleton.bones, clip.rate) == (("shoulder_pan", "elbow_flex", "gripper"), 30.0)
    assert np.degrees(angles_of(clip.rotation[:, 1:])) == pytest.approx(swing(40), abs=1e-4)
    (tmp_path / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    for other in ("tasks.parquet", "episodes/chunk-000/file-000.parquet"):
        (tmp_path / "meta" / other).write_bytes(path.read_bytes())
    assert recordings_below(tmp_path) == [path]  # of tables, those with frames


def test_names_of_version_2(tmp_path):
    names = {"motors": ["main_shoulder_pan", "main_elbow_flex", "main_gripper"]}
    clip = read_clip(dataset(tmp_path, [swing(9)], names=names, file="episode_000000"), DEGREES)
    assert clip.skeleton.bones == tuple(names["motors"])


def test_only_positions_are_joints_and_actions_do_for_states(tmp_path):
    names = ["pan.pos", "pan.vel", "ee_x"]
    clip = read_clip(dataset(tmp_path, [swing(9)], names=names, state="action"), ReadingOptions(unit=0.01))
    assert clip.skeleton.bones == ("pan",)
    assert angles_of(clip.rotation[:, 1:])[:, 0] == pytest.approx(0.01 * swing(9)[:, 0], abs=1e-6)


def test_of_several_episodes_one_is_chosen(tmp_path):
    path = dataset(tmp_path, [swing(20), swing(30, 0.5)])
    with pytest.raises(FileFormatError, match=r"holds 2 episodes \(0, 1\)\. Choose one: --skeleton NAME"):
        read_clip(path, DEGREES)
    clip = read_clip(path, ReadingOptions(unit=np.pi / 180.0, person="1"))
    assert np.degrees(angles_of(clip.rotation[:, 1:])) == pytest.approx(swing(30, 0.5), abs=1e-4)
    with pytest.raises(FileFormatError, match="no person in it is called '2'"):
        read_clip(path, ReadingOptions(unit=np.pi / 180.0, person="2"))


def test_what_is_wrong_is_said_with_its_remedy(tmp_path, monkeypatch):
    path = dataset(tmp_path, [swing(20)])
    with pytest.raises(FileFormatError, match=r"give --unit deg or --unit rad"):
        read_clip(path)
    with pytest.raises(FileFormatError, match=r"beyond two turns\. Is the unit right"):
        read_clip(path, ReadingOptions(unit=1.0))
    alone = tmp_path / "alone.parquet"
    alone.write_bytes(path.read_bytes())
    (tmp_path / "meta").rename(tmp_path / "moved")
    with pytest.raises(FileFormatError, match=r"without meta/info\.json, two folders above"):
        read_clip(alone, DEGREES)
    (tmp_path / "moved").rename(tmp_path / "meta")
    dataset(tmp_path, [swing(20)], names=None)
    with pytest.raises(FileFormatError, match=r"no names in observation\.state or action"):
        read_clip(path, DEGREES)
    info = tmp_path / "meta" / "info.json"
    for wrong in (
        "[]",
        '{"fps": 30}',
        '{"fps": "x", "features": {"action": {"names": ["a"]}}}',
        "{",
        '{"features": 3}',
    ):
        info.write_text(wrong)
        with pytest.raises(FileFormatError, match="not as LeRobot writes it"):
            read_clip(path, DEGREES)
    path = dataset(tmp_path, [np.where(np.arange(20)[:, None] == 7, np.nan, swing(20))])
    with pytest.raises(FileFormatError, match="a number is missing"):
        read_clip(path, DEGREES)
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(FileFormatError, match=r"Parquet needs pyarrow: pip install 'motiondeck\[lerobot\]'"):
        read_clip(path, DEGREES)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=8), st.booleans())
def test_any_damage_ends_in_one_line(tmp_path, place, piece, cut):
    path = dataset(tmp_path, [swing(20)])
    content = bytearray(path.read_bytes())
    place %= len(content)
    content[place:] = content[place : len(content) // 2] if cut else piece + content[place + len(piece) :]
    path.write_bytes(content)
    try:
        clip = read_clip(path, DEGREES)
    except MotiondeckError as error:
        message = str(error)
    else:
        assert clip.rotation.shape == (len(clip), 4, 4)
        return
    assert "\n" not in message
    assert len(message) < 1000
    assert "file-000" in message
