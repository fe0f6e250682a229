from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from controller.motion.formats.acclaim.amc import read_amc
from controller.motion.formats.acclaim.asf import read_asf
from controller.motion.rotations import dot
from motiondeck_base.errors import FileFormatError
from recordings import AMC, ASF

UNIT = 0.0254 / 0.45


@pytest.fixture
def files(tmp_path):
    """Writes an ASF and an AMC and reads them: (asf text, amc text) -> clip."""

    def read(asf=ASF, amc=AMC, rate=120.0):
        (tmp_path / "mannequin.asf").write_bytes(asf if isinstance(asf, bytes) else asf.encode("latin-1"))
        (tmp_path / "bow.amc").write_bytes(amc if isinstance(amc, bytes) else amc.encode("latin-1"))
        return read_amc(tmp_path / "bow.amc", read_asf(tmp_path / "mannequin.asf"), rate)

    return read


def test_a_skeleton_arrives_in_metres_and_in_our_axes(files):
    body = files().skeleton
    assert body.name == "mannequin"
    assert body.bones == ("hip", "leg", "foot", "chest")
    assert body.parent.tolist() == [-1, 0, 1, -1]
    assert np.allclose(body.length, np.array([2.0, 7.5, 2.0, 5.0]) * UNIT)
    assert np.allclose(body.rest_direction, [[0.0, 0.6, -0.8], [0, 0, -1], [1, 0, 0], [0, 0, 1]])


def test_axes_and_channels_are_read(files, tmp_path):
    files()
    acclaim = read_asf(tmp_path / "mannequin.asf")
    assert acclaim.dof == (("tx", "ty", "tz", "rx", "ry", "rz"), (), ("rx", "ry", "rz"), ("rz", "rx"), ("rx",))
    cycle = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    for bone, axes in ((2, Rotation.from_euler("xyz", [10, -20, 30], degrees=True)), (3, z_first(-90, 0, 20))):
        ours = Rotation.from_quat(acclaim.axis[bone], scalar_first=True).as_matrix()
        assert np.allclose(ours, cycle @ axes.as_matrix() @ cycle.T)
    assert acclaim.length_unit == pytest.approx(UNIT)
    assert acclaim.angle_unit == pytest.approx(np.pi / 180)
    assert acclaim.source == "mannequin.asf"


def z_first(x, y, z):
    return Rotation.from_euler("zyx", [z, y, x], degrees=True)


def test_the_motion_is_that_of_the_format_definition(files):
    """Each bone turns by C M C^-1 against its parent: worked out here in ASF's own axes with scipy."""
    clip = files()
    turn = {
        "root": Rotation.from_euler("xyz", [11, 19, 31], degrees=True),
        "leg": Rotation.from_euler("xyz", [5.5, -6, 7.25], degrees=True),
        "foot": Rotation.from_euler("zx", [8, 10], degrees=True),
    }
    axis = {"leg": Rotation.from_euler("xyz", [10, -20, 30], degrees=True), "foot": z_first(-90, 0, 20)}
    root = np.array([1.5, 17.0, 2.0])
    hip = root + turn["root"].apply([1.2, -1.6, 0.0])
    leg = turn["root"] * axis["leg"] * turn["leg"] * axis["leg"].inv()
    knee = hip + leg.apply([0.0, -7.5, 0.0])
    foot = leg * axis["foot"] * turn["foot"] * axis["foot"].inv()
    toe = knee + foot.apply([0.0, 0.0, 2.0])
    expected = np.array([root, hip, knee, toe])[:, [2, 0, 1]] * UNIT
    assert np.allclose(clip.joints()[1, :4], expected, atol=1e-12)


def test_a_clip_says_what_it_is(files):
    clip = files(rate=60.0)
    assert (clip.name, clip.source, clip.rate, len(clip)) == ("bow", "bow.amc", 60.0, 3)


def test_radians_mean_the_same_as_degrees(files):
    def to_radians(line):
        name, *values = line.split()
        keep = 3 if name == "root" else 0
        return " ".join([name, *values[:keep], *(repr(np.radians(float(value)).item()) for value in values[keep:])])

    lines = [to_radians(line) if line[0].isalpha() else line for line in AMC.splitlines()]
    in_radians = "\n".join(lines).replace(":DEGREES", ":RADIANS")
    assert np.allclose(files(amc=in_radians).rotation, files().rotation, atol=1e-12)


def test_without_a_word_on_angles_the_skeleton_decides(files):
    silent = AMC.replace(":DEGREES\n", "")
    assert np.array_equal(files(amc=silent).rotation, files().rotation)
    radians = ASF.replace("angle deg", "angle rad")
    assert np.allclose(
        files(radians, silent).rotation[0, 0],
        files(radians, AMC.replace("DEG", "RADI").replace("REES", "ANS")).rotation[0, 0],
    )


