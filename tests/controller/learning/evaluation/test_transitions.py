from dataclasses import replace

import numpy as np
import pytest

import synthetic
from controller.learning.evaluation.tables import crossing_table
from controller.learning.evaluation.transitions import METHODS, RAMP, all_crossings

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def crossings():
    syllabus = synthetic.training_set()
    return all_crossings(synthetic.small_library(), syllabus)


def test_every_ordered_pair_is_crossed_in_every_way(crossings):
    names = list(synthetic.MOTIONS)
    pairs = [(c.source, c.target) for c in crossings if c.method == "deck"]
    assert pairs == [(a, b) for a in names for b in names if a != b]
    assert len(crossings) == len(METHODS) * len(pairs)


def test_the_deck_arrives_and_keeps_bones_whole(crossings):
    ours = [c for c in crossings if c.method == "deck"]
    assert [(c.source, c.target, c.reason) for c in ours if c.failed] == []
    assert max(c.bone_error for c in ours) < 1e-6


def test_morphing_takes_its_ramp_and_shrinks_bones(crossings):
    theirs = [c for c in crossings if c.method == "morph"]
    assert {c.frames for c in theirs} == {RAMP}
    assert np.median([c.bone_error for c in theirs]) > 0.01


def test_the_table_has_a_row_a_method_and_kind_and_every_pair_below(crossings):
    table = crossing_table("t", crossings, synthetic.LOOPS, [])
    assert [row["to"] for row in table.rows] == [
        f"{kind}, {method}" for method in METHODS for kind in ("loops", "once")
    ]
    assert len(table.details) == len(crossings)


def test_the_table_names_each_pair_that_failed(crossings):
    failed = replace(crossings[0], failed=True, reason="turned round")
    table = crossing_table(
        "t", [failed, *(replace(c, failed=False) for c in crossings[1:])], synthetic.LOOPS, ["a note"]
    )
    assert table.notes == ["a note", f"{failed.method}, {failed.source} to {failed.target}: turned round"]


def test_recordings_are_joined_as_smoothly_as_a_network_that_learned_them(crossings):
    ours, recorded = ([c for c in crossings if c.method == method] for method in ("deck", "clip player"))
    assert [(c.source, c.target, c.reason) for c in recorded if c.failed] == []
    apart = [abs(a.acceleration - b.acceleration) for a, b in zip(ours, recorded, strict=True)]
    assert np.median(apart) < 0.2


def test_a_cut_takes_no_time_and_is_by_far_the_hardest(crossings):
    hardest = {method: np.median([c.acceleration for c in crossings if c.method == method]) for method in METHODS}
    assert max(c.frames for c in crossings if c.method == "cut") <= 3
    assert hardest["cut"] > 5.0 * hardest["deck"]
