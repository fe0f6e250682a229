"""Odd and hostile files as they come: each is read right, or refused in one line that says what to do."""

import gzip
import re
import tracemalloc
from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest

from controller.motion.canonical.body_doubts import doubts
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.clip import ReadingOptions
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import FileFormatError
from people import KEYS, OFFSET, check_person, in_our_axes, moving
from recordings import c3d_bytes
from written_files import LAFAN1, MIXAMO, bvh_text, gltf_file

MOTION = moving(frames=20)
TEXT = bvh_text(MOTION)
TIME = "Frame Time: 0.0166667\n"
HEAD, _, ROWS = TEXT.partition(TIME)
ORDERS = ("ZYX", "XYZ", "YXZ", "ZXY", "YZX", "XZY")


def write(tmp_path, text, name="odd.bvh"):
    (tmp_path / name).write_bytes(text.encode())
    return tmp_path / name


def zeros_in_position_channels(text):
    """A file in which the position channels of all joints but the root are zeros, to be added to their OFFSET."""
    head, _, rows = text.partition(TIME)
    numbers = np.array([row.split() for row in rows.splitlines()], dtype=float).reshape(len(rows.splitlines()), -1, 6)
    numbers[:, 1:, :3] = 0.0
    return head + TIME + "".join(" ".join(map(str, row.ravel())) + "\n" for row in numbers)


def offset_of_the_root(text, place):
    """A file whose root is at its OFFSET where its channels are zero."""
    head, _, rows = text.partition(TIME)
    numbers = np.array([row.split() for row in rows.splitlines()], dtype=float)
    numbers[:, :3] -= place
    rows = "".join(" ".join(map(str, row)) + "\n" for row in numbers)
    return head.replace("OFFSET 0.000000 0.000000 0.000000", "OFFSET {} {} {}".format(*place), 1) + TIME + rows


READ = {
    "line ends of Windows": (TEXT.replace("\n", "\r\n"), ()),
    "line ends of old Macs": (TEXT.replace("\n", "\r"), ()),
    "remarks": ("# from a program\n" + TEXT.replace("MOTION", "// here it comes\nMOTION"), ()),
    "blanks and tabs": (TEXT.replace(" ", " \t "), ()),
    "numbers across lines": (HEAD + TIME + ROWS.replace(" ", "\n", 200), ()),
    "one frame more than announced": (TEXT.replace("Frames: 20", "Frames: 19"), ()),
    "no blanks after colons": (TEXT.replace("Frames: ", "Frames:").replace("Time: ", "Time:"), ()),
    "position channels on every joint": (bvh_text(MOTION, everywhere=True), ()),
    "position channels of zeros": (zeros_in_position_channels(bvh_text(MOTION, everywhere=True)), ()),
    "a path from the OFFSET of the root": (offset_of_the_root(TEXT, 100.0 * MOTION.root[0]), ()),
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


@pytest.mark.parametrize(("alphabet", "spine"), [("utf-8", "脊椎"), ("utf-16", "脊椎"), ("latin-1", "Rücken")])
def test_names_of_any_language_are_read_and_can_be_renamed(tmp_path, alphabet, spine):
    path = tmp_path / "names.bvh"
    path.write_bytes(TEXT.replace("JOINT Spine\n", f"JOINT {spine}\n").encode(alphabet))
    assert any(spine in bone for bone in read_clip(path).skeleton.bones)
    renamed = read_clip(path, ReadingOptions(rename={spine: "Spine"})).skeleton.bones
    assert renamed == read_clip(write(tmp_path, TEXT)).skeleton.bones


def elsewhere(place):
    """The person at a place, (x, y, z) of the file in m, with the small moves of the recording."""
    moves = 0.1 * (MOTION.root - MOTION.root[0]) + np.array(place)
    return replace(MOTION, root=moves)


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ([0.3, 1.44, 0.4], "the body floats 0."),  # hips half a metre too high
        ([0.3, 0.44, 0.4], "m below the ground"),  # and too low
        ([0.3, 2.0, 0.12], "the body floats 1."),  # lies along y, and z is up, though y is in the pose with arms out
    ],
)
def test_a_body_off_the_ground_is_doubted(tmp_path, place, said):
    found = [line for line in doubts(read_clip(write(tmp_path, bvh_text(elsewhere(place))))) if said in line]
    assert len(found) == 1
    assert "--up" in found[0]


