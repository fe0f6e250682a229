from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from benchmarks.recognition.baselines import (
    Gaussian,
    conceptor_evidence,
    eros,
    frame_gaussians,
    lagged,
    linear_experts,
    mean_pose,
    nearest_by_warping,
)
from benchmarks.recognition.committee import committee
from benchmarks.recognition.contenders import candidates, contenders, ours
from benchmarks.recognition.first_check import first_check
from benchmarks.recognition.folds import (
    dimension_curves,
    measure,
    warp_curve,
)
from benchmarks.recognition.frequency_retrieval import (
    ALL_NUMBERS,
    FREQUENCIES,
    frequency_vector,
    nearest_frequencies,
)
from benchmarks.recognition.methods import Method, looking_at, proposal, shared_experts
from benchmarks.recognition.motion_templates import motion_templates, relations, template
from benchmarks.recognition.self_organising_map import motion_strings, pose_map
from benchmarks.recognition.unknown import Doubter, area_under_curve, nested_unknown_auc, unknown_auc
from controller.learning.recognition.experts import ExpertRecipe
from controller.learning.recognition.features import FeatureRecipe
from controller.learning.recognition.labelled_recordings import Example
from motiondeck_base.errors import MotiondeckError
from recognition_examples import PEOPLE, clip, dataset

LOOK = looking_at(FeatureRecipe(velocity=False, rate=15.0))
SMALL = ExpertRecipe(neurons=30)
METHODS = {
    "experts": shared_experts(SMALL),
    "committee": committee(SMALL, 3),
    "raw experts": shared_experts(ExpertRecipe(neurons=10, ridge=0.01), centred=False),
    "proposal": proposal(20),
    "mean pose": mean_pose,
    "Gaussians": frame_gaussians(),
    "linear experts": linear_experts(2, 0.1),
    "warping": nearest_by_warping,
    "Eros": eros,
    "conceptors": conceptor_evidence(SMALL),
    "map": motion_strings(side=5),
    "templates on postures": motion_templates,
}


@pytest.fixture(scope="module")
def examples():
    return dataset()


@pytest.mark.parametrize("name", METHODS)
def test_every_method_tells_three_plain_motions_apart(examples, name):
    # Templates want yes and no; a posture is made of them by asking whether each number is positive.
    look = (lambda e, tempo: (LOOK(e, tempo) > 0.0).astype(float)) if name.startswith("templates") else LOOK
    result = measure(name, lambda seed: [Method(name, look, METHODS[name])], examples, "half", [1])
    assert result.accuracy >= 0.9
    assert np.sum(result.confusion) == sum(len(examples.examples) - 15 for _ in range(3))


@pytest.mark.parametrize("name", METHODS)
def test_a_class_that_was_not_learned_cannot_win(examples, name):
    look = (lambda e, tempo: (LOOK(e, tempo) > 0.0).astype(float)) if name.startswith("templates") else LOOK
    signals = [look(example, 1.0) for example in examples.examples]
    learn = np.flatnonzero(examples.labels != 1)
    costs = METHODS[name](signals, examples.labels, 3)(learn, np.arange(len(signals)))
    assert np.isinf(costs[:, 1]).all()
    assert np.isfinite(costs[:, [0, 2]]).all()


def test_confusion_and_shares_tell_the_same_story(examples):
    def always_first(signals, labels, classes):
        return lambda learn, ask: np.tile(np.arange(classes, dtype=float), (len(ask), 1))

    result = measure("first", lambda seed: [Method("", LOOK, always_first)], examples, "actor-out", [1, 2])
    assert result.per_class == {"bow": 1.0, "march": 0.0, "wave": 0.0}
    assert result.accuracy == pytest.approx(1.0 / 3.0)
    assert np.array_equal(result.confusion, [[18, 0, 0]] * 3)


