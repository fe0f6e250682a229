import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.recognition.alignment import aligned, locally_aligned, warped, warping_distances, warping_path


def slow_warp(cost):
    table = np.full((cost.shape[0] + 1, cost.shape[1] + 1), np.inf)
    table[0, 0] = 0.0
    for i in range(cost.shape[0]):
        for j in range(cost.shape[1]):
            table[i + 1, j + 1] = cost[i, j] + min(table[i, j], table[i, j + 1], table[i + 1, j])
    return table[1:, 1:]


def slow_local(similarity, gap):
    table = np.zeros((similarity.shape[0] + 1, similarity.shape[1] + 1))
    for i in range(similarity.shape[0]):
        for j in range(similarity.shape[1]):
            options = table[i, j] + similarity[i, j], table[i, j + 1] - gap, table[i + 1, j] - gap, 0.0
            table[i + 1, j + 1] = max(options)
    return table[1:, 1:]


@given(st.integers(0, 10_000), st.integers(1, 3), st.integers(1, 7), st.integers(1, 7))
def test_warping_is_what_the_definition_says(seed, batch, rows, columns):
    cost = np.random.default_rng(seed).uniform(0, 1, (batch, rows, columns))
    assert np.allclose(warped(cost), [slow_warp(one) for one in cost])


@given(st.integers(0, 10_000), st.integers(1, 7), st.integers(1, 7))
def test_local_alignment_is_what_the_definition_says(seed, rows, columns):
    similarity = np.random.default_rng(seed).uniform(-1, 1, (2, rows, columns))
    assert np.allclose(locally_aligned(similarity, 0.3), [slow_local(one, 0.3) for one in similarity])


@given(st.integers(0, 10_000), st.integers(1, 7), st.integers(1, 7))
def test_the_path_costs_what_the_table_says(seed, rows, columns):
    cost = np.random.default_rng(seed).uniform(0, 1, (rows, columns))
    table = warped(cost[None])[0]
    path = warping_path(table)
    assert path[0] == (0, 0)
    assert path[-1] == (rows - 1, columns - 1)
    assert np.isclose(sum(cost[cell] for cell in path), table[-1, -1])


def test_a_motion_at_half_the_pace_is_no_distance_away():
    signal = np.random.default_rng(0).normal(size=(10, 3))
    other = np.random.default_rng(1).normal(size=(25, 3))
    distances = warping_distances(signal, [np.repeat(signal, 2, axis=0), other, signal])
    assert np.allclose(distances[[0, 2]], 0.0)
    assert distances[1] > 0.5


@given(st.integers(1, 50), st.integers(2, 80))
def test_alignment_keeps_both_ends_and_straight_lines(count, frames):
    out = aligned(np.arange(count, dtype=float)[:, None], frames)
    assert np.allclose(out[:, 0], np.linspace(0.0, count - 1.0, frames))
