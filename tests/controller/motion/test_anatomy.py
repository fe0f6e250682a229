from hypothesis import given

from controller.motion.anatomy import anatomy
from simulated_bodies import AHEAD, DOWN, HUMAN, human, skeleton_of, skeletons


def test_a_human_is_told_by_its_shape():
    body = human()
    parts = anatomy(body)
    told = {name: (parts.part[bone], parts.side[bone]) for bone, name in enumerate(body.bones)}
    assert told["rhip"] == ("hip", "right")
    assert told["lkne"] == ("thigh", "left")
    assert told["rank"] == ("shank", "right")
    assert told["lfoo"] == ("foot", "left")
    assert told["back"] == told["neck"] == ("trunk", "middle")
    assert told["head"] == ("head", "middle")
    assert told["rsho"] == ("clavicle", "right")
    assert told["lelb"] == ("upper arm", "left")
    assert told["rwri"] == ("forearm", "right")
    assert told["lhan"] == ("hand", "left")


def test_fingers_and_toes_belong_to_hand_and_foot():
    more = (*HUMAN, ("rtoe", 3, (1, 0, 0), 0.05), ("rfinger", 14, (0, -1, 0), 0.05), ("rthumb", 13, (1, -1, 0), 0.05))
    body = skeleton_of(more)
    parts = anatomy(body)
    assert [parts.part[body.index(bone)] for bone in ("rtoe", "rfinger", "rthumb")] == ["foot", "hand", "hand"]
    assert parts.part[body.index("rkne")] == "thigh"
    assert parts.part[body.index("relb")] == "upper arm"


def test_bones_of_the_upper_neck_are_neck():
    bones = [*HUMAN[:10], ("nape", 9, (0, 0, 1), 0.1), ("head", 10, (0, 0, 1), 0.2)]
    bones += [(name, 9 if parent == 9 else parent + 1, way, length) for name, parent, way, length in HUMAN[11:]]
    body = skeleton_of(bones)
    assert anatomy(body).part[body.index("nape")] == "neck"


def test_a_spine_without_names_leads_to_the_arms_and_on_to_the_head():
    limbs = {"kne": "UpLeg", "ank": "Leg", "foo": "Foot", "sho": "Shoulder", "elb": "Arm", "wri": "ForeArm"}
    names = {side + end: f"{side.upper()}_{limb}" for side in "lr" for end, limb in limbs.items()}
    names |= {"back": "bone1", "neck": "bone2", "head": "bone3"}
    bones = [(names.get(name, name), *rest) for name, *rest in HUMAN]
    tail = ("tail", -1, DOWN, 0.9)
    parts = anatomy(skeleton_of([*bones, tail]))
    found = dict(zip((name for name, *_ in [*bones, tail]), parts.part, strict=True))
    assert [found[name] for name in ("bone1", "bone2", "bone3", "tail")] == ["trunk", "trunk", "head", "other"]


@given(skeletons())
def test_any_skeleton_gets_a_part_and_a_side_for_every_bone(skeleton):
    parts = anatomy(skeleton)
    assert len(parts.part) == len(parts.side) == len(skeleton)
    assert all(parts.part[bone] == part for part in set(parts.part) for bone in parts.all(part))


def test_a_collar_bone_longer_than_the_upper_arm_is_none():
    """As in the skeleton of one of HDM05's actors, and on one side only."""
    lengths = {"lsho": 0.262, "lelb": 0.259, "lwri": 0.194, "lhan": 0.2}
    body = skeleton_of([(name, parent, way, lengths.get(name, length)) for name, parent, way, length in HUMAN])
    parts = anatomy(body)
    assert [parts.part[body.index(name)] for name in lengths] == ["clavicle", "upper arm", "forearm", "hand"]


def test_forearms_as_long_as_upper_arms_are_none():
    lengths = {"rsho": 0.13, "relb": 0.252, "rwri": 0.257, "rhan": 0.18}
    body = skeleton_of([(name, parent, way, lengths.get(name, length)) for name, parent, way, length in HUMAN])
    parts = anatomy(body)
    assert [parts.part[body.index(name)] for name in lengths] == ["clavicle", "upper arm", "forearm", "hand"]


def test_twist_bones_and_breasts_are_no_limbs_and_fingers_are_hands():
    more = (
        ("ltwist", 4, DOWN, 0.24),  # beside the thigh
        ("breast", 8, (1, 0.4, 0), 0.16),
        ("rthumb", 13, AHEAD, 0.04),
    )
    body = skeleton_of([*HUMAN, *more])
    parts = anatomy(body)
    assert [parts.part[body.index(name)] for name in ("ltwist", "breast", "rthumb")] == ["other", "other", "hand"]
    plain = anatomy(human())
    assert parts.part[: len(HUMAN)] == plain.part
