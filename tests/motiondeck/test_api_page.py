"""The API page names everything that is public, and its scripts run."""

import re
from pathlib import Path

import motiondeck

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text()
SCRIPTS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


def test_every_public_name_is_on_the_page():
    words = set(re.findall(r"\w+", PAGE))
    for name in (*motiondeck.__all__, *motiondeck.networks.__all__):
        assert name in words, name


def test_the_first_script_is_the_example_with_a_rig():
    example = (ROOT / "examples" / "play_ten_lines.py").read_text().partition('"""\n\n')[2]
    assert SCRIPTS[0] == example.replace("physics=False", 'robot="servo20", rig="emulated"')
    assert len(SCRIPTS[0].splitlines()) <= 10


def test_all_scripts_compile_and_that_of_the_networks_runs(capsys):
    for script in SCRIPTS:
        compile(script, "docs/api.md", "exec")
    exec(SCRIPTS[-1], {})
    similarity, quota = map(float, capsys.readouterr().out.split())
    assert 0.0 < quota < similarity < 1.0
