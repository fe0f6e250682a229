"""The BVH reader puts every joint where the file has it, whatever its exporter's zero pose, axes and units."""

import codecs
import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.recordings.independent_readings import bvh_joints
from controller.motion.anatomy import anatomy
from controller.motion.clip import ReadingOptions
from controller.motion.formats.bvh import read_bvh
from controller.motion.formats.reading import read_clip
from controller.motion.formats.writing import bvh_text
from motiondeck_base.errors import FileFormatError
from recordings import BVH


def write(folder, text, name="bow.bvh"):
    (folder / name).write_text(text)
    return folder / name


def test_each_joint_turns_in_its_own_order_of_channels(tmp_path):
    clip, file = read_bvh(write(tmp_path, BVH)), bvh_joints(BVH)
    ours = dict(zip(clip.skeleton.bones, np.moveaxis(clip.joints()[:, 1:], 1, 0), strict=True))
    ends = {
        "Hips-LeftUpLeg": "LeftUpLeg",
        "LeftUpLeg": "LeftLeg",
        "LeftLeg": "LeftFoot",
        "LeftFoot": "LeftFoot end",
        "RightLeg": "RightFoot",
        "RightFoot": "RightFoot end",
        "Spine": "Neck",
        "Neck": "Neck end",
        "LeftForeArm": "LeftForeArm end",
        "RightForeArm": "RightForeArm end",
    }
    for bone, end in ends.items():
        np.testing.assert_allclose(ours[bone], 0.01 * file[end][:, [2, 0, 1]], atol=1e-12, err_msg=bone)


def test_what_a_file_says_and_what_it_leaves_open(tmp_path):
    clip = read_clip(write(tmp_path, BVH))
    assert (clip.name, clip.rate, len(clip)) == ("bow", 120.0, 2)
    assert clip.skeleton.leg_length == pytest.approx(0.88)  # its centimetres were found out
    assert read_bvh(tmp_path / "bow.bvh", ReadingOptions(unit=0.02)).skeleton.leg_length == pytest.approx(1.76)
    parts = anatomy(clip.skeleton)
    assert clip.skeleton.bones[parts.first("shank", "right")] == "RightLeg"
    assert clip.skeleton.bones[parts.first("upper arm", "left")] == "LeftArm"
    assert clip.skeleton.bones[parts.first("head")] == "Neck"
    assert len(clip.skeleton) == 14  # three children of the spine begin in one place: one bone leads there


def test_a_file_with_z_up_gives_the_same_clip(tmp_path):
    def cyclic(found):
        x, y, z = found.group(2).split()
        return f"{found.group(1)} {z} {x} {y}"

    offsets = re.sub(r"(OFFSET) (\S+ \S+ \S+)", cyclic, BVH)
    axes = re.sub(r"\b([XYZ])(position|rotation)", lambda f: "YZX"["XYZ".index(f.group(1))] + f.group(2), offsets)
    upright, lying = read_bvh(write(tmp_path, BVH)), read_bvh(write(tmp_path, axes, "z.bvh"))
    np.testing.assert_allclose(lying.joints(), upright.joints(), atol=1e-12)
    np.testing.assert_allclose(lying.skeleton.rest_direction, upright.skeleton.rest_direction, atol=1e-12)


def test_joints_of_the_same_place_make_no_bone_and_a_reference_above_the_body_none_either(tmp_path):
    reference = BVH.replace("ROOT Hips\n{\n  OFFSET 0 0 0\n", "ROOT Reference\n{\n  OFFSET 0 0 0\n", 1)
    reference = reference.replace("  JOINT LeftUpLeg", "JOINT Hips {\n OFFSET 0 4 0\n CHANNELS 0\n  JOINT LeftUpLeg", 1)
    reference = reference.replace("}\nMOTION", "}\n}\nMOTION")
    plain, carried = read_bvh(write(tmp_path, BVH)), read_bvh(write(tmp_path, reference, "carried.bvh"))
    assert carried.skeleton.bones == plain.skeleton.bones
    up = Rotation.from_euler("ZYX", [10, 20, 30], degrees=True).apply([0, 0.04, 0])
    np.testing.assert_allclose((carried.joints() - plain.joints())[0, :, [1, 2, 0]].T, np.tile(up, (15, 1)), atol=1e-12)


