"""Recordings of Acclaim as trees of joints that can be changed as other programs would write them, and written as BVH.

All of it with scipy alone, so that where the joints are is known without the readers that are judged. Axes are the
file's, y up unless a change says otherwise; m, degrees only in files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from benchmarks.recordings.independent_readings import amc_bones

Y, Z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
TO_OURS = {"y": [2, 0, 1], "z": [0, 1, 2]}


@dataclass(frozen=True)
class Body:
    """Joints, parents first, over T frames.

    Attributes:
        names: in the file.
        bone: of each joint, the bone of the .asf that begins there, whatever the joint is called.
        parent: of each joint; -1 for the first.
        offset: from the parent in the zero pose, shape (J, 3), m.
        end: of joints without others below them, the End Site's offset.
        turn: world rotation of each joint over time.
        root: where the hips are, shape (T, 3), m; a joint above them stands at the origin.
        rate: Hz.
        up: the file's axis that is up.
    """

    names: list[str]
    bone: list[str]
    parent: list[int]
    offset: np.ndarray
    end: dict[int, np.ndarray]
    turn: list[Rotation]
    root: np.ndarray
    rate: float = 120.0
    up: str = "y"

    def places(self) -> list[np.ndarray]:
        """Where each joint is, (T, 3)."""
        place: list[np.ndarray] = []
        for joint, above in enumerate(self.parent):
            if self.bone[joint] == "root":
                place.append(self.root)
            elif above < 0:
                place.append(np.zeros_like(self.root))
            else:
                place.append(place[above] + self.turn[above].apply(self.offset[joint]))
        return place

    def landmarks(self) -> dict[str, np.ndarray]:
        """Where the canonical bones of limbs and neck end, and the root, in our axes, by name, (T, 3)."""
        place = self.places()
        at = dict(zip(self.bone, place, strict=True))
        ends = {"hip": "femur", "kne": "tibia", "ank": "foot", "sho": "humerus", "elb": "radius", "wri": "wrist"}
        found = {side + end: at[side + bone] for side in "lr" for end, bone in ends.items()}
        found |= {"neck": at["lowerneck"], "root": at["lowerback"]}
        return {name: track[:, TO_OURS[self.up]] for name, track in found.items()}


def of_acclaim(asf: Path, amc: Path, frames: slice = slice(None)) -> Body:
    """The joints of an .asf, each where its bone begins; fingers, hands and thumbs are ends."""
    places, turns, vectors, parents = amc_bones(asf.read_text("latin-1"), amc.read_text("latin-1"), frames)
    left_out = {side + bone for side in "lr" for bone in ("hand", "fingers", "thumb")}
    bones = ["root", *(bone for bone in parents if bone not in left_out)]
    above = {bone: bones.index(parents[bone]) if bone != "root" else -1 for bone in bones}
    offset = np.array([vectors.get(parents.get(bone, ""), np.zeros(3)) for bone in bones])
    ends = {index: vectors[bone] for index, bone in enumerate(bones) if index not in {above[other] for other in bones}}
    turn = [turns[bone] for bone in bones]
    return Body(list(bones), bones, [above[bone] for bone in bones], offset, ends, turn, places["root"])


def renamed(body: Body, names: Mapping[str, str]) -> Body:
    """With other names; sides are put where a name has {}: as left, right by `names["sides"]`."""
    left, right = names["sides"].split()
    found = []
    for bone in body.bone:
        if bone in names:
            found.append(names[bone])
        else:
            found.append(names[bone[1:]].format(left if bone[0] == "l" else right))
    return replace(body, names=found)


def rezeroed(body: Body, turns: Callable[[str], Rotation] | Sequence[Rotation]) -> Body:
    """The same motion of a file whose zero pose is another: each joint's own turned by a rotation."""
    by = [turns(bone) for bone in body.bone] if callable(turns) else list(turns)
    offset = np.array(
        [
            by[above].apply(body.offset[joint]) if above >= 0 else body.offset[joint]
            for joint, above in enumerate(body.parent)
        ]
    )
    ends = {joint: by[joint].apply(end) for joint, end in body.end.items()}
    turn = [own * k.inv() for own, k in zip(body.turn, by, strict=True)]
    return replace(body, offset=offset, end=ends, turn=turn)


def world_turned(body: Body, by: Rotation, up: str) -> Body:
    """The motion in other axes; the zero pose stays as it is."""
    return replace(body, turn=[by * own for own in body.turn], root=by.apply(body.root), up=up)


def moved(body: Body, by: Sequence[float]) -> Body:
    """The motion elsewhere."""
    return replace(body, root=body.root + np.array(by))


def scaled(body: Body, by: float) -> Body:
    """A larger or smaller body that moves alike."""
    ends = {joint: by * end for joint, end in body.end.items()}
    return replace(body, offset=by * body.offset, end=ends, root=by * body.root)


