"""The error against the recording is small where a library plays what was recorded, and finds what differs."""

import json
from dataclasses import replace
from functools import cache, partial

import msgspec
import numpy as np
import pytest

from bodies import turned, waving
from command_line import motiondeck
from controller.deck.motion_generator import MotionGenerator
from controller.learning.fit import judge_against, judged
from controller.learning.learn import learn
from controller.learning.measures.recording_errors import recorded_part, recording_error
from controller.library.motion_library import load_library, read_header, save_library
from controller.library.recording_error import LARGEST_DEGREES, Errors, RecordingError
from controller.motion.canonical.canonical_body import leg
from controller.motion.clip import Clip
from controller.motion.formats.taught_clip import taught_clip
from controller.motion.formats.writing import bvh_text
from controller.motion.rotations import multiply
from controller.motion.skeleton import walk_path
from motiondeck import load_library as load_motions
from motiondeck_base.errors import MotiondeckError
from synthetic import small_library


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    (folder / "swing.bvh").write_text(bvh_text(waving(60.0, 4.0)))
    (folder / "bow.bvh").write_text(bvh_text(waving(120.0, 2.0, ends=True)))
    (folder / "greet.bvh").write_text(bvh_text(on_its_feet(waving(60.0, 4.0))))
    return folder


def on_its_feet(clip):
    """The clip with legs at rest."""
    rotation = clip.rotation.copy()
    legs = [1 + clip.skeleton.index(side + end) for side in "lr" for end in ("kne", "ank", "foo")]
    rotation[:, legs] = [1.0, 0.0, 0.0, 0.0]
    return replace(clip, rotation=rotation)


@pytest.fixture(scope="module")
def library(recordings):
    return learn([recordings], "two", seeds=[0]).library


def part_of(library, motion):
    """What the library itself plays, as a recording of what it learned; with the learned part's bounds, s."""
    info = next(one for one in library.info.motions if one.name == motion)
    seconds = info.against_recording.to_s - info.against_recording.from_s
    rate = library.info.rate
    pose = walk_path(library.encoding.decode(MotionGenerator(library, motion).frames(seconds, rate)), 1.0 / rate)
    return Clip(motion, library.skeleton, rate, pose.root_position, pose.rotation), seconds, info.plays == "loop"


def error(library, motion, change=lambda clip: clip):
    """The error against what is played, changed."""
    clip, seconds, loop = part_of(library, motion)
    return recording_error(library, motion, recorded_part(change(clip), 0.0, seconds, loop=loop))


def with_arm_turned(clip, degrees=5.0):
    rotation = clip.rotation.copy()
    arm = [1 + clip.skeleton.index(bone) for bone in ("lelb", "lwri", "lhan")]
    turn = turned(np.full(len(clip), np.radians(degrees)), axis=0)
    rotation[:, arm] = multiply(turn[:, None], rotation[:, arm])
    return replace(clip, rotation=rotation)


@pytest.mark.parametrize("motion", ["swing", "bow"])
def test_a_recording_of_what_is_played_has_no_error(library, motion):
    found = error(library, motion)
    assert found.mm.worst < 1e-3
    assert found.degrees.worst < 1e-4
    assert not found.reason


@pytest.mark.parametrize("motion", ["swing", "bow"])
def test_an_arm_off_by_five_degrees_is_named_with_its_time(library, motion):
    found = error(library, motion, with_arm_turned)
    assert found.degrees.worst == pytest.approx(5.0, abs=0.01)
    assert found.degrees.joint in ("lelb", "lwri", "lhan")
    assert found.mm.joint == "lhan"
    assert "left hand at " in found.mm.where
    assert 0.0 <= found.mm.worst_at_s <= 4.0


def moved(clip, axis, metres):
    place = clip.root_position.copy()
    place[:, axis] += metres
    return replace(clip, root_position=place)


def test_a_floor_off_by_twenty_millimetres_is_found_at_standing_feet(library):
    found = error(library, "greet", lambda clip: moved(clip, 2, 0.02))
    assert found.mm.median == pytest.approx(20.0, abs=0.1)
    assert found.floor_mm == pytest.approx(-20.0, abs=0.1)


def test_the_floor_is_judged_where_it_is_farthest_off(library):
    def rises(clip):
        return moved(clip, 2, 0.04 * np.clip(np.linspace(-2.0, 2.0, len(clip)), 0.0, 1.0))

    assert error(library, "greet", rises).floor_mm == pytest.approx(-40.0, abs=1.0)


def test_feet_that_slide_are_told_from_feet_that_slid_when_recorded(library):
    found = error(library, "greet", lambda clip: moved(clip, 0, 0.05 * np.arange(len(clip)) / clip.rate))
    assert found.slide_mm < 1.0
    assert found.recorded_slide_mm > 40.0


