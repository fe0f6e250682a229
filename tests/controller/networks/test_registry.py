"""A kind of network is a folder, and its trainer a file of the same name."""

import pytest

from controller.learning.trainers.registry import kind_of, network_recipes, trainer_named
from controller.networks.registry import network_kind, network_kinds
from motiondeck_base.errors import UnknownNameError


def test_each_kind_is_found_by_its_folder():
    assert set(network_kinds()) >= {"conceptor", "echo-state", "random-feature", "phase-conceptor", "centralized"}
    for kind in network_kinds():
        assert network_kind(kind).kind == kind


def test_each_kind_has_a_trainer_whose_recipe_bears_its_name():
    assert len(network_recipes()) == len(network_kinds())
    for kind in network_kinds():
        assert kind_of(trainer_named(kind).recipe()) == kind


def test_an_unknown_kind_is_refused_with_the_nearest():
    with pytest.raises(UnknownNameError, match="conceptor"):
        network_kind("conzeptor")
