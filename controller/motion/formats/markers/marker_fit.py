"""Fits a skeleton to markers on the skin: joint positions, bone lengths, and rotations.

The marker set is that of Vicon's full-body models, as recorded at CMU: 41 markers, LFHD to RMT5; pelvis markers may
have the Plug-in Gait names (LASI for LFWT, LPSI or SACR for LBWT, LTIB for LSHN).

1. Joint centres are estimated from the markers near them: hips from the pelvis (Bell, Pedersen and Brand 1990), knees,
   ankles and elbows half a joint width inwards from their marker, the others between their markers.
2. The skeleton is that of the thesis (19 bones), with median lengths, left and right alike.
3. Alternately, the offset of each marker on its bone is the median over time, and the poses of the rigid skeleton that
   minimise the distances to all markers are found by the Gauss-Newton method with Levenberg's damping. An unseen marker
   is interpolated in time with a small weight; a marker far from its place has less weight.
"""

import re
from dataclasses import dataclass

import numpy as np

from controller.motion import rotations
from controller.motion.clip import Clip, Markers, bridged
from controller.motion.orientation import orient
from controller.motion.rotations import Array, conjugate, continuous, cross, multiply, normalise, rotate
from controller.motion.skeleton import JAEGER_BONES, JAEGER_TREE, Skeleton, thesis_skeleton
from controller.motion.up_axis import TO_OURS
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

# The bone of each marker; l and r are put before those of the limbs.
_LIMBS: dict[str, tuple[str, ...]] = {"kne": ("THI", "KNE"), "ank": ("SHN", "ANK"), "foo": ("HEE", "TOE", "MT5")}
_LIMBS |= {"sho": ("SHO",), "elb": ("UPA", "ELB"), "wri": ("FRM", "WRA", "WRB"), "han": ("FIN",)}
BONE_OF = {
    **dict.fromkeys(("LFWT", "RFWT", "LBWT", "RBWT"), "root"),
    **dict.fromkeys(("C7", "T10", "CLAV", "STRN", "RBAC"), "neck"),
    **dict.fromkeys(("LFHD", "RFHD", "LBHD", "RBHD"), "head"),
    **{side + m: side.lower() + bone for side in "LR" for bone, markers in _LIMBS.items() for m in markers},
}
ALIASES = {"ASI": "FWT", "PSI": "BWT", "TIB": "SHN", "FRA": "FRM"}
NEEDED = (
    *("LFWT", "RFWT", "LBWT", "RBWT", "C7", "CLAV", "STRN", "T10", "LFHD", "RFHD", "LBHD", "RBHD"),
    *(side + name for side in "LR" for name in ("KNE", "ANK", "HEE", "TOE", "SHO", "ELB", "WRA", "WRB", "FIN")),
)

# From the middle of the front waist markers to a hip, in widths between them (Bell et al. 1990): back, sideways, down.
HIP = (-0.19, 0.36, -0.30)
# From a marker inwards to the centre of its joint, m: half the joint's width and the marker's radius.
KNEE, ANKLE, ELBOW = 0.058, 0.044, 0.040
SHOULDER = 0.055  # m below the marker on it

BRIDGED = 0.03  # weight of an unseen marker, against a seen one
FAR_OFF = 0.03  # m: a marker farther from its place has less weight; it slipped, or is another
# Collar bones and hands have one marker each, which does not determine their twist: they are held in line with their
# parents, at this lever, m.
HELD = {"lsho": 0.05, "rsho": 0.05, "lhan": 0.02, "rhan": 0.02}
_BETWEEN = re.compile(r"[_.|/ -]")  # separators between the names of a person and a marker, besides a colon
MISPLACED = 0.15  # m off its place: skin and fit leave 0.13 at most in the recordings we have, a cartwheel included
NO_BODY = 0.1  # m: with a larger median distance the markers are not on one body
SAMPLE = 150  # frames, spread over the recording, for the offsets of the markers
ROUNDS = 6
STEPS = 4  # of Gauss-Newton, each round
DAMPING = 1e-4  # m^2: what no marker determines, such as the twist of a collar bone, stays near the estimate
AT_ONCE = 256  # frames, to keep the matrices small


@dataclass(frozen=True, eq=False)
class Fit:
    """A clip of the thesis's skeleton and its distances from the markers used."""

    clip: Clip
    markers: tuple[str, ...]
    residual: Array  # distance of each marker from its place on the body, (T, M), m; NaN where it was not seen