@pytest.mark.parametrize(
    ("file", "unit", "off"),
    [
        ("cgspeed-3dsmax_cmu_131_01", 0.0254 / 0.45, 1e-9),
        ("cgspeed-motionbuilder_cmu_12_01", 0.0254 / 0.45, 1e-9),
        ("iclone_cmu_02_03", 0.01, 5e-6),  # some of its joints lie a micrometre beside their neighbours
    ],
)
def test_exporters_files_are_read_to_the_last_joint(mocap_data, file, unit, off):
    path = mocap_data / "bvh" / f"{file}.bvh"
    clip = read_clip(path)
    theirs = unit * np.stack(list(bvh_joints(path.read_text()).values()), axis=1)[..., [2, 0, 1]]
    given = [1 + bone for bone, name in enumerate(clip.skeleton.bones) if name != "CC_Base_Head"]  # its end is assumed
    ours = clip.joints()[:, [0, *given]]
    nearest = np.linalg.norm(ours[0][:, None] - theirs[0][None], axis=-1).argmin(axis=1)
    assert np.linalg.norm(ours - theirs[:, nearest], axis=-1).max() < off
    parts = anatomy(clip.skeleton)
    for part in ("thigh", "shank", "foot", "upper arm", "forearm", "hand"):
        assert parts.first(part, "left") is not None
        assert parts.first(part, "right") is not None
    assert 0.8 < clip.skeleton.leg_length < 1.1


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (("MOTION", ""), "no MOTION"),
        (("HIERARCHY", "NOTES"), "this is no BVH file"),
        (("Frames: 2", "Frames: 3"), "line 72: 3 frames are announced, but 2 follow. Fetch the file again, or"),
        (("Frame Time: .0083333", "Frame Time: 0"), "line 73: a frame time of 0 s"),
        (("Frame Time: .0083333", "Frame Time: 24"), "For 24 frames a second write 0.041667."),
        (("88 2 10", "88 10"), "line 72: a frame has 37 channels, but line 74 has 36 numbers"),
        (("Frame Time: .0083333", ""), "'Frame Time:' is missing"),
        (("88 2 10", "88 two 10"), "line 74: expected a number, found 'two'"),
        (("CHANNELS 3 Xrotation", "CHANNELS 2 Xrotation"), "line 9: 2 channels are announced, but 3"),
        (("CHANNELS 3 Xrotation", "CHANNELS 3 Wrotation"), "line 9: 'wrotation' is no channel"),
        (("OFFSET 10 0 0", "OFFSET 10 0"), "line 8: expected 3 numbers"),
        (("    OFFSET 10 0 0\n", ""), "line 18: joint 'LeftUpLeg' has no OFFSET"),
        (("JOINT LeftLeg", "ROOT LeftLeg"), "line 10: expected a ROOT outside of all joints"),
        (("JOINT LeftLeg", "JOINT"), "line 10: JOINT has no name"),
        (("JOINT LeftLeg", "JOIN LeftLeg"), "line 10: 'JOIN' cannot stand here"),
        (("  }\n}\nMOTION", "  }\nMOTION"), "not closed"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path, change, problem):
    assert change[0] in BVH
    with pytest.raises(FileFormatError, match=re.escape(problem)) as caught:
        read_bvh(write(tmp_path, BVH.replace(*change, 1)))
    assert "bow.bvh" in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le"])
def test_what_editors_write_before_the_text_is_left_out(tmp_path, encoding):
    file = tmp_path / "marked.bvh"
    file.write_bytes((codecs.BOM_UTF16_LE if encoding == "utf-16-le" else b"") + BVH.encode(encoding))
    plain, found = read_bvh(write(tmp_path, BVH)), read_bvh(file)
    np.testing.assert_array_equal(found.rotation, plain.rotation)
    assert found.skeleton.bones == plain.skeleton.bones


