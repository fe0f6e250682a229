"""The canonical body of all recordings, and the conversion to it.

Rest poses of different files cannot be compared; directions of limbs in the world can. So every recording is carried to
a body of 20 landmarks: the last joint of the trunk that moves with the pelvis (its root), waist, base of the neck,
head, and on each side hip, knee, ankle, toe base, shoulder, elbow, wrist and knuckles. Its 19 bones are the lines
between them, named and ordered as in the thesis: recordings of markers and Jaeger's patterns are already on this body,
with the middle between the hips as root.

Each bone has the direction of the recorded landmarks in every frame, and the median of their distance as its length. A
line from the hips to the waist would shorten by up to 80 mm in a bend; those within the pelvis are rigid, and the two
along the spine nearly are. The twist of a bone is that of the recorded bone at its end, relative to its rest pose.

Missing landmarks (hands, feet) are placed as in the rest pose of their parent, those of an arm as hanging (`lacking`).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from controller.motion.anatomy import SIDES, Anatomy, Part, Side, anatomy, leg_without_name
from controller.motion.bone_names import THESIS_LIMBS
from controller.motion.clip import Clip
from controller.motion.rotations import Array, between, conjugate, continuous, dot, multiply, normalise, rotate, yaw
from controller.motion.skeleton import JAEGER_BONES, JAEGER_PARENT, JAEGER_REST, Pose, Skeleton, thesis_skeleton
from controller.motion.upper_body import ACCEPTED, lacks_legs
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

CANONICAL_BONES = JAEGER_BONES
NO_LENGTH = 1e-6  # m
WAIST = 0.35  # of the way along the spine from the root to the neck
RIGID = 5e-5  # m: a joint whose distances from the hips change by less belongs to the pelvis
SAME_PELVIS = 0.003  # m: a pelvis that differs by less is the actor's own
LOW = 0.02  # m: a joint this much above the lowest one counts e times less for the height of the body
_BACK = JAEGER_BONES.index("back")
_HIPS = [JAEGER_BONES.index("rhip"), JAEGER_BONES.index("lhip")]
_OTHERS = [bone for bone in range(len(JAEGER_BONES)) if bone not in _HIPS]
# Lengths of missing bones over thigh and shank (Winter 2009, fig. 4.1).
_ASSUMED = {"foo": 0.30, "neck": 0.58, "head": 0.35, "sho": 0.26, "elb": 0.38, "wri": 0.30, "han": 0.20}
_HANGS = (0.0, 0.17, -0.985)  # direction of a missing left arm


@dataclass(frozen=True)
class Landmarks:
    """The joints of a skeleton that are landmarks; a joint is 0 for the root or 1 + the bone that ends there."""

    joint: dict[str, int]  # in which each canonical bone ends that the skeleton has
    bone: dict[str, int]  # that gives each canonical bone its rotation
    root: int | None  # the last joint of the trunk that moves with the pelvis; None without a trunk
    waist: int | None  # a joint above it, nearest to WAIST of the way to the neck; None if there is none

    @property
    def lacking(self) -> list[str]:
        """The canonical bones that the skeleton lacks."""
        return [bone for bone in CANONICAL_BONES if bone not in self.joint and bone != "back"]


def is_canonical(skeleton: Skeleton) -> bool:
    """Whether a skeleton is the canonical body, of any proportions and with its root anywhere in the pelvis."""
    if skeleton.bones != CANONICAL_BONES or tuple(skeleton.parent.tolist()) != JAEGER_PARENT:
        return False
    return np.allclose(skeleton.rest_direction[_OTHERS], np.array(JAEGER_REST)[_OTHERS], atol=1e-6)


def landmarks_of(skeleton: Skeleton, joints: Array | None = None) -> Landmarks:
    """The landmarks of any skeleton of a human (FileFormatError without two legs).

    Joints (T, 1 + B, 3), m, of a recording tell which bones of the trunk move with the pelvis; by default none does.
    """
    lacks = leg_without_name(skeleton)
    if lacks is not None:
        raise _no_leg(skeleton, lacks)
    parts = anatomy(skeleton)
    joint: dict[str, int] = {}
    bone: dict[str, int] = {}
    for side in SIDES:
        for end, part in THESIS_LIMBS:
            own = _main(skeleton, parts, part, side)
            if not own:
                continue
            # Toes and fingers add to foot and hand: these end where their first bone does.
            last = own[0] if part in ("foot", "hand") else own[-1]
            joint[side[0] + end], bone[side[0] + end] = 1 + last, last
        thigh = _main(skeleton, parts, "thigh", side)
        if not thigh or side[0] + "ank" not in joint:
            raise _no_leg(skeleton, side)
        joint[side[0] + "hip"] = 1 + int(skeleton.parent[thigh[0]])
        bone.setdefault(side[0] + "hip", -1)
        arm = _main(skeleton, parts, "upper arm", side)
        if arm:
            joint[side[0] + "sho"] = 1 + int(skeleton.parent[arm[0]])
            bone.setdefault(side[0] + "sho", int(skeleton.parent[arm[0]]))
    trunk = _main(skeleton, parts, "trunk", "middle")
    root = waist = None
    if trunk:
        joint["neck"], bone["neck"] = 1 + trunk[-1], trunk[-1]
        if joints is not None:
            hips = joints[:, [joint["lhip"], joint["rhip"]]]
            apart = [np.linalg.norm(joints[:, [1 + bone]] - hips, axis=-1) for bone in trunk[:-1]]
            moves = [bool(np.ptp(distance, axis=0).max() > RIGID) for distance in apart]
            trunk = trunk[min(moves.index(True), len(trunk) - 2) if True in moves else 0 :]
        root = 1 + int(skeleton.parent[trunk[0]])
        length = np.cumsum(skeleton.length[trunk])
        middle = int(np.argmin(np.abs(length[:-1] - WAIST * length[-1]))) if len(trunk) > 1 else None
        waist = None if middle is None else 1 + trunk[middle]
        bone["back"] = trunk[0] if middle is None else trunk[middle]
    top = _main(skeleton, parts, "head", "middle")[:1] or _main(skeleton, parts, "neck", "middle")
    if top and "neck" in joint:
        joint["head"], bone["head"] = 1 + top[-1], top[-1]
    return Landmarks(joint, bone, root, waist)


def _no_leg(skeleton: Skeleton, side: Side) -> FileFormatError:
    upper = f" `learn --accept {ACCEPTED}` learns it as an upper body." if lacks_legs(skeleton.bones) else ""
    return FileFormatError(
        f"skeleton '{skeleton.name}': no {side} leg was found (bones: {listed(skeleton.bones)}). "
        f"Name its joints with --rename OLD={side.capitalize()}UpLeg and so on.{upper}"
    )


def _main(skeleton: Skeleton, parts: Anatomy, part: Part, side: Side) -> list[int]:
    """The bones of a part along its longest path, from the root outwards."""
    own = parts.all(part, side)
    if not own:
        return []
    chain = skeleton.chain[np.ix_(own, own)]
    reach = chain @ skeleton.length[own] + 1e-9 * chain.sum(axis=1)
    end = own[int(np.argmax(reach))]
    return [bone for bone in own if skeleton.chain[end, bone]]


def to_canonical(clip: Clip) -> Clip:
    """A recording on the canonical body, with its own proportions (FileFormatError without two legs)."""
    if is_canonical(clip.skeleton):
        return clip
    marks = landmarks_of(clip.skeleton, clip.joints())
    rest, start = _rest_places(clip.skeleton, marks, clip.rotation[:1])
    place, turned = _landmark_places(clip.skeleton, marks, clip.root_position, clip.rotation)
    length = np.median(np.linalg.norm(_lines(place), axis=-1), axis=0)
    # With arms at the neck a shoulder may have no length, and then moves with its parent.
    length[length < NO_LENGTH] = 0.0
    across = (rest[1 + _HIPS[1]] - rest[1 + _HIPS[0]])[:2]
    # A rest pose may face a few degrees aside; the canonical root faces at right angles to its hips.
    facing = yaw(np.arctan2(-across[0], across[1]))
    rests = np.array(JAEGER_REST)
    rests[_HIPS] = np.where(length[_HIPS, None] > 0.0, rotate(conjugate(facing), start[_HIPS]), rests[_HIPS])
    skeleton = replace(thesis_skeleton(length, clip.skeleton.name), rest_direction=rests)
    rotation = np.empty((len(clip), 1 + len(skeleton), 4))
    rotation[:, 0] = multiply(turned[:, 0], facing)
    rotation[:, 1:] = multiply(turned[:, 1:], between(rests, np.where(length[:, None] > 0.0, start, rests)))
    _point(rotation, rests, _lines(place))
    for bone in np.flatnonzero(length == 0.0):
        rotation[:, 1 + bone] = rotation[:, 1 + JAEGER_PARENT[bone]]
    return Clip(clip.name, skeleton, clip.rate, place[:, 0], continuous(rotation), clip.source)


def on_bones_of(clip: Clip, skeleton: Skeleton) -> Clip:
    """A recording with its own proportions: as it is if it has the skeleton's bones, else on the canonical body."""
    joints = clip.skeleton.is_rig or skeleton.is_rig
    return clip if joints or set(clip.skeleton.bones) == set(skeleton.bones) else to_canonical(clip)


