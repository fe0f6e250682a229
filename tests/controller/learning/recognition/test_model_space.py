import numpy as np

from controller.learning.recognition.experts import ExpertRecipe, ModelSpace, expert_reservoir, force, moments

RECIPE = ExpertRecipe(neurons=20, groups=2, washout=0)


def test_one_frequency_is_told_from_another_at_any_phase_and_votes_spread_as_far_as_costs():
    rng = np.random.default_rng(1)

    def swings(clips):
        labels = [number % 2 for number in range(clips)]
        times = np.arange(60)[:, None] / 30.0
        starts = rng.uniform(0.0, 2.0 * np.pi, (clips, 1)) + np.arange(3)
        signals = [np.sin(2.0 * np.pi * (1.0 + 0.5 * of) * times + s) for of, s in zip(labels, starts, strict=True)]
        return labels, [moments(forced) for forced in force(expert_reservoir(RECIPE, 3), signals, RECIPE.washout)]

    labels, learned = swings(40)
    costs = rng.normal(size=(40, 2))
    space = ModelSpace.fit(learned, labels, costs, RECIPE)
    spread = (costs - costs.mean(1, keepdims=True)).std()
    assert np.isclose(space.votes(learned, RECIPE).std(), spread, rtol=1e-3)
    assert np.allclose(space.votes(learned, RECIPE).sum(1), 0.0, atol=1e-4)
    asked, others = swings(40)
    assert np.mean(space.votes(others, RECIPE).argmax(1) == asked) > 0.9