def test_a_larger_person_has_no_error(library):
    def larger(clip):
        body = replace(clip.skeleton, length=1.2 * clip.skeleton.length)
        return replace(clip, skeleton=body, root_position=1.2 * clip.root_position)

    assert error(library, "swing", larger).mm.worst < 0.01


def test_a_seam_is_not_counted_and_what_is_beside_it_is(library):
    def odd(first, end):
        def change(clip):
            rotation, turned_arm = clip.rotation.copy(), with_arm_turned(clip, 20.0).rotation
            span = slice(round(first * clip.rate), round(end * clip.rate))
            rotation[span] = turned_arm[span]
            return replace(clip, rotation=rotation)

        return change

    assert error(library, "swing", odd(0.0, 0.35)).degrees.worst < 0.01
    assert error(library, "swing", odd(0.5, 0.6)).degrees.worst == pytest.approx(20.0, abs=0.1)


def test_the_time_of_the_worst_is_that_of_the_recording(library):
    clip, seconds, loop = part_of(library, "bow")
    rotation = clip.rotation.copy()
    rotation[24:36] = with_arm_turned(clip, 20.0).rotation[24:36]  # 0.2 to 0.3 s
    before = np.repeat(rotation[:1], 60, axis=0), np.repeat(clip.root_position[:1], 60, axis=0)
    longer = replace(
        clip,
        rotation=np.concatenate([before[0], rotation]),
        root_position=np.concatenate([before[1], clip.root_position]),
    )
    found = recording_error(library, "bow", recorded_part(longer, 0.5, 0.5 + seconds, loop=loop))
    assert 0.7 <= found.degrees.worst_at_s <= 0.8


def test_a_one_shot_may_come_to_rest_a_little_late(library):
    def ahead(since):
        """What is recorded from `since` s before the end on is up to 0.08 s ahead of what is played."""

        def change(clip):
            t = np.arange(len(clip))
            by = 0.08 * clip.rate * np.clip((t - len(clip) + since * clip.rate) / 20.0, 0.0, 1.0)
            frame = np.minimum(np.rint(t + by).astype(int), len(clip) - 1)
            return replace(clip, rotation=clip.rotation[frame], root_position=clip.root_position[frame])

        return change

    late = error(library, "bow", ahead(0.5)).degrees
    assert late.worst < 1.0
    assert error(library, "bow", ahead(1.5)).degrees.worst > 3.0


def test_another_size_of_the_body_is_told_from_another_motion(library):
    def longer_arms(clip):
        length = clip.skeleton.length * np.where(["elb" in bone for bone in clip.skeleton.bones], 1.3, 1.0)
        return replace(clip, skeleton=replace(clip.skeleton, length=length))

    found = error(library, "swing", longer_arms)
    assert found.mm.worst > 30.0
    assert found.degrees.worst < 0.1
    assert found.own_body_mm < 0.1
    turned_arm = error(library, "swing", with_arm_turned)
    assert turned_arm.own_body_mm == pytest.approx(turned_arm.mm.p95, rel=0.05)


def test_a_clip_of_a_motion_is_on_the_body_of_its_recording(library, tmp_path):
    clip, seconds, loop = part_of(library, "swing")
    length = clip.skeleton.length * np.where(
        [bone in ("lelb", "rkne", "back") for bone in clip.skeleton.bones], 1.2, 1.0
    )
    other = replace(clip, skeleton=replace(clip.skeleton, length=length))
    model = judged(library, {"swing": partial(recorded_part, other, 0.0, seconds, loop=loop)})
    save_library(model, tmp_path / "two.safetensors")
    played = load_motions(tmp_path / "two.safetensors")
    found = played.generate_clip("swing", seconds=seconds)
    assert found.joints()[:, 1:] - found.joints()[:, :1] == pytest.approx(
        other.joints()[:, 1:] - other.joints()[:, :1], abs=1e-3
    )
    lowest, before = (one.joints()[..., 2].min(axis=1) for one in (found, clip))
    assert lowest == pytest.approx(before * leg(other.skeleton) / leg(clip.skeleton), abs=0.02)  # a soft minimum
    assert played.generate_clip("bow", seconds=1.0).skeleton.length == pytest.approx(clip.skeleton.length, abs=1e-6)


def test_a_pose_held_that_was_never_recorded_is_found(library):
    def ends_elsewhere(clip):
        part = with_arm_turned(clip, 30.0)
        rotation = clip.rotation.copy()
        rotation[-1] = part.rotation[-1]
        return replace(clip, rotation=rotation)

    assert error(library, "bow").held_degrees < 10.0
    assert error(library, "bow", ends_elsewhere).held_degrees == pytest.approx(30.0, abs=10.0)
    assert error(library, "swing").held_degrees is None