def landmark_places(clip: Clip) -> tuple[Array, NDArray[np.bool_]]:
    """Positions of root and landmarks (T, 20, 3), m, and which are recorded (20,). FileFormatError without two legs."""
    if is_canonical(clip.skeleton):
        return clip.joints(), np.full(1 + len(CANONICAL_BONES), True)
    marks = landmarks_of(clip.skeleton, clip.joints())
    places, _ = _landmark_places(clip.skeleton, marks, clip.root_position, clip.rotation)
    return places, np.array([True, *(bone not in marks.lacking for bone in CANONICAL_BONES)])


def _lines(place: Array) -> Array:
    """From the beginning to the end of each canonical bone, (..., 19, 3), m, by root and landmarks (..., 20, 3)."""
    return place[..., 1:, :] - place[..., np.array(JAEGER_PARENT) + 1, :]


def _point(rotation: Array, rests: Array, line: Array) -> None:
    """Swings bones with rotations (T, 1 + 19, 4) onto lines (T, 19, 3) that have a length, in place."""
    now = rotate(rotation[:, 1:], rests)
    apart = np.sqrt(np.square(line).sum(-1)) >= NO_LENGTH
    rotation[:, 1:] = multiply(between(now, np.where(apart[..., None], normalise(line), now)), rotation[:, 1:])