def test_somebody_who_lies_along_y_is_read_right_with_the_axis_given(tmp_path):
    path = write(tmp_path, bvh_text(elsewhere([0.3, 2.0, 0.12])))
    clip = read_clip(path, ReadingOptions(up="z"))
    assert ["lies all the time" in doubt for doubt in doubts(clip)] == [True]
    assert 0.0 < np.median(clip.joints()[..., 2]) < 0.3


def test_angles_in_radians_are_doubted(tmp_path):
    numbers = np.array([row.split() for row in ROWS.splitlines()], dtype=float)
    numbers[:, 3:] = np.radians(numbers[:, 3:])
    rows = "".join(" ".join(map(str, row)) + "\n" for row in numbers)
    assert any("are the angles radians" in line for line in doubts(read_clip(write(tmp_path, HEAD + TIME + rows))))


@pytest.mark.parametrize("unit", [0.001, 0.01, 1.0])
@pytest.mark.parametrize("said", ["", "furlongs"])
def test_a_c3d_file_that_does_not_say_its_unit_is_read_in_that_of_a_person(tmp_path, unit, said):
    labels, place = zip(*((name, in_our_axes(track)) for name, track in MOTION.place.items()), strict=True)
    seen = np.stack(place, axis=1) / unit
    seen[3, 4] = np.nan
    seen[:2, 5] = 1e30  # broken numbers
    (tmp_path / "walk.c3d").write_bytes(c3d_bytes(labels, seen, unit=said))
    found = read_c3d(tmp_path / "walk.c3d").position[2]
    np.testing.assert_allclose(found, seen[2] * unit, atol=1e-5)


def without(joint, text):
    """A file without a joint and what is below it, channels included."""
    kept, depth, left, columns, column = [], 0, None, [], 0
    head, _, rows = text.partition(TIME)
    for line in head.splitlines():
        words = line.split()
        if words[:2] == ["JOINT", joint]:
            left = depth
        if words[:1] == ["CHANNELS"]:
            columns += [] if left is not None else range(column, column + int(words[1]))
            column += int(words[1])
        depth += words.count("{")
        kept += [] if left is not None else [line]
        depth -= words.count("}")
        if "}" in words and depth == left:
            left = None
    numbers = [row.split() for row in rows.splitlines()]
    return "\n".join(kept) + "\n" + TIME + "".join(" ".join(row[at] for at in columns) + "\n" for row in numbers)


def test_legs_alone_stand_and_carry_an_assumed_trunk(tmp_path):
    whole = to_canonical(read_clip(write(tmp_path, TEXT)))
    legs = read_clip(write(tmp_path, without("Spine", TEXT), "legs.bvh"))
    assert legs.skeleton.leg_length == pytest.approx(read_clip(tmp_path / "odd.bvh").skeleton.leg_length, rel=1e-6)
    carried = to_canonical(legs)
    for bone in ("lkne", "rank"):
        at = 1 + carried.skeleton.index(bone)
        np.testing.assert_allclose(carried.joints()[:, at], whole.joints()[:, at], atol=1e-3)
    neck = carried.joints()[:, 1 + carried.skeleton.index("neck")] - carried.joints()[:, 0]
    assert np.linalg.norm(neck, axis=-1) == pytest.approx(0.5 * 0.86, abs=0.1)
    assert sum("are assumed" in doubt for doubt in doubts(legs)) == 1


def test_a_leg_that_is_missing_is_named_and_no_arm_taken_for_it(tmp_path):
    clip = read_clip(write(tmp_path, without("RightUpLeg", TEXT)))
    with pytest.raises(FileFormatError, match=r"no right leg was found .*--rename OLD=RightUpLeg"):
        to_canonical(clip)


