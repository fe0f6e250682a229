"""Trackers: points of a person's body or angles of a rig arrive by UDP, as JSON or VMC, and lead the deck.

VMC is OSC: /VMC/Ext/{Tra,Hmd,Con}/Pos has the place of a device by its serial number, /VMC/Ext/Bone/Pos the place and
rotation of a bone in its parent, with Unity's axes (x right, y up, z forward) and names of bones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import msgspec
import numpy as np

from controller.deck.person_follower import PersonFollower
from controller.deck.phase_filter import RATE
from controller.motion.rotations import Array, multiply, rotate
from controller.wire.messages.commands import FollowPerson, LockPhase
from motiondeck.stage.command_pattern import Notify, Signal
from motiondeck.stage.osc import LoopbackPort

SEEN_FOR = 0.1  # s for which a point counts after it was seen
MOST_STEPS = 15  # of a silence; the filter has forgotten by then
_DEVICES = {"/VMC/Ext/Tra/Pos", "/VMC/Ext/Hmd/Pos", "/VMC/Ext/Con/Pos"}
_ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand"), ("", "sho", "elb", "wri")
_LEG = ("UpperLeg", "LowerLeg", "Foot", "Toes"), ("hip", "kne", "ank", "foo")
_TRUNK = ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"), ("root", "", "", "", "", "head")
_SIDES = [(side, *limb) for side in ("Left", "Right") for limb in (("UpperChest", *_ARM), ("Hips", *_LEG))]
_PARENT, _POINT = dict[str, str](), dict[str, str]()  # of each bone the one above, and the point where it begins
for _side, _first, _bones, _points in (("", "", *_TRUNK), *_SIDES):
    _names = [_side + bone for bone in _bones]
    _PARENT |= zip(_names, [_first, *_names], strict=False)
    _POINT |= {name: _side[:1].lower() + point for name, point in zip(_names, _points, strict=True) if point}


class _Datagram(msgspec.Struct, forbid_unknown_fields=True):
    points: dict[str, tuple[float, float, float]] = {}  # m, z up
    angles: dict[str, float] = {}  # of a rig's joints, rad


class TrackerInput(LoopbackPort):
    """What a person does, as commands to follow them; devices have the names of points in `names`."""

    def __init__(self, port: int, follower: PersonFollower, names: Mapping[str, str], notify: Notify) -> None:
        super().__init__(port, "trackers", "[tracker]", notify)
        self._follower, self._names = follower, names
        self._json = msgspec.json.Decoder(_Datagram)
        self._points: dict[str, tuple[float, Sequence[float]]] = {}  # when each was seen, and where, m, z up
        self._bones: dict[str, tuple[Array, Array]] = {}  # place and rotation of each in its parent, by Unity's axes
        self._at: float | None = None  # until when the filter has gone

    def read(self, now: float) -> Iterator[Signal]:
        """The person's place in a motion, after what has arrived; the first time also the lock to them."""
        for data in self.datagrams("tracker data"):
            self._take(data, now)
        if self._at is None:
            self._at = now - 1.0 / RATE
            yield Signal(now, "tracker", LockPhase("person"))
        steps = int((now - self._at) * RATE + 1e-6)
        self._at = self._at + steps / RATE if steps <= MOST_STEPS else now
        place = None
        for left in reversed(range(min(steps, MOST_STEPS))):
            place = self._follower.step({} if left else self._seen(now))
        if place is not None:
            motion, phase, tempo = place
            yield Signal(now, "tracker", FollowPerson(motion, phase, tempo, body=self._follower.body))

    def _seen(self, now: float) -> dict[str, Sequence[float]]:
        return {name: place for name, (at, place) in self._points.items() if now - at <= SEEN_FOR}

    def _take(self, data: bytes, now: float) -> None:
        if data[:1] == b"{":
            try:
                given = self._json.decode(data)
            except msgspec.MsgspecError as error:
                self._notify(f"tracker data that cannot be read was left out ({error})")
                return
            heights = {name: (0.0, 0.0, angle) for name, angle in given.angles.items()}
            self._points |= {name: (now, place) for name, place in (given.points | heights).items()}
            return
        bones = False
        for timed in self.messages(data):
            address, values = timed.message.address, timed.message.params
            if address not in _DEVICES and address != "/VMC/Ext/Bone/Pos":
                continue
            if len(values) != 8 or not isinstance(values[0], str) or not all(isinstance(v, float) for v in values[1:]):
                self._notify(f"{address} has a name and seven numbers; another was left out")
                continue
            place, (x, y, z, w) = np.array(values[1:4]), values[4:]
            if address in _DEVICES:
                self._points[self._names.get(values[0], values[0])] = now, _ours(place)
            elif values[0] in _PARENT:
                bones, self._bones[values[0]] = True, (place, np.array([w, x, y, z]))
        if bones:
            for bone, point in _POINT.items():
                if bone in self._bones:
                    self._points[point] = now, _ours(self._placed(bone)[0])

    def _placed(self, bone: str) -> tuple[Array, Array]:
        """Where a bone is, and its rotation, below the nearest bone above it that is sent."""
        place, rotation = self._bones[bone]
        above = _PARENT[bone]
        while above and above not in self._bones:
            above = _PARENT[above]
        if not above:
            return place, rotation
        to, turn = self._placed(above)
        return to + rotate(turn, place), multiply(turn, rotation)


def _ours(place: Array) -> tuple[float, float, float]:
    x, y, z = place.tolist()
    return z, -x, y