def carried(clip: Clip, skeleton: Skeleton) -> Clip:
    """A recording on a given body: the canonical one with other proportions, or the skeleton of a library.

    Limbs keep their directions. The path is scaled by the ratio of leg lengths. FileFormatError without two legs.
    """
    same = set(clip.skeleton.bones) == set(skeleton.bones)
    if (skeleton.is_rig or clip.skeleton.is_rig) and not same:
        raise FileFormatError(
            f"clip '{clip.name}': its joints are not those of '{skeleton.name}'. A taught clip fits its rig only."
        )
    if same and not is_canonical(skeleton):
        return _with_same_bones(clip, skeleton)
    canonical = to_canonical(clip)
    return _proportioned(canonical, skeleton) if is_canonical(skeleton) else _from_canonical(canonical, skeleton)


def _proportioned(clip: Clip, skeleton: Skeleton) -> Clip:
    """A canonical clip on the canonical body with other proportions; in each frame its lowest joints stay as high."""
    own = clip.skeleton
    ratio = leg(skeleton) / leg(own)
    rotation, place = clip.rotation.copy(), ratio * clip.joints()
    line = rotate(rotation[:, 1:], own.rest_direction)
    root = place[:, 0]
    if not _same_pelvis(own, skeleton):
        (to_hips, half), (to_own, _) = _pelvis(skeleton), _pelvis(own)
        right, left = (place[:, 1 + hip] for hip in _HIPS)
        middle, across = 0.5 * (left + right), half * normalise(left - right)
        # The pelvis is turned as its lines are: the twist of the root may follow a rule.
        turn = _turn(own, middle - root, across) if to_own.any() else rotation[:, 0]
        ahead = rotate(turn, to_hips)
        root = middle - ahead
        line[:, _HIPS] = np.stack([ahead - across, ahead + across], axis=1)
        if to_hips.any() != to_own.any():
            line[:, _BACK] = place[:, 1 + _BACK] - root
    _point(rotation, skeleton.rest_direction, line)
    done = replace(clip, skeleton=skeleton, root_position=root, rotation=continuous(rotation))
    lift = _lowest(place) - _lowest(done.joints())
    return replace(done, root_position=root + lift[:, None] * np.array([0.0, 0.0, 1.0]))