def test_line_ends_blank_lines_tabs_and_comments_do_not_matter(files):
    plain = files()
    other = "\r\n".join(line.replace(" ", "\t ") + "  # Größe \x85" for line in AMC.splitlines()) + "\r\n\r\n"
    busy = ASF.replace("\n", " # \xe4\r\n\r\n")
    assert np.array_equal(files(busy, other).rotation, plain.rotation)


def test_bones_may_come_in_any_order(files):
    body = ASF.replace(
        "    root hip chest\n    hip leg\n    leg foot\n", "    leg foot\n    hip leg\n    root chest hip\n"
    )
    shuffled = AMC.replace("leg 5 -6 7\nfoot 8.5 1e1\nchest -3\n", "chest -3\nfoot 8.5 1e1\nleg 5 -6 7\n")
    assert np.array_equal(files(body, shuffled).joints(), files().joints())


def test_children_listed_before_their_parents_in_bonedata_are_put_in_order(files):
    begin = ASF.index("  begin\n    id 1")
    second = ASF.index("  begin\n    id 2")
    end = ASF.index(":hierarchy")
    swapped = ASF[:begin] + ASF[second:end] + ASF[begin:second] + ASF[end:]
    body = files(swapped).skeleton
    assert all(parent < bone for bone, parent in enumerate(body.parent))
    assert np.array_equal(files(swapped).joints()[:, 1 + body.index("foot")], files().joints()[:, 3])


def test_a_bone_without_channels_may_have_a_line_or_none(files):
    assert np.array_equal(files(amc=AMC.replace("leg 5 ", "hip\nleg 5 ")).rotation, files().rotation)


def test_the_root_may_be_shifted_and_its_channels_reordered(files):
    shifted = files(ASF.replace("position 0 0 0", "position 1 2 3"))
    assert np.allclose(shifted.root_position - files().root_position, np.array([3.0, 1.0, 2.0]) * UNIT)
    reordered = files(
        ASF.replace("TX TY TZ RX RY RZ", "RX RY RZ TZ TX TY"),
        AMC.replace("root 1 17 2 10 20 30", "root 10 20 30 2 1 17"),
    )
    assert np.allclose(reordered.root_position[0], files().root_position[0])
    assert np.allclose(reordered.rotation[0], files().rotation[0])


def test_angles_that_jump_by_full_turns_leave_no_jump_in_the_rotations(files):
    rotation = files(amc=AMC.replace("leg 5.5 -6 7.25", "leg 365.5 -366 7.25")).rotation
    assert np.all(dot(rotation[1:], rotation[:-1]) > 0.9)
    assert np.allclose(np.abs(dot(rotation, files().rotation)), 1.0)


@given(st.permutations(["rx", "ry", "rz"]), st.integers(0, 3), st.lists(st.floats(-400, 400), min_size=3, max_size=3))
def test_any_subset_and_order_of_channels_turns_in_that_order(files, order, count, angles):
    order, angles = order[:count], angles[:count]
    body = ASF.replace(
        "dof rx ry rz\n    limits (-160.0 20.0)\n           (-70.0 70.0)\n           (-60.0 70.0)\n",
        f"dof {' '.join(order)}\n",
    )
    motion = "1\nroot 0 0 0 0 0 0\nfoot 0 0\nchest 0\nleg " + " ".join(map(repr, angles))
    direction = files(body.replace("axis 10 -20 30", "axis 0 0 0"), motion).joints()[0]
    turn = Rotation.identity()
    for channel, angle in zip(order, angles, strict=True):
        turn = Rotation.from_euler(channel[1], angle, degrees=True) * turn
    expected = turn.apply([0.0, -7.5, 0.0])[[2, 0, 1]] * UNIT
    assert np.allclose(direction[2] - direction[1], expected, atol=1e-12)


def complaint(files, **texts):
    with pytest.raises(FileFormatError) as error:
        files(**texts)
    message = str(error.value)
    assert "\n" not in message
    return message


