"""Our CSV read back is the same body; markers in a CSV are markers; other tables are refused."""

from dataclasses import replace

import numpy as np
import pytest

from bodies import random_body, random_clip
from controller.motion.canonical.body_doubts import doubts
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.canonical.clip_edits import mirrored
from controller.motion.clip import Clip, ReadingOptions
from controller.motion.formats.positions import read_positions
from controller.motion.formats.reading import read_clip, recordings_below
from controller.motion.formats.writing import csv_text, write_clip
from controller.motion.rotations import multiply, normalise
from motiondeck_base.errors import FileFormatError
from people import CANONICAL, in_our_axes, moving
from written_files import gltf_file


@pytest.fixture
def walk(tmp_path):
    (tmp_path / "walk.glb").write_bytes(gltf_file(moving(frames=40)).glb())
    return read_clip(tmp_path / "walk.glb")


def written(clip):
    return csv_text(("root", *clip.skeleton.bones), clip.joints(), clip.rate)


def back(tmp_path, clip):
    write_clip(clip, tmp_path / "back.csv")
    return read_clip(tmp_path / "back.csv")


@pytest.mark.parametrize("change", [lambda clip: clip, to_canonical, mirrored])
def test_a_body_comes_back_with_its_bones(tmp_path, walk, change):
    clip = change(walk)
    again = back(tmp_path, clip)
    assert again.skeleton.bones == clip.skeleton.bones
    assert np.array_equal(again.skeleton.parent, clip.skeleton.parent)
    assert (again.rate, len(again)) == (clip.rate, len(clip))
    assert np.abs(again.joints() - clip.joints()).max() < 2e-5
    one, other = to_canonical(again), to_canonical(clip)
    assert np.abs(one.joints() - other.joints()).max() < 2e-5


@pytest.mark.parametrize("seed", range(5))
def test_bones_of_any_tree_are_found(tmp_path, seed):
    rng = np.random.default_rng(seed)
    clip = random_clip(rng, random_body(rng, 20), 30)
    again = back(tmp_path, clip)
    assert np.array_equal(again.skeleton.parent, clip.skeleton.parent)


def test_one_frame_is_a_pose(tmp_path, walk):
    one = Clip("one", walk.skeleton, walk.rate, walk.root_position[:1], walk.rotation[:1])
    assert np.abs(back(tmp_path, one).joints() - one.joints()).max() < 2e-5


def test_markers_stay_markers(tmp_path):
    from controller.motion.clip import Markers

    seen = np.random.default_rng(0).normal(size=(4, 3, 3))
    seen[1, 2] = np.nan
    markers = Markers(("LKNE", "C7", "CLAV"), 120.0, seen, "z", "a.c3d")
    (tmp_path / "m.csv").write_text(csv_text(markers.labels, seen, markers.rate))
    again = read_positions(tmp_path / "m.csv")
    assert isinstance(again, Markers)
    assert again.labels == markers.labels
    assert np.allclose(again.position, seen, atol=1e-6, equal_nan=True)
    with pytest.raises(FileFormatError, match=r"m\.csv: no marker is called LFWT, "):
        read_clip(tmp_path / "m.csv")


def test_unit_and_names_are_overruled(tmp_path, walk):
    write_clip(walk, tmp_path / "walk.csv")
    bigger = read_clip(tmp_path / "walk.csv", ReadingOptions(unit=1.1, rename={"LeftLeg": "LeftShin"}))
    assert "LeftShin" in bigger.skeleton.bones
    assert np.allclose(bigger.joints(), 1.1 * walk.joints(), atol=2e-5)


def decimal_commas(text):
    head, *rows = text.splitlines()
    return "\n".join([head, *(row.replace(".", ",") for row in rows)])


def timed(text, change):
    head, *rows = text.splitlines()
    return "\n".join([head, *(f"{change(float(row.partition(',')[0])):.9f},{row.partition(',')[2]}" for row in rows)])


def test_times_may_be_those_of_a_clock(tmp_path, walk):
    (tmp_path / "clock.csv").write_text(timed(written(walk), lambda time: 1.7e9 + time))
    clip = read_clip(tmp_path / "clock.csv")
    assert clip.rate == pytest.approx(walk.rate, rel=1e-4)
    assert np.abs(clip.joints() - walk.joints()).max() < 2e-5


