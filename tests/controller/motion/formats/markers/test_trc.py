"""TRC files that the test writes: the markers of a person's skin, points in a person's joints, and broken ones."""

from dataclasses import replace

import numpy as np
import pytest

from controller.motion.canonical.canonical_body import is_canonical
from controller.motion.clip import ReadingOptions
from controller.motion.formats.markers.c3d import read_c3d
from controller.motion.formats.markers.marker_fit import fit_markers
from controller.motion.formats.markers.trc import read_trc
from controller.motion.formats.reading import read_clip, read_fitted
from motiondeck_base.errors import FileFormatError
from people import moving
from written_files import trc_text

MOTION = moving(frames=40)
OPENPOSE = {
    "MidHip": "hips",
    "Neck": "neck",
    "Head": "head end",
    **{
        side.upper() + name: f"{side} {key}"
        for side in "lr"
        for name, key in (
            ("Hip", "thigh"),
            ("Knee", "shank"),
            ("Ankle", "foot"),
            ("BigToe", "toes"),
            ("Shoulder", "arm"),
            ("Elbow", "forearm"),
            ("Wrist", "hand"),
        )
    },
}
PLACES = np.stack([MOTION.place[key] for key in OPENPOSE.values()], axis=1)
TEXT = trc_text(OPENPOSE, PLACES, 60.0)


def write(tmp_path, text):
    (tmp_path / "walk.trc").write_text(text)
    return tmp_path / "walk.trc"


@pytest.mark.parametrize("unit", ["mm", "m"])
def test_markers_are_where_the_file_has_them(tmp_path, unit):
    seen = PLACES.copy()
    seen[3:5, 2] = np.nan
    found = read_trc(write(tmp_path, trc_text(OPENPOSE, seen, 60.0, unit)))
    assert np.allclose(found.position, seen, atol=1e-5, equal_nan=True)
    assert (found.labels, found.rate, found.up) == (tuple(OPENPOSE), 60.0, None)


def test_bones_lead_through_points_in_the_joints(tmp_path):
    """Whose distances are kept here, so that the body meets all of them."""
    clip = read_clip(write(tmp_path, TEXT))
    assert is_canonical(clip.skeleton)
    place = dict(zip(clip.skeleton.bones, np.moveaxis(clip.joints(), 1, 0)[1:], strict=True))
    for side in "lr":
        for bone, parent, key, above in (
            ("kne", "hip", "shank", "thigh"),
            ("ank", "kne", "foot", "shank"),
            ("foo", "ank", "toes", "foot"),
            ("elb", "sho", "forearm", "arm"),
            ("wri", "elb", "hand", "forearm"),
        ):
            ours = place[side + bone] - place[side + parent]
            theirs = (MOTION.place[f"{side} {key}"] - MOTION.place[f"{side} {above}"])[:, [2, 0, 1]]
            assert np.allclose(ours, theirs, atol=2e-5), side + bone


def test_gaps_of_points_are_bridged(tmp_path):
    seen = PLACES.copy()
    seen[10:13, 4] = np.nan
    seen[:2, 5] = np.nan
    clip = read_clip(write(tmp_path, trc_text(OPENPOSE, seen, 60.0)))
    assert np.isfinite(clip.joints()).all()


def test_points_without_toes_and_head_get_them_assumed(tmp_path):
    kept = [label for label in OPENPOSE if "Toe" not in label and label != "Head"]
    places = np.stack([MOTION.place[OPENPOSE[label]] for label in kept], axis=1)
    clip = read_clip(write(tmp_path, trc_text(kept, places, 60.0)))
    ahead = clip.joints()[:, 1 + clip.skeleton.index("lfoo")] - clip.joints()[:, 1 + clip.skeleton.index("lank")]
    assert (ahead[:, 0] > 0.05).all()  # the person walks along x


