from pathlib import Path

import pytest

from benchmarks.reservoirs.zoo import LARGEST, libraries_of


@pytest.mark.parametrize("count", [1, 8, 16, 17, 31, 32, 33, 100])
def test_libraries_hold_8_to_16_motions_where_there_are_so_many(count):
    files = [Path(f"{number}.bvh") for number in range(count)]
    parts = libraries_of(files)
    assert [file for part in parts for file in part] == files
    assert all(min(count, 8) <= len(part) <= LARGEST for part in parts)
