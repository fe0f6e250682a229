"""A draft: what limits leave of it, what is undone, and that no file is lost."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from controller.motion.encodings.joint_angles import JointBody
from controller.motion.formats.keyframes import read_keyframes
from hardware.rig.rig_file import load_rig
from motiondeck.page.keys.draft import Draft
from motiondeck.run.robots.rig_on_deck import robot_of
from motiondeck_base.errors import FileFormatError, UnknownNameError

ARM = Path(__file__).parents[4] / "examples" / "arm"


@pytest.fixture(scope="module")
def arm():
    return robot_of(ARM / "arm.toml", JointBody.of(load_rig(ARM / "arm.toml").names))


def test_a_slow_motion_is_the_same_through_the_limits_and_a_fast_one_is_held_back(arm, tmp_path):
    draft = Draft(tmp_path / "wave.toml", arm)
    draft.change(lambda sheet: sheet.set(2.0, {"elbow": 60.0}))
    assert (draft.course == draft.wanted).all()
    assert not draft.held
    draft.change(lambda sheet: sheet.set(3.0, {"elbow": 60.0}))
    draft.change(lambda sheet: sheet.set(3.1, {"elbow": 0.0}))
    joint = arm.joints.index("elbow")
    speed = np.abs(np.diff(draft.course[:, joint])) * draft.rate
    assert np.abs(np.diff(draft.wanted[:, joint])).max() * draft.rate > 2.0 * arm.limits.velocity[joint]
    assert speed.max() <= arm.limits.velocity[joint]
    [(begins, ends, text)] = draft.held
    assert 3.0 <= begins < 3.1 < ends < 4.0
    assert text.startswith("elbow is held back by up to ")
    assert text.endswith("and may 172°/s")
    others = np.arange(len(arm.joints)) != joint
    assert (draft.course[:, others] == draft.wanted[:, others]).all()
    draft.undo()
    assert not draft.held


def test_a_loop_is_judged_in_its_second_round(arm, tmp_path):
    draft = Draft(tmp_path / "spin.toml", arm, "loop")
    for at, base in ((0.0, -120.0), (0.6, 120.0), (4.0, -120.0)):
        draft.change(lambda sheet, at=at, base=base: sheet.set(at, {"base": base}))
    draft.change(lambda sheet: setattr(sheet, "length", 0.9))
    joint = arm.joints.index("base")
    # In its first round it begins at its first key; in the second it comes from a way that it could not finish.
    assert abs(draft.course[0, joint] - draft.wanted[0, joint]) > 0.1


def test_a_change_that_contradicts_the_keys_is_refused_and_nothing_is_changed(arm, tmp_path):
    draft = Draft(tmp_path / "wave.toml", arm)
    draft.change(lambda sheet: sheet.set(3.0, {"base": 20.0}))
    before, course = draft.sheet.copy(), draft.course
    with pytest.raises(FileFormatError, match="end at 1 s"):
        draft.change(lambda sheet: setattr(sheet, "length", 1.0))
    assert (draft.sheet, draft.course is course) == (before, True)
    draft.undo()
    assert list(draft.sheet.keys) == [0.0]
    draft.undo()
    assert list(draft.sheet.keys) == [0.0]


def test_what_a_file_held_before_is_kept_and_an_example_plays_as_before(arm, tmp_path):
    file = tmp_path / "wave.toml"
    shutil.copy(ARM / "wave.toml", file)
    as_shipped, shipped = read_keyframes(file), file.read_bytes()
    draft = Draft(file, arm)
    assert not draft.unsaved
    assert draft.save().endswith("what it held before is in wave.toml.bak")
    assert (tmp_path / "wave.toml.bak").read_bytes() == shipped
    again = read_keyframes(file)
    assert (again.plays, again.rate) == (as_shipped.plays, as_shipped.rate)
    order = [again.skeleton.bones.index(bone) for bone in as_shipped.skeleton.bones]
    assert again.rotation[:, 1:][:, order] == pytest.approx(as_shipped.rotation[:, 1:], abs=1e-9)
    draft.change(lambda sheet: sheet.set(1.0, {"base": 1.0}))
    assert draft.unsaved
    assert not draft.save().endswith(".bak")
    file.write_text("# mine\n" + file.read_text())
    assert draft.save().endswith(".bak")
    assert (tmp_path / "wave.toml.bak").read_text().startswith("# mine")


@pytest.mark.parametrize(
    ("text", "error", "said"),
    [
        ('unit = "deg"\nkey = [{ at = 1, joint = "elbo", value = 2 }]', UnknownNameError, "elbow"),
        ((ARM / "arm.toml").read_text(), FileFormatError, "unknown"),
    ],
)
def test_a_file_that_does_not_fit_the_rig_is_refused(arm, tmp_path, text, error, said):
    (tmp_path / "wrong.toml").write_text(text)
    with pytest.raises(error, match=said):
        Draft(tmp_path / "wrong.toml", arm)
