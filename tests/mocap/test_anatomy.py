from hypothesis import given

from controller.mocap.anatomy import anatomy
from simulated_bodies import HUMAN, human, skeleton_of, skeletons


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


@given(skeletons())
def test_any_skeleton_gets_a_part_and_a_side_for_every_bone(skeleton):
    parts = anatomy(skeleton)
    assert len(parts.part) == len(parts.side) == len(skeleton)
    assert all(parts.part[bone] == part for part in set(parts.part) for bone in parts.all(part))
