"""Joint centres under markers on the skin, of any marker set whose labels name landmarks (`skin_markers.toml`).

The outside of the left knee is LKNE (Vicon), LLEK (Motek), L.Knee.Lat (OpenSim), L_FLE (Qualisys) or LKneeOut
(OptiTrack). The centre of a joint lies between the markers on both sides of it, or half its width inwards of the outer
one; that of a hip is Bell's regression from the pelvis (`marker_fit`). Pelvis and legs are required.
"""

import re
import tomllib
from pathlib import Path

import numpy as np

from controller.motion.clip import Markers, bridged
from controller.motion.formats.markers.marker_fit import ANKLE, ELBOW, KNEE, SHOULDER, hips_of_pelvis
from controller.motion.rotations import Array, cross, normalise
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

_LABELS: dict[str, dict[str, str]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_PLACES = {name: place for place, names in _LABELS["of_a_side"].items() for name in names.split()}
_MIDDLE_PLACES = {name: place for place, names in _LABELS["middle"].items() for name in names.split()}
_SIDES = {"LEFT": "l", "RIGHT": "r", "L": "l", "R": "r"}
_BETWEEN = re.compile(r"[^A-Z0-9]")
_COMPUTED = re.compile(r"V_(?=[LR]\.)")  # V_R.Hip_JC
_SIDE_WITHIN = re.compile(r"(WAIST)([LR])(FRONT|BACK)")  # OptiTrack and Qualisys: WaistLFront
_SIDE_LAST = re.compile(r"(.*)[_.\- ](L|R|LEFT|RIGHT)")
_FAR_ABOVE = 0.1  # m from the hips' middle to "pelvis"
_WAIST = 2.0  # the trunk over the part of it below the waist's markers

Landmarks = dict[tuple[str, str], Array]  # track of (place, "l", "r" or "")


def joints_under_skin(markers: Markers) -> dict[str, Array]:
    """The centres (T, 3) of the joints, by canonical joint, in the file's axes; gaps are interpolated linearly.

    "pelvis" is a point straight above the middle between the hips. Empty without known markers on the front and back
    of the pelvis. FileFormatError if the pelvis has markers and a knee or an ankle has none; it names them.
    """
    seen = _landmarks(markers)
    back = _pelvis_back(seen)
    if back is None:
        return {}
    missing = [
        f"the {side} {joint}"
        for side, short in (("left", "l"), ("right", "r"))
        for joint in ("knee", "ankle")
        if not any((place, short) in seen for place in (joint, f"outside of the {joint}"))
    ]
    if missing:
        raise FileFormatError(
            f"{markers.source}: the pelvis has markers, but {listed(missing)} none that is known (there are: "
            f"{listed(markers.labels)}). Name the marker on the outside of each with --rename OLD=LKNE, RKNE, LANK or "
            "RANK."
        )
    front = "front of the pelvis"
    joints, ahead, left, up = hips_of_pelvis(seen[front, "l"], seen[front, "r"], back)
    for side, sign in (("l", 1.0), ("r", -1.0)):
        joints[side + "hip"] = seen.get(("hip", side), joints[side + "hip"])
        joints |= _leg(seen, side, sign, ahead)
    root = 0.5 * (joints["lhip"] + joints["rhip"])
    joints["pelvis"] = root + _FAR_ABOVE * up
    joints |= _trunk(seen, root)
    if "neck" in joints:
        for side, sign in (("l", 1.0), ("r", -1.0)):
            joints |= _arm(seen, side, sign, left, normalise(joints["neck"] - root))
    return joints


def marks_pelvis(markers: Markers) -> bool:
    """Whether some label is that of a marker on the skin of the pelvis."""
    return any(place is not None and "pelvis" in place[0] for place in map(_place, markers.labels))


def _landmarks(markers: Markers) -> Landmarks:
    """Tracks of the landmarks, of the person with most of them; gaps are interpolated linearly."""
    people: dict[str, Landmarks] = {}
    for index, label in enumerate(markers.labels):
        person, _, name = label.rpartition(":")
        place = _place(name)
        if place is None:  # such as eva_LKNE
            person, _, name = re.sub(r"[_.|/ -]", ":", label).rpartition(":")
            place = _place(name)
        track = markers.position[:, index]
        if place is not None and not np.isnan(track).all():
            place = ("head", name) if place[0] == "head" else place  # has several
            people.setdefault(person, {}).setdefault(place, track)
    found = max(people.values(), key=len, default={})
    return {place: bridged(track) for place, track in found.items()}


def _place(label: str) -> tuple[str, str] | None:
    label = _COMPUTED.sub("", label.rpartition(":")[2].upper().removesuffix("_STUDY"))  # OpenCap's
    bare = _BETWEEN.sub("", label)
    if bare in _MIDDLE_PLACES:
        return _MIDDLE_PLACES[bare], ""
    if within := _SIDE_WITHIN.fullmatch(bare):
        bare = within[2] + within[1] + within[3]
    if last := _SIDE_LAST.fullmatch(label):
        bare = last[2] + _BETWEEN.sub("", last[1])
    for word, side in _SIDES.items():
        if bare.startswith(word) and bare[len(word) :] in _PLACES:
            return _PLACES[bare[len(word) :]], side
    return None


def _mean(seen: Landmarks, *places: tuple[str, str]) -> Array | None:
    there = [seen[place] for place in places if place in seen]
    return np.mean(there, axis=0) if there else None


def _between(seen: Landmarks, one: tuple[str, str], other: tuple[str, str]) -> Array | None:
    return 0.5 * (seen[one] + seen[other]) if one in seen and other in seen else None


def _pelvis_back(seen: Landmarks) -> Array | None:
    """The middle of the back of the pelvis, or None if it or the front has no markers."""
    front, back = "front of the pelvis", "back of the pelvis"
    if (front, "l") not in seen or (front, "r") not in seen:
        return None
    behind = _between(seen, (back, "l"), (back, "r"))
    return seen.get((back, "")) if behind is None else behind


def _leg(seen: Landmarks, side: str, sign: float, ahead: Array) -> dict[str, Array]:
    toes = _between(seen, ("inside of the toes", side), ("outside of the toes", side))
    for place in ("middle of the toes", "inside of the toes", "outside of the toes", "tip of the toes"):
        toes = seen.get((place, side)) if toes is None else toes
    knee, ankle = (seen.get((f"outside of the {of}", side), seen.get((of, side))) for of in ("knee", "ankle"))
    assert knee is not None  # checked by `joints_under_skin`
    assert ankle is not None
    foot = ahead if toes is None else toes - seen.get(("heel", side), ankle)
    # Down the shank cross along the foot points to the right.
    inwards = sign * normalise(cross(ankle - knee, foot))
    joints = {side + "kne": _centre(seen, "knee", side, KNEE * inwards)}
    joints[side + "ank"] = _centre(seen, "ankle", side, ANKLE * inwards)
    return joints if toes is None else joints | {side + "foo": toes}


def _centre(seen: Landmarks, joint: str, side: str, inwards: Array) -> Array:
    """A joint's computed centre, the middle between its sides, or a distance inwards from the outside."""
    if (joint, side) in seen:
        return seen[joint, side]
    outside = f"outside of the {joint}", side
    middle = _between(seen, outside, (f"inside of the {joint}", side))
    return seen[outside] + inwards if middle is None else middle


def _trunk(seen: Landmarks, root: Array) -> dict[str, Array]:
    neck = _between(seen, ("back of the neck", ""), ("front of the neck", ""))
    if neck is None:
        neck = _between(seen, ("shoulder", "l"), ("shoulder", "r"))
    waist = _between(seen, ("back of the waist", ""), ("front of the waist", ""))
    if neck is None and waist is not None:
        neck = root + _WAIST * (waist - root)
    if neck is None:
        neck = _mean(seen, ("back of the neck", ""), ("front of the neck", ""))
    if neck is None:
        return {}
    head = _mean(seen, *(place for place in seen if place[0] == "head"))
    return {"neck": neck} if head is None else {"neck": neck, "head": head}


def _arm(seen: Landmarks, side: str, sign: float, left: Array, up: Array) -> dict[str, Array]:
    """Shoulder, elbow, wrist and, where it has a marker, hand; nothing if one of the three is missing."""
    wrist = _mean(seen, ("one side of the wrist", side), ("other side of the wrist", side))
    wrist = seen.get(("wrist", side)) if wrist is None else wrist
    elbow = seen.get(("outside of the elbow", side))
    if wrist is None or elbow is None or ("shoulder", side) not in seen:
        return {}
    shoulder = seen["shoulder", side] - SHOULDER * up
    # A bent arm determines the axis of its elbow; that of a straight one is assumed to lie across the chest.
    axis = cross(normalise(elbow - shoulder), normalise(wrist - elbow)) - 0.2 * left
    elbow = _centre(seen, "elbow", side, sign * ELBOW * normalise(axis))
    joints = {side + "sho": shoulder, side + "elb": elbow, side + "wri": wrist}
    hand = seen.get(("hand", side))
    return joints if hand is None else joints | {side + "han": hand}
