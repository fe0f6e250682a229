"""A filled C3D file has points where there were none, and is the same file everywhere else."""

import numpy as np
import pytest

from controller.motion.formats.markers.c3d import read_c3d, with_points
from controller.motion.formats.writing import csv_text
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import write_file
from recordings import c3d_bytes


@pytest.fixture
def seen():
    points = np.random.default_rng(1).uniform(-900.0, 900.0, (5, 3, 3))
    points[1:3, 2] = np.nan
    points[4, 0] = np.nan
    return points


@pytest.mark.parametrize("processor", [84, 85, 86])
@pytest.mark.parametrize(("scale", "off"), [(-0.1, 1e-6), (0.05, 3e-5)])
def test_points_are_written_where_there_were_none(tmp_path, seen, processor, scale, off):
    file = tmp_path / "lost.c3d"
    file.write_bytes(c3d_bytes(["A", "B", "C"], seen, processor=processor, scale=scale))
    before = read_c3d(file).position
    new = np.full(seen.shape, 0.123)
    new[4, 0] = np.nan  # stays open
    content = with_points(file, new)
    (tmp_path / "filled.c3d").write_bytes(content)
    after = read_c3d(tmp_path / "filled.c3d").position
    assert np.array_equal(after[np.isfinite(before)], before[np.isfinite(before)])
    np.testing.assert_allclose(after[1:3, 2], 0.123, atol=off)
    assert np.isnan(after[4, 0]).all()
    changed = np.flatnonzero(np.frombuffer(content, "u1") != np.frombuffer(file.read_bytes(), "u1"))
    assert len(changed) <= 2 * 16


def test_a_place_beyond_whole_numbers_is_refused(tmp_path, seen):
    file = tmp_path / "lost.c3d"
    file.write_bytes(c3d_bytes(["A", "B", "C"], seen, scale=0.05))
    with pytest.raises(FileFormatError, match=r"lost\.c3d: a filled point is beyond"):
        with_points(file, np.full(seen.shape, 9.0))


def test_csv_leaves_empty_what_is_missing(tmp_path, seen):
    file = tmp_path / "lost.c3d"
    file.write_bytes(c3d_bytes(["A", "B,b", "C"], seen))
    markers = read_c3d(file)
    rows = csv_text(markers.labels, markers.position, markers.rate).splitlines()
    assert rows[0] == "time_s,A.x,A.y,A.z,B b.x,B b.y,B b.z,C.x,C.y,C.z"
    assert len(rows) == 6
    assert rows[2].endswith(",,,")
    assert rows[2].startswith("0.008333,")
    with pytest.raises(FileFormatError, match="cannot be written"):
        write_file(tmp_path / "no" / "such.csv", b"")