def test_the_markers_of_a_whole_body_are_fitted(mocap_data, tmp_path):
    """A file of CMU's rewritten as TRC is fitted to the same body."""
    path = mocap_data / "c3d" / "02_03_runjog.c3d"
    whole = read_c3d(path)
    markers = replace(whole, position=whole.position[:30])
    labels = [label.rpartition(":")[2] for label in markers.labels]
    (tmp_path / "run.trc").write_text(trc_text(labels, markers.position, markers.rate))
    one, other = read_fitted(tmp_path / "run.trc"), fit_markers(markers, "run")
    assert np.abs(one.clip.joints() - other.clip.joints()).max() < 1e-4
    assert one.fit is not None


def test_a_unit_that_is_given_overrules_the_file(tmp_path):
    plain = read_trc(write(tmp_path, TEXT))
    assert np.allclose(read_trc(write(tmp_path, TEXT), ReadingOptions(unit=0.01)).position, 10.0 * plain.position)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("PathFileType", "Path"), "this is no .trc file"),
        (("60\t60", "x\t60"), "line 3: expected a number, found 'x'"),
        (("60\t60", "0\t60"), "line 3: a rate of 0"),
        (("\tmm\t", "\tfurlong\t"), "line 3: the unit 'furlong' is unknown. Give it with --unit"),
        (("LKnee", "LHip"), "line 4: expected the names of markers, no two alike"),
        (("X1\tY1", "A1\tB1"), "line 5: expected X1, Y1, Z1"),
        (("\n2\t", "\n2\tx\t"), "line 8: 52 numbers, but the markers have 51"),
        (("\n40\t", "\n41\t0\tone\n40\t"), "expected a number, found 'one'"),
        (("LKnee", "Nose2"), "no marker is called LFWT, "),
    ],
)
def test_a_broken_file_is_one_line(tmp_path, change, said):
    assert change[0] in TEXT
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(write(tmp_path, TEXT.replace(*change, 1)))
    assert "walk.trc" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_cut_short_within_a_line_is_refused(tmp_path):
    with pytest.raises(FileFormatError, match="40 frames are announced, but 31 follow, and the last line is cut short"):
        read_clip(write(tmp_path, "\n".join(TEXT.split("\n")[:37]).rpartition("\t")[0]))


def test_a_file_cropped_at_a_line_is_read(tmp_path):
    assert len(read_clip(write(tmp_path, "\n".join(TEXT.split("\n")[:37])))) == 31


def test_spaces_in_line_1_and_several_tabs_in_line_3_are_read(tmp_path):
    """As older exporters of OpenSim's community write them."""
    lines = TEXT.split("\n")
    lines[0] = "PathFileType  4\t(X/Y/Z) C:\\walk"
    lines[2] = "   60.0\t\t   60.0\t\t     40\t\t     17\t\t mm\t   60.0\t      1\t     40"
    old, new = read_trc(write(tmp_path, "\n".join(lines))), read_trc(write(tmp_path, TEXT))
    assert (old.rate, old.labels) == (new.rate, new.labels)
    assert np.array_equal(old.position, new.position)


def test_decimal_commas_are_named_with_their_line(tmp_path):
    head, _, rows = TEXT.partition("Z17\n")
    with pytest.raises(FileFormatError, match="line 7: expected a number, found"):
        read_clip(write(tmp_path, head + "Z17\n" + rows.replace(".", ",")))


def test_markers_on_the_thighs_are_not_taken_for_hips(tmp_path):
    """Helen Hayes: R.Thigh is a marker on a wand, beside which the pelvis has markers on the skin."""
    labels = [label.replace("Hip", ".Thigh") if label != "MidHip" else "V.Sacral" for label in OPENPOSE]
    with pytest.raises(FileFormatError, match=r"no marker is called LFWT, .* points in the joints"):
        read_clip(write(tmp_path, trc_text(labels, PLACES, 60.0)))
    both = [label if label != "MidHip" else "V.Sacral" for label in OPENPOSE]  # computed hips beside it are read
    assert is_canonical(read_clip(write(tmp_path, trc_text(both, PLACES, 60.0))).skeleton)
