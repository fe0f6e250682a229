"""Odd and hostile files as they come: each is read right, or refused in one line that says what to do."""

import re
import tracemalloc
from dataclasses import replace
from itertools import cycle

import pytest

from controller.mocap.formats.reading import read_clip
from motiondeck_base.errors import FileFormatError
from people import KEYS, check_person, moving
from written_files import LAFAN1, MIXAMO, bvh_text, gltf_file

MOTION = moving(frames=20)
TEXT = bvh_text(MOTION)
TIME = "Frame Time: 0.0166667\n"
HEAD, _, ROWS = TEXT.partition(TIME)
ORDERS = ("ZYX", "XYZ", "YXZ", "ZXY", "YZX", "XZY")


def write(tmp_path, text, name="odd.bvh"):
    (tmp_path / name).write_bytes(text.encode())
    return tmp_path / name


READ = {
    "line ends of Windows": (TEXT.replace("\n", "\r\n"), ()),
    "line ends of old Macs": (TEXT.replace("\n", "\r"), ()),
    "blanks and tabs": (TEXT.replace(" ", " \t "), ()),
    "numbers across lines": (HEAD + TIME + ROWS.replace(" ", "\n", 200), ()),
    "one frame more than announced": (TEXT.replace("Frames: 20", "Frames: 19"), ()),
    "position channels on every joint": (bvh_text(MOTION, everywhere=True), ()),
    "no end sites": (
        re.sub(r"End Site\n{\n[^}]*}\n", "", bvh_text(MOTION, LAFAN1)),
        tuple(key for key in MIXAMO if key.endswith(" end")),
    ),
    "two joints of one name": (TEXT.replace("JOINT Spine1", "JOINT Spine"), ()),
    "an order of rotations for each joint": (bvh_text(MOTION, order=dict(zip(KEYS, cycle(ORDERS), strict=False))), ()),
}


@pytest.mark.parametrize("name", READ)
def test_an_odd_file_is_read_right(tmp_path, name):
    text, lacking = READ[name]
    check_person(read_clip(write(tmp_path, text)), MOTION, tolerance=1e-5, lacking=lacking)


def test_one_frame_is_a_pose(tmp_path):
    one = replace_frames(MOTION, 1)
    check_person(read_clip(write(tmp_path, bvh_text(one))), one, tolerance=1e-5)


def replace_frames(motion, count):
    cut = {key: track[:count] for key, track in motion.place.items()}
    return replace(
        motion,
        root=motion.root[:count],
        turn={key: turn[:count] for key, turn in motion.turn.items()},
        place=cut,
        world={key: turn[:count] for key, turn in motion.world.items()},
    )


def beginning_with(word):
    """The file with another first number."""
    return f"{HEAD}{TIME}{word}{ROWS[ROWS.index(' ') :]}"


SECOND_ROOT = HEAD.partition("MOTION")[0].replace("HIERARCHY\n", "")
REFUSED = {
    "two roots": (TEXT.replace("MOTION", SECOND_ROOT + "MOTION"), "expected one ROOT"),
    "no frame": (HEAD.replace("Frames: 20", "Frames: 0") + TIME, "no frames follow. Export the motion again"),
    "fewer frames than announced": (TEXT.replace("Frames: 20", "Frames: 21"), "21 frames are announced, but 20 follow"),
    "a frame cut short": (TEXT[: TEXT.rindex(" ")], "cut short or not whole"),
    "not a number": (beginning_with("nan"), "line 155: expected a number, found 'nan'"),
    "an infinite number": (beginning_with("inf"), "line 155: expected a number, found 'inf'"),
    "digit groups": (beginning_with("1_0"), "line 155: expected a number, found '1_0'"),
    "decimal commas": (HEAD + TIME + ROWS.replace(".", ","), "Decimals are written with a dot"),
    "a decimal comma in the frame time": (TEXT.replace("0.0166667", "0,0166667"), "found '0,0166667'"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_broken_file_is_refused_in_one_line(tmp_path, name):
    text, said = REFUSED[name]
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(write(tmp_path, text))
    assert "odd.bvh" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_memory_that_a_long_recording_takes_is_bounded(tmp_path):
    """A frame of a joint takes 250 bytes at most: 15 million of them, the most that is read, take 4 GB."""
    frames = 4000
    long = HEAD.replace("Frames: 20", f"Frames: {frames}") + TIME + ROWS * (frames // 20)
    path = write(tmp_path, long)
    tracemalloc.start()
    clip = read_clip(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(clip) == frames
    assert peak < 250 * frames * 29 + 6 * len(long)


@pytest.mark.parametrize("suffix", [".glb", ".bvh"])
def test_a_million_frames_are_refused_before_memory_is_taken(tmp_path, suffix, monkeypatch):
    monkeypatch.setattr("controller.mocap.formats.gltf.MOST_POSES", 400)
    monkeypatch.setattr("controller.mocap.formats.bvh.MOST_POSES", 400)
    path = tmp_path / f"long{suffix}"
    path.write_bytes(gltf_file(MOTION).glb() if suffix == ".glb" else TEXT.encode())
    with pytest.raises(FileFormatError, match="fit into memory"):
        read_clip(path)