def test_position_channels_on_every_joint_move_it(tmp_path):
    """A file whose hips carry the path below a still root, with channels of position everywhere."""
    clip = read_bvh(write(tmp_path, BVH))
    moving = clip.root_position + np.linspace(0.0, 2.0, len(clip))[:, None] * np.array([1.0, 0.5, 0.0])
    text = bvh_text(replace(clip, root_position=moving))
    text = text.replace("ROOT root", "ROOT floor\n{\n OFFSET 0 0 0\n CHANNELS 0\nJOINT Hips").replace(
        "MOTION", "}\nMOTION"
    )
    found = read_bvh(write(tmp_path, text))
    np.testing.assert_allclose(found.root_position, moving, atol=1e-6)
    order = [0, *(1 + found.skeleton.index(bone) for bone in clip.skeleton.bones)]
    still = clip.joints() - clip.root_position[:, None]
    np.testing.assert_allclose(found.joints()[:, order] - moving[:, None], still, atol=1e-6)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda t: t.replace("MOTION", "JOINT Other { OFFSET 0 0 0 CHANNELS 0 }\nMOTION"), "within one"),  # no ROOT
        (lambda t: re.sub(r"(Frame Time.*\n)(.*\n)*", r"\1", t).replace("Frames: 2", "Frames: 0"), "no frames follow"),
        (lambda t: re.sub(r"\n(\S+)( \S+){30,}\n", r"\nnan\2\n", t, count=1), "number"),
        (lambda t: re.sub(r"(?m)^(-?\d+)\.(\d)", r"\1,\2", t), "expected a number, found"),  # comma decimals
        (lambda t: t.replace("Frames: 2", "Frames: 7"), "announced"),  # a wrong frame count
    ],
)
def test_odd_files_are_refused_in_one_line(tmp_path, change, complaint):
    text = bvh_text(read_bvh(write(tmp_path, BVH)))
    assert change(text) != text
    with pytest.raises(FileFormatError, match=complaint) as caught:
        read_bvh(write(tmp_path, change(text), "odd.bvh"))
    assert "\n" not in str(caught.value)
    assert "odd.bvh" in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        lambda t: t.replace("\n", "\r\n"),
        lambda t: t.replace("  ", "\t"),
        lambda t: t + "\n\n",
        lambda t: t.replace("rotation", "ROTATION"),
    ],
)
def test_odd_files_are_read_right(tmp_path, change):
    text = bvh_text(read_bvh(write(tmp_path, BVH)))
    plain, odd = read_bvh(write(tmp_path, text)), read_bvh(write(tmp_path, change(text), "odd.bvh"))
    np.testing.assert_array_equal(plain.joints(), odd.joints())


def test_wrapped_lines_of_channels_and_frames_are_read(tmp_path):
    (tmp_path / "plain.bvh").write_text(BVH)
    head, _, rows = BVH.partition("MOTION")
    head = head.replace("6 Xposition Yposition Zposition ", "6 Xposition Yposition\n Zposition\n")
    head = head.replace("CHANNELS 3 Zrotation", "CHANNELS\n3 Zrotation\n")
    first, *frames = rows.split("Frame Time:")[1].split("\n")
    rows = rows.split("Frame Time:")[0] + "Frame Time:" + "\n".join([first, *(f.replace(" ", "\n", 3) for f in frames)])
    (tmp_path / "wrapped.bvh").write_text(head + "MOTION" + rows)
    plain, wrapped = (read_clip(tmp_path / f"{name}.bvh") for name in ("plain", "wrapped"))
    assert np.array_equal(wrapped.joints(), plain.joints())