def fit_markers(markers: Markers, name: str) -> Fit:
    """The motion of the body that carries these markers (FileFormatError if one is missing, or they fit no body)."""
    seen = _upright(markers, _named(markers))
    names = [marker for marker in BONE_OF if marker in seen]
    filled = {marker: bridged(seen[marker]) for marker in names}
    joints = _joint_centres(filled)
    skeleton = _skeleton(joints, name)
    ends = np.stack([joints[bone] for bone in ("root", *skeleton.bones)], axis=1)
    position, rotation = ends[:, 0], orient(skeleton, normalise(ends[:, 1:] - ends[:, skeleton.parent + 1]))

    place = np.stack([filled[marker] for marker in names], axis=1)
    weight = np.where(np.isnan(np.stack([seen[marker][:, 0] for marker in names], axis=1)), BRIDGED, 1.0)
    body = _Body(skeleton, [BONE_OF[marker] for marker in names])
    sample = np.unique(np.linspace(0, len(place) - 1, SAMPLE).astype(int))
    few = position[sample], rotation[sample]
    for _ in range(ROUNDS):
        offset = body.offsets(*few, place[sample])
        few = body.pose(*few, place[sample], weight[sample], offset)
    offset = body.offsets(*few, place[sample])
    position, rotation = body.pose(position, rotation, place, weight, offset, 3 * STEPS)
    off = np.linalg.norm(place - body.markers(position, rotation, offset), axis=-1)
    typical = float(np.median(off[weight == 1.0]))
    if typical > NO_BODY:
        raise FileFormatError(
            f"{markers.source}: the markers lie {1000.0 * typical:.0f} mm off the body that fits them best. "
            "Labels may be exchanged, or be those of several people: check them, or use --rename."
        )
    clip = Clip(name, skeleton, markers.rate, position, continuous(rotation), markers.source)
    return Fit(clip, tuple(names), np.where(weight == 1.0, off, np.nan))


def wears_full_set(markers: Markers) -> bool:
    """Whether every marker that the fit requires was seen."""
    found, _ = _people(markers)
    return all(marker in found for marker in NEEDED)


def _named(markers: Markers) -> dict[str, Array]:
    """The tracks (T, 3) of the known markers; of several people, of the one with most."""
    found, unseen = _people(markers)
    missing = [marker for marker in NEEDED if marker not in found]
    unnamed = [marker for marker in missing if marker not in unseen]
    if unnamed:
        raise FileFormatError(
            f"{markers.source}: no marker is called {listed(unnamed)} (there are: {listed(markers.labels)}). "
            "A skeleton can be fitted to Vicon's full-body markers, labelled as CMU or Plug-in Gait does, to any set "
            "with markers on pelvis, knees and ankles under usual names (LASI, LPSI, LKNE, LANK), and to points in the "
            "joints (LHip, LKnee, LAnkle and so on). --rename OLD=NEW gives a marker another name."
        )
    if missing:
        raise FileFormatError(
            f"{markers.source}: never seen in this recording: {listed(missing)}. "
            "The skeleton cannot be fitted without: take another recording, or a part in which they are seen."
        )
    return found


def _people(markers: Markers) -> tuple[dict[str, Array], set[str]]:
    """The tracks of the person with most of the known markers, and the markers that were never seen."""
    people: dict[str, dict[str, Array]] = {}
    unseen: set[str] = set()
    for index, label in enumerate(markers.labels):
        person, _, marker = _BETWEEN.sub(":", label).rpartition(":")
        marker = marker.upper()
        marker = marker[:1] + ALIASES.get(marker[1:], marker[1:])
        track = markers.position[:, index]
        if np.isnan(track).all():
            unseen.add(marker)
            continue
        for known in ("LBWT", "RBWT") if marker == "SACR" else (marker,):
            if known in BONE_OF:
                people.setdefault(person, {}).setdefault(known, track)
    return max(people.values(), key=len, default={}), unseen


def _upright(markers: Markers, seen: dict[str, Array]) -> dict[str, Array]:
    up = markers.up
    if up not in TO_OURS:
        head = np.stack([seen["LFHD"], seen["RFHD"]])
        feet = np.stack([seen["LTOE"], seen["RTOE"]])
        tall = np.nanmean(head, axis=(0, 1)) - np.nanmean(feet, axis=(0, 1))
        up = "y" if abs(tall[1]) > abs(tall[2]) else "z"
    return {marker: rotate(TO_OURS[up], track) for marker, track in seen.items()}


