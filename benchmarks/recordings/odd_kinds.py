"""Odd but plausible files: how other programs write a recording, each with where its limbs then are.

A kind is a function from a recorded body (`odd_bodies`) to a `Written`; `KINDS` has them by name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.recordings.odd_bodies import (
    Body,
    Style,
    at_rate,
    below,
    bvh,
    moved,
    renamed,
    rezeroed,
    scaled,
    with_joint,
    world_turned,
)

UPRIGHT = Rotation.from_euler("x", 90, degrees=True)  # y up becomes z up


@dataclass(frozen=True)
class Written:
    """A file and the truth about it.

    Attributes:
        content: of the file.
        body: what it holds; its landmarks are in our axes.
        frames: in which the reading must agree; the others were spoilt.
        suffix: of the file.
        well_placed: whether the file has the body where it was recorded.
    """

    content: bytes
    body: Body
    frames: slice = field(default_factory=lambda: slice(None))
    suffix: str = ".bvh"
    well_placed: bool = True


Kind = Callable[[Body], Written]


def names(sides: str, middle: str, limbs: str) -> dict[str, str]:
    """A vocabulary: hips, three of the back, two of the neck, the head; then of either side from the hip outwards."""
    keys = ["root", "lowerback", "upperback", "thorax", "lowerneck", "upperneck", "head"]
    ends = ["hipjoint", "femur", "tibia", "foot", "toes", "clavicle", "humerus", "radius", "wrist"]
    return (
        {"sides": sides}
        | {key: name.replace("~", " ") for key, name in zip(keys, middle.split(), strict=True)}
        | {key: name.replace("~", " ") for key, name in zip(ends, limbs.split(), strict=True)}
    )


HAHNE = names(
    "Left Right",
    "Hips LowerBack Spine Spine1 Neck Neck1 Head",
    "{}HipJoint {}UpLeg {}Leg {}Foot {}ToeBase {}Shoulder {}Arm {}ForeArm {}Hand",
)
VOCABULARIES = {
    "Mixamo": names(
        "Left Right",
        "mixamorig:Hips mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2 mixamorig:Neck mixamorig:Neck1 "
        "mixamorig:Head",
        "mixamorig:{}HipJoint mixamorig:{}UpLeg mixamorig:{}Leg mixamorig:{}Foot mixamorig:{}ToeBase "
        "mixamorig:{}Shoulder mixamorig:{}Arm mixamorig:{}ForeArm mixamorig:{}Hand",
    ),
    "SMPL": names(
        "L R",
        "Pelvis Spine1 Spine2 Spine3 Neck Neck1 Head",
        "{}_Pelvis {}_Hip {}_Knee {}_Ankle {}_Foot {}_Collar {}_Shoulder {}_Elbow {}_Wrist",
    ),
    "OptiTrack": names(
        "L R",
        "Skeleton1:Hip Skeleton1:Ab Skeleton1:Spine Skeleton1:Chest Skeleton1:Neck Skeleton1:Neck2 Skeleton1:Head",
        "Skeleton1:{}Hip Skeleton1:{}Thigh Skeleton1:{}Shin Skeleton1:{}Foot Skeleton1:{}Toe Skeleton1:{}Shoulder "
        "Skeleton1:{}UArm Skeleton1:{}FArm Skeleton1:{}Hand",
    ),
    "Xsens": names(
        "Left Right",
        "Hips Chest Chest2 Chest3 Neck Neck2 Head",
        "{}HipJoint {}Hip {}Knee {}Ankle {}Toe {}Collar {}Shoulder {}Elbow {}Wrist",
    ),
    "Rokoko": names(
        "Left Right",
        "Hips Spine1 Spine2 Spine3 Neck Neck1 Head",
        "{}HipJoint {}Thigh {}Shin {}Foot {}Toe {}Shoulder {}Arm {}ForeArm {}Hand",
    ),
    "DAZ": names(
        "l r",
        "hip abdomen abdomen2 chest neck neck2 head",
        "{}Pelvis {}Thigh {}Shin {}Foot {}Toe {}Collar {}Shldr {}ForeArm {}Hand",
    ),
    "DAZ Genesis 8": names(
        "l r",
        "hip abdomenLower abdomenUpper chestLower neckLower neckUpper head",
        "{}Pelvis {}ThighBend {}Shin {}Foot {}Metatarsals {}Collar {}ShldrBend {}ForearmBend {}Hand",
    ),
    "3ds Max Biped": names(
        "L R",
        "Bip01 Bip01~Spine Bip01~Spine1 Bip01~Spine2 Bip01~Neck Bip01~Neck1 Bip01~Head",
        "Bip01~{}~HipJoint Bip01~{}~Thigh Bip01~{}~Calf Bip01~{}~Foot Bip01~{}~Toe0 Bip01~{}~Clavicle "
        "Bip01~{}~UpperArm Bip01~{}~Forearm Bip01~{}~Hand",
    ),
    "Unreal": names(
        "l r",
        "pelvis spine_01 spine_02 spine_03 neck_01 neck_02 head",
        "hipjoint_{} thigh_{} calf_{} foot_{} ball_{} clavicle_{} upperarm_{} lowerarm_{} hand_{}",
    ),
    "Blender's Rigify": names(
        "L R",
        "spine spine.001 spine.002 spine.003 spine.004 spine.005 spine.006",
        "pelvis.{} thigh.{} shin.{} foot.{} toe.{} shoulder.{} upper_arm.{} forearm.{} hand.{}",
    ),
    "Advanced Skeleton": names(
        "L R",
        "Root_M Spine1_M Spine2_M Chest_M Neck_M Neck1_M Head_M",
        "HipJoint_{} Hip_{} Knee_{} Ankle_{} Toes_{} Scapula_{} Shoulder_{} Elbow_{} Wrist_{}",
    ),
    "DeepMotion": names(
        "l r",
        "hips_JNT spine_JNT spine1_JNT spine2_JNT neck_JNT neck1_JNT head_JNT",
        "{}_hipjoint_JNT {}_upleg_JNT {}_leg_JNT {}_foot_JNT {}_toebase_JNT {}_shoulder_JNT {}_arm_JNT "
        "{}_forearm_JNT {}_hand_JNT",
    ),
    "Qualisys": names(
        "Left Right",
        "Q_Hips Q_Spine Q_Spine1 Q_Spine2 Q_Neck Q_Neck1 Q_Head",
        "Q_{}HipJoint Q_{}UpLeg Q_{}Leg Q_{}Foot Q_{}ToeBase Q_{}Shoulder Q_{}Arm Q_{}ForeArm Q_{}Hand",
    ),
    "German": names(
        "links rechts",
        "Hüfte Wirbelsäule Wirbelsäule1 Brust Hals Hals1 Kopf",
        "hüftgelenk_{} Oberschenkel_{} Unterschenkel_{} Fuß_{} Zehen_{} Schlüsselbein_{} Oberarm_{} Unterarm_{} "
        "Hand_{}",
    ),
    "Japanese": names(
        "左 右",
        "センター 上半身 上半身1 上半身2 首 首1 頭",
        "{}腰 {}足 {}ひざ {}足首 {}つま先 {}肩 {}腕 {}ひじ {}手首",
    ),
    "iPi": names(
        "L R",
        "Hip LowerSpine MiddleSpine Chest Neck Neck1 Head",
        "{}Pelvis {}Thigh {}Shin {}Foot {}Toe {}Clavicle {}Shoulder {}Forearm {}Hand",
    ),
    "Kinect": names(
        "LEFT RIGHT",
        "HIP_CENTER SPINE SPINE_MID SHOULDER_CENTER NECK NECK_2 HEAD",
        "PELVIS_{} HIP_{} KNEE_{} ANKLE_{} FOOT_{} CLAVICLE_{} SHOULDER_{} ELBOW_{} WRIST_{}",
    ),
    "mocopi": names(
        "l r",
        "root torso_1 torso_3 torso_6 neck_1 neck_2 head",
        "{}_hip {}_up_leg {}_low_leg {}_foot {}_toes {}_shoulder {}_up_arm {}_low_arm {}_hand",
    ),
    "Cascadeur": names(
        "l r",
        "pelvis stomach stomach_2 chest neck neck_2 head",
        "hip_{} thigh_{} calf_{} foot_{} toe_{} clavicle_{} arm_{} forearm_{} hand_{}",
    ),
    "Second Life": names(
        "Left Right",
        "mPelvis mTorso mSpine3 mChest mNeck mNeck2 mHead",
        "mHindLimbsRoot{} mHip{} mKnee{} mAnkle{} mFoot{} mCollar{} mShoulder{} mElbow{} mWrist{}",
    ),
    "MakeHuman": names(
        "L R",
        "root spine05 spine03 spine01 neck01 neck02 head",
        "pelvis.{} upperleg01.{} lowerleg01.{} foot.{} toe1-1.{} clavicle.{} upperarm01.{} lowerarm01.{} wrist.{}",
    ),
    "Theia": names(
        "l r",
        "pelvis abdomen lower_torso torso neck upper_neck head",
        "{}_hip {}_thigh {}_shank {}_foot {}_toes {}_clavicle {}_uarm {}_larm {}_hand",
    ),
    "CMU for DAZ by cgspeed": names(
        "l r",
        "hip abdomen abdomen2 chest neck neck2 head",
        "{}Buttock {}Thigh {}Shin {}Foot {}Toe {}Collar {}Shldr {}ForeArm {}Hand",
    ),
    "Talking with hands": names(
        "l r",
        "b_root b_spine0 b_spine1 b_spine2 b_neck0 b_neck1 b_head",
        "b_{}_hip b_{}_upleg b_{}_leg b_{}_foot b_{}_toe b_{}_shoulder b_{}_arm b_{}_forearm b_{}_wrist",
    ),
    "Roblox": names(
        "Left Right",
        "LowerTorso MiddleTorso MiddleTorso2 UpperTorso Neck Neck2 Head",
        "{}Hip {}UpperLeg {}LowerLeg {}Foot {}Toes {}Clavicle {}UpperArm {}LowerArm {}Hand",
    ),
    "video to BVH": names(
        "Left Right",
        "Hip Spine Spine2 Thorax Neck Neck2 HeadTop",
        "{}Pelvis {}Hip {}Knee {}Ankle {}Toe {}Collar {}Shoulder {}Elbow {}Wrist",
    ),
    "short forms": names(
        "L R",
        "PELV SP1 SP2 CHST NCK NCK2 HD",
        "{}_HJ {}_UPLEG {}_LOLEG {}_FT {}_TOE {}_CLAV {}_UPARM {}_LOARM {}_HND",
    ),
    "numbers only": names("0 1", "J0 J1 J2 J3 J4 J5 J6", "{}J7 {}J8 {}J9 {}J10 {}J11 {}J12 {}J13 {}J14 {}J15"),
}


def spelled(vocabulary: dict[str, str]) -> Kind:
    return lambda body: plain(renamed(body, vocabulary))


def plain(body: Body, style: Style | None = None, **more: Any) -> Written:
    return Written(bvh(body, style or Style()).encode(), body, **more)


def hahne(body: Body) -> Body:
    """With the names of B. Hahne's conversion of CMU's recordings."""
    return renamed(body, HAHNE)


def styled(**style: Any) -> Kind:
    return lambda body: plain(hahne(body), Style(**style))


def edited(change: Callable[[str], str], encoding: str = "utf-8") -> Kind:
    def kind(body: Body) -> Written:
        own = hahne(body)
        return Written(change(bvh(own)).encode(encoding), own)

    return kind


def changed(change: Callable[[Body], Body], **style: Any) -> Kind:
    return lambda body: plain(change(hahne(body)), Style(**style))


def zero_pose(body: Body, arms: float, legs: float = 0.0) -> Body:
    """The arms in the zero pose lowered by some degrees, and the legs spread."""

    def turn(bone: str) -> Rotation:
        side = 1.0 if bone[:1] == "l" else -1.0
        if bone[1:] in ("humerus", "radius", "wrist"):
            return Rotation.from_euler("z", -side * arms, degrees=True)
        if bone[1:] in ("femur", "tibia", "foot", "toes"):
            return Rotation.from_euler("z", side * legs, degrees=True)
        return Rotation.identity()

    return rezeroed(body, turn)


def along(body: Body, axis: str) -> Body:
    """A zero pose in which every bone points along one axis, as rigs with joints that look along their bones have."""
    goal = np.eye(3)["xyz".index(axis)]
    turns = []
    for joint in range(len(body.names)):
        children = [child for child, above in enumerate(body.parent) if above == joint]
        vector = body.offset[children[-1]] if children else body.end[joint]
        norm = np.linalg.norm(vector)
        turns.append(Rotation.align_vectors([goal], [vector / norm])[0] if norm > 1e-6 else Rotation.identity())
    return rezeroed(body, turns)


def at_first_frame(body: Body) -> Body:
    """A zero pose that is the first frame of the motion."""
    return rezeroed(body, [turn[0] for turn in body.turn])


def with_pose_before(body: Body, frames: int) -> Body:
    """With a T pose at the origin before the motion."""
    rest = Rotation.identity(frames)
    place = np.array([0.0, float(body.root[0, 1]), 0.0])
    return replace(
        body,
        turn=[Rotation.concatenate([rest, own]) for own in body.turn],
        root=np.vstack([np.tile(place, (frames, 1)), body.root]),
    )


def spiked(body: Body, at: int) -> Body:
    """One frame in which the root and an arm are elsewhere."""
    root = body.root.copy()
    root[at] += [3.0, 1.0, 0.0]
    arm = body.bone.index("lhumerus")
    turn = list(body.turn)
    quaternions = turn[arm].as_quat()
    quaternions[at] = (turn[arm][at] * Rotation.from_euler("z", 150, degrees=True)).as_quat()
    turn[arm] = Rotation.from_quat(quaternions)
    return replace(body, root=root, turn=turn)


def limb_spiked(body: Body, at: int) -> Body:
    """One frame in which only an arm is elsewhere."""
    return replace(spiked(body, at), root=body.root)


def lost(body: Body, first: int, end: int) -> Body:
    """Frames in which the body was lost: all zeros, as trackers write them."""
    root = body.root.copy()
    root[first:end] = 0.0
    turn = []
    for own in body.turn:
        quaternions = own.as_quat()
        quaternions[first:end] = [0.0, 0.0, 0.0, 1.0]
        turn.append(Rotation.from_quat(quaternions))
    return replace(body, root=root, turn=turn)


def cut(body: Body, frames: slice) -> Body:
    return replace(body, root=body.root[frames], turn=[own[frames] for own in body.turn])


def repeated(body: Body, seconds: float) -> Body:
    """The motion to and fro until a time is filled."""
    frames = len(body.root)
    wave = np.concatenate([np.arange(frames), np.arange(frames - 2, 0, -1)])
    index = np.tile(wave, int(seconds * body.rate / len(wave)) + 1)[: int(seconds * body.rate)]
    return replace(body, root=body.root[index], turn=[Rotation.from_quat(own.as_quat()[index]) for own in body.turn])


def lying(body: Body) -> Body:
    """Somebody who lies on the back: the recording tipped over, near the ground."""
    by = Rotation.from_euler("x", -90, degrees=True)
    turned = [by * own for own in body.turn]
    place = 0.1 * (body.root - body.root.mean(axis=0))
    return replace(body, turn=turned, root=place * [1.0, 0.0, 1.0] + [0.3, 0.12, 0.4])


def lowered_to_zero(body: Body) -> Body:
    """A root that has no height and no path: the file's positions are left away."""
    return replace(body, root=np.zeros_like(body.root))