def test_one_frame_duplicate_names_and_missing_end_sites_are_read(tmp_path):
    text = bvh_text(read_bvh(write(tmp_path, BVH)))
    head, frames = text.split("Frames: 2\n")
    lines = frames.splitlines()
    one = read_bvh(write(tmp_path, f"{head}Frames: 1\n{lines[0]}\n{lines[1]}\n", "one.bvh"))
    assert len(one) == 1
    twice = read_bvh(write(tmp_path, text.replace("JOINT LeftForeArm", "JOINT LeftArm"), "twice.bvh"))
    assert len(twice.skeleton) == len(one.skeleton)
    assert len(set(twice.skeleton.bones)) == len(twice.skeleton)
    endless = re.sub(r"End Site\s*{[^}]*}", "", text)
    assert read_bvh(write(tmp_path, endless, "endless.bvh")).skeleton.leg_length > 0.5


def test_more_frames_than_memory_holds_are_refused_before_they_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr("controller.motion.formats.bvh.MOST_POSES", 30)
    with pytest.raises(FileFormatError, match=r"do not fit into memory\. Cut the recording"):
        read_bvh(write(tmp_path, BVH))


def test_names_and_axis_can_be_given(tmp_path):
    names = {"LeftUpLeg": "bone1", "RightUpLeg": "bone2", "LeftLeg": "bone3", "RightLeg": "bone4"}
    text = BVH
    for name, other in names.items():
        text = re.sub(rf"\b{name}\b", other, text)
    given = read_bvh(write(tmp_path, text), ReadingOptions(rename={other: name for name, other in names.items()}))
    assert given.skeleton.bones == read_bvh(write(tmp_path, BVH)).skeleton.bones
    assert read_bvh(write(tmp_path, BVH), ReadingOptions(up="z")).root_position[0, 2] != pytest.approx(
        given.root_position[0, 2]
    )


@pytest.mark.parametrize(
    ("unit", "size"),
    [
        *product([1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45], [0.8, 1.0, 1.15]),
        *product([1.0, 0.01, 0.001], [0.5]),  # a child in inches has the numbers of a man in CMU's unit
    ],
)
def test_the_unit_is_guessed_from_the_size_of_the_body(tmp_path, unit, size):
    """A file in centimetres, written again in every other unit, is the same body: a child of 0.9 m, or a tall man."""

    def scaled(found):
        numbers = [float(number) * size * 0.01 / unit for number in found.group(2).split()]
        return found.group(1) + " ".join(f"{number:.9f}" for number in numbers)

    text = bvh_text(read_bvh(write(tmp_path, BVH)))
    text = re.sub(r"((?:OFFSET |^)(?=[-\d]))(\S+ \S+ \S+)", scaled, text, flags=re.MULTILINE)
    clip = read_bvh(write(tmp_path, text))
    assert clip.skeleton.leg_length == pytest.approx(0.88 * size, abs=1e-6)


@pytest.mark.parametrize(
    ("period", "rate"),
    [
        ("0.033", 30.0),
        (".03", 30.0),
        ("0.0333", 30.0),
        ("0.017", 60.0),
        ("0.0083", 120.0),
        ("0.042", 24.0),
        ("3.3e-2", 30.0),
        ("0.008", 125.0),
        ("0.02", 50.0),
        ("0.0160", 62.5),
        ("0.033000", 30.3),
    ],
)
def test_few_digits_of_a_frame_time_mean_a_usual_rate(tmp_path, period, rate):
    """0.033 s is 30 Hz, not 30.3: played so, a minute would be half a second short. What whole rates give is exact."""
    text = re.sub(r"Frame Time:\s*\S+", f"Frame Time: {period}", BVH)
    assert read_bvh(write(tmp_path, text)).rate == rate


@pytest.mark.parametrize(("period", "rate"), [("0.0083333", 120.0), ("0.03336670", 29.97), ("0.0166833", 59.94)])
def test_a_rate_need_not_be_a_whole_number_of_hertz(tmp_path, period, rate):
    """A rate rounded to whole Hz would drift by a frame in a thousand."""
    text = re.sub(r"Frame Time:\s*\S+", f"Frame Time: {period}", BVH)
    assert read_bvh(write(tmp_path, text)).rate == rate
