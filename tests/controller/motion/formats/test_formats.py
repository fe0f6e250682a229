"""The list of formats comes from the modules that read them."""

import importlib.util
import os
import threading
from pathlib import Path

import pytest

from controller.motion.formats.reading import FORMATS, read_clip
from motiondeck_base.errors import FileFormatError
from recordings import BVH

DOCS = Path(__file__).parents[4] / "docs"


def test_the_table_of_the_docs_lists_every_format():
    spec = importlib.util.spec_from_file_location("formats_table", DOCS / "formats_table.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    page = script.PAGE.read_text(encoding="utf-8")
    assert page == script.with_table(page), "run: python docs/formats_table.py"


def test_of_formats_that_share_a_suffix_one_reads_what_no_other_matches():
    for suffix, rows in FORMATS.items():
        assert [row.general for row in rows[:-1]] == [False] * (len(rows) - 1), suffix
        assert rows[-1].general or len(rows) == 1, suffix


@pytest.mark.parametrize("name", ["walk.txt", "walk.trc", "walk"])
def test_a_file_of_another_format_is_named_by_its_first_bytes(tmp_path, name):
    (tmp_path / name).write_text("\n HIERARCHY\nROOT Hips\n")
    with pytest.raises(FileFormatError, match=r"begins as a \.bvh file\. Rename it"):
        read_clip(tmp_path / name)


def test_a_recording_is_read_from_a_pipe(tmp_path):
    pipe = tmp_path / "walk.bvh"
    os.mkfifo(pipe)
    clips = []
    ends = [
        threading.Thread(target=pipe.write_text, args=(BVH,), daemon=True),
        threading.Thread(target=lambda: clips.append(read_clip(pipe)), daemon=True),
    ]
    for end in ends:
        end.start()
    for end in ends:
        end.join()
    assert [clip.name for clip in clips] == ["walk"]
