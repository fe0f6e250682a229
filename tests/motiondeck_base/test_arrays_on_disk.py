"""Arrays in a temporary file: what is read is what was written."""

import pickle

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from motiondeck_base.arrays_on_disk import ArraysOnDisk


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
