"""What commands write never replaces a recording whose name was given by mistake."""

import pytest

from bodies import waving
from command_line import invoked
from controller.motion.formats.writing import bvh_text
from motiondeck_base.shipped import find_library


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("learn", str(find_library("thesis15").with_suffix(".toml")), "--data", "."), "a library"),
        (("learn", "walk.bvh", "--force"), "a library"),
        (("library", "add", "thesis15", "walk.bvh"), "a library"),
        (("recognize", "train", "."), "a recognizer"),
    ],
    ids=lambda words: " ".join(words[:2]) if isinstance(words, tuple) else None,
)
def test_a_library_is_not_written_under_the_name_of_a_recording(tmp_path, monkeypatch, words, what):
    monkeypatch.chdir(tmp_path)
    recording = tmp_path / "walk.bvh"
    recording.write_text(bvh_text(waving(30.0, 1.0)))
    before = recording.read_bytes()
    result = invoked(*words, "--out", "walk.bvh")
    assert str(result.exception) == f"walk.bvh: {what} ends in .safetensors. Name the file so."
    assert recording.read_bytes() == before
