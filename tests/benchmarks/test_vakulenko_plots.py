"""Figures of Vakulenko et al. 2017 are drawn from their tables."""

import pytest

from controller.learning.evaluation.tables import Table

pytest.importorskip("matplotlib")


def test_table_1_has_a_panel_a_segment(tmp_path):
    from benchmarks.papers.vakulenko_plots import draw_table1

    rows = [
        {"centers, satellites, segment": f"2, {m}, {k}", "paper": 0.1 / m, "its method": 0.2 / m, "learned": 0.05 / m}
        for m in (25, 50)
        for k in (1, 2)
    ]
    draw_table1(Table("table 1", rows, ("paper", "its method", "learned")), tmp_path / "table1.png")
    assert (tmp_path / "table1.png").read_bytes().startswith(b"\x89PNG")


def test_errors_by_segment_and_joint(tmp_path):
    from benchmarks.papers.vakulenko_plots import draw_segment_errors

    rows = [{"segment": name, "16 satellites": 2.0, "49 satellites": 0.3} for name in ("1", "2", "mean")]
    details = [{"segment": k, "joint": joint, "mm": 0.1 * k, "relative": 0.01} for k in (1, 2) for joint in ("a", "b")]
    draw_segment_errors(Table("two", rows, ("16 satellites", "49 satellites"), [], details), tmp_path / "errors.png")
    assert (tmp_path / "errors.png").read_bytes().startswith(b"\x89PNG")


def test_hidden_joints_share_one_scale(tmp_path):
    from benchmarks.papers.vakulenko_plots import draw_hidden

    rows = [
        {"hidden": "lfoot, 0.25 s", "network mm": 1.0, "cubic mm": 4.0},
        {"hidden": "b", "network mm": None, "cubic mm": 2.0},
    ]
    draw_hidden(Table("hidden joints", rows, ("network mm", "cubic mm")), tmp_path / "hidden.png")
    assert (tmp_path / "hidden.png").read_bytes().startswith(b"\x89PNG")
