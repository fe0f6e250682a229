"""The usual vocabularies name every limb of a body, and sides in every usual spelling."""

import pytest

from controller.mocap.bone_names import named_parts

LEG_AND_ARM = ("thigh", "shank", "foot", "upper arm", "forearm", "hand")


@pytest.mark.parametrize(
    "names",
    [
        "LeftUpLeg LeftLeg LeftFoot LeftArm LeftForeArm LeftHand",  # LAFAN1, MotionBuilder
        "mixamorig:LeftUpLeg mixamorig:LeftLeg mixamorig:LeftFoot mixamorig1:LeftArm mixamorig:LeftForeArm "
        "mixamorig:LeftHand",
        "lfemur ltibia lfoot lhumerus lradius lhand",  # CMU, HDM05
        "UpperLeg_L LowerLeg_L Foot_L UpperArm_L LowerArm_L Hand_L",  # Bandai-Namco
        "left_hip left_knee left_ankle left_shoulder left_elbow left_wrist",  # SMPL
        "J_Bip_L_UpperLeg J_Bip_L_LowerLeg J_Bip_L_Foot J_Bip_L_UpperArm J_Bip_L_LowerArm J_Bip_L_Hand",  # VRM
        "leftUpperLeg leftLowerLeg leftFoot leftUpperArm leftLowerArm leftHand",
        "LeftThigh LeftShin LeftFoot LeftArm LeftForeArm LeftHand",  # Rokoko
        "LeftUpperLeg LeftLowerLeg LeftFoot LeftUpperArm LeftForeArm LeftHand",  # Xsens
        "LeftHip LeftKnee LeftAnkle LeftShoulder LeftElbow LeftWrist",
        "thigh_l calf_l foot_l upperarm_l lowerarm_l hand_l",  # Unreal
        "thigh.L shin.L foot.L upper_arm.L forearm.L hand.L",  # Blender
        "DEF-thigh.L DEF-shin.L DEF-foot.L DEF-upper_arm.L DEF-forearm.L DEF-hand.L",
        "CC_Base_L_Thigh CC_Base_L_Calf CC_Base_L_Foot CC_Base_L_Upperarm CC_Base_L_Forearm CC_Base_L_Hand",
        "Character1_LeftUpLeg Character1_LeftLeg Character1_LeftFoot Character1_LeftArm Character1_LeftForeArm "
        "Character1_LeftHand",
        "lThigh lShin lFoot lShldr lForeArm lHand",  # Poser
        "LHip LKnee LAnkle LShoulder LElbow LWrist",  # OpenPose
        "lkne lank lfoo lelb lwri lhan back neck head lhip rhip rkne rank rfoo lsho rsho relb rwri rhan",  # the thesis
    ],
)
def test_limbs_of_each_vocabulary(names):
    left = names.split()
    for side, bones in (("left", left), ("right", [mirrored(name) for name in left])):
        found = named_parts(bones)[: len(LEG_AND_ARM)]
        assert [part and tuple(part) for part in found] == [(part, side) for part in LEG_AND_ARM], bones


def mirrored(name):
    pairs = (("Left", "Right"), ("left", "right"), ("_L_", "_R_"), ("_L", "_R"), ("_l", "_r"), (".L", ".R"))
    for one, other in pairs:
        if one in name:
            return name.replace(one, other)
    swap = {"l": "r", "L": "R", "r": "l"}
    return name if name in ("back", "neck", "head") else swap[name[0]] + name[1:]


def test_biped_names_with_blanks():
    parts = named_parts(["Bip01 Pelvis", "Bip01 L Thigh", "Bip01 R Calf", "Bip01 Spine1", "Bip01 L Finger0"])
    assert [part and tuple(part) for part in parts] == [
        ("pelvis", "middle"),
        ("thigh", "left"),
        ("shank", "right"),
        ("trunk", "middle"),
        None,
    ]


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
