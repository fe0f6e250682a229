"""Rig files: the servo, port and limits of each joint of a robot."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from hardware.errors import RigError
from hardware.families.family import Family
from hardware.rig.rig_joint import RigJoint
from motiondeck_base.toml_file import read_toml

_WATCHDOG_UNIT = 0.02  # s, in which the servos count
BAUD_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)


class FollowConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How joints follow their targets."""

    learn: bool = False  # whether what they are still off, in each motion and phase, is learned while they play


class GazeConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How joints look somewhere: the angle of each per angle of the gaze."""

    pan: dict[str, float] = {}  # to the left
    tilt: dict[str, float] = {}  # up


class RigConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A rig file's contents."""

    # Of the serial adapter, such as /dev/ttyUSB0, for joints that name no other.
    port: Annotated[str, msgspec.Meta(min_length=1)]
    baud: int  # of the bus, bits/s
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=1000)]  # how often targets are sent
    joints: Annotated[tuple[RigJoint, ...], msgspec.Meta(min_length=1)]  # in the order of every array about this rig
    # Silence on the bus after which the servos' own watchdogs stop them; at least 1.5 ticks and 20 ms.
    watchdog_ms: Annotated[int, msgspec.Meta(ge=20, le=2540)] = 200
    # How often the state is read; 0 for as often as targets are sent.
    read_hz: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    on_exit: Literal["off", "hold"] = "off"  # what the servos do in the end: "off", or "hold" where they are
    # What happens when a joint is lost for good: "stop" the rig, or "go on" without it.
    on_loss: Literal["stop", "go on"] = "stop"
    # How long a vanished port may take to come back; 0 to stop at once.
    reconnect_s: Annotated[float, msgspec.Meta(ge=0, le=3600)] = 10.0
    follow: FollowConfig = FollowConfig()  # how joints follow their targets
    groups: dict[str, tuple[str, ...]] = {}  # joints that layers play on, by the name of their group
    gaze: GazeConfig = GazeConfig()  # how joints look somewhere
    board: str = ""  # the serial port of a board with the exported sketch, if that plays the servos
    model: str = ""  # an MJCF or URDF file with these joints, relative to this file's folder, to show the rig

    def __post_init__(self) -> None:
        if self.baud not in BAUD_RATES:
            raise ValueError(f"baud {self.baud} is not one of {', '.join(map(str, BAUD_RATES))}")
        if self.watchdog_ms < (shortest := round(1e3 * _WATCHDOG_UNIT) + math.ceil(1.5e3 / self.rate_hz)):
            raise ValueError(
                f"watchdog_ms {self.watchdog_ms} is too short for rate_hz {self.rate_hz:g}: the servos would stop "
                f"between two targets. It must be at least {shortest}"
            )
        if not 0 <= self.read_hz <= self.rate_hz:
            raise ValueError(f"read_hz {self.read_hz:g} must be from 0 to rate_hz, {self.rate_hz:g}")
        for number, joint in enumerate(self.joints, 1):
            if joint.table.baud_value(self.baud) is None:
                raise ValueError(f"joint {number} ({joint.name}): model '{joint.model}' cannot do {self.baud} baud")
        for port in self.ports:
            ids = [[servo.id for servo in one.servos if self._port_of(one) == port] for one in self.joints]
            self._refuse_doubles("id", ids)
        self._refuse_doubles("name", [(joint.name,) for joint in self.joints])

    @property
    def names(self) -> tuple[str, ...]:
        """The joints' names, in order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def ports(self) -> tuple[str, ...]:
        """The ports its joints are on, each once, in order."""
        return tuple(dict.fromkeys(self._port_of(joint) for joint in self.joints))

    @property
    def parts(self) -> tuple[RigConfig, ...]:
        """The joints of each port as a rig of one port, in the order of `ports`."""
        parts = []
        for port in self.ports:
            joints = tuple(msgspec.structs.replace(one, port="") for one in self.joints if self._port_of(one) == port)
            parts.append(msgspec.structs.replace(self, port=port, joints=joints))
        return tuple(parts)

    def on_ports(self, ports: Sequence[str] = ()) -> tuple[RigConfig, ...]:
        """As `parts`, on these ports in place of the rig file's own if any; RigError if their number is another one."""
        if ports and len(ports) != len(self.ports):
            raise RigError(f"the rig has {len(self.ports)} ports ({', '.join(self.ports)}), {len(ports)} were given.")
        return tuple(
            msgspec.structs.replace(part, port=port) for part, port in zip(self.parts, ports or self.ports, strict=True)
        )

    @property
    def watchdog_units(self) -> int:
        """The silence of `watchdog_ms` as the servos' watchdogs count it."""
        return round(self.watchdog_ms * 1e-3 / _WATCHDOG_UNIT)

    @property
    def patience(self) -> float:
        """The silence after which the servos count as stopped, s."""
        # It is one unit shorter than theirs: rather stopped here and not there than the reverse.
        return self.watchdog_ms * 1e-3 - _WATCHDOG_UNIT

    @property
    def families(self) -> dict[int, Family]:
        """The family of each ID, for the rig of one port."""
        return {joint.id: joint.table.family for joint in self.servos.joints}

    @property
    def servos(self) -> RigConfig:
        """The rig with each servo as a joint, those of one joint one after the other."""
        if all(joint.second is None for joint in self.joints):
            return self
        return msgspec.structs.replace(self, joints=tuple(servo for joint in self.joints for servo in joint.servos))

    @property
    def joint_of(self) -> list[int]:
        """The index of the joint of each servo in `servos`."""
        names = [servo.joint_name for servo in self.servos.joints]
        order = list(dict.fromkeys(names))
        return [order.index(name) for name in names]

    @property
    def through_turns(self) -> list[int]:
        """The indices of the joints that go through several turns of their horns."""
        return [index for index, joint in enumerate(self.joints) if joint.several_turns]

    def only(self, joints: Sequence[int]) -> RigConfig:
        """The rig reduced to the joints with these indices."""
        return msgspec.structs.replace(self, joints=tuple(self.joints[index] for index in joints))

    def _port_of(self, joint: RigJoint) -> str:
        return joint.port or self.port

    def _refuse_doubles(self, key: str, values: Sequence[Sequence[object]]) -> None:
        twice = [value for value, count in Counter(one for own in values for one in own).items() if count > 1]
        if twice:
            where = ", ".join(
                f"joint {number} ({joint.name}, id {joint.id})"
                for number, (joint, own) in enumerate(zip(self.joints, values, strict=True), 1)
                if set(own) & set(twice)
            )
            raise ValueError(f"{key} {', '.join(map(str, twice))} is used more than once: {where}.")


def load_rig(path: str | Path) -> RigConfig:
    """Reads a rig file; FileFormatError if it cannot be read or is not TOML, for unknown keys or impossible values."""
    return read_toml(Path(path), RigConfig)
