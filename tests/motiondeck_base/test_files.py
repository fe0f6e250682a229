"""Files that commands write: whole or not there, and what is no file stays what it is."""

import os
import stat
import threading
from pathlib import Path

import pytest

from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import read_lines, read_text, write_file


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_file(pipe, b"a table")
    reader.join()
    assert read == [b"a table"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_folder_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match="Is a directory"):
        write_file(tmp_path, b"")


def test_a_link_stays_a_link_to_what_was_written(tmp_path):
    link = tmp_path / "latest.bvh"
    link.symlink_to(tmp_path / "monday.bvh")
    write_file(link, b"walk")
    assert link.is_symlink()
    assert (tmp_path / "monday.bvh").read_bytes() == b"walk"


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_the_umask_decides_who_may_read_a_file(tmp_path, mask):
    before = os.umask(mask)
    try:
        write_file(tmp_path / "walk.bvh", b"walk")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "walk.bvh").stat().st_mode) == 0o666 & ~mask


def test_a_file_is_on_the_disk_before_it_takes_the_place_of_another(tmp_path, monkeypatch):
    done = []
    sync, replace = os.fsync, Path.replace
    monkeypatch.setattr(os, "fsync", lambda number: done.append("synced") or sync(number))
    monkeypatch.setattr(Path, "replace", lambda path, to: done.append("renamed") or replace(path, to))
    write_file(tmp_path / "walk.bvh", b"walk")
    assert done == ["synced", "renamed"]
    assert [file.name for file in tmp_path.iterdir()] == ["walk.bvh"]


@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("code", ["ascii", "utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_lines_are_those_of_the_text(tmp_path, ends, code):
    path = tmp_path / "lines.txt"
    words = ["a b", "", "c\x0bd", "e\x1cf", "" if code == "ascii" else "é", "g"]
    path.write_bytes(ends.join(words).encode(code))
    assert [*read_lines(path)] == words == read_text(path).split("\n")