def _turn(own: Skeleton, ahead: Array, across: Array) -> Array:
    """The rotation (T, 4) of a pelvis from its lines: root to the middle of the hips, and right to left hip, (T, 3)."""
    right, left = own.rest_direction[_HIPS] * own.length[_HIPS, None]
    axis = normalise(across)
    turn = between(normalise(left - right), axis)
    now, then = (normalise(way - dot(way, axis)[:, None] * axis) for way in (ahead, rotate(turn, 0.5 * (left + right))))
    return multiply(between(then, now), turn)


def _lowest(place: Array) -> Array:
    """A soft minimum of the heights of landmarks (T, 20, 3), shape (T,), m: smooth where another becomes the lowest."""
    height = place[:, 1:, 2]
    least = height.min(axis=1)
    return least - LOW * np.log(np.exp((least[:, None] - height) / LOW).sum(axis=1))


def root_height(pose: Pose, skeleton: Skeleton, own: Skeleton) -> Array:
    """The height of the root (...), m, at which another body has its lowest joints where a skeleton has them."""
    turns = pose.rotation.reshape(-1, *pose.rotation.shape[-2:])
    here, there = (_lowest(one.joints(np.zeros((len(turns), 3)), turns)) for one in (skeleton, own))
    return pose.root_position[..., 2] + (here - there).reshape(pose.rotation.shape[:-2])


def leg(skeleton: Skeleton) -> float:
    """Thigh and shank of a canonical body, m, the mean of both sides."""
    return 0.5 * float(sum(skeleton.length[skeleton.index(side + end)] for side in "lr" for end in ("kne", "ank")))


def _pelvis(skeleton: Skeleton) -> tuple[Array, float]:
    """From the root to the middle between the hips of a canonical body at rest, (3,), and half their distance, m."""
    right, left = skeleton.rest_direction[_HIPS] * skeleton.length[_HIPS, None]
    return 0.5 * (left + right), 0.5 * float(np.linalg.norm(left - right))


def offsets_at_rest(body: Skeleton, skeleton: Skeleton) -> Array:
    """The offsets (19, 3), m, of a canonical body for motions that were carried from it to another one.

    Files rest with the pelvis bent differently; hips of the same shape were carried as they stand.
    """
    offsets = body.length[:, None] * body.rest_direction
    if _same_pelvis(body, skeleton):
        offsets[_HIPS] = skeleton.offsets[_HIPS] * (leg(body) / leg(skeleton))
    return offsets


def _same_pelvis(body: Skeleton, skeleton: Skeleton) -> bool:
    (to_own, own_half), (to_hips, half) = _pelvis(body), _pelvis(skeleton)
    ratio = leg(skeleton) / leg(body)
    apart = abs(half - ratio * own_half), abs(np.hypot(*to_hips[::2]) - ratio * np.hypot(*to_own[::2]))
    return max(apart) <= SAME_PELVIS


def _with_same_bones(clip: Clip, skeleton: Skeleton) -> Clip:
    """A clip on a skeleton with the same bones in another order and rest pose; directions and twists stay."""
    own = clip.skeleton
    order = [own.bones.index(bone) for bone in skeleton.bones]
    rotation = clip.rotation[:, [0, *(1 + bone for bone in order)]].copy()
    for bone, rest in enumerate(skeleton.rest_direction):
        turn = between(rest, own.rest_direction[order[bone]])
        rotation[:, 1 + bone] = multiply(rotation[:, 1 + bone], turn)
    ratio = skeleton.leg_length / own.leg_length
    return replace(clip, skeleton=skeleton, root_position=clip.root_position * ratio, rotation=continuous(rotation))


