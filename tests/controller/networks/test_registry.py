"""A kind of network is a folder, and its trainer a file of the same name."""

import re
from pathlib import Path

import pytest

from controller.learning.trainers.trainer import kind_of, network_recipes, trainer_named
from controller.motion.encodings.encoding import ENCODINGS
from controller.networks.registry import network_kind, network_kinds
from motiondeck_base.errors import UnknownNameError


def test_each_kind_is_found_by_its_folder():
    assert set(network_kinds()) >= {
        "conceptor",
        "echo-state",
        "phase-conceptor",
        "shared-conceptor",
        "centralized",
    }
    for kind in network_kinds():
        assert network_kind(kind).kind == kind


def test_each_kind_has_a_trainer_whose_recipe_bears_its_name():
    assert len(network_recipes()) == len(network_kinds())
    for kind in network_kinds():
        assert kind_of(trainer_named(kind).recipe()) == kind


def test_an_unknown_kind_is_refused_with_the_nearest():
    with pytest.raises(UnknownNameError, match="conceptor"):
        network_kind("conzeptor")


def test_nothing_asks_for_the_class_of_a_network_recipe_or_encoding():
    """They are asked through their own methods; the class of a rig's body is known to the encodings alone."""
    kinds = [network_kind(kind) for kind in network_kinds()]
    recipes, bases = network_recipes(), [base for kind in kinds for base in kind.__mro__[:-1]]
    names = {one.__name__ for one in (*bases, *recipes, *ENCODINGS.values())} - {"Generic", "ABC", "Protocol"}
    asks = re.compile(r"isinstance\([^\n]*\b(" + "|".join(sorted({*names, "JointBody"})) + r")\b")
    root = Path(__file__).parents[3]
    found = [
        path.relative_to(root).as_posix()
        for room in ("controller", "sim", "motiondeck")
        for path in sorted((root / room).rglob("*.py"))
        if asks.search(path.read_text())
    ]
    assert found == ["controller/motion/encodings/encoding.py"]