def test_a_nested_choice_takes_the_better_candidate_without_seeing_the_answers(examples):
    asked_about = []

    def nonsense(signals, labels, classes):
        return lambda learn, ask: np.random.default_rng(0).uniform(size=(len(ask), classes))

    def spying(signals, labels, classes):
        score = mean_pose(signals, labels, classes)

        def spied(learn, ask):
            asked_about.append((set(learn.tolist()), set(ask.tolist())))
            return score(learn, ask)

        return spied

    methods = [Method("nonsense", LOOK, nonsense), Method("spying", LOOK, spying)]
    assert measure("nested", lambda seed: methods, examples, "actor-out", [1]).accuracy >= 0.9
    everything = set(range(len(examples.examples)))
    while asked_about:
        # Two inner splits look at learned examples alone; the third call is the real question.
        (learn1, ask1), (learn2, ask2), (learn, ask) = asked_about[:3]
        del asked_about[:3]
        assert learn1 | ask1 | learn2 | ask2 <= learn
        assert learn | ask == everything


def test_all_contenders_are_named_and_the_nested_one_has_a_choice():
    assert {"experts (ours)", "motion templates", "1-NN Eros", "nearest mean pose"} <= set(contenders())
    assert len(candidates(1)) > 10


def test_warping_time_costs_these_motions_nothing(examples):
    points = warp_curve(ours(1)[0], examples, "actor-out", (0.7, 1.0, 1.4))
    assert [point.x for point in points] == [0.7, 1.0, 1.4]
    assert min(point.accuracy for point in points) >= 0.95


def test_fewer_dimensions_do_not_help(examples):
    curves = dimension_curves(examples, "actor-out", SMALL, (1, 10, 99))
    for points in curves.values():
        assert [point.x for point in points] == [1, 10]
        assert points[0].accuracy <= points[1].accuracy


def doubter(examples, prepare, level=0.0):
    signals = [LOOK(example, 1.0) for example in examples.examples]
    return Doubter(prepare(signals, examples.labels, 3), level)


@pytest.mark.parametrize("name", ["experts", "committee"])
def test_motions_left_out_are_less_sure(examples, name):
    assert unknown_auc(doubter(examples, METHODS[name]), examples.labels, examples.actors, "actor-out") > 0.8


def test_a_committee_of_one_that_looks_at_all_joints_together_ranks_as_the_experts_do(examples):
    alone = doubter(examples, committee(SMALL, 1, None)).score
    experts = doubter(examples, shared_experts(SMALL)).score
    learn, ask = np.flatnonzero(examples.actors != 0), np.flatnonzero(examples.actors == 0)
    difference = alone(learn, ask) - experts(learn, ask)
    assert np.allclose(difference, difference[0])  # the errors are the same; only the centre is taken clip by clip


def test_a_joint_that_hardly_moves_counts_as_much_as_one_that_swings():
    # The first joint swings at random whatever the class is; only the second, in the next three channels, knows it.
    rng, labels = np.random.default_rng(3), np.tile(np.arange(2), 10)
    signals = [
        np.hstack([0.2 * rng.standard_normal((60, 3)), 0.01 * (2 * label - 1) + 0.002 * rng.standard_normal((60, 3))])
        for label in labels
    ]
    costs = committee(SMALL, 1)(signals, labels, 2)(np.arange(10), np.arange(10, 20))
    assert np.array_equal(costs.argmin(1), labels[10:])
    assert np.abs(costs[:, 0] - costs[:, 1]).min() > 1.0


def test_a_nested_doubter_is_chosen_without_the_actor_and_the_class_that_are_asked():
    labels, actors = np.repeat(np.arange(4), 6), np.tile(np.arange(3), 8)
    calls = []

    def knowing(learn, ask):
        """Half as far from every learned class as those are from each other, unless it is one of them."""
        calls.append(np.concatenate([learn, ask]))
        costs = np.where(np.isin(np.arange(4), labels[learn]), 1.0, np.inf) * np.ones((len(ask), 1))
        costs[np.arange(len(ask)), labels[ask]] -= 0.5
        return costs

    def nonsense(learn, ask):
        return np.where(np.isfinite(knowing(learn, ask)), np.random.default_rng(0).uniform(size=(len(ask), 4)), np.inf)

    assert nested_unknown_auc([Doubter(nonsense), Doubter(knowing)], labels, actors, "actor-out") == 1.0
    # For each of 3 actors and 4 classes, 2 doubters are tried on 2 other actors and 3 other classes, and one is asked.
    choosing = [seen for seen in calls if len(np.unique(actors[seen])) == 2]
    assert (len(choosing), len(calls)) == (3 * 4 * 2 * 2 * 3, 3 * 4 * (2 * 2 * 3 + 1))
    assert {len(np.unique(labels[seen])) for seen in choosing} == {3}
    with pytest.raises(MotiondeckError, match="four classes"):
        nested_unknown_auc([Doubter(knowing)], labels % 3, actors, "actor-out")


