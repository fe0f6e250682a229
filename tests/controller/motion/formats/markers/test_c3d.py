"""The C3D reader sees the same points whatever machine wrote the file, and says what is wrong with one."""

import numpy as np
import pytest

from controller.motion.formats.markers.c3d import read_c3d
from motiondeck_base.errors import FileFormatError
from recordings import c3d_bytes

LABELS = ["eva:C7", "eva:CLAV", "*3"]


def points(frames=4, count=3):
    return np.random.default_rng(1).uniform(-900.0, 900.0, (frames, count, 3))


def write(folder, content):
    (folder / "walk.c3d").write_bytes(content)
    return folder / "walk.c3d"


@pytest.mark.parametrize("processor", [84, 85, 86])
@pytest.mark.parametrize(("scale", "off"), [(-0.1, 1e-6), (0.05, 3e-5)])
def test_every_machine_and_both_kinds_of_numbers(tmp_path, processor, scale, off):
    seen = points()
    seen[1, 2] = np.nan
    markers = read_c3d(write(tmp_path, c3d_bytes(LABELS, seen, processor=processor, scale=scale)))
    np.testing.assert_allclose(markers.position, seen / 1000.0, atol=off)
    assert np.isnan(markers.position[1, 2]).all()
    assert np.isnan(markers.position).sum() == 3
    assert (markers.labels, markers.up, markers.source) == (tuple(LABELS), "z", "walk.c3d")
    assert markers.rate == pytest.approx(120.0)


def test_units_axes_and_what_is_not_said(tmp_path):
    metres = read_c3d(write(tmp_path, c3d_bytes(LABELS, points() / 1000.0, unit="m", up="+Y")))
    np.testing.assert_allclose(metres.position, points() / 1000.0, atol=1e-6)
    assert metres.up == "y"
    assert read_c3d(write(tmp_path, c3d_bytes(LABELS, points(), up=None))).up is None


def test_points_at_the_origin_were_not_seen(tmp_path):
    seen = points()
    seen[2, 0] = 0.0
    assert np.isnan(read_c3d(write(tmp_path, c3d_bytes(LABELS, seen))).position[2, 0]).all()


def test_a_point_farther_than_ten_kilometres_is_a_broken_number(tmp_path):
    """Studio origins may lie kilometres away (survey coordinates); a damaged float lies beyond any place."""
    seen = points() / 1000.0
    seen[0, 0, 0], seen[1, 1, 1], seen[2, 2, 2] = 9990.0, -10010.0, 1e30
    read = read_c3d(write(tmp_path, c3d_bytes(LABELS, seen, unit="m"))).position
    assert read[0, 0, 0] == pytest.approx(9990.0)
    assert np.argwhere(np.isnan(read).all(axis=-1)).tolist() == [[1, 1], [2, 2]]


def test_more_points_than_one_parameter_can_label(tmp_path):
    labels = [f"p{number}" for number in range(300)]
    markers = read_c3d(write(tmp_path, c3d_bytes(labels, points(2, 300))))
    assert markers.labels == tuple(labels)
    unlabelled = c3d_bytes(labels, points(2, 300)).replace(b"LABELS2", b"LABELZ2")
    assert read_c3d(write(tmp_path, unlabelled)).labels[253:258] == ("p253", "p254", "*256", "*257", "*258")


def test_more_frames_than_the_header_can_count(tmp_path):
    seen = points(65540, 1)
    ends = [("A", (1, 0)), ("B", (65540 % 65536, 1))]
    trial = [
        (f"ACTUAL_{name}_FIELD", 2, [2], np.array(value, dtype="<u2").tobytes())
        for name, value in zip(("START", "END"), (value for _, value in ends), strict=True)
    ]
    content = c3d_bytes(["C7"], np.zeros((4, 1, 3)) + 1.0, extra=trial).replace(b"POINT", b"TRIAL")
    head = bytearray(content[: -4 * 16])
    head[6:10] = np.array([1, 65535], dtype="<u2").tobytes()
    words = np.concatenate([seen, np.zeros((len(seen), 1, 1))], axis=-1).astype("<f4")
    assert len(read_c3d(write(tmp_path, bytes(head) + words.tobytes())).position) == 65540


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"\2\x50" + bytes(2000), "unknown kind of machine"),
        (b"BVH" + bytes(2000), "no C3D file"),
        (b"\x50\x50" + bytes(2000), "its parameters are not in the file"),
        (c3d_bytes(LABELS, points())[:-1], "4 frames of 3 points are announced, 3 are there"),
        (c3d_bytes(LABELS, points(), rate=0.0), "a rate of 0 frames"),
        (c3d_bytes(LABELS, points() * np.nan), "no point was ever seen"),
        (c3d_bytes(LABELS, points()).replace(b"SCALE\x09\0\x04", b"SCALE\x09\0\x07"), "its parameters are damaged"),
    ],
)
def test_a_broken_file_is_refused_by_name(tmp_path, content, problem):
    with pytest.raises(FileFormatError, match=problem) as caught:
        read_c3d(write(tmp_path, content))
    assert "walk.c3d" in str(caught.value)


def test_recorded_files_are_read(mocap_data):
    """Frames, points and rates as the files' headers give them; two label fewer points than they hold."""
    expected = {
        "02_03_runjog": (173, 41),
        "0803_walk": (353, 50),
        "133_01_crawlStandup": (1375, 41),
        "16_36_runjog": (189, 330),
        "49_08_CartWheel": (575, 336),
        "55_01dance": (1806, 43),
    }
    for name, shape in expected.items():
        markers = read_c3d(mocap_data / "c3d" / f"{name}.c3d")
        assert markers.position.shape[:2] == shape
        assert markers.rate == 120.0
        assert np.nanmin(markers.position[..., 2]) > -0.1
        assert 1.0 < np.nanmax(markers.position[..., 2]) < 2.1
