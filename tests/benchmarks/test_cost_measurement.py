import pytest

import synthetic
from benchmarks.papers import cost_measurement as cost
from controller.learning.recipe import LibraryRecipe, MotionRecipe


@pytest.fixture
def found(monkeypatch):
    monkeypatch.setattr(cost, "SIZES", (100, 300))
    recipe = LibraryRecipe(
        name="small",
        network=synthetic.SMALL_RECIPE,
        motions=[MotionRecipe(name=name, file="") for name in synthetic.MOTIONS],
        body="",
        licence="",
    )
    syllabus = synthetic.training_set()
    return cost.costs(recipe, syllabus, 0)


def test_size_length_and_number_are_varied_one_at_a_time(found):
    assert [one.varied for one in found] == ["N", "N", "T", "T", "P", "P"]
    assert [one.neurons for one in found] == [100, 300, 300, 300, 300, 300]
    assert [one.motions for one in found] == [3, 3, 3, 3, 1, 2]
    assert found[2].frames < found[3].frames < found[1].frames
    assert all(one.training_s > 0.0 and one.training_mb > 0.0 and one.step_us > 0.0 for one in found)


def test_what_is_stored_grows_with_neurons_and_motions(found):
    for varied, against in (("N", "neurons"), ("P", "motions")):
        power = cost.exponent(found, varied, against, "stored_mb")
        assert power is not None
        assert 0.3 < power < 1.5
    assert cost.exponent(found[:1], "N", "neurons", "stored_mb") is None