def test_a_head_without_an_end_gets_one_though_what_carries_it_has_no_known_name(tmp_path):
    text = re.sub(r"End Site\n{\n[^}]*}\n", "", bvh_text(MOTION, LAFAN1))
    unnamed = re.sub(r"JOINT (Neck|Spine\d?)\n", lambda found: f"JOINT bone_{found.start()}\n", text)
    assert unnamed != text
    clips = [read_clip(write(tmp_path, one)).skeleton for one in (text, unnamed)]
    lengths = [clip.length[clip.index("Head")] for clip in clips]
    assert lengths[0] == pytest.approx(lengths[1], rel=0.2)


def test_a_head_that_nothing_leads_to_gets_no_end(tmp_path):
    head = "JOINT Head\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n}\n"
    prop = head.replace("Head", "Prop").replace("0 0 0", "0 9 0").replace("}", "End Site\n{\nOFFSET 0 9 0\n}\n}")
    root = "HIERARCHY\nROOT Root\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\n"
    text = root + head + prop + "}\nMOTION\nFrames: 1\nFrame Time: 0.01\n" + "0 " * 9 + "\n"
    assert read_clip(write(tmp_path, text)).skeleton.bones == ("Root", "Prop")


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
    "two roots and channels of one": (
        TEXT.replace("MOTION", SECOND_ROOT + "MOTION"),
        "20 frames are announced, but 10 follow",
    ),
    "no frame": (HEAD.replace("Frames: 20", "Frames: 0") + TIME, "no frames follow. Export the motion again"),
    "fewer frames than announced": (
        TEXT.replace("Frames: 20", "Frames: 21"),
        "21 frames are announced, but 20 follow. Fetch .* write 'Frames: 20'",
    ),
    "a frame cut short": (TEXT[: TEXT.rindex(" ")], "cut short or not whole"),
    "not a number": (beginning_with("nan"), "line 155: expected a number, found 'nan'. Export the recording again"),
    "an infinite number": (beginning_with("inf"), "line 155: expected a number, found 'inf'"),
    "digit groups": (beginning_with("1_0"), "line 155: expected a number, found '1_0'"),
    "decimal commas": (HEAD + TIME + ROWS.replace(".", ","), "Write decimals with a dot"),
    "commas between numbers": (HEAD + TIME + ROWS.replace(" ", ", "), "Put blanks between numbers, not commas"),
    "a decimal comma in the frame time": (
        TEXT.replace("0.0166667", "0,0166667"),
        "found '0,0166667'. Write decimals with a dot",
    ),
}


@pytest.mark.parametrize(("unit", "legs"), [(0.01, 0.3), (0.01, 1.0), (0.0254, 1.0), (0.01, 0.6), (1.0, 0.3)])
def test_short_legs_below_a_large_body_make_no_giant(tmp_path, unit, legs):
    """A character of a cartoon is tall by its trunk and head: of cm and inch, its legs alone would choose the inch."""
    offset = {key: by * (legs if key.endswith(("shank", "foot")) else 1.0) for key, by in OFFSET.items()}
    person = moving(frames=20, offset=offset)
    check_person(read_clip(write(tmp_path, bvh_text(person, offset=offset, unit=unit))), person)


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
    monkeypatch.setattr("controller.motion.formats.gltf.MOST_POSES", 400)
    monkeypatch.setattr("controller.motion.formats.bvh.MOST_POSES", 400)
    path = tmp_path / f"long{suffix}"
    path.write_bytes(gltf_file(MOTION).glb() if suffix == ".glb" else TEXT.encode())
    with pytest.raises(FileFormatError, match="fit into memory"):
        read_clip(path)


@pytest.mark.parametrize("name", ["walk.bvh.gz", "walk.bvh"])
def test_a_packed_file_is_refused_with_the_way_to_unpack_it(tmp_path, name):
    (tmp_path / name).write_bytes(gzip.compress(TEXT.encode()))
    with pytest.raises(FileFormatError, match=r"packed.* Unpack it"):
        read_clip(tmp_path / name)
