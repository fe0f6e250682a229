import msgspec
import numpy as np
import pytest

import synthetic
from controller.learning.fit import settle
from controller.learning.measures.self_test import distances, run_free, self_test
from controller.learning.preparation.training_motion import Lessons
from controller.learning.recipe import read_recipe
from controller.learning.reservoirs.conceptor_training import cut, cut_to_tolerance, rank_within
from controller.motion.encodings.motion_matching import joint_features
from controller.networks.conceptor.network import ConceptorNetwork
from motiondeck_base.errors import FileFormatError


@pytest.fixture(scope="module")
def network():
    return synthetic.small_network()


def joints_apart(network, other, motion, frames):
    """How far two networks' joints are apart over a free run, mm."""
    runs = [joint_features(synthetic.small_encoding(), run_free(n, motion, frames)) for n in (network, other)]
    return distances(*runs).max()


@pytest.mark.parametrize("motion", list(synthetic.MOTIONS))
def test_a_tighter_tolerance_needs_a_higher_rank(network, motion):
    encoding = synthetic.small_encoding()
    ranks = [rank_within(network[motion], encoding, mm) for mm in (1000.0, 10.0, 0.5)]
    assert ranks[0] == 1
    assert ranks == sorted(ranks)
    assert 1 < ranks[2] <= len(network[motion].offset)


def test_the_next_frame_stays_within_the_tolerance(network):
    tight = cut_to_tolerance(network, synthetic.small_encoding(), 2.0)
    for motion in network.motions:
        assert len(tight[motion].offset) < len(network[motion].offset)
        assert joints_apart(network, tight, motion, 1) <= 2.0


def test_what_is_cut_still_plays(network):
    judge = synthetic.judge()
    tight = cut_to_tolerance(network, synthetic.small_encoding(), 0.5)
    assert all(verdict.passed for verdict in self_test(tight, judge).values())


def test_a_cut_keeps_the_first_directions(network):
    part = cut(network["wave"], 7)
    assert part.recurrent.shape == (network.neurons, 7)
    assert part.recurrent.flags.c_contiguous
    assert np.array_equal(part.states, network["wave"].states[:, :7])


def test_a_recipe_with_a_tolerance_gets_a_rank_of_its_own_for_each_motion():
    judge = synthetic.judge()
    recipe = msgspec.structs.replace(synthetic.SMALL_RECIPE, rank_tolerance_mm=5.0)
    network = settle(recipe, Lessons(*synthetic.lessons(), synthetic.RATE), 0, judge).network
    assert isinstance(network, ConceptorNetwork)
    whole = synthetic.small_network()
    for motion in network.motions:
        assert len(network[motion].offset) < recipe.rank
        assert joints_apart(whole, network, motion, 1) <= 5.1


def test_a_tolerance_of_nothing_is_refused(tmp_path):
    path = tmp_path / "recipe.toml"
    path.write_text(
        'name = "x"\nbody = "b.bvh"\nlicence = ""\n[network]\ntype = "conceptor"\nrank_tolerance_mm = 0.0\n'
        '[[motions]]\nname = "walk"\nfile = "b.bvh"\n'
    )
    with pytest.raises(FileFormatError, match=r"rank_tolerance_mm is 0\.0; it lies between"):
        read_recipe(path)
