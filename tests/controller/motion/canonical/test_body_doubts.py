"""What looks wrong about a body is named with bone, reason and remedy; a sound one raises no doubt."""

import re
from dataclasses import replace

import numpy as np
import pytest

from controller.motion.canonical.body_doubts import anatomy_doubts, doubts, recorded_parts
from controller.motion.clip import Clip
from controller.motion.rotations import about, multiply
from controller.motion.skeleton import Skeleton
from simulated_bodies import human


def standing(skeleton, height=0.9):
    rotation = np.zeros((30, 1 + len(skeleton), 4))
    rotation[..., 0] = 1.0
    place = np.zeros((30, 3))
    place[:, 2] = height
    return Clip("stand", skeleton, 60.0, place, rotation)


def renamed(names):
    body = human()
    return replace(body, bones=tuple(names.get(bone, bone) for bone in body.bones))


def test_a_sound_body_raises_no_doubt():
    clip = standing(human())
    assert doubts(clip) == []
    assert recorded_parts(clip)["left thigh"] == "lkne"
    assert recorded_parts(clip)["chest"] == "neck"


def longer(bone, factor):
    body = human()
    length = body.length.copy()
    length[body.index(bone)] *= factor
    return replace(body, length=length)


@pytest.mark.parametrize(
    ("clip", "doubt"),
    [
        (standing(replace(human(), length=0.1 * human().length)), r"the left leg is 0\.\d\d m long: the unit .*--unit"),
        (standing(human(), height=1.5), r"the body floats 0\.\d\d m above the ground all the time: .*--up"),
        (standing(human(), height=0.0), r"the body is 0\.\d\d m below the ground: .*--up"),
        (standing(longer("lkne", 2.5)), r"bone 'lkne', taken for the left thigh, is .*--rename"),
        (standing(longer("relb", 1.5)), r"bones 'lelb' and 'relb', taken for upper arms, are .*--rename"),
        (standing(renamed({"lkne": "bone1", "rkne": "bone2"})), r"no names of legs were understood.*--rename"),
        (
            standing(renamed({"lkne": "LeftUpLeg", "rkne": "RightUpLeg", "lank": "LeftLeg", "rank": "RightLeg"})),
            r"no name of the left arm and the right arm was understood: .*--rename",
        ),
    ],
)
def test_each_doubt_names_bone_reason_and_remedy(clip, doubt):
    found = doubts(clip)
    assert any(re.search(doubt, line) for line in found), found


def test_a_body_on_its_head_and_one_with_sides_exchanged_are_doubted():
    upside_down = standing(human())
    flipped = upside_down.rotation * 0.0
    flipped[..., 1] = 1.0  # half a turn about x
    assert any("--up" in line for line in doubts(replace(upside_down, rotation=flipped)))
    sides = {bone: {"l": "r", "r": "l"}[bone[0]] + bone[1:] for bone in human().bones if bone[0] in "lr"}
    assert any("toes point backwards" in line for line in doubts(standing(renamed(sides))))


def test_who_lies_all_the_time_is_doubted_and_who_only_bends_is_not():
    lying, bent = standing(human()), standing(human())
    lying.rotation[:] = bent.rotation[:] = about(np.array([0.0, 1.0, 0.0]), 0.5 * np.pi)
    bent.rotation[:, [1 + human().index(leg) for leg in ("lkne", "lank", "rkne", "rank")]] = [1.0, 0.0, 0.0, 0.0]
    assert any(re.search(r"the body lies all the time: .*--up", line) for line in doubts(lying))
    assert not any("lies" in line for line in doubts(bent))


def test_who_walks_with_another_axis_up_is_doubted_though_his_legs_swing():
    side = about(np.array([1.0, 0.0, 0.0]), 0.5 * np.pi)
    upright, clip = striding(), striding()
    clip.rotation[:] = multiply(np.broadcast_to(side, clip.rotation.shape), clip.rotation)
    assert any("the body lies all the time" in line for line in doubts(clip))
    assert not any("lies" in line for line in doubts(upright))


def striding():
    """Somebody who takes long strides on the spot."""
    clip = standing(human(), height=0.85)
    for side, sign in (("l", 1.0), ("r", -1.0)):
        for frame, angle in enumerate(sign * 0.8 * np.sin(np.arange(len(clip)) / 3.0)):
            for bone in ("kne", "ank", "foo"):
                clip.rotation[frame, 1 + human().index(side + bone)] = about(np.array([0.0, 1.0, 0.0]), angle)
    return clip


