"""What a run imports before it begins, alone or with a page, and what the page and the prompt do."""

import subprocess
import sys

import pytest

BESIDE = (
    "motiondeck.page",
    "motiondeck.run.page",
    "motiondeck.run.beside.tick_recorder",
    "motiondeck.shows",
    "hardware",
)
OPTIONAL = (*BESIDE, "motiondeck.run.recognition.watches", "motiondeck.run.plugin_outputs", "prompt_toolkit")


@pytest.mark.parametrize(
    ("modules", "spared"),
    [
        ("motiondeck.run.library_run", OPTIONAL),
        ("motiondeck.run.page.page, motiondeck.page.ghost", ("viser", "trimesh", "asyncio", "scipy.sparse")),
        ("motiondeck.page.viewer", ("scipy", "controller.deck.deck")),
        ("motiondeck.run.terminal", ("asyncio", "numpy", "prompt_toolkit")),
    ],
)
def test_what_not_every_run_needs_is_not_imported(modules, spared):
    program = f"import sys, {modules}; print([name for name in {spared} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