def test_a_table_with_uneven_times_is_evened_out(tmp_path, walk):
    """As cameras of telephones write them: some frames come late, some not at all."""
    draw = np.random.default_rng(4)
    late = timed(written(walk), lambda time: time + (0.0 < time < 0.6) * draw.uniform(0.0, 0.006))
    head, *rows = late.splitlines()
    moved = np.array([[float(word) for word in row.split(",")] for row in rows])
    true = np.arange(len(walk)) / walk.rate
    places = walk.joints().reshape(len(walk), -1)
    moved[:, 1:] = np.stack([np.interp(moved[:, 0], true, column) for column in places.T], axis=1)
    kept = [",".join(f"{value:.6f}" for value in row) for k, row in enumerate(moved) if k not in (9, 20, 21)]
    (tmp_path / "late.csv").write_text("\n".join([head, *kept]))
    clip = read_clip(tmp_path / "late.csv")
    assert clip.rate == pytest.approx(walk.rate, rel=0.05)
    when = np.arange(len(clip)) / clip.rate
    expected = np.stack([np.interp(when, true, column) for column in places.T], axis=1)
    assert np.abs(clip.joints().reshape(len(clip), -1) - expected).max() < 0.02


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: text.replace("time_s", "frame"), "line 1: expected 'time_s'"),
        (lambda text: text.replace(".y", ".b"), "line 1: expected x, y and z of each joint side by side"),
        (lambda text: text.replace("LeftArm.", "LeftLeg."), "no two joints alike"),
        (lambda text: text.splitlines()[0], "no frames in it"),
        (lambda text: text.replace(",", "|"), "line 1: expected 'time_s'"),
        (lambda text: decimal_commas(text), r"line 2: .*\(Decimals have a dot"),
        (lambda text: text.replace(",0.", ",zero.", 1), "line 2: expected a number, found 'zero"),
        (lambda text: text.replace(",0.", ",nan0.", 1), "line 2: expected a number"),
        (lambda text: text[: text.rindex(",")], "values, but the first line names"),
        (lambda text: text[: text.rindex(",") + 1], "Fill the gaps"),
        (
            lambda text: text.replace("\n0.016667", "\n0.5"),
            r"odd\.csv line 4: the time 0\.0333.* does not come after 0\.5",
        ),
        (
            lambda text: "\n".join(text.splitlines()[:2] + text.splitlines()[1:2]),
            "line 3: the time 0 .*not come after 0",
        ),
        (
            lambda text: timed(text, lambda time: time + (time > 0.3)),
            r"line 21: no frames from 0\.3 to 1\.31\d+ s. Cut",
        ),
        (lambda text: timed(text, lambda time: time if time > 0.4 else 1e-5 * time), "do not fit into memory. Cut"),
        (
            lambda text: timed(text, lambda time: 1e5 + 1000.0 * time),
            "line 3: .* Times are in seconds: divide them by 1000",
        ),
    ],
)
def test_another_table_is_one_line(tmp_path, walk, change, said):
    text = written(walk)
    (tmp_path / "odd.csv").write_text(change(text))
    with pytest.raises(FileFormatError, match=said) as caught:
        read_clip(tmp_path / "odd.csv")
    assert "odd.csv" in str(caught.value)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(",", ";"),
        lambda text: decimal_commas(text.replace(",", ";")),
        lambda text: decimal_commas(text.replace(",", "\t")),
        lambda text: "\n".join(",".join(f'"{word}"' for word in line.split(",")) for line in text.splitlines()),
        lambda text: "# exported\n" + text.replace("time_s", "Time").replace(".x", "_X").replace(".y", "_Y"),
        lambda text: text.replace("time_s", "t").replace(".x", "X").replace(".y", "Y").replace(".z", "Z"),
    ],
)
def test_the_same_table_as_others_write_it_is_the_same_body(tmp_path, walk, change):
    text = written(walk)
    (tmp_path / "others.csv").write_text(change(text))
    assert np.abs(read_clip(tmp_path / "others.csv").joints() - walk.joints()).max() < 2e-5
    assert tmp_path / "others.csv" in recordings_below(tmp_path)


@pytest.mark.parametrize("unit", [100.0, 1000.0])
def test_a_body_in_centimetres_or_millimetres_is_as_large(tmp_path, walk, unit):
    head, *rows = written(walk).splitlines()
    times, places = zip(*(row.split(",", 1) for row in rows), strict=True)
    larger = [",".join(f"{unit * float(word):.4f}" for word in row.split(",")) for row in places]
    (tmp_path / "larger.csv").write_text("\n".join([head, *map(",".join, zip(times, larger, strict=True))]))
    assert np.abs(read_clip(tmp_path / "larger.csv").joints() - walk.joints()).max() < 2e-5


JOINTS = {"hips": "Hip", "neck": "Neck", "head": "Head"} | {
    f"{side} {key}": word + name
    for side, word in (("l", "left_"), ("r", "right_"))
    for key, name in zip(
        ("thigh", "shank", "foot", "toes", "arm", "forearm", "hand"),
        ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist"),
        strict=True,
    )
}