@pytest.mark.parametrize(
    ("old", "new", "place", "said"),
    [
        (":root\n", ":roof\n", "", "there is no :root section"),
        (":bonedata\n", "", "", "there is no :bonedata section"),
        (":hierarchy\n", "", "", "there is no :hierarchy section"),
        ("  begin\n    id 1\n", "", "line 16", "expected 'begin' of a bone, found 'name'"),
        ("  order TX TY TZ RX RY RZ\n", "", "", "no 'order' line"),
        ("TX TY TZ", "TX TY TT", "line 11", "'tt' is not supported here; there may be: rx, ry, rz, tx"),
        ("TX TY TZ", "TX TX TZ", "line 11", "named twice"),
        ("orientation 0 0 0", "orientation 0 90 0", "line 14", "root orientation"),
        ("position 0 0 0", "position 0 0", "line 13", "expected 3 numbers after 'position', found 2"),
        ("length 0.45", "length 0", "line 6", "length unit of 0"),
        ("length 0.45", "length nan", "line 6", "expected a number, found 'nan'"),
        ("length 0.45", "length", "line 6", "expected 1 number after 'length', found 0"),
        ("angle deg", "angle grad", "line 7", "'angle deg' or 'angle rad'"),
        ("name leg\n", "\n", "line 33", "has no name"),
        ("name leg", "name hip", "line 25", "already a bone called 'hip'"),
        ("name leg", "name root", "line 25", "already a bone called 'root'"),
        ("direction 0 -1 0", "direction 0 -1 O", "line 26", "expected a number, found 'O'"),
        ("direction 0 -1 0", "direction 0 0 0", "line 26", "unit vector"),
        ("direction 0 -1 0", "direction 1e300 0 0", "line 26", "unit vector"),
        ("    direction 0 -1 0\n", "", "", "bone 'leg' has no 'direction' line"),
        ("    length 7.5\n", "", "", "bone 'leg' has no 'length' line"),
        ("length 7.5", "length -7.5", "line 27", "cannot be -7.5 long"),
        ("length 7.5", "length 1_0", "line 27", "expected a number, found '1_0'"),
        ("length 7.5", "length inf", "line 27", "expected a number, found 'inf'"),
        ("10 -20 30 XYZ", "10 -20 30 XYY", "line 28", "such as XYZ, found 'xyy'"),
        ("10 -20 30 XYZ", "10 -20 30", "line 28", "such as XYZ"),
        ("dof rx ry rz", "dof rx ry l", "line 29", "'l' is not supported here; there may be: rx, ry, rz."),
        ("dof rx ry rz", "dof rx tx rz", "line 29", "'tx' is not supported here"),
        ("(-60.0 70.0)\n  end\n", "(-60.0 70.0)\n", "line 33", "Put 'end' between them"),
        ("    dof rx\n  end\n:h", "    dof rx\n:h", "", "no 'end'"),
        ("leg foot", "leg hand", "line 56", "bone 'hand' is not in :bonedata (it has: root, hip, leg, foot, chest)"),
        ("leg foot", "knee foot", "line 56", "bone 'knee' is not in :bonedata"),
        ("    leg foot\n", "", "", "bone 'foot' has no parent"),
        ("leg foot", "leg foot chest", "line 56", "bone 'chest' has two parents, 'root' and 'leg'"),
        ("leg foot", "leg foot root", "line 56", "the root cannot have the parent 'leg'"),
        ("root hip chest\n", "root chest\n    foot hip\n", "", "bone 'hip' is its own ancestor"),
    ],
)
def test_a_skeleton_that_breaks_the_format_is_refused_with_its_place(files, old, new, place, said):
    assert ASF.count(old) == 1
    message = complaint(files, asf=ASF.replace(old, new))
    assert said in message
    assert "mannequin.asf" in message
    assert place in message


@pytest.mark.parametrize(
    ("old", "new", "place", "said"),
    [
        ("chest -1\n", "", "line 14", "frame 9 has no line for chest. The recording is cut short here"),
        ("foot 7.5 10\nchest -1\n", "", "line 14", "no line for foot, chest"),
        ("chest -3\n", "", "line 4", "frame 7 has no line for chest"),
        ("foot 7.5 10", "foot 7.5", "line 17", "bone 'foot' has 2 channels (rz rx), but 1 values"),
        ("foot 7.5 10", "foot 7.5 10 11", "line 17", "but 3 values"),
        (
            "leg 6 -6 7.5",
            "lhipjoint 6 -6 7.5",
            "line 16",
            "bone 'lhipjoint' is not in the skeleton mannequin.asf (it has: root, hip, leg",
        ),
        ("leg 6 -6 7.5", "hip 6 -6 7.5", "line 16", "bone 'hip' has 0 channels (it is rigid)"),
        ("leg 6 -6 7.5", "leg 6 x 7.5", "line 16", "expected a number, found 'x'"),
        ("leg 6 -6 7.5\nfoot", "leg 6 -6\n7.5 foot", "line 16", "but 2 values stand here"),
        ("leg 6 -6 7.5", "leg 6 1_0 7.5", "line 16", "expected a number, found '1_0'"),
        ("leg 6 -6 7.5", "leg 6 nan 7.5", "line 16", "expected a number, found 'nan'"),
        ("leg 6 -6 7.5", "leg 6 1e999 7.5", "line 16", "expected a number, found '1e999'"),
        ("leg 6 -6 7.5", "leg 6 -6 7.5\nleg 6 -6 7.5", "line 17", "second line in this frame"),
        ("\n8\n", "\n9\n", "line 9", "frame 9 follows frame 7"),
        ("\n9\n", "\n", "line 14", "bone 'root' has a second line"),
        ("\n7\n", "\n", "line 4", "the number of a frame is expected"),
        ("\n7\n", "\n" + "7" * 50 + "\n", "line 4", "bone '7777"),
    ],
)
def test_a_recording_that_breaks_the_format_is_refused_with_its_place(files, old, new, place, said):
    assert AMC.count(old) == 1
    message = complaint(files, amc=AMC.replace(old, new))
    assert said in message
    assert "bow.amc" in message
    assert place in message


