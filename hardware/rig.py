"""Rig files: which servo on which port is which joint of a robot, and what it may do."""

from __future__ import annotations

import difflib
import math
import re
from collections import Counter
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from hardware.control_table.models import MODELS
from hardware.control_table.table import ControlTable
from hardware.errors import RigFileError

BAUD_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)


class RigJoint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One servo as a joint: angle = direction * (pulses - zero) * 2 pi / pulses_per_turn.

    Attributes:
        name: of the robot's joint.
        id: on the bus, 0 to 252.
        model: the maker's name, as in `MODELS`.
        direction: +1 or -1, which way the servo turns when the joint's angle grows.
        zero: the servo's position at angle 0, pulses.
        lower, upper: what the joint may do, rad; within the servo's one turn.
        velocity: its limit, rad/s.
    """

    name: str
    id: Annotated[int, msgspec.Meta(ge=0, le=252)]
    model: str
    direction: Literal[-1, 1]
    zero: int
    lower: float
    upper: float
    velocity: Annotated[float, msgspec.Meta(gt=0)]

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise ValueError(f"model '{self.model}' is unknown; known are {', '.join(MODELS)}")
        if not (math.isfinite(self.velocity) and self.lower < self.upper):
            raise ValueError("limits must be finite numbers with lower < upper")
        top = self.table.pulses_per_turn - 1
        low, high = sorted((self.pulses(self.lower), self.pulses(self.upper)))
        if not (low >= 0 and high <= top):
            raise ValueError(
                f"limits {self.lower} to {self.upper} rad with zero {self.zero} reach from {low:.0f} to {high:.0f} "
                f"pulses, outside the servo's one turn (0 to {top})"
            )

    @property
    def table(self) -> ControlTable:
        """The control table of this servo's model."""
        return MODELS[self.model]

    @property
    def pulses_per_radian(self) -> float:
        """Pulses for one rad, negative where the servo turns the other way."""
        return self.direction * self.table.pulses_per_turn / (2.0 * math.pi)

    def pulses(self, angle: float) -> float:
        """The servo's position (not rounded) at a joint angle in rad."""
        return self.zero + angle * self.pulses_per_radian


class RigConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A rig as its file says.

    Attributes:
        port: of the serial adapter, such as /dev/ttyUSB0.
        baud: of the bus, bits/s.
        rate_hz: how often targets are sent.
        joints: in the order of every array about this rig.
        watchdog_ms: silence on the bus after which the servos stop by themselves; 20 to 2540.
    """

    port: Annotated[str, msgspec.Meta(min_length=1)]
    baud: int
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=1000)]
    joints: Annotated[tuple[RigJoint, ...], msgspec.Meta(min_length=1)]
    watchdog_ms: Annotated[int, msgspec.Meta(ge=20, le=2540)] = 200

    def __post_init__(self) -> None:
        if self.baud not in BAUD_RATES:
            raise ValueError(f"baud {self.baud} is none of {', '.join(map(str, BAUD_RATES))}")
        models = {joint.model for joint in self.joints}
        if len(models) > 1:  # the loop reads and writes one block of addresses for all
            raise ValueError(f"one rig of several models ({', '.join(sorted(models))}) is not possible yet")
        for key in ("id", "name"):
            owners = Counter(getattr(joint, key) for joint in self.joints)
            twice = [str(value) for value, count in owners.items() if count > 1]
            if twice:
                who = ", ".join(
                    f"joint {number} ({joint.name}, id {joint.id})"
                    for number, joint in enumerate(self.joints, 1)
                    if str(getattr(joint, key)) in twice
                )
                raise ValueError(f"{key} {', '.join(twice)} is used more than once: {who}")

    @property
    def names(self) -> tuple[str, ...]:
        """The joints' names, in order."""
        return tuple(joint.name for joint in self.joints)


def load_rig(path: str | Path) -> RigConfig:
    """Reads a rig file.

    Raises:
        RigFileError: if it cannot be read, is no TOML, or says something unknown or impossible.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise RigFileError(f"cannot read the rig file {path}: {error.strerror}.") from error
    try:
        return msgspec.toml.decode(data, type=RigConfig)
    except msgspec.ValidationError as error:
        raise RigFileError(f"{path}: {_explain(str(error))}") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise RigFileError(f"{path} is no complete TOML file: {error}") from error


def _explain(message: str) -> str:
    """What msgspec found, with the place in the words of the file and with the allowed keys where one is unknown."""
    what, _, where = message.partition(" - at `$")
    place = re.sub(r"\[(\d+)\]", lambda found: f" {int(found[1]) + 1}", where.rstrip("`").lstrip("."))
    place = place.replace("joints ", "joint ", 1)
    unknown = re.search(r"unknown field `(.*)`", what)
    if unknown:
        keys = (RigJoint if where.startswith(".joints[") else RigConfig).__struct_fields__
        near = difflib.get_close_matches(unknown[1], keys, n=1)
        hint = f" Did you mean {near[0]}?" if near else ""
        what = f"unknown key '{unknown[1]}'.{hint} The keys here are {', '.join(keys)}"
    elif what.startswith("Invalid enum value"):
        what = f"{what.removeprefix('Invalid enum value ')} is not allowed; -1 and 1 are"
    return f"{place}: {what}." if place else f"{what}."
