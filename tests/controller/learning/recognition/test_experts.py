import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.learning.recognition.experts import (
    ExpertRecipe,
    expert_reservoir,
    force,
    frame_errors,
    log_errors,
    margins,
    mean_errors,
    moments,
    readout,
    teach,
    total,
)
from controller.learning.recognition.features import FeatureRecipe, features
from controller.networks.ridge import ridge
from motiondeck_base.errors import MotiondeckError
from recognition_examples import clip

SMALL = ExpertRecipe(neurons=20)
LOOK = FeatureRecipe(velocity=False)


def signals(seed, count=4, channels=3):
    rng = np.random.default_rng(seed)
    return [np.cumsum(rng.normal(0, 0.1, (int(rng.integers(8, 40)), channels)), axis=0) for _ in range(count)]


@given(st.integers(0, 1000))
def test_a_readout_from_moments_is_the_ridge_regression_on_all_states(seed):
    forced = force(expert_reservoir(SMALL, 3), signals(seed), 2)
    together = total(moments(f) for f in forced)
    states = np.concatenate([f.states for f in forced])
    targets = np.concatenate([f.targets for f in forced])
    expected = ridge(states, targets, 0.1 * np.square(states).sum() / 20)
    assert np.allclose(readout(together, 0.1), expected, atol=1e-6)


@given(st.integers(0, 1000))
def test_moments_know_the_error_of_any_readout(seed):
    forced = force(expert_reservoir(SMALL, 3), signals(seed), 0)
    weights = np.random.default_rng(seed).normal(0, 0.3, (3, 20))
    groups = weights.reshape(3, 2, 10).transpose(1, 0, 2)
    for readouts, together in ((weights[None], 3), (groups, 1)):
        errors = np.concatenate([frame_errors(readouts[None], f, together) for f in forced])
        found = mean_errors(readouts, total(moments(f) for f in forced), together)
        assert found == pytest.approx(errors.mean((0, 1)), rel=1e-8)


def test_a_state_has_seen_everything_up_to_the_frame_before():
    signal = signals(1, 1)[0]
    reservoir = expert_reservoir(SMALL, 3)
    other = signal.copy()
    other[-1] += 5.0
    one, two = force(reservoir, [signal], 0)[0], force(reservoir, [other], 0)[0]
    assert np.array_equal(one.states, two.states)
    assert not np.array_equal(one.targets[-1], two.targets[-1])


@pytest.mark.parametrize("frames", [2, 3, 5, 9])
def test_a_clip_shorter_than_the_washout_still_counts(frames):
    forced = force(expert_reservoir(SMALL, 3), [np.ones((frames, 3))], washout=50)[0]
    assert len(forced.targets) >= max(1, 2 * (frames - 1) // 3)


def test_a_single_frame_and_a_gap_are_refused_by_number():
    reservoir = expert_reservoir(SMALL, 3)
    with pytest.raises(MotiondeckError, match="motion 1: 1 frames"):
        force(reservoir, [np.ones((5, 3)), np.ones((1, 3))], 0)
    gap = np.ones((5, 3))
    gap[2, 1] = np.nan
    with pytest.raises(MotiondeckError, match="motion 0: its features hold a number that is not finite"):
        force(reservoir, [gap], 0)


@pytest.mark.parametrize(
    "wrong", [{"neurons": 0}, {"leak": 0.0}, {"ridge": 0.0}, {"seed": -1}, {"spectral_radius": -1}]
)
def test_impossible_recipes_are_refused(wrong):
    with pytest.raises(MotiondeckError):
        ExpertRecipe(**wrong)


def test_constant_channels_do_no_harm():
    parts = [np.column_stack([s, np.zeros((len(s), 2)), np.full((len(s), 1), 7.0)]) for s in signals(3)]
    bank = teach(SMALL, parts, ["a", "a", "b", "b"])
    assert np.isfinite(bank.costs(bank.force(parts))).all()


def test_each_motion_is_foretold_best_by_its_own_expert():
    # The proposal's inequality: mse(e_i, m_i) < mse(e_i, m_j), on takes that were not learned.
    names = ("bow", "march", "wave")
    learned = [features(clip(name, "ann", pace), LOOK) for name in names for pace in (0.9, 1.0, 1.1)]
    bank = teach(ExpertRecipe(), learned, [name for name in names for _ in range(3)])
    asked = [features(clip(name, "bob", 1.05, 20), LOOK) for name in names]
    errors = log_errors(bank.readouts, bank.force(asked), bank.together)
    assert (np.diag(errors) == errors.min(0)).all()


def test_the_margin_is_the_lead_over_the_second():
    costs = np.array([[3.0, -1.0, 0.5], [2.0, 2.0, 9.0]])
    assert np.allclose(margins(costs), [1.5, 0.0])
    assert np.allclose(margins(costs[:, :1]), 0.0)


def test_a_committee_is_the_mean_over_groups_and_joints():
    """Each group judges by its own neurons, joint by joint; the mean is what each would say by itself."""
    parts, names = signals(7, 6, channels=6), ["a", "b", "a", "b", "a", "b"]
    recipe = ExpertRecipe(neurons=20, groups=2)
    bank = teach(recipe, parts, names)
    forced = bank.force(parts)
    expected = np.zeros((len(parts), 2))
    for group in (slice(0, 10), slice(10, 20)):
        for expert, of in enumerate(bank.moments):
            weights = ridge_of(of, group, recipe.ridge)
            for number, one in enumerate(forced):
                square = np.square(one.states[:, group] @ weights.T - one.targets).mean(0)
                expected[number, expert] += np.log(square.reshape(2, 3).mean(1)).sum() / 4.0
    assert np.allclose(bank.costs(bank.force(parts)), expected - bank.centre, atol=1e-9)


def ridge_of(of, group, share):
    """A readout from moments, by solving the normal equations."""
    xx, xy = of.xx[group, group], of.xy[group]
    return np.linalg.solve(xx + share * np.trace(xx) / len(xx) * np.eye(len(xx)), xy).T


def test_a_committee_subtracts_a_share_of_the_best_cost_from_its_margin():
    parts = signals(8, 4, channels=6)
    costs = np.array([[-1.0, -0.5], [2.0, 3.0]])
    assert np.allclose(teach(SMALL, parts, ["a", "b"] * 2).confidences(costs), [0.5, 1.0])
    committee = teach(ExpertRecipe(neurons=20, groups=2), parts, ["a", "b"] * 2)
    assert np.allclose(committee.confidences(costs), [0.6, 0.8])
