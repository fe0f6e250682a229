"""Orbits of the neurons, seen from where the shipped networks play."""

import numpy as np
import pytest

from controller.networks.orbits import orbits
from controller.networks.reservoirs.conceptor_algebra import conceptor, correlation, similarity
from shipped_libraries import shipped


@pytest.fixture(scope="module")
def thesis15():
    return shipped()


@pytest.fixture(scope="module")
def found(thesis15):
    return orbits(thesis15.network, {motion.name: motion.frames for motion in thesis15.info.motions})


def test_a_loop_is_closed_and_a_one_shot_ends(thesis15, found):
    for motion in thesis15.info.motions:
        path = found.paths[motion.name]
        step = np.linalg.norm(np.diff(path, axis=0), axis=1)
        rests = step[-5:].max() < 0.02 * step.max()
        assert rests == (motion.plays == "once"), motion.name
        assert rests or np.linalg.norm(path[-1] - path[0]) < 3.0 * step.max(), motion.name


def test_a_network_that_plays_is_on_the_orbit_of_its_motion(thesis15, found):
    player, out = thesis15.network.twin(), np.zeros(thesis15.network.channels)
    for motion in ("walk", "waltz"):
        player.cue(motion, 2)
        for _ in range(30):
            player.advance(out)
        point = found.point(player.activation)
        apart = {name: np.linalg.norm(path - point, axis=1).min() for name, path in found.paths.items()}
        assert min(apart, key=apart.get) == motion
        assert apart[motion] < 0.05


def test_the_three_directions_show_most_and_reach_one(found):
    every = np.concatenate([*found.paths.values()])
    spread = every.std(0)
    assert spread[0] >= spread[1] >= spread[2] > 0.0
    assert np.mean(np.linalg.norm(every, axis=1) <= 1.0) == pytest.approx(0.95, abs=0.01)
    assert 0.1 < found.share <= 1.0


def test_motions_overlap_as_far_as_they_use_the_same_neurons(thesis15, found):
    names = list(found.paths)
    assert found.overlap.diagonal() == pytest.approx(np.ones(len(names)))
    assert found.overlap == pytest.approx(found.overlap.T)
    assert ((found.overlap > 0.0) & (found.overlap < 1.0 + 1e-9)).all()
    walk = dict(zip(names, found.overlap[names.index("walk")], strict=True))
    assert walk["slow-walk"] > walk["jog"] > walk["waltz"] > walk["crawl"]

    # As the conceptors of a small aperture are alike, computed by their definition.
    states, player, out = {}, thesis15.network.twin(), np.zeros(thesis15.network.channels)
    for motion in ("walk", "crawl"):
        player.cue(motion, 0)
        count = {m.name: m.frames for m in thesis15.info.motions}[motion]
        states[motion] = np.array([player.advance(out) or player.activation.copy() for _ in range(count)])
    c, b = (conceptor(correlation(x), 1e-3) for x in states.values())
    assert walk["crawl"] == pytest.approx(similarity(c, b), abs=0.02)


def test_looking_does_not_disturb_what_plays(thesis15):
    player = thesis15.network.twin()
    player.cue("walk", 0)
    before = player.snapshot()
    orbits(player, {motion.name: 20 for motion in thesis15.info.motions})
    assert np.array_equal(player.snapshot()[2], before[2])


def test_what_has_no_neurons_is_told_apart(thesis15):
    assert thesis15.network.activation is not None
    assert shipped("cmu86").network.activation is None
