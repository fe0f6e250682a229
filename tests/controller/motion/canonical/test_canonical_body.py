"""Carried to the canonical body every bone points as recorded, by an independent reading of the file."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.recordings.independent_readings import (
    ACCLAIM,
    BANDAI,
    ENDS,
    ICLONE,
    MAX,
    MOTIONBUILDER,
    amc_joints,
    bvh_joints,
    landmarks,
)
from bodies import random_body, random_clip, small_body
from controller.motion.canonical.canonical_body import (
    CANONICAL_BONES,
    carried,
    is_canonical,
    landmarks_of,
    leg,
    to_canonical,
)
from controller.motion.clip import ReadingOptions
from controller.motion.formats.acclaim.amc import skeleton_of as skeleton_of_recording
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import conjugate, multiply, normalise, rotate
from controller.motion.skeleton import Skeleton, thesis_skeleton
from motiondeck_base.errors import FileFormatError
from simulated_bodies import human, skeleton_of, smooth_poses

BVH_FILES = {
    "bvh/cgspeed-motionbuilder_cmu_12_01.bvh": MOTIONBUILDER,
    "bvh/cgspeed-3dsmax_cmu_131_01.bvh": MAX,
    "bvh/iclone_cmu_02_03.bvh": ICLONE,
}
EVERY = slice(None, None, 7)


def worst_degrees(clip, seen):
    """The largest angle between a carried bone and the line between recorded landmarks, over bones and frames."""
    worst = 0.0
    for bone, parent in zip(CANONICAL_BONES, clip.skeleton.parent, strict=True):
        start = "root" if parent < 0 else CANONICAL_BONES[parent]
        if bone not in seen or start not in seen:
            continue
        line = normalise((seen[bone] - seen[start])[:, [2, 0, 1]])
        index = clip.skeleton.index(bone)
        ours = rotate(clip.rotation[EVERY, 1 + index], clip.skeleton.rest_direction[index])
        worst = max(worst, float(np.degrees(np.arccos(np.clip((line * ours).sum(-1), -1.0, 1.0))).max()))
    return worst


def bvh_check(path, table):
    joints = bvh_joints(path.read_text(), EVERY)
    return read_clip(path), joints, landmarks(joints, table)


@pytest.mark.parametrize("file", BVH_FILES)
def test_bones_of_exporters_files_point_as_recorded(mocap_data, file):
    recorded, _, seen = bvh_check(mocap_data / file, BVH_FILES[file])
    assert worst_degrees(to_canonical(recorded), seen) < 1.0
    assert landmarks_of(recorded.skeleton).lacking == []


@pytest.mark.thorough
def test_bones_of_bandai_files_point_as_recorded_and_stay_on_their_path(mocap_data):
    files = sorted((mocap_data / "bvh" / "bandai").glob("*.bvh"))
    assert len(files) == 12
    for path in files:
        recorded, joints, seen = bvh_check(path, BANDAI)
        assert worst_degrees(to_canonical(recorded), seen) < 1.0, path.name
        assert landmarks_of(recorded.skeleton).lacking == [], path.name
        assert np.allclose(recorded.root_position[EVERY], 0.01 * joints["Hips"][:, [2, 0, 1]], atol=1e-9), path.name
        assert 0.8 < np.median(recorded.root_position[:, 2]) < 1.1, path.name


@pytest.mark.parametrize("file", ["cmu/02/02_03.amc", "cmu/86/86_01.amc", "cmu/35/35_01.amc", "hdm05"])
def test_bones_of_acclaim_files_point_as_recorded(mocap_data, file):
    path = mocap_data / file
    path = path if path.is_file() else sorted(path.rglob("*.[aA][mM][cC]"))[40]
    skeleton = skeleton_of_recording(path, mocap_data)
    seen = landmarks(amc_joints(skeleton.read_text("latin-1"), path.read_text("latin-1"), EVERY), ACCLAIM)
    assert worst_degrees(to_canonical(read_clip(path, ReadingOptions(skeleton))), seen) < 1.0


def moving(skeleton, frames=20):
    poses = smooth_poses(skeleton, np.random.default_rng(3), frames, reach=0.6)
    clip = random_clip(np.random.default_rng(3), skeleton, frames)
    return replace(clip, rotation=np.array([pose.rotation for pose in poses]))


NAMES = {
    "usual": ("LHipJoint", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"),
    "after joints": ("l_hipjoint", "l_hip", "l_knee", "l_ankle", "l_collar", "l_shoulder", "l_elbow", "l_wrist"),
}


def renamed(clip, style, seed):
    """The same movement of a body with other names whose limbs rest otherwise."""
    names = {}
    for end, left in zip(ENDS, NAMES[style], strict=True):
        names |= {"l" + end: left, "r" + end: left.replace("Left", "Right").replace("LHip", "RHip").replace("l_", "r_")}
    names |= {"back": "Spine", "neck": "Chest", "head": "Head"}
    turn = normalise(np.random.default_rng(seed).normal(size=(len(clip.skeleton), 4)))
    turn[[clip.skeleton.index(bone) for bone in ("lhip", "rhip")]] = [1.0, 0.0, 0.0, 0.0]
    rotation = clip.rotation.copy()
    rotation[:, 1:] = multiply(rotation[:, 1:], conjugate(turn))
    rest = rotate(turn, clip.skeleton.rest_direction)
    bones = tuple(names[bone] for bone in clip.skeleton.bones)
    return replace(clip, skeleton=replace(clip.skeleton, bones=bones, rest_direction=rest), rotation=rotation)


def test_the_same_body_under_other_names_and_rest_poses_is_carried_to_the_same_clip():
    clip = moving(human())
    one, two = (to_canonical(renamed(clip, style, seed)) for seed, style in enumerate(NAMES))
    assert np.allclose(one.joints(), two.joints(), atol=1e-9)
    assert is_canonical(two.skeleton)


def test_carried_to_a_given_body_limbs_point_as_recorded_and_the_path_grows_with_the_legs():
    clip = to_canonical(moving(human()))
    twice = replace(clip.skeleton, length=2.0 * clip.skeleton.length)
    other = carried(clip, twice)
    assert np.allclose(other.joints(), 2.0 * clip.joints())


def test_a_library_with_bones_of_its_own_gets_limbs_that_point_as_recorded(mocap_data):
    run = read_clip(mocap_data / "bvh" / "bandai" / "run_normal_001.bvh")
    skeleton = read_clip(mocap_data / "cmu" / "86" / "86_01.amc").skeleton
    clip, canonical = carried(run, skeleton), to_canonical(run)
    for own, bone in {"lfemur": "lkne", "ltibia": "lank", "rhumerus": "relb", "rradius": "rwri"}.items():
        ours = rotate(clip.rotation[:, 1 + skeleton.index(own)], skeleton.rest_direction[skeleton.index(own)])
        index = CANONICAL_BONES.index(bone)
        theirs = rotate(canonical.rotation[:, 1 + index], canonical.skeleton.rest_direction[index])
        assert np.degrees(np.arccos(np.clip((ours * theirs).sum(-1), -1.0, 1.0))).max() < 1.0


def test_a_body_twice_the_size_with_the_same_bones_moves_twice_as_far():
    one = random_clip(np.random.default_rng(0), small_body(), 6)
    other = carried(one, small_body(scale=2.0))
    assert np.allclose(other.joints(), 2.0 * one.joints())


def test_the_same_bones_with_another_rest_pose_point_as_recorded():
    """A motion carried between two files with the same joints used to have limbs off by up to 178 degrees."""
    one = random_clip(np.random.default_rng(0), small_body(), 6)
    rest = normalise(np.random.default_rng(1).normal(size=(9, 3)))
    skeleton = Skeleton("other", one.skeleton.bones, one.skeleton.parent, rest, one.skeleton.length)
    ours = carried(one, skeleton)
    ratio = skeleton.leg_length / one.skeleton.leg_length
    shift = (ratio - 1.0) * one.root_position[:, None]
    assert np.allclose(ours.joints() - shift, one.joints())


def test_a_body_without_legs_is_refused_with_the_remedy():
    clip = random_clip(np.random.default_rng(1), random_body(np.random.default_rng(1), 9), 3)
    with pytest.raises(FileFormatError, match=r"no (left|right) leg was found .* Name its joints with --rename"):
        to_canonical(clip)


def test_arms_that_hang_from_the_neck_point_as_recorded():
    """The shoulder then has no length."""
    body = human()
    length = body.length.copy()
    length[[body.index(bone) for bone in ("lsho", "rsho")]] = 0.0
    clip = renamed(moving(replace(body, length=length)), "usual", 0)
    own = to_canonical(clip)
    assert own.skeleton.length[own.skeleton.index("lsho")] == 0.0
    bones = [clip.skeleton.index(bone) for bone in ("LeftArm", "RightForeArm")]
    theirs = rotate(clip.rotation[:, 1:][:, bones], clip.skeleton.rest_direction[bones])
    ours = [own.skeleton.index(bone) for bone in ("lelb", "rwri")]
    assert np.allclose(rotate(own.rotation[:, 1:][:, ours], own.skeleton.rest_direction[ours]), theirs, atol=1e-9)


ARM, LEG = (("sho", 0.15), ("elb", 0.3), ("wri", 0.25), ("han", 0.08)), (("kne", 0.43), ("ank", 0.4), ("foo", 0.15))
ARM_NAMES, LEG_NAMES = ("Shoulder", "Arm", "ForeArm", "Hand"), ("UpLeg", "Leg", "Foot")
SIDES = (("Left", 1.0), ("Right", -1.0))
HIP_NAMES = ("LeftHipJoint", "RightHipJoint", "Spine0", "Spine1")


def person(draw, spine, pelvis=1):
    """A body of any proportions with its root above the hips; `pelvis` bones of its trunk move with the root."""
    bones = []

    def add(name, parent, direction, length):
        bones.append((name, parent, direction, length * draw.uniform(0.7, 1.3)))
        return len(bones) - 1

    for side, sign in SIDES:
        at = add(side + "HipJoint", -1, (draw.uniform(-0.3, 0.3), sign, draw.uniform(-1.2, -0.2)), 0.12)
        for name, (_, length) in zip(LEG_NAMES, LEG, strict=True):
            at = add(side + name, at, (1, 0, 0) if name == "Foot" else (0, 0, -1), length)
    at = -1
    for number in range(pelvis + spine):
        at = add(f"Spine{number}", at, (0, 0, 1), 0.45 / (pelvis + spine))
    for side, sign in SIDES:
        arm = at
        for name, (_, length) in zip(ARM_NAMES, ARM, strict=True):
            arm = add(side + name, arm, (0, sign, 0), length)
    add("Head", at, (0, 0, 1), 0.2)
    return skeleton_of(bones), [bone for bone, one in enumerate(bones) if one[0] in HIP_NAMES[: 2 + pelvis]]


LANDMARKS = {
    **{side[0].lower() + end: side + name for side, _ in SIDES for (end, _), name in zip(LEG, LEG_NAMES, strict=True)},
    **{side[0].lower() + end: side + name for side, _ in SIDES for (end, _), name in zip(ARM, ARM_NAMES, strict=True)},
    "lhip": "LeftHipJoint",
    "rhip": "RightHipJoint",
}


def moved(skeleton, rigid, draw, frames=40, bend=0.7):
    clip = random_clip(draw, skeleton, frames)
    poses = smooth_poses(skeleton, draw, frames, reach=bend)
    rotation = np.array([pose.rotation for pose in poses])
    rotation[:, 1 + np.array(rigid)] = rotation[:, :1]
    return replace(clip, rotation=rotation)


def off(clip, own, scale=1.0):
    """How far landmarks are from where they were, seen from the middle between the hips, (T, landmarks), m."""
    seen = []
    for body, names in ((clip, LANDMARKS.values()), (own, LANDMARKS)):
        joints = body.joints()[:, [1 + body.skeleton.index(name) for name in names]]
        seen.append(joints - joints[:, [-1, -2]].mean(axis=1, keepdims=True))
    return np.linalg.norm(seen[0] * scale - seen[1], axis=-1)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(0, 2))
def test_on_its_own_canonical_body_a_person_of_two_spine_bones_keeps_every_joint(seed, pelvis):
    """Also the hands of those that bend: no bone spans a joint that moves."""
    draw = np.random.default_rng(seed)
    clip = moved(*person(draw, 2, pelvis), draw)
    own = to_canonical(clip)
    assert is_canonical(own.skeleton)
    assert off(clip, own).max() < 1e-6
    assert np.allclose(carried(clip, own.skeleton).joints(), own.joints(), atol=1e-6)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_takes_of_one_actor_are_carried_to_one_body_whatever_they_do(seed):
    draw = np.random.default_rng(seed)
    skeleton, rigid = person(draw, 2)
    still, bent = moved(skeleton, rigid, draw, bend=0.1), moved(skeleton, rigid, draw, bend=0.9)
    assert np.allclose(to_canonical(still).skeleton.length, to_canonical(bent).skeleton.length, atol=1e-6)
    assert off(bent, carried(bent, to_canonical(still).skeleton)).max() < 1e-6


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_a_body_whose_root_lies_between_the_hips_is_carried_to_as_well(seed):
    """The canonical body of older libraries: hips sideways, a body of Jaeger's patterns."""
    draw = np.random.default_rng(seed)
    clip, older = moved(*person(draw, 2), draw), human()
    own, other = to_canonical(clip), carried(clip, older)
    assert other.skeleton is older
    for bone in ("lkne", "rank", "lfoo", "lelb", "rwri", "neck", "head"):
        index = CANONICAL_BONES.index(bone)
        lines = [rotate(body.rotation[:, 1 + index], body.skeleton.rest_direction[index]) for body in (own, other)]
        assert np.allclose(*lines, atol=1e-9), bone
    joints = [body.joints() for body in (own, other)]
    across = [normalise(seen[:, 1 + CANONICAL_BONES.index("lhip")] - seen[:, 1]) for seen in joints]
    assert np.allclose(*across, atol=1e-9)
    assert np.allclose(joints[1][:, 0], joints[1][:, [1, 1 + CANONICAL_BONES.index("lhip")]].mean(axis=1), atol=1e-9)
    middle = [seen[:, [1, 1 + CANONICAL_BONES.index("lhip")]].mean(axis=1) for seen in joints]
    assert np.allclose(middle[1][:, :2], middle[0][:, :2] * leg(older) / leg(own.skeleton), atol=1e-9)
    waist = [
        normalise(seen[:, 1 + CANONICAL_BONES.index("back")] - at) for seen, at in zip(joints, middle, strict=True)
    ]
    assert np.allclose(*waist, atol=1e-9)
    legs = [at for at, name in enumerate(LANDMARKS) if name[1:] in ("hip", "kne", "ank", "foo")]
    assert off(clip, carried(other, own.skeleton))[:, legs].max() < 1e-6


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_back_from_the_body_of_another_person_every_joint_is_where_it_was(seed):
    """Whatever the rotation of the root is there: a library has directions of bones, and the root follows a rule."""
    draw = np.random.default_rng(seed)
    hips = [CANONICAL_BONES.index(hip) for hip in ("rhip", "lhip")]
    bodies: list[Skeleton] = []
    for _ in range(2):
        body = thesis_skeleton(draw.uniform(0.1, 0.4, 19), "someone")
        ahead, up = draw.uniform(-0.4, 0.4), draw.uniform(-1.2, -0.2)
        rests, length = body.rest_direction.copy(), body.length.copy()
        rests[hips], length[hips] = normalise(np.array([[ahead, -1.0, up], [ahead, 1.0, up]])), length[hips[0]]
        bodies.append(replace(body, rest_direction=rests, length=length))
    own = moved(bodies[0], hips, draw)
    there = carried(own, bodies[1])
    rotation = there.rotation.copy()
    rotation[:, 0] = random_clip(draw, there.skeleton, len(there)).rotation[:, 0]
    back = carried(replace(there, rotation=rotation), own.skeleton)
    at = 1 + np.array(hips)
    seen = [body.joints() - body.joints()[:, at].mean(axis=1, keepdims=True) for body in (own, back)]
    assert np.abs(seen[0] - seen[1]).max() < 1e-6


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_feet_stand_as_high_on_a_body_with_other_legs(seed):
    """Also on bent legs, which reach less far down where the thigh is longer and the shank shorter."""
    draw = np.random.default_rng(seed)
    clip = to_canonical(moved(*person(draw, 2), draw, bend=0.4))
    length = clip.skeleton.length.copy()
    for bone, factor in (("kne", 1.15), ("ank", 0.85), ("foo", 1.2)):
        length[[CANONICAL_BONES.index(side + bone) for side in "lr"]] *= factor
    other = carried(clip, replace(clip.skeleton, length=length))
    lowest, now = (body.joints()[..., 2].min(axis=1) for body in (clip, other))
    assert np.abs(now - lowest * leg(other.skeleton) / leg(clip.skeleton)).max() < 0.03


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_hands_that_carry_the_body_stay_as_high_on_other_arms(seed):
    """In any pose, head over heels too, and with the root between the hips as in Jaeger's patterns."""
    draw = np.random.default_rng(seed)
    clip = random_clip(draw, thesis_skeleton(draw.uniform(0.1, 0.5, 19)), 50)
    length = clip.skeleton.length.copy()
    length[[CANONICAL_BONES.index(side + bone) for side in "lr" for bone in ("elb", "wri")]] *= draw.uniform(0.7, 1.4)
    other = carried(clip, replace(clip.skeleton, length=length))
    lowest, now = (body.joints()[:, 1:, 2].min(axis=1) for body in (clip, other))
    assert np.abs(now - lowest).max() < 0.06


def test_hands_of_a_squat_are_where_they_were_on_the_body_of_a_jog(mocap_data):
    """By an independent reading; on a body with lines from the hips to the waist they are 60 mm off."""
    folder = mocap_data / "hdm05"
    names = ("jogLeftCircle4StepsRstart/HDM_tr_jogLeftCircle4StepsRstart_014_120.amc",)
    jog, squat = (folder / name for name in (*names, "squat1Reps/HDM_tr_squat1Reps_041_120.amc"))
    skeleton = skeleton_of_recording(jog, mocap_data)
    body = to_canonical(read_clip(jog, ReadingOptions(skeleton))).skeleton
    ours = carried(read_clip(squat, ReadingOptions(skeleton)), body).joints()[EVERY]
    seen = landmarks(amc_joints(skeleton.read_text("latin-1"), squat.read_text("latin-1"), EVERY), ACCLAIM)
    for hand in ("lwri", "rwri"):
        away = np.linalg.norm(ours[:, 1 + CANONICAL_BONES.index(hand)] - seen[hand][:, [2, 0, 1]], axis=-1)
        assert 1000.0 * np.percentile(away, 95) < 10.0