def test_the_area_under_the_curve_counts_pairs():
    assert area_under_curve(np.array([3.0, 1.0]), np.array([0.0, 2.0])) == 0.75
    assert area_under_curve(np.ones(3), np.ones(2)) == 0.5


def test_a_gaussian_agrees_with_scipys():
    rng = np.random.default_rng(0)
    frames, asked = rng.normal(size=(50, 3)) @ rng.normal(size=(3, 3)), rng.normal(size=(4, 3))
    ours_ = Gaussian(frames, 0.1)
    covariance = np.cov(frames.T, bias=True)
    covariance += np.eye(3) * 0.1 * np.trace(covariance) / 3
    theirs = -multivariate_normal(frames.mean(0), covariance).logpdf(asked)
    assert np.allclose(np.diff(ours_.surprise(asked)), np.diff(theirs))


def test_lagged_frames_are_the_last_ones_in_order():
    signal = np.arange(5.0)[:, None]
    forced = lagged(signal, 2)
    assert np.array_equal(forced.states, [[0, 0, 1], [1, 0, 1], [2, 1, 1], [3, 2, 1]])
    assert np.array_equal(forced.targets, signal[1:])


def test_a_template_agrees_on_what_its_examples_agree_on():
    always, never = np.ones((6, 1)), np.zeros((6, 1))
    sometimes = np.array([[0.0], [1.0]] * 3)
    first = np.hstack([always, never, sometimes])
    second = np.hstack([always, never, 1.0 - sometimes])
    mean, counts = template([first, second, first[::2], second[::2]])
    assert counts[:, :2].all()
    assert np.allclose(mean[:, :2], [1.0, 0.0])
    assert not counts[:, 2].all()


def test_motion_templates_need_their_joints(examples):
    with pytest.raises(MotiondeckError, match="need a bone 'lfemur'"):
        relations(examples.examples[0], 1.0)


def test_frequency_vectors_tell_motions_by_their_pace_and_extents_by_how_far_they_go():
    fast, slow = ([Example(clip("march", who, pace), "", who, Path()) for who in PEOPLE] for pace in (0.5, 1.0))
    waving = [Example(clip("wave", who, 1.0), "", who, Path()) for who in PEOPLE]
    labels = np.array([0, 0, 0, 1, 1, 1, 2, 2, 2])
    vectors = [frequency_vector(example, 1.0) for example in fast + slow + waving]
    learn, ask = np.flatnonzero(np.arange(9) % 3), np.array([0, 3, 6])
    paces = nearest_frequencies(FREQUENCIES)(vectors, labels, 3)(learn, ask)
    assert paces[:2, :2].argmin(1).tolist() == [0, 1]
    assert nearest_frequencies(ALL_NUMBERS)(vectors, labels, 3)(learn, ask).argmin(1).tolist() == [0, 1, 2]
    # Half as fast is the same as learned at half the pace.
    assert np.allclose(frequency_vector(fast[0], 2.0), vectors[3], rtol=0.1)


def test_the_proposal_needs_recorded_angles(examples):
    from benchmarks.recognition.methods import at_recorded_angles

    taken_elsewhere = replace(examples.examples[0], path=examples.examples[0].path.with_suffix(".mat"))
    with pytest.raises(MotiondeckError, match=r"only \.amc files hold angles"):
        at_recorded_angles(taken_elsewhere, 1.0)


def test_the_nodes_of_a_map_lie_among_the_postures():
    rng = np.random.default_rng(0)
    frames = rng.normal(size=(400, 2)) * np.array([3.0, 1.0])
    nodes = pose_map(frames, 5)
    assert nodes.shape == (25, 2)
    nearest = np.sqrt(np.square(frames[:, None] - nodes).sum(2)).min(1)
    assert nearest.mean() < 0.75


def test_the_proposals_network_learns_a_sine_and_a_bias_helps_with_henon():
    plain, biased = first_check(200, 0.0), first_check(200, 0.2)
    assert plain.sine_free_run < 0.1
    assert biased.henon_one_step < plain.henon_one_step < 0.1