def twisted(body: Body) -> Body:
    """With twist joints half way along upper arms and thighs."""
    for side, letter in (("Left", "l"), ("Right", "r")):
        for bone, name in (("femur", "UpLegTwist"), ("humerus", "ArmTwist"), ("radius", "ForeArmTwist")):
            body = with_joint(body, letter + bone, side + name, 0.5)
    return body


def doubled(body: Body) -> Body:
    """With joints that lie where others do, as Kinect's files have."""
    for side, letter in (("Left", "l"), ("Right", "r")):
        for bone, name in (("femur", "UpLegRoll"), ("humerus", "ArmRoll"), ("tibia", "LegRoll")):
            body = with_joint(body, letter + bone, side + name, 0.0)
    return body


def recast(text: str) -> str:
    head, mark, rows = text.partition("Frame Time")
    return head.replace("Hips", "Körper Größe") + mark + rows


KINDS: dict[str, Kind] = {
    "CMU by Hahne": styled(),
    **{f"names: {name}": spelled(words) for name, words in VOCABULARIES.items()},
    "MotionBuilder: ZYX, 6 channels on every joint": styled(order=["ZYX"], positions="all"),
    "Noitom: YXZ, positions everywhere": styled(order=["YXZ"], positions="all", root_offset=True),
    "position channels of zeros besides the root": styled(positions="zeros"),
    "rotations before positions": styled(rotations_first=True),
    "only rotations, root at the origin": lambda body: Written(
        bvh(hahne(body), Style(positions="none")).encode(), lowered_to_zero(hahne(body)), well_placed=False
    ),
    "an order for each joint": styled(order=["YXZ", "ZXY", "XYZ", "ZYX", "XZY", "YZX"]),
    "no End Sites": styled(ends=False),
    "scientific notation": styled(number="{:.8e}"),
    "two decimals": styled(number="{:.2f}"),
    **{
        f"unit {unit}": styled(unit=size)
        for unit, size in (("m", 1.0), ("mm", 0.001), ("inch", 0.0254), ("CMU's", 0.0254 / 0.45))
    },
    "line ends of Windows, tabs": edited(lambda text: text.replace("\n", "\r\n").replace(" ", "\t")),
    "byte order mark": edited(lambda text: text, "utf-8-sig"),
    "UTF-16": edited(lambda text: text, "utf-16"),
    "a root with a name in Latin-1": edited(recast, "latin-1"),
    "no blanks after colons": edited(lambda text: text.replace("Frames: ", "Frames:").replace("Time: ", "Time:")),
    "no line end at the end, blank lines": edited(lambda text: text.replace("MOTION", "\nMOTION").rstrip() + "\n\n\n "),
    "END SITE, lower-case words": edited(lambda text: text.replace("End Site", "END SITE").replace("JOINT", "Joint")),
    "A pose": changed(lambda body: zero_pose(body, 45)),
    "arms hang in the zero pose": changed(lambda body: zero_pose(body, 85)),
    "legs apart in the zero pose": changed(lambda body: zero_pose(body, 30, 20)),
    "zero pose is the first frame": changed(at_first_frame),
    "bones along x (LAFAN1)": changed(lambda body: along(body, "x")),
    "bones along y (Blender)": changed(lambda body: along(body, "y")),
    "bones along z": changed(lambda body: along(body, "z")),
    "z up, zero pose too": changed(
        lambda body: world_turned(rezeroed(body, [UPRIGHT] * len(body.names)), UPRIGHT, "z")
    ),
    "z up, zero pose y up": changed(lambda body: world_turned(body, UPRIGHT, "z")),
    "y up, zero pose z up": changed(lambda body: rezeroed(body, [UPRIGHT] * len(body.names))),
    "lies on the back, y up": changed(lying),
    "lies on the back, z up, zero pose y up": changed(lambda body: world_turned(lying(body), UPRIGHT, "z")),
    "lies on the back, z up, zero pose too": changed(
        lambda body: world_turned(lying(rezeroed(body, [UPRIGHT] * len(body.names))), UPRIGHT, "z")
    ),
    "a zero pose that faces aside": changed(
        lambda body: rezeroed(body, [Rotation.from_euler("y", 90, degrees=True)] * len(body.names))
    ),
    "a zero pose that faces back": changed(
        lambda body: rezeroed(body, [Rotation.from_euler("y", 180, degrees=True)] * len(body.names))
    ),
    "a child of 0.9 m": changed(lambda body: scaled(body, 0.52)),
    "somebody of 2.1 m": changed(lambda body: scaled(body, 1.2)),
    "far from the origin": changed(lambda body: moved(body, [50.0, 0.0, -80.0])),
    "0.5 m too high": changed(lambda body: moved(body, [0.0, 0.5, 0.0])),
    "0.5 m too low": changed(lambda body: moved(body, [0.0, -0.5, 0.0])),
    "on a floor at 12 m": changed(lambda body: moved(body, [0.0, 12.0, 0.0])),
    "below a Reference, positions of both": lambda body: plain(
        below(hahne(body), "Reference"), Style(positions="carrier")
    ),
    "below a root on the floor, all channels": lambda body: plain(below(hahne(body), "root"), Style(positions="all")),
    "twist joints": changed(twisted),
    "joints of no length": changed(doubled),
    **{
        f"{rate:g} Hz": changed(lambda body, rate=rate: at_rate(body, rate))
        for rate in (24.0, 25.0, 29.97, 60.0, 240.0, 1000.0)
    },
    "a T pose first": lambda body: plain(with_pose_before(hahne(body), 1), frames=slice(1, None)),
    "20 frames of T pose first": lambda body: plain(with_pose_before(hahne(body), 20), frames=slice(20, None)),
    "a spike of the whole body": lambda body: plain(spiked(hahne(body), 70), frames=slice(0, 70)),
    "a spike of one arm": lambda body: plain(limb_spiked(hahne(body), 70), frames=slice(0, 70)),
    "lost for 10 frames": lambda body: plain(lost(hahne(body), 60, 70), frames=slice(0, 60)),
    "10 minutes": changed(lambda body: at_rate(repeated(body, 600.0), 30.0)),
    "5 frames": changed(lambda body: cut(body, slice(40, 45))),
    "one frame": changed(lambda body: cut(body, slice(40, 41))),
    "radians": styled(radians=True),
    "an empty motion section": edited(lambda text: text[: text.index("Frame Time")] + "Frame Time: 0.0083333\n"),
    "nan in a frame": edited(lambda text: text[: text.rindex(" ")] + " nan\n"),
    "cut short": edited(lambda text: text[: int(0.8 * len(text))]),
    "a rate for a frame time": edited(lambda text: text.replace("Frame Time: 0.0083333", "Frame Time: 120")),
    "left and right exchanged": lambda body: plain(renamed(body, HAHNE | {"sides": "Right Left"})),
}
