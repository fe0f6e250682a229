"""The smallest network within an error is taken, and the clip beside it."""

import json

import pytest

import synthetic
from bodies import waving
from command_line import invoked
from controller.learning import smallest
from controller.learning.smallest import smallest_network
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.trainer import kind_of
from controller.library.motion_library import load_library
from controller.motion.formats.writing import bvh_text
from motiondeck_base.errors import MotiondeckError


@pytest.fixture
def quick(monkeypatch):
    """One size of one other kind."""
    monkeypatch.setattr(smallest, "_GROWING", ([PhaseRecipe(neurons=80, rank=20)],))


def test_the_smallest_comes_first_and_the_clip_last(quick):
    known = synthetic.training_set()
    chosen, other, clip = smallest_network(2.0, known, 0)
    assert [kind_of(one.recipe) for one in (chosen, other, clip)] == ["phase-echo-state", "phase-conceptor", "clip"]
    assert chosen.stored_bytes <= 1.1 * clip.stored_bytes < other.stored_bytes
    assert chosen.error_mm <= 2.0
    assert clip.error_mm <= 2.0
    assert (chosen.note, other.note) == ("", "larger")


@pytest.mark.thorough
def test_where_none_is_near_enough_the_nearest_are_named(quick):
    with pytest.raises(MotiondeckError, match=r"1e-06 mm: phase-echo-state: .* \(too far off\); phase-conceptor: "):
        smallest_network(1e-6, synthetic.training_set(), 0)


@pytest.mark.thorough
def test_learn_prints_what_it_compared_and_writes_the_smallest(quick, tmp_path, monkeypatch):
    (tmp_path / "swing.bvh").write_text(bvh_text(waving(30.0, 4.0, still=1.0)))
    monkeypatch.chdir(tmp_path)
    said = invoked("learn", "swing.bvh", "--tolerance", "2", "--json")
    chosen, *_, clip = json.loads(said.stdout)["candidates"]
    assert (chosen["network"], clip["network"]) == ("phase-echo-state", "clip")
    library = load_library(tmp_path / "mine.safetensors")
    assert library.info.network == "phase-echo-state"
    assert max(motion.error_mm for motion in library.info.motions) <= 2.0
    assert chosen["stored_bytes"] == library.network.stored_bytes
    again = invoked("learn", "mine.toml", "--data", ".", "--tolerance", "2", "--force").stdout
    assert f"phase-echo-state: {chosen['stored_bytes'] / 1e3:.1f} kB" in again
    assert "clip: " in again
