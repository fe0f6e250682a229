"""Arrays in a temporary file: what is read is what was written."""

import pickle
import resource
from pathlib import Path
from unittest.mock import patch

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from motiondeck_base import arrays_on_disk
from motiondeck_base.arrays_on_disk import on_disk, release


@settings(max_examples=20)
@given(
    arrays(st.sampled_from([np.float64, np.float32, np.float16, np.int8]), array_shapes(max_dims=3, max_side=5)),
    st.sampled_from([0, arrays_on_disk.SMALL]),
)
def test_an_array_on_disk_stays_as_it_is_and_as_it_is_changed_when_memory_is_released(array, small):
    with patch.object(arrays_on_disk, "SMALL", small):
        stored = on_disk(array.T)
    release()
    assert not np.shares_memory(stored, array)
    assert stored.dtype == array.dtype
    assert np.array_equal(stored, array.T, equal_nan=True)
    stored[...] = 1
    release()
    assert (pickle.loads(pickle.dumps(stored)) == 1).all()


def test_released_memory_goes_back_to_the_system():
    stored = on_disk(np.ones(4_000_000))
    assert stored.sum() == 4_000_000
    before = resident()
    release()
    assert before - resident() > 30e6


def test_more_arrays_than_a_program_may_usually_open_files():
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, before[1]))
    arrays_on_disk._allow_many_files.cache_clear()
    try:
        with patch.object(arrays_on_disk, "SMALL", 0):
            stored = [on_disk(np.full(2, number)) for number in range(400)]
        assert [int(array[0]) for array in stored] == [*range(400)]
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def resident():
    """The memory in use, bytes."""
    return 4096 * int(Path("/proc/self/statm").read_text().split()[1])
