"""Several people in a file are named, each is read on demand, and each is a take of its own to learn."""

import numpy as np
import pytest

from command_line import invoked
from controller.learning.fit import judge_against
from controller.learning.learn import learn
from controller.learning.training_set import read_motion
from controller.library.motion_library import load_library, save_library
from controller.motion.clip import ReadingOptions
from controller.motion.formats.reading import read_clip
from controller.motion.joint_tree import SeveralPeopleError
from motiondeck_base.errors import FileFormatError
from people import check_person, moving
from written_files import MIXAMO, bvh_text, mvnx_text, trc_text

JOINTS = {  # m: x forward, y left, z up
    "LHip": (0.0, 0.1, 0.9), "RHip": (0.0, -0.1, 0.9), "LKnee": (0.02, 0.1, 0.5), "RKnee": (0.02, -0.1, 0.5),
    "LAnkle": (0.0, 0.1, 0.09), "RAnkle": (0.0, -0.1, 0.09), "Neck": (0.0, 0.0, 1.45), "LShoulder": (0.0, 0.18, 1.4),
    "RShoulder": (0.0, -0.18, 1.4), "LElbow": (0.0, 0.2, 1.1), "RElbow": (0.0, -0.2, 1.1), "LWrist": (0.05, 0.2, 0.85),
    "RWrist": (0.05, -0.2, 0.85),
}  # fmt: skip
TIME = np.arange(180) / 60.0


def person(size, pace):
    """The joints of a body of some size that walks along and swings an arm, (T, 13, 3), m."""
    tracks = np.tile(size * np.array([*JOINTS.values()]), (len(TIME), 1, 1))
    tracks[:, :, 0] += 0.5 * TIME[:, None]
    tracks[:, [*JOINTS].index("LWrist"), 0] += 0.2 * np.sin(pace * TIME)
    return tracks


def written(tmp_path, between=":"):
    labels = [f"{name}{between}{joint}" for name in ("Anna", "Ben") for joint in JOINTS]
    path = tmp_path / "duo.trc"
    path.write_text(trc_text(labels, np.concatenate([person(1.0, 3.0), person(0.8, 5.0)], axis=1), 60.0))
    return path


@pytest.mark.parametrize("between", [":", "_"])
def test_none_of_several_people_is_taken_in_silence(tmp_path, between):
    path = written(tmp_path, between)
    with pytest.raises(SeveralPeopleError, match=r"holds 2 people \(Anna, Ben\)\. Choose one: --skeleton NAME"):
        read_clip(path)
    with pytest.raises(FileFormatError, match="no person in it is called 'Eve'"):
        read_clip(path, ReadingOptions(person="Eve"))
    heights = [read_clip(path, ReadingOptions(person=name)).joints()[..., 2].max() for name in ("Anna", "Ben")]
    assert heights[1] == pytest.approx(0.8 * heights[0], rel=0.05)


def test_one_person_with_a_name_is_read_as_before(tmp_path):
    path = tmp_path / "solo.trc"
    path.write_text(trc_text([f"Anna:{joint}" for joint in JOINTS], person(1.0, 3.0), 60.0))
    assert len(read_clip(path)) == len(TIME)


def test_each_person_is_learned_under_a_name(tmp_path):
    learned = learn([written(tmp_path)], "duo", seeds=[0])
    assert [motion.name for motion in learned.motions] == ["duo-Anna", "duo-Ben"]
    assert [motion.person for motion in learned.recipe.motions] == ["Anna", "Ben"]
    assert [actor.actor for actor in learned.actors] == ["duo-Anna", "duo-Ben"]


ANNA, BEN = moving(seed=1), moving(seed=2)
SWORD = "ROOT Sword\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\nOFFSET 0 90 0\n}\n}\n"


def duo_bvh(*texts):
    """One BVH of several: their ROOTs one after the other, and in each frame the channels of all."""
    heads, rows = [], []
    for text in texts:
        head, _, motion = text.partition("MOTION\n")
        heads.append(head.removeprefix("HIERARCHY\n"))
        count, period, *frames = motion.splitlines()
        rows.append(frames)
    lines = ["HIERARCHY", *heads, "MOTION", count, period, *(" ".join(row) for row in zip(*rows, strict=True))]
    return "\n".join(lines) + "\n"