ON_SIDE = np.array([0.5, -0.5, -0.5, -0.5])  # z up becomes y up: (x, y, z) becomes (y, z, x)


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("unit", [1.0, 100.0, 1000.0])
@pytest.mark.parametrize("first", ["Hip", "root"])
def test_a_table_of_joints_of_others_is_the_person_whatever_axis_is_up(tmp_path, up, unit, first):
    """As pose estimators write them; where the joints are is known from the person."""
    person = moving(frames=40)
    names = JOINTS | {"hips": first}
    axes = unit * (np.eye(3) if up == "y" else np.eye(3)[[2, 0, 1]])
    own = to_canonical(estimated(tmp_path, person, axes, names))
    joints = dict(zip(("root", *own.skeleton.bones), np.moveaxis(own.joints(), 1, 0), strict=True))
    for side in "lr":
        for upper, lower in (("hip", "kne"), ("kne", "ank"), ("sho", "elb"), ("elb", "wri")):
            ours = joints[side + lower] - joints[side + upper]
            true = in_our_axes(person.place[CANONICAL[side + lower]] - person.place[CANONICAL[side + upper]])
            assert np.abs(normalise(ours) - normalise(true)).max() < 1e-3, side + lower
    middle = in_our_axes(0.5 * (person.place["l thigh"] + person.place["r thigh"]))
    assert np.abs(own.root_position - middle).max() < 0.02


def estimated(tmp_path, person, axes, names=JOINTS):
    """A table of a pose estimator, its places turned into other axes."""
    places = np.stack([person.place[key] for key in names], axis=1) @ np.array(axes, float).T
    lines = [",".join(["time", *(f"{name}_{axis}" for name in names.values() for axis in "xyz")])]
    lines += [f"{k / person.rate:.6f}," + ",".join(f"{v:.6f}" for v in row.ravel()) for k, row in enumerate(places)]
    (tmp_path / "estimated.csv").write_text("\n".join(lines))
    return read_clip(tmp_path / "estimated.csv")


Y_DOWN, TIPPED = np.diag([1.0, -1.0, -1.0]), [[1, 0, 0], [0, 0, -1], [0, 1, 0]]


@pytest.mark.parametrize("axes", [Y_DOWN, TIPPED @ Y_DOWN], ids=["y down", "z down"])
def test_a_camera_has_its_axis_down_and_the_person_stands(tmp_path, axes):
    person = moving(frames=40)
    clip = estimated(tmp_path, person, axes)
    own = to_canonical(clip)
    assert np.percentile(own.joints()[:, own.skeleton.bones.index("head") + 1, 2] - own.root_position[:, 2], 5) > 0.3
    shank = (
        own.joints()[:, 1 + own.skeleton.bones.index("lank")] - own.joints()[:, 1 + own.skeleton.bones.index("lkne")]
    )
    true = person.place["l foot"] - person.place["l shank"]
    assert np.allclose(normalise(shank)[:, 2], normalise(true)[:, 1], atol=1e-3)


def test_who_stands_on_the_hands_is_not_turned_over(tmp_path):
    """The arms tell: they point away from the legs."""
    person = moving(frames=40)
    up = {key: place.copy() for key, place in person.place.items()}
    for side in "lr":
        for k, key in enumerate(("forearm", "hand")):
            up[f"{side} {key}"] = up[f"{side} arm"] + (k + 1) * np.array([0.0, 0.27, 0.0])
    own = to_canonical(estimated(tmp_path, replace(person, place=up), Y_DOWN))
    assert (own.joints()[:, own.skeleton.bones.index("head") + 1, 2] < own.root_position[:, 2]).all()


def test_a_table_written_as_ours_with_another_axis_up_is_doubted(tmp_path, walk):
    turned = replace(walk, root_position=walk.root_position[:, [1, 2, 0]], rotation=multiply(ON_SIDE, walk.rotation))
    assert any("lies all the time" in doubt for doubt in doubts(back(tmp_path, turned)))
    assert not doubts(back(tmp_path, walk))


def test_line_ends_do_not_matter(tmp_path, walk):
    (tmp_path / "dos.csv").write_text(written(walk).replace("\n", "\r\n"))
    assert np.abs(read_clip(tmp_path / "dos.csv").joints() - walk.joints()).max() < 2e-5


def test_folders_are_searched_for_tables_of_positions_only(tmp_path, walk):
    write_clip(walk, tmp_path / "ours.csv")
    (tmp_path / "other.csv").write_text("name,age\n")
    assert [path.name for path in recordings_below(tmp_path)] == ["ours.csv", "walk.glb"]
