"""The zoo counts what was read, carried, learned and played, and sees what was not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.reservoirs import zoo
from bodies import waving
from controller.learning.learn import learn
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.formats.writing import bvh_text
from controller.motion.rotations import multiply


@pytest.mark.parametrize("count", [1, 8, 16, 17, 31, 32, 33, 100])
def test_libraries_hold_8_to_16_motions_where_there_are_so_many(count):
    files = [Path(f"{number}.bvh") for number in range(count)]
    parts = zoo.libraries_of(files)
    assert [file for part in parts for file in part] == files
    assert all(min(count, 8) <= len(part) <= zoo.LARGEST for part in parts)


def test_a_bone_that_is_turned_is_seen():
    clip = waving(60.0, 1.0)
    body = to_canonical(clip)
    assert zoo.carried_degrees(clip, body) < 1e-3
    bent = body.rotation.copy()
    at = 1 + body.skeleton.index("lwri")
    bent[30, at] = multiply(bent[30, at], np.array([np.cos(0.05), 0.0, 0.0, np.sin(0.05)]))
    assert zoo.carried_degrees(clip, replace(body, rotation=bent)) == pytest.approx(np.degrees(0.1), abs=0.01)


def test_a_library_that_plays_something_else_is_seen(tmp_path):
    (tmp_path / "swing.bvh").write_text(bvh_text(waving(60.0, 3.3)))
    learned = learn([tmp_path / "swing.bvh"], "one", seeds=[0])
    (motion,) = learned.motions
    assert zoo.played_mm(learned.library, motion, waving(60.0, 3.3)) < 3.0
    assert zoo.played_mm(learned.library, motion, waving(60.0, 3.3, hertz=1.3)) > 50.0


def test_each_source_has_its_line(tmp_path, capsys):
    (tmp_path / "swings").mkdir()
    (tmp_path / "swings" / "swing.bvh").write_text(bvh_text(waving(60.0, 3.3)))
    (tmp_path / "swings" / "broken.bvh").write_text("HIERARCHY\n")
    zoo.main(tmp_path)
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[:6] == ["swings", "2", "1", "1", "1", "1"]
    assert "not read" in lines[2]
    assert "broken.bvh" in lines[2]
