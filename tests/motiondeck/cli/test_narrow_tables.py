"""Tables in a window too narrow for their words: no word is cut."""

import re
import sys

import pytest

from motiondeck.cli.common.tables import show_table

HEADINGS = ["motion", "of the recording", "relative accuracy", "satellites", "largest weight"]
ROWS = [["wave", "0.26 to 1.86 of 2.06 s", "5.669e-05", "53", "0.2167"], ["nod", "whole", "0.0001842", "60", "0.2773"]]


@pytest.mark.parametrize("width", [30, 45, 60, 80, 160])
def test_every_word_of_a_table_is_whole_at_any_width(monkeypatch, capsys, width):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setenv("TERM", "xterm")
    show_table(HEADINGS, ROWS, title="anchors")
    shown = re.sub(r"\x1b\[[\d;]*m", "", capsys.readouterr().out)
    assert max(map(len, shown.splitlines())) <= width
    assert {word for line in [HEADINGS, *ROWS] for cell in line for word in cell.split()} <= set(shown.split())
