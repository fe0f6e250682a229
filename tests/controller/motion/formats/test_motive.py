"""Motive's CSV exports that the test writes: bones with their rotations, markers, and broken ones."""

import csv
import io

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from controller.motion.canonical.body_doubts import doubts
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.clip import Markers, ReadingOptions
from controller.motion.formats.motive import read_motive
from controller.motion.formats.reading import read_clip, recordings_below
from motiondeck_base.errors import FileFormatError
from people import check_person, moving

MOTION = moving(frames=40, rate=120.0)
BONES = {
    **{"Hip": "hips", "Ab": "spine", "Chest": "chest", "Neck": "neck", "Head": "head"},
    **{
        side.upper() + name: f"{side} {key}"
        for side in "lr"
        for name, key in (
            *(("Shoulder", "collar"), ("UArm", "arm"), ("FArm", "forearm"), ("Hand", "hand")),
            *(("Thigh", "thigh"), ("Shin", "shank"), ("Foot", "foot"), ("Toe", "toes")),
        )
    },
}
ENDS = ("head end", "l toes end", "r toes end", "l hand end", "r hand end", "l toes", "r toes")
ABOUT = (
    "Format Version,1.23,Take Name,walk,Take Notes,,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
    "Rotation Type,Quaternion,Length Units,{},Coordinate Space,Global"
)


def exported(blocks, unit="Millimeters", scale=1000.0, person="eva:", rate=120.0):
    """The text of an export: a block is a kind, a name, a measure and its columns (T, C)."""
    rows = [[""] * 2 for _ in range(4)]
    axes, table = ["Frame", "Time (Seconds)"], []
    rows[0][1], rows[1][1], rows[2][1] = "Type", "Name", "ID"
    for kind, name, measure, columns in blocks:
        for axis in "XYZW"[: columns.shape[1]]:
            for row, cell in zip(rows, (kind, person + name, "4F:1", measure), strict=True):
                row.append(cell)
            axes.append(axis)
        table.append(columns * (scale if measure == "Position" else 1.0))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    out.write(ABOUT.format(unit) + "\n\n")
    writer.writerows([*rows, axes])
    for frame, row in enumerate(np.concatenate(table, axis=1)):
        writer.writerow([frame, f"{frame / rate:.6f}", *("" if np.isnan(v) else f"{v:.6f}" for v in row)])
    return out.getvalue()


def bones(of=BONES):
    for name, key in of.items():
        yield "Bone", name, "Rotation", MOTION.world[key].as_quat()
        yield "Bone", name, "Position", MOTION.place[key]


SKIN = {
    **{side + "ASI": (f"{side.lower()} thigh", (0.0, 0.06, 0.1)) for side in "LR"},
    **{side + "PSI": ("hips", (0.05 if side == "L" else -0.05, 0.03, -0.12)) for side in "LR"},
    **{side + "KNE": (f"{side.lower()} shank", (0.05 if side == "L" else -0.05, 0.0, 0.0)) for side in "LR"},
    **{side + "ANK": (f"{side.lower()} foot", (0.04 if side == "L" else -0.04, 0.0, 0.0)) for side in "LR"},
}


def markers(kind="Marker"):
    for name, (key, offset) in SKIN.items():
        yield kind, name, "Position", MOTION.place[key] + MOTION.world[key].apply(offset)