def hips_of_pelvis(left: Array, right: Array, back: Array) -> tuple[dict[str, Array], Array, Array, Array]:
    """Hip joints by Bell's regression, and axes of the pelvis (ahead, left, up), from its front markers and back."""
    front, across = 0.5 * (left + right), left - right
    width, leftwards = np.median(np.linalg.norm(across, axis=-1)), normalise(across)
    ahead = front - back
    ahead = normalise(ahead - (ahead * leftwards).sum(-1, keepdims=True) * leftwards)
    up = cross(ahead, leftwards)
    hips = {
        side + "hip": front + width * (HIP[0] * ahead + sign * HIP[1] * leftwards + HIP[2] * up)
        for side, sign in (("l", 1.0), ("r", -1.0))
    }
    return hips, ahead, leftwards, up


def _joint_centres(m: dict[str, Array]) -> dict[str, Array]:
    """Estimated ends of the thesis's bones, and its root, shape (T, 3) each."""
    hips, _, left, _ = hips_of_pelvis(m["LFWT"], m["RFWT"], 0.5 * (m["LBWT"] + m["RBWT"]))
    chest = 0.5 * (m["C7"] + m["CLAV"])
    waist = 0.5 * (m["T10"] + m["STRN"])
    trunk_up = normalise(chest - waist)
    joints: dict[str, Array] = {"back": waist, "neck": chest, **hips}
    joints["head"] = 0.25 * (m["LFHD"] + m["RFHD"] + m["LBHD"] + m["RBHD"])
    for side, sign in (("l", 1.0), ("r", -1.0)):
        s = side.upper()
        # Down the shank cross along the foot points to the right.
        inwards = sign * normalise(cross(m[s + "ANK"] - m[s + "KNE"], m[s + "TOE"] - m[s + "HEE"]))
        joints[side + "kne"] = m[s + "KNE"] + KNEE * inwards
        joints[side + "ank"] = m[s + "ANK"] + ANKLE * inwards
        joints[side + "foo"] = m[s + "TOE"]
        shoulder = m[s + "SHO"] - SHOULDER * trunk_up
        wrist = 0.5 * (m[s + "WRA"] + m[s + "WRB"])
        # A bent arm determines the axis of its elbow; that of a straight one is assumed to lie across the chest.
        upper, fore = m[s + "ELB"] - shoulder, wrist - m[s + "ELB"]
        axis = cross(normalise(upper), normalise(fore)) - 0.2 * left
        joints[side + "elb"] = m[s + "ELB"] + sign * ELBOW * normalise(axis)
        joints[side + "sho"], joints[side + "wri"], joints[side + "han"] = shoulder, wrist, m[s + "FIN"]
    joints["root"] = 0.5 * (joints["lhip"] + joints["rhip"])
    return joints


def _skeleton(joints: dict[str, Array], name: str) -> Skeleton:
    """The thesis's skeleton with the median lengths, left and right alike."""
    lines = {bone: joints[bone] - joints[parent] for bone, parent, _ in JAEGER_TREE}
    length = {bone: float(np.median(np.linalg.norm(line, axis=-1))) for bone, line in lines.items()}
    for bone in JAEGER_BONES:
        if bone[0] == "l":
            length[bone] = length["r" + bone[1:]] = 0.5 * (length[bone] + length["r" + bone[1:]])
    return thesis_skeleton(np.array([length[bone] for bone in JAEGER_BONES]), name)


def misplaced(fit: Fit) -> list[str]:
    """A warning about badly fitting markers, or an empty list."""
    far = np.nan_to_num(fit.residual) > MISPLACED
    if not far.any():
        return []
    worst = int(np.argmax(far.sum(axis=0)))
    others = int(far.any(axis=0).sum()) - 1
    more = f", as {others} other{'s are' if others > 1 else ' is'}" if others else ""
    distance, share = np.nanmax(fit.residual[:, worst]), 100.0 * far[:, worst].mean()
    begins = int(np.argmax(far[:, worst])) / fit.clip.rate
    return [
        f"marker '{fit.markers[worst]}' is up to {distance:.2f} m off its place on the body, in {share:.1f} % of the "
        f"frames, first at {begins:.2f} s{more}: labels may be exchanged. Mend them, or cut that "
        "part out (clip convert --from --to)."
    ]