def test_what_is_too_far_from_its_recording_fails_with_joint_and_time(library):
    clip, seconds, loop = part_of(library, "swing")
    other = replace(clip, rotation=np.roll(clip.rotation, len(clip) // 4, axis=0))
    after = judged(library, {"swing": partial(recorded_part, other, 0.0, seconds, loop=loop)})
    bow, _, swing = sorted(after.info.motions, key=lambda motion: motion.name)
    assert swing.against_recording.degrees.p95 > LARGEST_DEGREES
    assert not swing.passed
    assert swing.against_recording.mm.where in swing.reason
    assert bow.passed


def test_learning_writes_the_errors_against_the_files_into_the_library(library, tmp_path):
    save_library(library, tmp_path / "two.safetensors")
    for motion in load_library(tmp_path / "two.safetensors").info.motions:
        assert motion.against_recording.mm.p95 < 15.0
        assert motion.against_recording.degrees.p95 < 3.0
        assert motion.passed


def test_a_library_without_these_errors_still_loads(library, tmp_path):
    tree = json.loads(msgspec.json.encode(library.info))
    for motion in tree["motions"]:
        del motion["against_recording"]
    assert all(motion.against_recording is None for motion in read_header(tmp_path / "old", tree).motions)


def test_the_reason_says_millimetres_or_degrees():
    good = Errors(median=1.0, p95=2.0, worst=3.0, joint="rfoo", worst_at_s=1.25)
    fields = {"from_s": 0.0, "to_s": 2.0, "mm": good, "own_body_mm": 2.0}
    assert not RecordingError(degrees=good, **fields).reason
    assert "6.0°" in RecordingError(degrees=msgspec.structs.replace(good, p95=6.0), **fields).reason
    far = RecordingError(degrees=good, **fields | {"own_body_mm": 41.0})
    assert "41 mm" in far.reason
    assert "right toes at 1.25 s" in far.reason
    assert RecordingError(degrees=good, **fields | {"own_body_mm": np.nan}).reason
    assert not RecordingError(degrees=good, held_degrees=4.9, **fields).reason
    assert "holds a pose 31°" in RecordingError(degrees=good, held_degrees=31.0, **fields).reason


@cache
def _learned(folder):
    return motiondeck("learn", folder, "--out", folder / "two.safetensors", "--json")


def test_the_command_line_shows_the_errors_and_judges_anew(recordings, tmp_path):
    rows = {row["name"]: row for row in json.loads(_learned(recordings).stdout)["motions"]}
    library = recordings / "two.safetensors"
    again = motiondeck("library", "show", library, recordings / "bow.bvh", "--json")
    assert again.returncode == 0
    (judged_anew,) = json.loads(again.stdout)["motions"]
    assert judged_anew["against_recording"] == rows["bow"]["against_recording"]
    assert "against the recording" in motiondeck("library", "show", library).stdout
    (tmp_path / "bow.bvh").write_text(bvh_text(with_arm_turned(waving(120.0, 2.0, ends=True), 60.0)))
    worse = motiondeck("library", "show", library, tmp_path / "bow.bvh")
    assert worse.returncode == 1
    assert "too far from its recording" in worse.stdout
    (tmp_path / "jump.bvh").write_text("")
    unknown = motiondeck("library", "show", library, tmp_path / "jump.bvh")
    assert "give one of bow.bvh, greet.bvh, swing.bvh" in unknown.stderr


def test_joints_of_a_rig_have_no_such_error():
    clip = taught_clip("nod", ("neck", "jaw"), 50.0, np.zeros((50, 2)))
    assert recorded_part(clip, 0.0, 1.0, loop=False) is None


def test_a_network_that_runs_by_itself_keeps_no_time_to_compare():
    small = small_library()
    still = replace(waving(60.0, 1.0), name="march")
    assert judged(small, {"march": partial(recorded_part, still, 0.0, 1.0, loop=True)}) is small


def test_what_the_self_test_said_stays_when_a_motion_is_judged_anew(library, recordings, tmp_path):
    bow, *others = library.info.motions
    failed = msgspec.structs.replace(bow, passed=False, reason="the network ran away")
    broken = replace(library, info=msgspec.structs.replace(library.info, motions=[failed, *others]))
    (again,) = judge_against(broken, tmp_path / "two.safetensors", recordings / "bow.bvh")
    assert (again.passed, again.reason) == (False, "the network ran away")
    assert judge_against(library, tmp_path / "two.safetensors", recordings / "bow.bvh")[0].passed


def test_a_missing_file_is_named(library, tmp_path):
    with pytest.raises(MotiondeckError, match=r"gone\.bvh"):
        judge_against(library, tmp_path / "two.safetensors", tmp_path / "gone.bvh")
