"""Every example runs as it is, and prints what it promises."""

import re
import runpy
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
RUNS = {
    "play_ten_lines.py": ((), "ended: stopped on command"),
    "switch_by_sensor.py": ((), "so jog"),
    "echo_state_signal.py": ((), "nrmse 0.0"),
    "push_and_walk.py": (("--seconds", "1"), "still stands"),
    "learn_two_motions.py": (("--satellites", "25", "--out", "OUT/two.safetensors"), "400 frames of 61 channels"),
    "retarget_and_save.py": (("--out", "OUT/walk.csv"), "wrote 200 frames of 20 joints"),
    "drive_rig.py": (("--servos", "simulated"), "nodded 2 times"),
    "own_mujoco_loop.py": ((), "jog: servos within 0."),
    "conceptor_patterns.py": (("--plot", "OUT/patterns.png"), "nearly the same: recalled with nrmse 0.0"),
    "centers_and_satellites.py": ((), "a period takes 0.67 s"),
    "recognize_stream.py": (("--seconds", "1.5"), "looks like jog"),
}


def test_no_example_is_left_out():
    assert {path.name for path in EXAMPLES.glob("*.py")} == set(RUNS)
    listed = (EXAMPLES / "README.md").read_text()
    assert all(name in listed for name in RUNS)


@pytest.mark.parametrize("name", ["own_mujoco_loop.py", "echo_state_signal.py", "switch_by_sensor.py"])
def test_the_short_examples_stay_below_15_lines_of_code(name):
    source = (EXAMPLES / name).read_text().partition('"""\n\n')[2]
    without_docstrings = re.sub(r'\n *"""[^"]*"""', "", source)
    assert sum(1 for line in without_docstrings.splitlines() if line.strip()) < 15


@pytest.mark.thorough
@pytest.mark.parametrize("name", RUNS)
def test_an_example_runs(name, monkeypatch, tmp_path, capsys):
    arguments, printed = RUNS[name]
    if "--plot" in arguments:
        pytest.importorskip("matplotlib")
    monkeypatch.setattr(sys, "argv", [name, *(word.replace("OUT", str(tmp_path)) for word in arguments)])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    assert printed in capsys.readouterr().out
    for word in arguments:
        if word.startswith("OUT/"):
            assert (tmp_path / word.removeprefix("OUT/")).stat().st_size > 0
