"""Arrays in a temporary file: what is read is what was written."""

import pickle
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from motiondeck_base.arrays_on_disk import ArraysOnDisk, on_disk, release


@settings(max_examples=20)
@given(
    st.lists(st.tuples(st.sampled_from("abc"), arrays(np.float64, array_shapes(max_dims=2, max_side=4))), max_size=8)
)
def test_it_is_a_dictionary_of_arrays(written):
    known, stored = {}, ArraysOnDisk()
    for name, array in written:
        known[name] = stored[name] = array
    assert list(stored) == list(known)
    for name, array in known.items():
        assert np.array_equal(stored[name], array, equal_nan=True)


def test_each_access_has_its_own_copy():
    stored = ArraysOnDisk()
    stored["a"] = np.arange(6.0).reshape(3, 2).T
    stored["a"][:] = 0.0
    assert stored["a"].tolist() == [[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]]


def test_another_process_gets_a_dictionary():
    stored = ArraysOnDisk()
    stored["a"] = np.ones(2)
    assert pickle.loads(pickle.dumps(stored))["a"].tolist() == [1.0, 1.0]


@settings(max_examples=20)
@given(arrays(st.sampled_from([np.float64, np.float32, np.float16, np.int8]), array_shapes(max_dims=3, max_side=5)))
def test_an_array_on_disk_stays_as_it_is_and_as_it_is_changed_when_memory_is_released(array):
    stored = on_disk(array.T)
    release()
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


def resident():
    """The memory in use, bytes."""
    return 4096 * int(Path("/proc/self/statm").read_text().split()[1])