def write(tmp_path, text, name="take.csv"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


@pytest.mark.parametrize(("unit", "scale"), [("Millimeters", 1000.0), ("Meters", 1.0), ("Centimeters", 100.0)])
def test_bones_are_where_the_file_has_them_and_turn_as_there(tmp_path, unit, scale):
    clip = read_clip(write(tmp_path, exported(bones(), unit, scale)))
    check_person(clip, MOTION, 1e-5, ENDS)  # 0.01 mm
    assert (clip.rate, len(clip)) == (120.0, 40)
    assert doubts(clip) == []
    own = to_canonical(clip).skeleton
    assert sum(own.length[own.index(bone)] for bone in ("lkne", "lank")) == pytest.approx(0.82, abs=0.01)


def test_the_order_of_bones_and_a_row_of_parents_do_not_matter(tmp_path):
    text = exported(bones(dict([*reversed(BONES.items())][:-5]) | BONES))  # legs first, from below
    head, kinds, names, ids, rest = text.replace("\n\n", "\n", 1).split("\n", 4)
    parents = ",Parent" + ",x" * (ids.count(",") - 1)
    clip = read_clip(write(tmp_path, "\n".join([head, kinds, names, ids, parents, rest])))
    check_person(clip, MOTION, 1e-5, ENDS)


def test_each_of_two_people_is_read_by_name(tmp_path):
    away = {"eva": 0.0, "bob": 1.5}  # m to the left
    blocks = [
        (
            kind,
            f"{person}:{name}",
            measure,
            values + (measure == "Position") * np.array([left, 0.0, 0.0, 0.0])[: values.shape[1]],
        )
        for person, left in away.items()
        for kind, name, measure, values in bones()
    ]
    path = write(tmp_path, exported(blocks, person=""))
    eva, bob = (read_clip(path, ReadingOptions(person=person)) for person in away)
    check_person(eva, MOTION, 1e-5, ENDS)
    assert np.allclose(bob.joints() - eva.joints(), [0.0, 1.5, 0.0], atol=1e-5)


def test_gaps_of_bones_are_bridged(tmp_path):
    """Behind the gap the quaternions have the other sign, which is the same rotation."""
    blocks = [list(block) for block in bones()]
    for block in blocks[:4]:
        block[3] = block[3].copy()
        block[3][10:13] = np.nan
        block[3][13:] *= -1.0 if block[2] == "Rotation" else 1.0
    clip = read_clip(write(tmp_path, exported(blocks)))
    check = np.r_[0:10, 13:40]
    whole = read_clip(write(tmp_path, exported(bones()), "whole.csv"))
    assert np.allclose(clip.joints()[check], whole.joints()[check], atol=1e-6)
    assert np.abs(clip.joints() - whole.joints()).max() < 0.01
    assert np.abs((clip.rotation * whole.rotation).sum(-1)).min() > 0.99


def test_bones_with_euler_angles_are_points_in_joints(tmp_path):
    euler = [
        (kind, name, measure, values[:, :3] if measure == "Rotation" else values)
        for kind, name, measure, values in bones()
    ]
    points = read_motive(write(tmp_path, exported(euler)))
    assert isinstance(points, Markers)
    truth = np.stack([MOTION.place[key] for key in BONES.values()], axis=1)
    assert np.abs(points.position - truth).max() < 1e-5
    assert doubts(read_clip(write(tmp_path, exported(euler)))) == []


def test_measured_markers_win_over_computed_and_unlabelled_ones(tmp_path):
    solved = [(kind, name, measure, values + 0.5) for kind, name, measure, values in markers("Bone Marker")]
    stray = ("Marker", "Unlabeled 1002", "Position", np.ones((40, 3)))
    seen = [list(block) for block in markers()]
    seen[2][3] = np.where(np.arange(40)[:, None] == 7, np.nan, seen[2][3])
    points = read_motive(write(tmp_path, exported([*solved, *seen, stray])))
    assert points.labels == tuple("eva:" + name for name in SKIN)
    truth = np.stack([block[3] for block in seen], axis=1)
    assert np.allclose(points.position, truth, atol=1e-5, equal_nan=True)  # 0.01 mm
    assert recordings_below(tmp_path) == [tmp_path / "take.csv"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("Millimeters", "Furlongs"), "line 1: the unit 'Furlongs' is unknown. Give it with --unit"),
        (("Space,Global", "Space,Local"), "line 1: bones are in local coordinates. Export it again with global"),
        (("Frame,Time", "Frames,Time"), "no row 'Frame,Time .Seconds.,...'"),
        (("eva:LThigh", "bob:LThigh"), "holds 2 people .eva, bob.. Choose one"),
        (("eva:Hip", "eva:Hub"), "has no known parent"),
        (("\n5,0.041667,", "\n5,0.041667,x"), "line 13: expected a number, found 'x"),
        (("\n5,0.041667,", "\n5,0.031667,"), "line 13: the time 0.031667 does not come after"),
        (("\n5,0.041667,", "\n5,0.041667,1,"), "line 13: .* values, but the first line names"),
    ],
)
def test_a_broken_export_is_one_line_with_the_remedy(tmp_path, change, said):
    text = exported(bones())
    assert change[0] in text
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(write(tmp_path, text.replace(*change)))
    assert "take.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_rigid_bodies_alone_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match=r"neither bones nor labelled markers .* holds: Rigid Body"):
        read_clip(write(tmp_path, exported([("Rigid Body", "box", "Position", np.ones((3, 3)))])))


TEXT = exported([*bones()])


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.tuples(st.integers(0, 3000), st.sampled_from([",", "\n", '"', "nan", "Bone", "-", ":", "1e9"])),
        min_size=1,
        max_size=6,
    ),
    st.integers(0, 12),
)
def test_any_export_is_read_or_refused_in_one_line(tmp_path, changes, cut):
    lines = TEXT.split("\n")
    text = "\n".join(lines[: len(lines) - cut])
    for at, piece in changes:
        text = text[:at] + piece + text[at + len(piece) :]
    try:
        clip = read_clip(write(tmp_path, text))
    except FileFormatError as error:
        message = str(error)
    else:
        message = "take.csv"
        assert np.isfinite(clip.joints()).all()
    assert "take.csv" in message
    assert "\n" not in message