def test_who_rolls_over_head_and_feet_does_not_lie():
    clip = standing(human())
    for frame, angle in enumerate(np.linspace(0.0, 2.0 * np.pi, len(clip))):
        clip.rotation[frame] = about(np.array([0.0, 1.0, 0.0]), angle)
    assert not any("lies" in line for line in doubts(clip))


def swaying(degrees):
    """Somebody with the arms out whose every joint turns to and fro by so many degrees."""
    clip = standing(human())
    wave = np.radians(degrees) * np.sin(np.arange(30) / 3.0)
    turn = np.stack([about(np.array([1.0, 0.0, 0.0]), angle) for angle in wave])
    rotation = clip.rotation.copy()
    for bone in range(len(clip.skeleton)):
        rotation[:, 1 + bone] = multiply(rotation[:, 1 + clip.skeleton.parent[bone]], turn)
    return replace(clip, rotation=rotation)


def test_joints_that_hardly_turn_may_be_of_a_file_in_radians():
    assert any("no joint turns by more than 1.0 degrees" in line for line in doubts(swaying(1.0)))
    assert not any("radians" in line for line in doubts(swaying(10.0)))
    assert not any("radians" in line for line in doubts(standing(human())))


def test_the_head_of_somebody_who_lies_may_be_lower_than_his_feet():
    clip = standing(human(), height=0.15)
    back = np.broadcast_to(about(np.array([0.0, 1.0, 0.0]), np.radians(-92.0)), clip.rotation.shape)
    found = doubts(replace(clip, rotation=back))
    assert len(found) == 1
    assert "the body lies all the time" in found[0]


def test_the_feet_of_somebody_who_crawls_may_point_behind_him():
    """The pelvis half faces the ground, the shanks lie behind, and the feet go on from them."""
    clip = standing(human(), height=0.1)
    half, shanks, feet = (about(np.array([0.0, 1.0, 0.0]), np.radians(angle)) for angle in (60.0, 90.0, 180.0))
    rotation = clip.rotation.copy()
    rotation[:] = half
    for side in "lr":
        rotation[:, 1 + clip.skeleton.index(side + "ank")] = shanks
        rotation[:, 1 + clip.skeleton.index(side + "foo")] = feet
    assert not any("toes" in line for line in doubts(replace(clip, rotation=rotation)))


ARM_NAMES = {"lsho": "LeftShoulder", "lelb": "LeftArm", "lwri": "LeftForeArm", "lhan": "LeftHand"}
LEG_NAMES = {"lkne": "LeftUpLeg", "lank": "LeftLeg", "rkne": "RightUpLeg", "rank": "RightLeg"}


def without(names, *ends):
    """The human with other names and without some bones."""
    body = human()
    kept = [bone for bone, name in enumerate(body.bones) if name not in ends]
    new = {bone: place for place, bone in enumerate(kept)} | {-1: -1}
    return Skeleton(
        "part",
        tuple(names.get(body.bones[bone], body.bones[bone]) for bone in kept),
        np.array([new[int(body.parent[bone])] for bone in kept]),
        body.rest_direction[kept],
        body.length[kept],
    )


def test_arms_that_are_named_never_become_legs():
    names = {bone: name for side in ("Left", "Right") for bone, name in sided(ARM_NAMES, side)} | {"neck": "Neck"}
    legs = [side + end for side in "lr" for end in ("hip", "kne", "ank", "foo")]
    (refusal,) = anatomy_doubts(standing(without(names, *legs)))
    assert "no left leg was found" in refusal


def sided(names, side):
    return [(side[0].lower() + bone[1:], name.replace("Left", side)) for bone, name in names.items()]


def test_a_neck_that_is_named_never_becomes_the_missing_arm():
    names = LEG_NAMES | dict(sided(ARM_NAMES, "Right")) | {"neck": "Spine", "head": "Neck"}
    found = anatomy_doubts(standing(without(names, "lsho", "lelb", "lwri", "lhan")))
    assert found == ["no left upper arm was found: the arm is assumed to hang (--rename OLD=LeftArm)."]
