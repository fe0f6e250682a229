"""Defects of recordings, each in a small file that is written from recorded data, with the truth.

`ISSUE` are those that the take stage was built and chosen on, `FURTHER` those it is reported on. A defect is a function
from a recorded body (`odd_bodies`, y up, m) to a `Spoilt`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.recordings.odd_bodies import Body, Style, at_rate, bvh, moved, renamed, scaled
from benchmarks.recordings.odd_kinds import HAHNE, VOCABULARIES, hahne, limb_spiked, lost

INCH = 0.0254
USUAL = Style()
JOINTS = {"hip": "Hip", "kne": "Knee", "ank": "Ankle", "sho": "Shoulder", "elb": "Elbow", "wri": "Wrist"}


@dataclass(frozen=True)
class Spoilt:
    """A file with a defect.

    Attributes:
        bodies: what it should be read as, by the name of the person; only one without a name where there is one.
        refusal: words of the true reason, one of which a refusal must have; empty if it need not be refused.
        height: whether the file knows how high the body is.
    """

    content: str
    bodies: dict[str, Body]
    refusal: tuple[str, ...] = ()
    suffix: str = ".bvh"
    height: bool = True


Defect = Callable[[Body], Spoilt]


def one(file: Body, truth: Body | None = None, style: Style = USUAL, *, height: bool = True) -> Spoilt:
    return Spoilt(bvh(file, style), {"": file if truth is None else truth}, height=height)


def refused(file: Body, *refusal: str, style: Style = USUAL) -> Spoilt:
    return Spoilt(bvh(file, style), {}, refusal)


def frames_of(body: Body, frames: np.ndarray, rate: float) -> Body:
    """Some frames of a body, each as often as it is named."""
    return replace(body, root=body.root[frames], turn=[turn[frames] for turn in body.turn], rate=rate)


def held(recorded: float, filed: float) -> Defect:
    def defect(body: Body) -> Spoilt:
        truth = at_rate(hahne(body), recorded)
        count = int(len(truth.root) * filed / recorded)
        return one(frames_of(truth, (np.arange(count) * recorded / filed + 1e-9).astype(int), filed), truth)

    return defect


def stuttering(body: Body) -> Spoilt:
    """One frame in 25 repeats the one before."""
    body = at_rate(hahne(body), 60.0)
    frames = np.arange(len(body.root))
    frames[12::25] -= 1
    return one(frames_of(body, frames, 60.0), body)


def dropped(missing: int) -> Defect:
    """Frames are missing in two places where the body moves fastest."""

    def defect(body: Body) -> Spoilt:
        body = at_rate(hahne(body), 60.0)
        wrist = body.places()[body.bone.index("lwrist")]
        speed = np.convolve(np.linalg.norm(np.diff(wrist, axis=0), axis=-1), np.ones(9), "same")
        speed[:10] = speed[-14:] = 0.0
        first = int(speed.argmax())
        speed[max(0, first - 20) : first + 20] = 0.0
        gone = [place + more for place in (first, int(speed.argmax())) for more in range(missing)]
        return one(frames_of(body, np.setdiff1d(np.arange(len(body.root)), gone), 60.0), body)

    return defect


def of_stature(stature: float, unit: float) -> Defect:
    """A person of a stature, m, in a file of a unit, m."""

    def defect(body: Body) -> Spoilt:
        marks = body.landmarks()
        leg = sum(
            np.linalg.norm(marks[f"l{a}"] - marks[f"l{b}"], axis=-1).mean() for a, b in (("hip", "kne"), ("kne", "ank"))
        )
        return one(scaled(hahne(body), stature * 0.491 / leg), style=Style(unit=unit))

    return defect


def path_times(times: float) -> Defect:
    return lambda body: one(replace(hahne(body), root=times * body.root), hahne(body))


def without_height(height: float | None) -> Defect:
    """The hips stay at one height, and with None in one place."""

    def defect(body: Body) -> Spoilt:
        body = hahne(body)
        root = np.zeros_like(body.root) if height is None else body.root * [1.0, 0.0, 1.0] + [0.0, height, 0.0]
        return one(replace(body, root=root), body, height=False)

    return defect


def raised(by: float) -> Defect:
    return lambda body: one(moved(hahne(body), [0.0, by, 0.0]), hahne(body))


def tilted(degrees: float, axis: str) -> Defect:
    def defect(body: Body) -> Spoilt:
        body, by = hahne(body), Rotation.from_euler(axis, degrees, degrees=True)
        return one(replace(body, turn=[by * own for own in body.turn], root=by.apply(body.root)), body)

    return defect


def drifting(speed: float) -> Defect:
    def defect(body: Body) -> Spoilt:
        body = hahne(body)
        time = np.arange(len(body.root)) / body.rate
        return one(replace(body, root=body.root + speed * time[:, None] * [0.0, 1.0, 0.0]), body)

    return defect


def without(body: Body, gone: Collection[str]) -> Body:
    """The body without some bones and all beyond them."""
    kept: list[int] = []
    for joint, above in enumerate(body.parent):
        if body.bone[joint] not in gone and (above < 0 or above in kept):
            kept.append(joint)
    place = {joint: index for index, joint in enumerate(kept)} | {-1: -1}
    ends = {place[joint]: end for joint, end in body.end.items() if joint in kept}
    for joint in kept:
        if place[joint] not in ends and not any(body.parent[other] == joint for other in kept):
            ends[place[joint]] = body.offset[body.parent.index(joint)]
    return replace(
        body,
        names=[body.names[joint] for joint in kept],
        bone=[body.bone[joint] for joint in kept],
        parent=[place[body.parent[joint]] for joint in kept],
        offset=body.offset[kept],
        end=ends,
        turn=[body.turn[joint] for joint in kept],
    )


def lacking(*bones: str, names: str = "", says: str = "leg") -> Defect:
    return lambda body: refused(without(renamed(body, VOCABULARIES[names] if names else HAHNE), bones), says)


def longer(bone: str, times: float) -> Defect:
    def defect(body: Body) -> Spoilt:
        body = hahne(body)
        offset = body.offset.copy()
        offset[body.parent.index(body.bone.index(bone))] *= times
        return refused(replace(body, offset=offset), "--rename")

    return defect


def dog(body: Body) -> Spoilt:
    """A made-up dog that swings its legs."""
    joints = [
        ("Hips", -1, (0, 0, 0)),
        ("Spine", 0, (0, 0.02, 0.3)),
        ("Chest", 1, (0, 0, 0.3)),
        ("Neck", 2, (0, 0.15, 0.12)),
    ]
    joints += [("Head", 3, (0, 0.1, 0.1)), ("Tail", 0, (0, 0.05, -0.15)), ("Tail2", 5, (0, 0, -0.2))]
    for side, x in (("L", 0.1), ("R", -0.1)):
        for part, above in (("Hind", 0), ("Front", 2)):
            first = len(joints)
            joints += [
                (f"{part}Upper_{side}", above, (x, -0.05, 0.0)),
                (f"{part}Lower_{side}", first, (0, -0.22, 0.03)),
            ]
            joints += [(f"{part}Paw_{side}", first + 1, (0, -0.22, -0.03))]
    names = [name for name, *_ in joints]
    time = np.arange(len(body.root)) / body.rate
    turn = [Rotation.identity(len(time)) for _ in joints]
    for place, name in enumerate(names):
        if "Upper" in name:
            swing = 0.4 * np.sin(6.0 * time + (0.0 if ("L" in name) == ("Hind" in name) else np.pi))
            turn[place] = Rotation.from_rotvec(swing[:, None] * [1.0, 0.0, 0.0])
        elif joints[place][1] >= 0:
            turn[place] = turn[joints[place][1]]
    root = np.column_stack([np.zeros_like(time), np.full_like(time, 0.55), 0.8 * time])
    above = [parent for _, parent, _ in joints]
    ends = {place: np.array([0.0, 0.0, 0.08]) for place in range(len(joints)) if place not in above}
    offset = np.array([way for *_, way in joints], dtype=float)
    return refused(Body(names, ["root", *names[1:]], above, offset, ends, turn, root, body.rate), "--rename", "leg")


def points(body: Body) -> tuple[list[str], np.ndarray]:
    """Names of joints, and where they are, (T, J, 3), m, z up."""
    marks = body.landmarks()
    names = [f"{side.upper()}{label}" for side in "lr" for label in JOINTS.values()]
    tracks = [marks[side + end] for side in "lr" for end in JOINTS]
    return ["Neck", *names], np.stack([marks["neck"], *tracks], axis=1)


def duo(between: str, size: float = 0.9) -> Defect:
    """Two people in a file of points in joints (TRC)."""

    def defect(body: Body) -> Spoilt:
        people = {"Anna": hahne(body), "Ben": moved(scaled(hahne(body), size), [1.5, 0.0, 0.5])}
        labels = [f"{name}{between}{joint}" for name, own in people.items() for joint in points(own)[0]]
        places = np.concatenate([points(own)[1] for own in people.values()], axis=1)
        count, rate = len(places), body.rate
        lines = [
            "PathFileType\t4\t(X/Y/Z)\tduo.trc",
            "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
            f"{rate:g}\t{rate:g}\t{count}\t{len(labels)}\tmm\t{rate:g}\t1\t{count}",
            "Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t",
            "\t\t" + "\t".join(f"{axis}{number}" for number in range(1, len(labels) + 1) for axis in "XYZ"),
            "",
        ]
        for frame, row in enumerate(places):
            lines.append("\t".join([str(frame + 1), f"{frame / rate:.5f}", *(f"{1000 * v:.4f}" for v in row.ravel())]))
        return Spoilt("\n".join(lines) + "\n", people, suffix=".trc")

    return defect


def two_roots(body: Body) -> Spoilt:
    """Two people in a BVH, with joints of the same names."""
    people = {"Hips": hahne(body), "Hips 2": moved(scaled(hahne(body), 0.9), [1.5, 0.0, 0.5])}
    (head, rows), (second, more) = (bvh(one).split("MOTION\n") for one in people.values())
    lines = [" ".join(both) for both in zip(rows.splitlines()[2:], more.splitlines()[2:], strict=True)]
    text = [head + second.removeprefix("HIERARCHY\n") + "MOTION", *rows.splitlines()[:2], *lines]
    return Spoilt("\n".join(text) + "\n", people)


ISSUE: dict[str, Defect] = {
    "every frame twice, 30 in 60 Hz": held(30.0, 60.0),
    "two people in a marker file, Anna:LKnee": duo(":"),
    "a tall adult in inches": of_stature(2.1, INCH),
    "a small child in inches": of_stature(0.95, INCH),
    "the path in m, bones in cm": path_times(0.01),
    "hip-centred": without_height(None),
    "hips at 0.03 m": without_height(0.03),
    "no legs": lacking("lhipjoint", "rhipjoint"),
    "one arm": lacking("lclavicle", says="arm"),
    "a made-up dog": dog,
    "a floor that slopes by 5 degrees": tilted(5.0, "x"),
    "a floor that drifts by 0.1 m/s": drifting(0.1),
    "a floor 0.5 m too low": raised(-0.5),
}
FURTHER: dict[str, Defect] = {
    "30 in 120 Hz": held(30.0, 120.0),
    "24 in 60 Hz": held(24.0, 60.0),
    "25 in 30 Hz": held(25.0, 30.0),
    "50 in 60 Hz": held(50.0, 60.0),
    "one frame in 25 repeats": stuttering,
    "a frame missing twice": dropped(1),
    "3 frames missing twice": dropped(3),
    "an adult in inches": of_stature(1.75, INCH),
    "a child of 0.8 m in inches": of_stature(0.8, INCH),
    "a child of 1.1 m in cm": of_stature(1.1, 0.01),
    "an adult of 2.2 m in mm": of_stature(2.2, 0.001),
    "the path in mm, bones in m": path_times(1000.0),
    "the path in cm, bones in m": path_times(100.0),
    "hips at 0.9 m all the time": without_height(0.9),
    "a floor 0.5 m too high": raised(0.5),
    "a floor at 12 m": raised(12.0),
    "a floor that slopes by 8 degrees aside": tilted(8.0, "z"),
    "a floor that slopes by 3 degrees": tilted(-3.0, "x"),
    "a floor that sinks by 0.05 m/s": drifting(-0.05),
    "no legs, other names": lacking("lhipjoint", "rhipjoint", names="Roblox"),
    "no arms": lacking("lclavicle", "rclavicle", says="arm"),
    "one leg": lacking("rhipjoint"),
    "no shanks": lacking("ltibia", "rtibia"),
    "two roots": two_roots,
    "two people, Anna_LKnee": duo("_"),
    "a person and a child, Anna|LKnee": duo("|", 0.6),
    "a forearm twice as long": longer("lradius", 2.0),
    "a shank half as long": longer("rtibia", 0.5),
    "angles in radians": lambda body: refused(hahne(body), "radians", style=Style(radians=True)),
    "left and right exchanged": lambda body: refused(renamed(body, HAHNE | {"sides": "Right Left"}), "exchanged"),
    "lost for 10 frames": lambda body: refused(lost(hahne(body), 60, 70), "jumps", "elsewhere"),
    "a spike of an arm": lambda body: refused(limb_spiked(hahne(body), 70), "elsewhere", "jumps"),
}
