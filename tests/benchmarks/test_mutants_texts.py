"""What mutants of stops and shows break stands in the sources, once: else they would show nothing."""

from pathlib import Path

import pytest

from benchmarks.fleet._show_mutants import MUTANTS as OF_SHOWS
from benchmarks.stop.mutants import MUTANTS as OF_STOPS
from benchmarks.stop.mutants import ROOT

TEXTS = [(mutant.what, mutant.file, mutant.text) for mutant in OF_STOPS] + [
    (name, str(Path(module.replace(".", "/")).with_suffix(".py")), text)
    for name, changes in OF_SHOWS.items()
    for module, text, _ in changes
]


@pytest.mark.parametrize(("file", "text"), [text[1:] for text in TEXTS], ids=[text[0] for text in TEXTS])
def test_what_a_mutant_breaks_stands_once_in_its_file(file, text):
    assert (ROOT / file).read_text().count(text) == 1