def prefixed(name):
    return {key: f"{name}:{joint}" for key, joint in MIXAMO.items()}


DUOS = {
    "bvh": (duo_bvh(bvh_text(ANNA, prefixed("Anna")), bvh_text(BEN, prefixed("Ben"))), ("Anna", "Ben")),
    "names alike.bvh": (duo_bvh(bvh_text(ANNA), bvh_text(BEN)), ("Hips", "Hips 2")),
    "names that mean nothing.bvh": (
        duo_bvh(*(bvh_text(one, {key: f"j{at}" for at, key in enumerate(MIXAMO)}) for one in (ANNA, BEN))),
        ("j0", "j0 2"),
    ),
    "below one root.bvh": (
        duo_bvh(bvh_text(ANNA, prefixed("Anna")), bvh_text(BEN, prefixed("Ben")))
        .replace("ROOT", "JOINT")
        .replace("HIERARCHY\n", "HIERARCHY\nROOT Scene\n{\nOFFSET 0 0 0\nCHANNELS 0\n")
        .replace("MOTION", "}\nMOTION"),
        ("Anna", "Ben"),
    ),
    "mvnx": (
        mvnx_text(ANNA).replace('label="A"', 'label="Anna"').replace(
            "</mvnx>", "<subject" + mvnx_text(BEN).partition("<subject")[2].replace('label="A"', 'label="Ben"')
        ),
        ("Anna", "Ben"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", DUOS)
def test_each_of_two_bodies_is_read_by_name(tmp_path, kind):
    text, people = DUOS[kind]
    path = tmp_path / f"duo.{kind}"
    path.write_text(text)
    with pytest.raises(SeveralPeopleError) as caught:
        read_clip(path)
    assert caught.value.people == people
    for name, motion in zip(people, (ANNA, BEN), strict=True):
        check_person(read_clip(path, ReadingOptions(person=name)), motion, tolerance=1e-5)


def test_a_root_without_legs_beside_a_body_is_left_out_and_said(tmp_path):
    path = tmp_path / "armed.bvh"
    still = "HIERARCHY\n" + SWORD + "MOTION\n" + bvh_text(ANNA).partition("MOTION\n")[2]
    still = "\n".join([*still.splitlines()[: -len(ANNA.root)], *["0 0 0"] * len(ANNA.root)]) + "\n"
    path.write_text(duo_bvh(still, bvh_text(ANNA)))
    clip = read_clip(path)
    check_person(clip, ANNA, tolerance=1e-5)
    first = clip.decisions[0]
    assert (first.step, first.decided, first.notable) == ("people", "Hips", True)
    assert "Sword" in first.evidence


def test_a_person_of_a_bvh_is_learned_by_name_and_read_again_by_the_recipe(tmp_path):
    path = tmp_path / "pair.bvh"
    path.write_text(duo_bvh(*(bvh_text(moving(120, seed=seed, reach=0.4)) for seed in (1, 2))))
    learned = learn([path], "pair", seeds=[0])
    assert [motion.name for motion in learned.motions] == ["pair-Hips", "pair-Hips-2"]
    again = [read_motion(tmp_path, motion) for motion in learned.recipe.motions]
    assert np.abs(again[0].root_position - again[1].root_position).max() < 1e-6  # their paths are alike
    assert np.abs(again[0].joints() - again[1].joints()).max() > 0.05
    save_library(learned.library, out := tmp_path / "pair.safetensors")
    added = invoked(*f"library add {out} {path} --name again --allow-failing --skeleton".split(), "Hips 2")
    assert added.exit_code == 0
    motion = load_library(out).info.recipe["motions"][-1]
    assert (motion["person"], motion["skeleton"]) == ("Hips 2", None)
    judged = judge_against(learned.library, tmp_path / "pair.safetensors", path)
    assert [motion.name for motion in judged] == ["pair-Hips", "pair-Hips-2"]
    assert [motion.against_recording for motion in judged] == [one.info.against_recording for one in learned.motions]
