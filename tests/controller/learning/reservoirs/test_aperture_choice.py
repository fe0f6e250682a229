import msgspec
import numpy as np
import pytest

import synthetic
from controller.learning.measures.disturbance import FREE_RUN
from controller.learning.measures.self_test import self_test
from controller.learning.preparation.training_motion import Lessons
from controller.learning.reservoirs.aperture_choice import APERTURES, attenuations, settled_network
from controller.learning.reservoirs.conceptor_training import conceptor_network, load_reservoir
from controller.motion.encodings.motion_matching import joint_features

CHOOSING = msgspec.structs.replace(synthetic.SMALL_RECIPE, choose_apertures=True)


@pytest.fixture(scope="module")
def judge():
    return synthetic.judge()


@pytest.fixture(scope="module")
def loaded():
    return load_reservoir(synthetic.lessons()[0], CHOOSING, 0)


def lessons():
    return Lessons(*synthetic.lessons(), synthetic.RATE)


def settled(recipe, loaded, judge):
    return settled_network(loaded, lessons(), recipe, judge, 0)[0]


def test_attenuation_is_a_share(loaded):
    lost = attenuations(loaded.states[0], loaded, CHOOSING)
    assert ((lost >= 0.0) & (lost <= 1.0)).all()
    assert lost.shape == (len(APERTURES),)


def test_a_motion_that_does_not_hold_gets_another_aperture(loaded, judge):
    weak = msgspec.structs.replace(CHOOSING, aperture=0.5)
    plain = self_test(conceptor_network(loaded, lessons(), weak), judge)
    chosen = self_test(settled(weak, loaded, judge), judge)
    assert not all(verdict.passed for verdict in plain.values())
    assert sum(v.passed for v in chosen.values()) > sum(v.passed for v in plain.values())


def test_failures_are_those_of_the_network_that_was_cut(loaded, judge):
    crude = msgspec.structs.replace(CHOOSING, rank_tolerance_mm=1e6)
    network, failed = settled_network(loaded, lessons(), crude, judge, 0)
    assert {network[name].project.shape[0] for name in network.motions} == {1}
    assert max(failed.values()) == FREE_RUN


def test_an_aperture_that_was_given_is_kept(loaded, judge):
    weak = msgspec.structs.replace(CHOOSING, aperture=0.5, apertures=dict.fromkeys(synthetic.MOTIONS, 0.5))
    plain = conceptor_network(loaded, lessons(), weak)
    kept = settled(weak, loaded, judge)
    for name in plain.motions:
        assert np.array_equal(kept[name].project, plain[name].project)
        assert np.isfinite(joint_features(synthetic.small_encoding(), kept.anchors(name))).all()
