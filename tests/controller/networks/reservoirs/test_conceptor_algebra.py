import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.networks.reservoirs.conceptor_algebra import (
    adapt_aperture,
    attenuation,
    conceptor,
    conjunction,
    correlation,
    disjunction,
    negation,
    quota,
    similarity,
)
from motiondeck_base.errors import MotiondeckError

N = 6
SEEDS = st.integers(0, 10_000)
APERTURES = st.floats(0.1, 30.0)


def states(seed, rank=N):
    rng = np.random.default_rng(seed)
    return rng.standard_normal((40, rank)) @ rng.standard_normal((rank, N))


def conceptors(rank=None):
    """Conceptors of random states, some of which leave directions out."""
    ranks = st.integers(1, N) if rank is None else st.just(rank)
    return st.builds(lambda seed, r, a: conceptor(correlation(states(seed, r)), a), SEEDS, ranks, APERTURES)


def at_most(c, b):
    """Whether b lets through whatever c does."""
    return np.linalg.eigvalsh(b - c).min() > -1e-6


@given(conceptors())
def test_a_conceptor_is_symmetric_with_eigenvalues_in_0_1(c):
    values = np.linalg.eigvalsh(c)
    assert np.array_equal(c, c.T)
    assert values.min() > -1e-9
    assert values.max() < 1.0
    assert 0.0 < quota(c) < 1.0


@given(SEEDS, APERTURES)
def test_a_conceptor_is_what_the_thesis_writes(seed, aperture):
    r = correlation(states(seed))
    assert np.allclose(conceptor(r, aperture), r @ np.linalg.inv(r + aperture**-2 * np.eye(N)), atol=1e-8)


@given(conceptors())
def test_aperture_times_one_changes_nothing(c):
    assert np.allclose(adapt_aperture(c, 1.0), c, atol=1e-9)


@given(SEEDS, st.floats(0.5, 5.0), st.floats(0.2, 5.0))
def test_adapting_the_aperture_is_computing_anew(seed, aperture, factor):
    r = correlation(states(seed))
    assert np.allclose(adapt_aperture(conceptor(r, aperture), factor), conceptor(r, aperture * factor), atol=1e-6)


@given(conceptors(), st.floats(0.2, 5.0), st.floats(0.2, 5.0))
def test_adapting_twice_multiplies(c, first, second):
    twice = adapt_aperture(adapt_aperture(c, first), second)
    assert np.allclose(twice, adapt_aperture(c, first * second), atol=1e-6)


def test_the_ends_of_the_aperture_are_projectors():
    c = np.diag([1.0, 0.5, 0.0])
    assert np.allclose(adapt_aperture(c, 0.0), np.diag([1.0, 0.0, 0.0]))
    assert np.allclose(adapt_aperture(c, np.inf), np.diag([1.0, 1.0, 0.0]))


@given(conceptors())
def test_not_twice_is_nothing(c):
    assert np.allclose(negation(negation(c)), c)


@given(conceptors(), conceptors())
def test_and_and_or_do_not_care_for_order(c, b):
    assert np.allclose(conjunction(c, b), conjunction(b, c), atol=1e-6)
    assert np.allclose(disjunction(c, b), disjunction(b, c), atol=1e-6)


@given(conceptors(), conceptors())
def test_de_morgan(c, b):
    assert np.allclose(negation(conjunction(c, b)), disjunction(negation(c), negation(b)), atol=1e-6)
    assert np.allclose(negation(disjunction(c, b)), conjunction(negation(c), negation(b)), atol=1e-6)


@given(conceptors(), conceptors())
def test_what_logic_makes_is_a_conceptor_again(c, b):
    for made in (conjunction(c, b), disjunction(c, b), negation(c), adapt_aperture(c, 2.0)):
        values = np.linalg.eigvalsh(made)
        assert np.allclose(made, made.T, atol=1e-9)
        assert -1e-7 <= values.min() <= values.max() <= 1.0 + 1e-7


@given(conceptors(), conceptors(), st.floats(0.2, 5.0))
def test_aperture_passes_through_and_and_or(c, b, factor):
    # Jaeger 2014, proposition 11.
    for join in (conjunction, disjunction):
        apart = join(adapt_aperture(c, factor), adapt_aperture(b, factor))
        assert np.allclose(adapt_aperture(join(c, b), factor), apart, atol=1e-4)


@given(conceptors(), st.floats(0.2, 5.0))
def test_not_turns_a_factor_of_the_aperture_upside_down(c, factor):
    turned = adapt_aperture(negation(c), 1.0 / factor)
    assert np.allclose(negation(adapt_aperture(c, factor)), turned, atol=1e-6)


@given(conceptors(N), conceptors(N), conceptors(N))
def test_and_groups_as_it_likes(c, b, d):
    assert np.allclose(conjunction(conjunction(c, b), d), conjunction(c, conjunction(b, d)), atol=1e-5)


@given(conceptors(N), conceptors(N))
def test_and_lets_less_through_and_or_more(c, b):
    assert at_most(conjunction(c, b), c)
    assert at_most(c, disjunction(c, b))


@given(conceptors(), conceptors())
def test_everything_and_nothing(c, b):
    assert np.allclose(conjunction(c, np.eye(N)), c, atol=1e-6)
    assert np.allclose(conjunction(c, np.zeros((N, N))), 0.0, atol=1e-9)
    assert np.allclose(disjunction(c, np.zeros((N, N))), c, atol=1e-6)


@given(SEEDS, SEEDS, APERTURES)
def test_or_is_the_conceptor_of_both_signals_together(first, second, aperture):
    r, q = correlation(states(first)), correlation(states(second))
    both = conceptor(r + q, aperture)
    assert np.allclose(disjunction(conceptor(r, aperture), conceptor(q, aperture)), both, atol=1e-5)


@given(conceptors(), conceptors())
def test_similarity_is_one_for_itself_and_never_more(c, b):
    assert similarity(c, c) == pytest.approx(1.0)
    assert -1e-12 <= similarity(c, b) <= 1.0 + 1e-9


def test_what_shares_no_direction_is_not_similar_and_has_no_and():
    c, b = np.diag([0.9, 0.5, 0.0, 0.0]), np.diag([0.0, 0.0, 0.3, 0.8])
    assert similarity(c, b) == 0.0
    assert np.allclose(conjunction(c, b), 0.0)
    assert similarity(c, np.zeros((4, 4))) == 0.0


@given(SEEDS)
def test_a_wider_aperture_takes_less_away(seed):
    r = correlation(states(seed))
    taken = [attenuation(conceptor(r, aperture), r) for aperture in (0.1, 1.0, 10.0)]
    assert 1.0 >= taken[0] > taken[1] > taken[2] >= 0.0


def test_impossible_apertures_are_refused():
    with pytest.raises(MotiondeckError, match="aperture -1"):
        conceptor(np.eye(2), -1.0)
    with pytest.raises(MotiondeckError, match="aperture factor nan"):
        adapt_aperture(np.eye(2), float("nan"))