def at_rate(body: Body, rate: float) -> Body:
    """The motion at another rate, between frames by great circles."""
    frames = len(body.root)
    own = np.arange(frames) / body.rate
    times = np.arange(int(np.floor(own[-1] * rate + 1e-9)) + 1) / rate
    root = np.stack([np.interp(times, own, body.root[:, axis]) for axis in range(3)], axis=1)
    return replace(body, turn=[Slerp(own, turn)(times) for turn in body.turn], root=root, rate=rate)


def below(body: Body, name: str) -> Body:
    """The body below a still joint on the floor, which carries it by position channels."""
    names, bones = [name, *body.names], ["", *body.bone]
    parent = [-1, *(above + 1 for above in body.parent)]
    still = Rotation.identity(len(body.root))
    offset = np.vstack([np.zeros(3), body.offset])
    offset[1] = body.root[0]
    end = {joint + 1: vector for joint, vector in body.end.items()}
    return replace(body, names=names, bone=bones, parent=parent, offset=offset, end=end, turn=[still, *body.turn])


def with_joint(body: Body, bone: str, name: str, along: float) -> Body:
    """With a joint that goes along with a bone: at its beginning, or this share of the way to its end."""
    at = body.bone.index(bone)
    child = body.parent.index(at)
    vector = body.offset[child]
    shift = [above + (above > at) for above in body.parent]
    parent = [*shift[: at + 1], at, *shift[at + 1 :]]
    offset = np.insert(body.offset, at + 1, along * vector, axis=0)
    end = {joint + (joint > at): v for joint, v in body.end.items()}
    for joint, above in enumerate(body.parent):
        if above == at:
            parent[joint + 1] = at + 1
            offset[joint + 1] = body.offset[joint] - along * vector
    return replace(
        body,
        names=[*body.names[: at + 1], name, *body.names[at + 1 :]],
        bone=[*body.bone[: at + 1], "", *body.bone[at + 1 :]],
        parent=parent,
        offset=offset,
        end=end,
        turn=[*body.turn[: at + 1], body.turn[at], *body.turn[at + 1 :]],
    )


@dataclass(frozen=True)
class Style:
    """How a BVH is written.

    Attributes:
        unit: what one length is, m.
        order: of the rotations, of each joint in turn.
        positions: which joints have position channels: "root", "all", "none"; "zeros": all, but only the root's mean
            something; "carrier": the first two.
        rotations_first: whether rotation channels come before those of position.
        number: how numbers are written.
        ends: whether there are End Sites.
        root_offset: whether the OFFSET of the root is where it is in the first frame.
        radians: whether angles are.
    """

    unit: float = 0.01
    order: Sequence[str] = ("ZXY",)
    positions: str = "root"
    rotations_first: bool = False
    number: str = "{:.6f}"
    ends: bool = True
    root_offset: bool = False
    radians: bool = False


def bvh(body: Body, style: Style = Style()) -> str:
    """The body as a BVH file."""
    below_of = [[j for j, above in enumerate(body.parent) if above == joint] for joint in range(len(body.names))]
    lines, columns, places = ["HIERARCHY"], [], body.places()

    def numbers(values):
        return " ".join(style.number.format(value) for value in values)

    def add(joint: int, depth: int) -> None:
        pad = "\t" * depth
        above = body.parent[joint]
        lines.append(f"{pad}{'ROOT' if above < 0 else 'JOINT'} {body.names[joint]}")
        offset = body.root[0] if above < 0 and style.root_offset else body.offset[joint]
        lines.extend([f"{pad}{{", f"{pad}\tOFFSET {numbers(offset / style.unit)}"])
        order = style.order[joint % len(style.order)]
        has = {"root": above < 0, "none": False, "carrier": joint < 2}.get(style.positions, True)
        turns = [f"{axis}rotation" for axis in order]
        moves = ["Xposition", "Yposition", "Zposition"] if has else []
        names = [*turns, *moves] if style.rotations_first else [*moves, *turns]
        lines.append(f"{pad}\tCHANNELS {len(names)} {' '.join(names)}")
        own = body.turn[joint] if above < 0 else body.turn[above].inv() * body.turn[joint]
        angles = own.as_euler(order, degrees=not style.radians)
        place = places[joint] if above < 0 else body.turn[above].inv().apply(places[joint] - places[above])
        if style.positions == "zeros" and above >= 0:
            place = np.zeros_like(place)
        place = place / style.unit
        track = [angles, place] if style.rotations_first else [place, angles]
        columns.append(np.hstack(track if has else [angles]))
        for child in below_of[joint]:
            add(child, depth + 1)
        if not below_of[joint] and style.ends:
            end = numbers(body.end[joint] / style.unit)
            lines.extend([f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET {end}", f"{pad}\t}}"])
        lines.append(f"{pad}}}")

    add(0, 0)
    values = np.hstack(columns)
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1.0 / body.rate:.7f}"]
    lines += [numbers(row) for row in values]
    return "\n".join(lines) + "\n"
