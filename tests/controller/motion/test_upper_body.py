"""What was recorded without legs is refused, and learned as an upper body where that is asked."""

import numpy as np
import pytest

from command_line import invoked
from controller.learning.learn import learn
from controller.learning.recipe import read_recipe
from controller.learning.training_set import read_motion
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.clip import ReadingOptions
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import rotate
from motiondeck_base.errors import FileFormatError, MotiondeckError
from people import OFFSET, check_person, moving
from written_files import MIXAMO, bvh_text

LEGS = ("thigh", "shank", "foot", "toes")
UPPER = {key: name for key, name in MIXAMO.items() if not key[2:].startswith(LEGS)}
OF_LEGS = [key for key in MIXAMO if key not in UPPER]
MOTION = moving(90, reach=0.4)


def written(tmp_path, text, name="up.bvh"):
    (tmp_path / name).write_text(text)
    return tmp_path / name


def test_without_being_asked_it_is_refused_with_the_option(tmp_path):
    with pytest.raises(MotiondeckError, match=r"no left leg was found.*`learn --accept upper-body`"):
        learn([written(tmp_path, bvh_text(MOTION, UPPER))], "up")


@pytest.mark.parametrize("along_x", [False, True])
def test_arms_head_and_trunk_are_those_of_the_file_and_legs_stand(tmp_path, along_x):
    path = written(tmp_path, bvh_text(MOTION, UPPER, along_x=along_x))
    clip = read_clip(path, ReadingOptions(upper_body=True))
    check_person(clip, MOTION, tolerance=1e-5, lacking=OF_LEGS)
    own = to_canonical(clip)
    lines = rotate(own.rotation[:, 1:], own.skeleton.rest_direction)
    for side in "lr":
        for bone in ("kne", "ank"):
            assert lines[:, own.skeleton.index(side + bone), 2].max() < -0.999
    # The made-up person's legs are 0.82 m long, and 0.53 m of an arm make 0.78 m of them.
    legs = own.skeleton.length[[own.skeleton.index("lkne"), own.skeleton.index("lank")]]
    assert legs.sum() == pytest.approx(0.53 / 0.68, abs=0.01)


@pytest.mark.parametrize("unit", [0.01, 0.0254])
def test_it_stands_on_the_floor_and_is_learned_again_by_its_recipe(tmp_path, unit):
    path = written(tmp_path, bvh_text(MOTION, UPPER, unit=unit))
    made = invoked("learn", str(path), "--accept", "upper-body", "--out", str(tmp_path / "up.safetensors"))
    assert made.exit_code == 0
    assert "body: an upper body, to which legs that rest are added" in made.stdout
    recipe = read_recipe(tmp_path / "up.toml", tmp_path)
    assert recipe.motions[0].upper_body
    again = read_motion(tmp_path, recipe.motions[0])
    lowest = to_canonical(again).joints()[..., 2].min(axis=1)
    assert lowest == pytest.approx(0.04, abs=0.02)  # the joint of the toes above the sole


def test_other_files_are_read_as_before(tmp_path):
    path = written(tmp_path, bvh_text(MOTION))
    plain, asked = read_clip(path), read_clip(path, ReadingOptions(upper_body=True))
    assert np.array_equal(plain.joints(), asked.joints())
    assert plain.skeleton.bones == asked.skeleton.bones


def test_arms_with_names_that_are_not_understood_are_refused(tmp_path):
    path = written(tmp_path, bvh_text(MOTION, {**UPPER, "l hand": "j7"}))
    with pytest.raises(FileFormatError, match="an upper body needs both arms with names"):
        read_clip(path, ReadingOptions(upper_body=True))


def test_a_trunk_without_names_begins_in_the_first_joint(tmp_path):
    path = written(tmp_path, bvh_text(MOTION, {**UPPER, "hips": "j1", "spine": "j2", "chest": "j3"}))
    check_person(read_clip(path, ReadingOptions(upper_body=True)), MOTION, tolerance=1e-5, lacking=OF_LEGS)


@pytest.mark.parametrize("times", [0.1, 3.0])
def test_arms_without_a_joint_in_the_pelvis_are_refused(tmp_path, times):
    trunk = {key: by * (times if key in ("spine", "chest", "neck") else 1.0) for key, by in OFFSET.items()}
    motion = moving(20, offset=trunk)
    with pytest.raises(FileFormatError, match="needs a joint in its pelvis; 'Hips' is too near"):
        read_clip(written(tmp_path, bvh_text(motion, UPPER, offset=trunk)), ReadingOptions(upper_body=True))
