"""A recording of each source against an independent reading of its file; `python -m benchmarks readings` takes all."""

import pytest

from benchmarks.recordings.readings import measured

FILES = (
    "bvh/bandai/bow_old_001.bvh",
    "bvh/iclone_cmu_02_03.bvh",
    "cmu/02/02_03.amc",
    "hdm05/squat1Reps/HDM_bk_squat1Reps_013_120.amc",
    "jaeger/nnRawStandup.mat",
)


@pytest.mark.parametrize("file", FILES)
def test_a_recording_is_read_carried_and_written_as_its_file_has_it(mocap_data, file):
    path = mocap_data / file
    found = measured(path, mocap_data)
    assert found.joints_mm < 0.01
    assert not found.carried_degrees > 1.0
    assert not found.path > 0.01
    assert 0.8 < found.hips_stand < 1.1 or "Standup" in file
    assert not found.lacking
    assert found.bvh_mm < 1.0
    assert found.bvh_degrees < 0.1
    assert found.csv_mm < 1.0
    assert found.csv_carried_mm < 1.0
    assert found.by_shape