class _Body:
    """A rigid skeleton with markers; the hips rotate with the pelvis."""

    def __init__(self, skeleton: Skeleton, bones: list[str]) -> None:
        self._skeleton = skeleton
        self._vector = skeleton.rest_direction * skeleton.length[:, None]
        self._bone = np.array([0 if bone == "root" else 1 + skeleton.index(bone) for bone in bones])
        # 1 where a bone leads to the start of the marker's bone, (M, B).
        chain = np.vstack([np.zeros(len(skeleton)), skeleton.chain - np.eye(len(skeleton))])
        self._above = chain[self._bone]
        turns = np.arange(1 + len(skeleton))  # the rotation that moves each bone
        for hip in ("rhip", "lhip"):
            turns[1 + skeleton.index(hip)] = 0
        free, self._turn = np.unique(turns, return_inverse=True)
        self._free = len(free)
        index = {bone: 1 + skeleton.index(bone) for bone in HELD}
        self._held = [(index[bone], int(skeleton.parent[index[bone] - 1]) + 1, HELD[bone]) for bone in HELD]

    def markers(self, position: Array, rotation: Array, offset: Array) -> Array:
        """Positions (T, M, 3) of markers at offsets (M, 3) from the start of their bones."""
        return self._starts(position, rotation) + rotate(rotation[:, self._bone], offset)

    def offsets(self, position: Array, rotation: Array, place: Array) -> Array:
        """Median offsets on their bones of markers seen at (T, M, 3)."""
        inverse = conjugate(rotation[:, self._bone])
        return np.median(rotate(inverse, place - self._starts(position, rotation)), axis=0)

    def pose(
        self, position: Array, rotation: Array, place: Array, weight: Array, offset: Array, steps: int = STEPS
    ) -> tuple[Array, Array]:
        """The poses that bring the markers closest to (T, M, 3), starting from those given."""
        parts = [
            self._improved(position[at], rotation[at], place[at], weight[at], offset, steps)
            for at in (slice(begin, begin + AT_ONCE) for begin in range(0, len(place), AT_ONCE))
        ]
        return np.concatenate([p for p, _ in parts]), np.concatenate([r for _, r in parts])

    def _improved(
        self, position: Array, rotation: Array, place: Array, weight: Array, offset: Array, steps: int
    ) -> tuple[Array, Array]:
        frames, count = weight.shape
        free = self._free
        for _ in range(steps):
            bones = rotate(rotation[:, 1:], self._vector)
            ride = rotate(rotation[:, self._bone], offset)
            # A small rotation w of a bone moves its far end by w x v: the matrix of v, summed over all it carries.
            lever = np.zeros((frames, count, free, 3))
            for bone in range(len(self._skeleton)):
                turn = self._turn[1 + bone]
                lever[:, np.flatnonzero(self._above[:, bone]), turn] += bones[:, None, bone]
            lever[:, np.arange(count), self._turn[self._bone]] += ride
            jacobian = np.zeros((frames, count, 3, 3 + 3 * free))
            jacobian[..., :3] = np.eye(3)
            turns = jacobian[..., 3:].reshape(frames, count, 3, free, 3)
            x, y, z = np.moveaxis(lever, -1, 0)
            turns[:, :, 0, :, 1], turns[:, :, 0, :, 2] = z, -y
            turns[:, :, 1, :, 0], turns[:, :, 1, :, 2] = -z, x
            turns[:, :, 2, :, 0], turns[:, :, 2, :, 1] = y, -x
            off = place - self.markers(position, rotation, offset)
            trust = weight / np.maximum(np.linalg.norm(off, axis=-1) / FAR_OFF, 1.0)
            flat = jacobian.reshape(frames, 3 * count, -1)
            weighted = np.swapaxes(flat * np.repeat(trust, 3, axis=1)[..., None], -1, -2)
            normal = weighted @ flat + DAMPING * np.eye(3 + 3 * free)
            pull = (weighted @ off.reshape(frames, -1, 1))[..., 0]
            for bone, parent, lever in self._held:
                apart = rotations.to_rotation_vector(multiply(rotation[:, bone], conjugate(rotation[:, parent])))
                for one, other, sign in ((bone, parent, -1.0), (parent, bone, 1.0)):
                    at, there = (slice(3 + 3 * self._turn[b], 6 + 3 * self._turn[b]) for b in (one, other))
                    pull[:, at] += sign * lever**2 * apart
                    normal[:, at, at] += lever**2 * np.eye(3)
                    normal[:, at, there] -= lever**2 * np.eye(3)
            step = np.linalg.solve(normal, pull[..., None])[..., 0].astype(np.float64, copy=False)
            position = position + step[:, :3]
            turned = rotations.from_rotation_vector(step[:, 3:].reshape(frames, free, 3))
            rotation = normalise(multiply(turned[:, self._turn], rotation))
        return position, rotation

    def _starts(self, position: Array, rotation: Array) -> Array:
        """Starts of the bones of the markers, (T, M, 3)."""
        return position[:, None] + self._above @ rotate(rotation[:, 1:], self._vector)
