"""The usual vocabularies name every bone of a body, and sides in every usual spelling."""

import re

import pytest

from controller.motion.bone_names import named_parts
from vocabularies import CONVENTIONS

SIDED = ("hip", "thigh", "shank", "foot", "toes", "clavicle", "upper arm", "forearm", "hand")


def mirrored(name):
    """The same bone of the right side."""
    pairs = (("Left", "Right"), ("left", "right"), ("LEFT", "RIGHT"), ("Links", "Rechts"), ("Linker", "Rechter"))
    for left, right in (
        *pairs,
        ("Izq", "Der"),
        ("gauche", "droite"),
        ("左", "右"),
        ("Левое", "Правое"),
        ("왼쪽", "오른쪽"),
        ("lft", "rgt"),
    ):
        if left in name:
            return name.replace(left, right)
    swap = {"l": "r", "L": "R"}
    other = re.sub(r"(^|[_.: ])([lL])(?=[_. ]|$)", lambda found: found[1] + swap[found[2]], name, count=1)
    return other if other != name else swap[name[0]] + name[1:]


def check(convention, spelled=str, extra=()):
    """Every name must be its part, though extra names that are none stand beside them."""
    names, expected = list(extra), [None] * len(extra)
    for part, words in convention.items():
        for word in words.split():
            if part in SIDED:
                names += [spelled(word), spelled(mirrored(word))]
                expected += [(part, "left"), (part, "right")]
            else:
                names.append(spelled(word))
                expected.append(None if part == "other" else (part, "middle"))
    found = [part and tuple(part) for part in named_parts(names)]
    wrong = [(n, e, f) for n, e, f in zip(names, expected, found, strict=True) if e != f]
    assert wrong == []


@pytest.mark.parametrize("name", CONVENTIONS)
def test_every_bone_of_a_vocabulary(name):
    check(CONVENTIONS[name])


@pytest.mark.parametrize(
    "spelled",
    [
        lambda name: f"Ben:{name}",
        lambda name: f"Armature|{name}",
        lambda name: f"Robot_{name}",
        lambda name: f"hero_rig.{name}",
        lambda name: f"{name}_jnt",
    ],
)
@pytest.mark.parametrize("name", ["Bandai-Namco", "Unreal", "SMPL", "Mixamo, of Blender", "Biped", "VRM"])
def test_words_that_all_names_share_say_nothing(name, spelled):
    check(CONVENTIONS[name], spelled)


def test_of_a_path_the_last_name_counts_though_each_bone_has_another():
    """As Maya's long names and USD's joints: what a bone hangs from stands before it."""
    names = ["Hips", "hero|Hips|LeftUpLeg", "Hips/Spine/LeftArm", "a:Hips|a:Spine|a:Head", "b:RightUpLeg", "LeftLeg"]
    parts = [part and part.part for part in named_parts(names)]
    assert parts == ["pelvis", "thigh", "upper arm", "head", "thigh", "shank"]


@pytest.mark.parametrize("spelled", [lambda name: f"{name}_jnt_bind", lambda name: f"Q_{name}"])
@pytest.mark.parametrize("name", ["Bandai-Namco", "Unreal", "SMPL", "LAFAN1"])
def test_words_of_all_parts_say_nothing_beside_hair_and_skirt(name, spelled):
    extra = [f"{what}_{chain}_{joint}" for what in ("hair", "skirt") for chain in range(8) for joint in range(6)]
    check(CONVENTIONS[name], spelled, extra)


def test_of_parts_that_are_there_twice_those_without_a_further_word_count():
    limbs = "UpLeg Leg Foot Arm ForeArm Hand"
    names = ["Hips", "Spine", "Neck", "Head", *(side + limb for side in ("Left", "Right") for limb in limbs.split())]
    found = named_parts([*names, *(f"{name}_ctrl" for name in names)])
    assert found == named_parts(names) + [None] * len(names)


@pytest.mark.parametrize("name", ["Bandai-Namco", "Unreal", "SMPL", "Biped"])
def test_capitals_do_not_matter(name):
    check(CONVENTIONS[name], str.upper)


def test_biped_names_with_blanks():
    parts = named_parts(["Bip01 Pelvis", "Bip01 L Thigh", "Bip01 R Calf", "Bip01 Spine1", "Bip01 L Finger0"])
    assert [part and tuple(part) for part in parts] == [
        ("pelvis", "middle"),
        ("thigh", "left"),
        ("shank", "right"),
        ("trunk", "middle"),
        None,
    ]


def test_the_bones_of_the_thesis():
    names = [
        "lkne",
        "lank",
        "lfoo",
        "lelb",
        "lwri",
        "lhan",
        "back",
        "neck",
        "head",
        "lhip",
        "rhip",
        "rkne",
        "rank",
        "rfoo",
        "lsho",
        "rsho",
        "relb",
        "rwri",
        "rhan",
    ]
    found = named_parts(names)
    assert found[:3] == [("thigh", "left"), ("shank", "left"), ("foot", "left")]
    assert found[3:7] == [("upper arm", "left"), ("forearm", "left"), ("hand", "left"), ("trunk", "middle")]


def test_a_shoulder_is_a_collar_bone_unless_joints_are_named():
    assert named_parts(["LeftShoulder", "LeftArm"])[0] == ("clavicle", "left")
    assert named_parts(["LeftShoulder", "LeftElbow"])[0] == ("upper arm", "left")


def test_a_bone_between_two_joints_belongs_to_where_it_leads():
    names = ["Hips-LeftUpLeg", "Hips-Spine", "Chest-Shoulder_L", "Thigh_L-ThighTwist_L", "Thigh_L-Calf_L"]
    found = [part and tuple(part) for part in named_parts(names)]
    assert found == [("hip", "left"), ("pelvis", "middle"), ("clavicle", "left"), None, ("thigh", "left")]


@pytest.mark.parametrize(
    "name", ["", "-", "bone7", "L", "left", "Camera", "mixamorig:", "jaw", "LThumb", "tail_l", "7"]
)
def test_other_names_mean_no_part(name):
    assert named_parts([name]) == [None]