def _from_canonical(clip: Clip, skeleton: Skeleton) -> Clip:
    """A canonical clip on another skeleton: all bones of a part follow its canonical bone, in their rest shape."""
    parts = anatomy(skeleton)
    marks = landmarks_of(skeleton)
    rest, start = _rest_places(skeleton, marks)
    trunk = _main(skeleton, parts, "trunk", "middle")
    low = 1 + trunk.index(marks.waist - 1) if marks.waist is not None else 0
    leads: dict[int, str] = dict.fromkeys(trunk[:low], "back") | dict.fromkeys(trunk[low:], "neck")
    leads |= dict.fromkeys([*parts.all("neck"), *parts.all("head")], "head")
    for side in SIDES:
        for end, part in THESIS_LIMBS:
            leads |= dict.fromkeys(parts.all(part, side), side[0] + end)
    rotation = np.empty((len(clip), 1 + len(skeleton), 4))
    rotation[:, 0] = clip.rotation[:, 0]
    for bone, parent in enumerate(skeleton.parent):
        name = leads.get(bone)
        # Other bones (a tail, a twist bone), and those of the hips, move with their parents.
        if name is None:
            rotation[:, 1 + bone] = rotation[:, 1 + parent]
            continue
        of = CANONICAL_BONES.index(name)
        turn = between(start[of], np.array(JAEGER_REST[of]))
        rotation[:, 1 + bone] = multiply(clip.rotation[:, 1 + of], turn)
        lone = name[1:] not in ("hip", "sho") and name not in ("back", "neck", "head")
        if lone and parts.part[bone] not in ("foot", "hand"):
            # The landmarks of a limb lie on its bone: it has the direction of the canonical one.
            goal = rotate(clip.rotation[:, 1 + of], np.array(JAEGER_REST[of]))
            now = rotate(rotation[:, 1 + bone], skeleton.rest_direction[bone])
            rotation[:, 1 + bone] = multiply(between(now, goal), rotation[:, 1 + bone])
    at_hips = 1 + np.array(_HIPS)
    ratio = skeleton.leg_length / clip.skeleton.leg_length
    root = ratio * clip.joints()[:, at_hips].mean(axis=1) - rotate(rotation[:, 0], rest[at_hips].mean(axis=0))
    return replace(clip, skeleton=skeleton, root_position=root, rotation=continuous(rotation))


def _rest_places(skeleton: Skeleton, marks: Landmarks, recorded: Array | None = None) -> tuple[Array, Array]:
    """Positions of root and landmarks in the rest pose, (20, 3), and directions of the canonical bones, (19, 3)."""
    # The guess of a rest pose may bend the rigid pelvis: a recorded frame (1, 1 + B, 4) straightens it.
    rotation = np.tile([1.0, 0.0, 0.0, 0.0], (1, 1 + len(skeleton), 1))
    joints = [marks.joint["lhip"], marks.joint["rhip"], *([] if marks.root is None else [marks.root])]
    if recorded is not None:
        pelvis = [0, *(1 + bone for at in joints if at for bone in np.flatnonzero(skeleton.chain[at - 1]))]
        rotation[:, pelvis] = multiply(conjugate(recorded[:, :1]), recorded[:, pelvis])
    place = _landmark_places(skeleton, marks, np.zeros((1, 3)), rotation)[0][0]
    return place, normalise(_lines(place))


def _landmark_places(skeleton: Skeleton, marks: Landmarks, root: Array, rotation: Array) -> tuple[Array, Array]:
    """Positions of root and landmarks, shape (T, 20, 3), and rotations of the bones that end there, (T, 20, 4)."""
    joints = skeleton.joints(root, rotation)
    place = np.empty((len(joints), 20, 3))
    turned = np.empty((len(joints), 20, 4))
    hips = 0.5 * (joints[:, marks.joint["lhip"]] + joints[:, marks.joint["rhip"]])
    place[:, 0] = hips if marks.root is None else joints[:, marks.root]
    turned[:, 0] = rotation[:, 0]
    leg = float(skeleton.length[marks.bone["lkne"]] + skeleton.length[marks.bone["lank"]])
    for at, (bone, parent, rest) in enumerate(zip(CANONICAL_BONES, JAEGER_PARENT, JAEGER_REST, strict=True), 1):
        turned[:, at] = rotation[:, 1 + marks.bone[bone]] if bone in marks.bone else turned[:, 1 + parent]
        if bone == "back":
            continue
        if bone in marks.joint:
            place[:, at] = joints[:, marks.joint[bone]]
        else:
            share = _ASSUMED.get(bone, _ASSUMED.get(bone[1:], 0.5))
            if bone[1:] in ("elb", "wri", "han") and bone[0] + "elb" not in marks.joint:
                rest = (_HANGS[0], _HANGS[1] if bone[0] == "l" else -_HANGS[1], _HANGS[2])
            carrier = turned[:, 1 + parent]
            start = place[:, 0] if bone == "neck" else place[:, 1 + parent]  # the waist halves the way to the neck
            place[:, at] = start + rotate(carrier, np.array(rest) * share * leg)
        if bone == "neck":
            waist = 0.5 * (place[:, 0] + place[:, at]) if marks.waist is None else joints[:, marks.waist]
            place[:, 1 + _BACK] = waist
    return place, turned
