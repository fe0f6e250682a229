"""Manual handling of an emulated rig, by commands. Only joints without torque are moved.

swing pan 0.5 tilt -0.2 every 2     to 0.5 rad from the present angle and back, every 2 s, until the next command
move pan 1.2 tilt 0 in 1.5          to these angles, rad, in 1.5 s
rest                                lets go
pull pan                            unplugs the servo's cable
plug pan                            and plugs it in
warm pan 70                         sets the servo's temperature, degC
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from hardware.emulator.bus import EmulatedBus
from hardware.errors import MotiondeckError
from hardware.rig.rig_file import RigConfig

HELP = (
    "commands: swing JOINT RAD ... every SECONDS; move JOINT RAD ... in SECONDS; rest; where; "
    "pull JOINT; plug JOINT; warm JOINT DEGC"
)


class HandlingError(MotiondeckError):
    """An unknown command, joint or number."""


class _Grip(NamedTuple):
    """A joint in a hand since a time, s, on a way, pulses, that takes some seconds there, or there and back."""

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


class Handling:
    """Moves horns that have no torque, unplugs and warms servos."""

    def __init__(self, config: RigConfig) -> None:
        self._joints = {joint.name: joint for joint in config.joints}
        self._bus = {joint.name: config.ports.index(joint.port or config.port) for joint in config.joints}
        self._turns: dict[str, float] = {}
        self._wanted: dict[str, tuple[float, float, bool]] = {}
        self._grips: dict[str, _Grip] = {}
        self._deeds: list[tuple[str, str, float]] = []

    def command(self, words: str) -> None:
        """Replaces the movement under way, or does something to a servo; HandlingError if the command is unknown."""
        verb, *rest = words.split() or [""]
        if verb == "rest" and not rest:
            self._wanted, self._grips = {}, {}
            return
        if (verb, len(rest)) in (("pull", 1), ("plug", 1), ("warm", 2)):
            self._deeds.append((verb, self._known(rest[0]), _number(rest[1], words) if verb == "warm" else 0.0))
            return
        word = {"swing": "every", "move": "in"}.get(verb)
        if word is None or len(rest) < 4 or len(rest) % 2 or rest[-2] != word:
            raise HandlingError(f"'{words}' is not understood. {HELP}")
        seconds = _number(rest[-1], words)
        if seconds <= 0.0:
            raise HandlingError(f"'{words}': {rest[-1]} s is no time")
        wanted: dict[str, tuple[float, float, bool]] = {}
        for name, angle in zip(rest[:-2:2], rest[1:-2:2], strict=True):
            wanted[self._known(name)] = (_number(angle, words), seconds, verb == "swing")
        self._wanted, self._grips = wanted, {}

    def _known(self, name: str) -> str:
        if name not in self._joints:
            raise HandlingError(f"there is no joint '{name}': {', '.join(self._joints)}")
        return name

    def where(self, buses: Sequence[EmulatedBus]) -> str:
        """The true joint angles, rad; a bus for each port of the rig."""
        places: list[str] = []
        for name, joint in self._joints.items():
            device = buses[self._bus[name]][joint.id]
            places.append(f"{name} {joint.angle(float(device.bank.shaft[device.row])):+.3f}")
        return " ".join(places)

    def move(self, buses: Sequence[EmulatedBus], now: float) -> None:
        """Moves the joints as commanded at the time `now`, s; a bus for each port of the rig."""
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
                # Angles are counted on from the turn in which the joint was first grasped.
                found = 0.0 if joint.several_turns else float(joint.whole_turns(start))
                turns = self._turns.setdefault(name, found)
                way = angle * joint.pulses_per_radian if swings else joint.pulses(angle) + turns - start
                grip = self._grips[name] = _Grip(now, start, way, seconds, swings)
            moved = grip.place(now) - shaft[row]
            shaft[row] += moved
            for other in joint.servos[1:]:
                second = buses[self._bus[name]][other.id]
                second.bank.shaft[second.row] += moved * joint.direction * other.direction


def _number(text: str, words: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise HandlingError(f"'{words}': '{text}' is not a number")
    return number