def test_an_error_ends_with_a_remedy(files):
    message = complaint(files, amc=AMC.replace("leg 6 ", "lhipjoint 6 "))
    assert message.endswith("Give the skeleton that belongs to this recording.")


@pytest.mark.parametrize("which", ["asf", "amc"])
@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "the file is empty"),
        (b"\x00\x01\x02\xff" * 50, "not a text file"),
        (b"\x7f\x80 hello\n\xff\xfe", ""),
        (b"\n\n# nothing here\n", "there is no "),
    ],
)
def test_other_files_are_refused(files, which, content, said):
    message = complaint(files, **{which: content})
    assert said in message
    assert ("mannequin.asf" if which == "asf" else "bow.amc") in message


def test_files_that_cannot_be_opened_are_refused(files, tmp_path):
    files()
    skeleton = read_asf(tmp_path / "mannequin.asf")
    with pytest.raises(FileFormatError, match=r"gone\.asf: cannot be read \(No such file"):
        read_asf(tmp_path / "gone.asf")
    with pytest.raises(FileFormatError, match=r"gone\.amc: cannot be read \(No such file"):
        read_amc(tmp_path / "gone.amc", skeleton)
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_amc(tmp_path, skeleton)
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_asf("zero\0byte.asf")


def test_a_skeleton_with_too_many_bones_is_refused(files):
    bone = "begin\nname b{0}\ndirection 0 1 0\nlength 1\naxis 0 0 0 XYZ\nend\n"
    many = ":root\norder\n:bonedata\n" + "".join(bone.format(i) for i in range(1001)) + ":hierarchy\n"
    many += "".join(f"root b{i}\n" for i in range(1001))
    assert "1001 bones; 1 to 1000 are possible" in complaint(files, asf=many)


def test_a_rate_that_cannot_be_is_refused(files):
    with pytest.raises(FileFormatError, match=r"rate of 0\.0"):
        files(rate=0.0)


def many_angles(scale, frames=6):
    """A skeleton with a tail of eight joints, and a motion whose angles are degrees times a scale."""
    tail = [f"tail{number}" for number in range(8)]
    bones = "".join(
        f"  begin\n id {number}\n name {name}\n direction 0 0 -1\n length 2\n axis 0 0 0 XYZ\n dof rx ry rz\n  end\n"
        for number, name in enumerate(tail, 10)
    )
    asf = ASF.replace(":hierarchy", f"{bones}:hierarchy").replace(
        "root hip", "root tail0\n" + "".join(f"{above} {below}\n" for above, below in pairwise(tail)) + "root hip", 1
    )
    angle = scale * np.random.default_rng(4).uniform(-60.0, 60.0, (frames, 33))
    rows = []
    for frame, values in enumerate(angle, 1):
        words = [f"{value:.5f}" for value in values]
        rows += [str(frame), " ".join(["root 1 17 2", *words[:3]]), " ".join(["leg", *words[3:6]])]
        rows += [" ".join(["foot", *words[6:8]]), " ".join(["chest", words[8]])]
        rows += [" ".join([name, *words[9 + 3 * n : 12 + 3 * n]]) for n, name in enumerate(tail)]
    return asf, "\n".join(rows) + "\n"


def test_angles_that_cannot_be_of_their_unit_are_refused(files):
    asf, degrees = many_angles(1.0)
    _, radians = many_angles(np.pi / 180.0)
    np.testing.assert_allclose(files(asf, degrees).rotation, files(asf, ":RADIANS\n" + radians).rotation, atol=1e-4)
    with pytest.raises(FileFormatError, match=r"bow\.amc: no angle is larger than 1\.0.* Write ':RADIANS'"):
        files(asf, radians)
    with pytest.raises(FileFormatError, match=r"bow\.amc: angles up to 60 are no radians.* Write ':DEGREES'"):
        files(asf, ":RADIANS\n" + degrees)
    files(asf, ":DEGREES\n" + radians)  # what the file says counts; `body_doubts` tells that it may be wrong
