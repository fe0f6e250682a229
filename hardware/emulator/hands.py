"""Hands on an emulated rig: what somebody does to its joints and servos, in words.

Hands move only joints that have no torque.

swing pan 0.5 tilt -0.2 every 2     to 0.5 rad from where it is and back, every 2 s, until it is told otherwise
move pan 1.2 tilt 0 in 1.5          to these angles, rad, in 1.5 s
rest                                lets go
pull pan                            takes the servo's cable out
plug pan                            and puts it back
warm pan 70                         has the servo at so many degC
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from hardware.emulator.bus import EmulatedBus
from hardware.errors import MotiondeckError
from hardware.rig.rig_file import RigConfig, RigJoint

HELP = (
    "hands: swing JOINT RAD ... every SECONDS; move JOINT RAD ... in SECONDS; rest; where; "
    "pull JOINT; plug JOINT; warm JOINT DEGC"
)


class HandsError(MotiondeckError):
    """Words that hands do not understand."""


class _Grip(NamedTuple):
    """A joint in a hand.

    Attributes:
        since: when it was taken, s.
        start: where it stood then, pulses.
        way: how far it is moved, pulses.
        seconds: for the way there, or there and back.
        swings: whether it comes back, again and again.
    """

    since: float
    start: float
    way: float
    seconds: float
    swings: bool

    def place(self, now: float) -> float:
        """Where the joint is at a time, pulses."""
        passed = (now - self.since) / self.seconds
        share = math.sin(math.pi * passed) ** 2 if self.swings else math.sin(0.5 * math.pi * min(1.0, passed)) ** 2
        return self.start + self.way * share


class Hands:
    """Moves horns that have no torque, and does things to servos."""

    def __init__(self, config: RigConfig) -> None:
        self._joints = {joint.name: joint for joint in config.joints}
        self._bus = {joint.name: config.ports.index(joint.port or config.port) for joint in config.joints}
        self._turns: dict[str, float] = {}
        self._wanted: dict[str, tuple[float, float, bool]] = {}
        self._grips: dict[str, _Grip] = {}
        self._deeds: list[tuple[str, str, float]] = []

    def tell(self, words: str) -> None:
        """Does something else from now on.

        Raises:
            HandsError: if the words are not understood; it names what is.
        """
        verb, *rest = words.split() or [""]
        if verb == "rest" and not rest:
            self._wanted, self._grips = {}, {}
            return
        if (verb, len(rest)) in (("pull", 1), ("plug", 1), ("warm", 2)):
            self._deeds.append((verb, self._known(rest[0]), _number(rest[1], words) if verb == "warm" else 0.0))
            return
        word = {"swing": "every", "move": "in"}.get(verb)
        if word is None or len(rest) < 4 or len(rest) % 2 or rest[-2] != word:
            raise HandsError(f"'{words}' is not understood. {HELP}")
        seconds = _number(rest[-1], words)
        if seconds <= 0.0:
            raise HandsError(f"'{words}': {rest[-1]} s is no time")
        wanted: dict[str, tuple[float, float, bool]] = {}
        for name, angle in zip(rest[:-2:2], rest[1:-2:2], strict=True):
            wanted[self._known(name)] = (_number(angle, words), seconds, verb == "swing")
        self._wanted, self._grips = wanted, {}

    def _known(self, name: str) -> str:
        if name not in self._joints:
            raise HandsError(f"there is no joint '{name}': {', '.join(self._joints)}")
        return name

    def where(self, buses: Sequence[EmulatedBus]) -> str:
        """Where the joints really are, rad; a bus for each port of the rig."""
        places: list[str] = []
        for name, joint in self._joints.items():
            device = buses[self._bus[name]][joint.id]
            shaft = float(device.bank.shaft[device.row])
            places.append(f"{name} {(shaft - joint.zero) / joint.pulses_per_radian:+.3f}")
        return " ".join(places)

    def move(self, buses: Sequence[EmulatedBus], now: float) -> None:
        """Brings the joints where the hands have them at the time `now`, s; a bus for each port of the rig."""
        while self._deeds:
            verb, name, value = self._deeds.pop(0)
            device = buses[self._bus[name]][self._joints[name].id]
            if verb == "warm":
                device.bank.drive.temperature[device.row] = value
            else:
                device.dead = verb == "pull"
        for name, (angle, seconds, swings) in self._wanted.items():
            joint = self._joints[name]
            device = buses[self._bus[name]][joint.id]
            if device.torque:
                self._grips.pop(name, None)
                self._turns.pop(name, None)
                continue
            shaft, row = device.bank.shaft, device.row
            grip = self._grips.get(name)
            if grip is None:
                start = float(shaft[row])
                # Angles are counted on from the turn in which a hand first found the joint.
                turns = self._turns.setdefault(name, _whole_turns(joint, start))
                way = angle * joint.pulses_per_radian if swings else joint.pulses(angle) + turns - start
                grip = self._grips[name] = _Grip(now, start, way, seconds, swings)
            shaft[row] = grip.place(now)


def _whole_turns(joint: RigJoint, start: float) -> float:
    """The pulses of the whole turns that a position is away from the servo's one turn."""
    turn = joint.table.pulses_per_turn
    return math.floor((start - joint.table.one_turn[0]) / turn) * turn


def _number(text: str, words: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise HandsError(f"'{words}': '{text}' is not a number")
    return number
