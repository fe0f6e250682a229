"""The table of walks goes on where it was cut, and counts falls."""

from dataclasses import replace

import pytest

from benchmarks.robots import walk
from motiondeck_base.jobs import ALONE

CASE = walk.Case("servo20", "walk", 1.0, "as modelled", 1.0, 0, 60.0)
CASES = [replace(CASE, seed=seed) for seed in range(3)]


@pytest.fixture
def measured(monkeypatch):
    """The cases that were measured; the one of seed 1 is a fall."""
    cases = []

    def measure(case):
        cases.append(case)
        fell = case.seed == 1
        numbers = {"stood_s": 20.0 if fell else 60.0, "asked_m": 4.0, "walked_m": 3.0, "push_ns": 0.36}
        numbers |= {"upper_deg": 0.2, "legs_deg": 12.0, "tick_us": 900.0}
        return walk.asdict(case) | numbers | {"falls_s": [20.0] if fell else []}

    monkeypatch.setattr(walk, "measure", measure)
    return cases


def test_a_table_that_was_cut_goes_on_with_what_is_left(tmp_path, measured):
    file = tmp_path / "rows.jsonl"
    list(walk.run(CASES[:2], ALONE, file))
    # It was cut while it wrote.
    file.write_text(file.read_text()[:-10])
    rows = list(walk.run(CASES, ALONE, file))
    assert measured == [CASES[0], CASES[1], CASES[1], CASES[2]]
    assert sorted(row["seed"] for row in rows) == [0, 1, 2]
    assert list(walk.done(file)) == [CASES[0], CASES[1], CASES[2]]


def test_without_a_file_all_is_measured(measured):
    assert len(list(walk.run(CASES, ALONE, None))) == len(measured) == 3


def test_the_summary_counts_who_stood_and_how_much_of_the_way_they_went(measured):
    (line,) = walk.summary(list(walk.run(CASES, ALONE, None)))
    assert "  2 of  3" in line
    assert "20.0 of  60 s" in line
    assert "75%" in line
    assert line.endswith("  1")
