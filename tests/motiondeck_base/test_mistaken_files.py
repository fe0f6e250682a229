"""A file that is not what its name says is called what it is, in every format, with what to do."""

from pathlib import Path

import pytest

from controller.library.motion_library import load_library
from controller.motion.formats.reading import FORMATS, read_clip
from motiondeck_base.errors import FileFormatError
from recordings import ASF

LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"
ENDINGS = sorted(FORMATS.keys() - {".clip"})


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (LFS, "a Git LFS pointer.*git lfs pull"),
        (b"\n<!DOCTYPE html>\n<html><title>404</title></html>", "a web page"),
        (b"Kaydara FBX Binary  \0\x1a\0", "FBX.*glb or .bvh"),
        (b"\x1f\x8b\x08\0\0\0", "gunzip"),
    ],
    ids=["lfs", "page", "fbx", "gzip"],
)
def test_a_recording_that_is_something_else_is_named(tmp_path, ending, content, words):
    path = tmp_path / f"walk{ending}"
    path.write_bytes(content)
    (tmp_path / "walk.asf").write_text(ASF)
    with pytest.raises(FileFormatError, match=rf"walk{ending}: .*{words}"):
        read_clip(path)


def test_an_archive_under_the_name_of_a_recording_is_named(tmp_path):
    path = tmp_path / "walk.bvh"
    path.write_bytes(b"PK\x03\x04rest")
    with pytest.raises(FileFormatError, match="a zip archive"):
        read_clip(path)


def test_a_library_that_is_a_pointer_is_named(tmp_path):
    path = Path(tmp_path / "mine.safetensors")
    path.write_bytes(LFS)
    with pytest.raises(FileFormatError, match="a Git LFS pointer"):
        load_library(path)
