"""The cost table: powers of growth beside the thesis's bounds, as a table and as a picture."""

import pytest

import synthetic
from benchmarks.papers import cost_measurement as cost
from benchmarks.papers.cost_measurement import TrainingCost
from benchmarks.papers.training_cost import cost_figure, cost_table
from controller.learning.recipe import LibraryRecipe, MotionRecipe
from controller.learning.trainers.centralized import CentralizedRecipe

RECIPE = LibraryRecipe(
    name="small",
    network=CentralizedRecipe(satellites=16, iterations=1),
    motions=[MotionRecipe(name=name, file="") for name in synthetic.MOTIONS],
    body="",
    licence="",
)


def test_costs_grow_with_the_power_they_were_made_with():
    found = [TrainingCost("N", n, 3000, 15, 1e-6 * n**2, 1e-3 * n, 5.0, 0.01 * n) for n in (300, 600, 1000)]
    found.append(TrainingCost("T", 1000, 1500, 15, 0.5, 1.0, 5.0, 10.0))
    rows = {row["network"]: row for row in cost_table("c", found, []).rows}
    assert rows["power of N"]["training s"] == pytest.approx(2.0)
    assert rows["power of N"]["step us"] == pytest.approx(0.0, abs=1e-9)
    assert rows["power of T"]["training s"] == pytest.approx(1.0)
    assert rows["power of P"]["training s"] is None
    assert rows["thesis's bound for N"]["training s"] == 3.0


def test_costs_are_drawn_against_each_size_with_power_and_bound():
    pytest.importorskip("matplotlib")
    found = [TrainingCost("N", n, 3000, 15, 1e-6 * n**2, 1e-3 * n, 5.0, 0.01 * n) for n in (300, 1000)]
    found += [TrainingCost("T", 1000, 1500, 15, 0.5, 1.0, 5.0, 10.0)]
    panels = cost_figure(cost_table("c", found, [])).axes
    assert [axes.get_xlabel() for axes in panels] == ["neurons N", "frames T", "motions P"] * 2
    said = [text.get_text() for text in panels[0].get_legend().get_texts()]
    assert said == ["measured", "fitted, power 2.0", "thesis's bound, power 3"]
    # The recipe in full belongs to the costs in which the length was varied; where nothing was it is said.
    assert list(panels[1].get_lines()[0].get_xdata()) == [1500, 3000]
    assert [text.get_text() for text in panels[2].texts] == ["not varied"]


def test_costs_grow_with_satellites_frames_and_motions(monkeypatch):
    monkeypatch.setattr(cost, "SATELLITES", (4, 16))
    monkeypatch.setattr(cost, "SHARES", (0.5, 1.0))
    syllabus = synthetic.training_set()
    found = cost.costs(RECIPE, syllabus, 0)
    assert [one.varied for one in found] == ["N", "N", "T", "T", "P", "P"]
    assert [one.neurons for one in found[:2]] == [3 * (4 + 2), 3 * (16 + 2)]
    assert found[2].frames < found[3].frames
    assert found[4].motions < found[5].motions
    stored = cost.exponent(found, "P", "motions", "stored_mb")
    assert stored == pytest.approx(1.0, abs=0.4)
    assert not [row for row in cost_table("c", found, [], bounds=False).rows if "thesis" in str(row["network"])]
