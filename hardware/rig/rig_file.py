"""Rig files: the servo, port and limits of each joint of a robot."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from hardware.errors import RigError, RigFileError
from hardware.families.models import MODELS, TRAITS, WHY_NO_JOINT
from hardware.families.table import ControlTable
from motiondeck_base.errors import FileFormatError
from motiondeck_base.file_numbers import SMALLEST, impossible_numbers
from motiondeck_base.file_words import in_file_words
from motiondeck_base.near_names import did_you_mean
from motiondeck_base.toml_file import parse_toml

_DRIVEN = "the XL-320 and servos of the X, MX, AX, RX, P and PRO(A) series"
_GAINS = ("position_p_gain", "position_i_gain", "position_d_gain")
_WATCHDOG_UNIT = 0.02  # s, in which the servos count
_QUOTED = re.compile(r'"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'')
POSITION_MODE = 3
"""The operating mode of a joint without a limit of current."""
BAUD_RATES = (9600, 57600, 115200, 1_000_000, 2_000_000, 3_000_000, 4_000_000)


class RigJoint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One servo as a joint: angle = direction * (pulses - zero) * 2 pi / (pulses_per_turn * gear).

    Attributes:
        name: the robot's joint.
        id: on the bus, 0 to 252.
        model: the maker's name, as in `MODELS`.
        direction: +1 or -1, which way the servo turns when the joint's angle grows.
        zero: the servo's position at angle 0, pulses.
        lower, upper: position limits, rad; within the servo's one turn.
        velocity: its limit, rad/s.
        acceleration: its limit, rad/s^2; 0 for none.
        current: its limit, A, that the servo itself keeps; 0 for none.
        gear: turns of the horn for one turn of the joint.
        lag: how long after a target the shaft is there, s; 0 if that is not known.
        port: of the serial adapter that its servo is on; the rig's own if empty.
        position_p_gain, position_i_gain, position_d_gain: counts of these registers; what the servo has if None.
        lag: how late its shaft is behind its targets while it plays, s; see `tools.identify`.
        friction: the current that turns it slowly without a load, A; None where it is unknown.
    """

    name: str
    id: Annotated[int, msgspec.Meta(ge=0, le=252)]
    model: str
    direction: Literal[-1, 1]
    zero: int
    lower: float
    upper: float
    velocity: Annotated[float, msgspec.Meta(gt=0)]
    acceleration: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    current: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    gear: Annotated[float, msgspec.Meta(gt=0)] = 1.0
    lag: Annotated[float, msgspec.Meta(ge=0, le=0.5)] = 0.0
    port: str = ""
    position_p_gain: Annotated[int, msgspec.Meta(ge=0)] | None = None
    position_i_gain: Annotated[int, msgspec.Meta(ge=0)] | None = None
    position_d_gain: Annotated[int, msgspec.Meta(ge=0)] | None = None
    lag: Annotated[float, msgspec.Meta(ge=0, le=0.5)] = 0.0
    friction: Annotated[float, msgspec.Meta(ge=0)] | None = None

    def __post_init__(self) -> None:
        if not (self.name.strip() and self.name.isprintable()):
            raise ValueError(f"name {self.name!r} must be printable, and not empty")
        if self.model in WHY_NO_JOINT:
            raise ValueError(f"model '{self.model}' cannot be a joint of a rig: {WHY_NO_JOINT[self.model]}")
        if self.model not in MODELS:
            near = MODELS.near(self.model)
            raise ValueError(
                f"model '{self.model}' is unknown. "
                + (f"Did you mean {' or '.join(near)}?" if near else "Only Dynamixel servos are driven")
            )
        if not math.isfinite(self.velocity):
            raise ValueError(f"velocity is {self.velocity}; it must be a finite number")
        if not self.lower < self.upper:
            raise ValueError(f"lower is {self.lower} rad and upper {self.upper} rad; lower must be below upper")
        if self.model not in TRAITS:
            raise ValueError(f"model '{self.model}' cannot be a joint of a rig; {_DRIVEN} can")
        if not (math.isfinite(self.acceleration) and math.isfinite(self.current) and math.isfinite(self.gear)):
            raise ValueError("acceleration, current and gear must be finite numbers")
        if self.acceleration and "profile_acceleration" not in self.table.registers:
            raise ValueError(f"model '{self.model}' has no limit of acceleration: leave acceleration out")
        if self.current and "current_limit" not in self.table.registers:
            raise ValueError(f"model '{self.model}' measures no current, so it takes no limit of it")
        if self.current and self.current > (most := (limit := self.table["current_limit"]).maximum * limit.si):
            raise ValueError(f"current is {self.current:g} A; the most that model '{self.model}' takes is {most:.3g} A")
        self._refuse_too_small_limits()
        self._refuse_unknown_gains()
        bottom, top = self.table.one_turn
        low, high = sorted((self.pulses(self.lower), self.pulses(self.upper)))
        if not (low >= bottom and high <= top):
            in_degrees = ". Limits are in radians" if max(-self.lower, self.upper) > 2.0 * math.pi * self.gear else ""
            raise ValueError(
                f"limits {self.lower} to {self.upper} rad with zero {self.zero} reach from {low:.0f} to {high:.0f} "
                f"pulses, outside the servo's one turn ({bottom} to {top}){in_degrees}"
            )

    def _refuse_too_small_limits(self) -> None:
        """Raises ValueError for a limit below one count of its register, in which 0 means no limit."""
        for key, value, unit, name, gear in (
            ("velocity", self.velocity, "rad/s", "profile_velocity", self.gear),
            ("acceleration", self.acceleration, "rad/s^2", "profile_acceleration", self.gear),
            ("current", self.current, "A", "current_limit", 1.0),
        ):
            if value and value < (least := self.table[name].si / gear):
                raise ValueError(
                    f"{key} is {value:g} {unit}; the least that model '{self.model}' can keep is {least:.3g}"
                )

    def _refuse_unknown_gains(self) -> None:
        """Raises ValueError for a gain that the model does not have, or does not take."""
        for name, gain in self.gains.items():
            if (register := self.table.registers.get(name)) is None:
                raise ValueError(f"model '{self.model}' has no {name}: leave it out")
            if gain > register.maximum:
                raise ValueError(f"{name} is {gain}; the most that model '{self.model}' takes is {register.maximum}")

    @property
    def gains(self) -> dict[str, int]:
        """The gains that the rig file asks for, by register."""
        asked = {name: getattr(self, name) for name in _GAINS}
        return {name: gain for name, gain in asked.items() if gain is not None}

    def check_restartable(self) -> None:
        """Checks that the servo can be restarted; raises a RigError if its model cannot."""
        if not self.table.series.reboots:
            raise RigError(f"{self.name} ({self.model}) cannot be restarted. Switch its power off and on.")

    @property
    def label(self) -> str:
        """Name and ID for a message."""
        return f"{self.name} (id {self.id})"

    @property
    def table(self) -> ControlTable:
        """The control table of this servo's model."""
        return MODELS[self.model]

    @property
    def mode(self) -> int:
        """The operating mode in which the servo keeps to positions, and to a limit of current where there is one."""
        limited = self.table.series.current_limited
        return POSITION_MODE if not self.current or POSITION_MODE in limited else limited[0]

    @property
    def hottest(self) -> float:
        """The temperature at which the servo shuts down as delivered, degC."""
        register = self.table.registers.get("temperature_limit")
        return float(register.default) if register is not None and register.default else 80.0

    def slack(self, position_p_gain: int | None = None) -> float:
        """How far from its goal the servo drives with its full voltage, rad; infinite without a gain.

        Args:
            position_p_gain: as the servo keeps it; as delivered if None.
        """
        traits, row = TRAITS[self.model], self.table.registers.get("position_p_gain")
        usual = row.default if row is not None else None
        stiffness = float(traits.stiffness or usual or 0)
        if position_p_gain is not None:
            stiffness *= position_p_gain / (usual or traits.stiffness)
        full = traits.series.full_pwm * traits.series.gain_unit / abs(self.pulses_per_radian)
        return full / stiffness if stiffness else math.inf

    @property
    def pulses_per_radian(self) -> float:
        """Pulses for one rad, negative where the servo turns the other way."""
        return self.direction * self.gear * self.table.pulses_per_turn / (2.0 * math.pi)

    def whole_turns(self, pulses: float) -> int:
        """The pulses of the whole turns between a position and the servo's one turn."""
        turn = self.table.pulses_per_turn
        return int((pulses - self.table.one_turn[0]) // turn) * turn

    def pulses(self, angle: float) -> float:
        """The servo's position (not rounded) at a joint angle in rad."""
        return self.zero + angle * self.pulses_per_radian

    def angle(self, pulses: float) -> float:
        """The joint angle, rad, at a position of the servo."""
        return (pulses - self.zero) / self.pulses_per_radian


class RigConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A rig file's contents.

    Attributes:
        port: of the serial adapter, such as /dev/ttyUSB0, for joints that name no other.
        baud: of the bus, bits/s.
        rate_hz: how often targets are sent.
        joints: in the order of every array about this rig.
        watchdog_ms: silence on the bus after which the servos' own watchdogs stop them; at least 1.5 ticks and 20 ms.
        read_hz: how often the state is read; 0 for as often as targets are sent.
        on_exit: what the servos do in the end: "off", or "hold" where they are.
        on_loss: what happens when a joint is lost for good: "stop" the rig, or "go on" without it.
        reconnect_s: how long a vanished port may take to come back; 0 to stop at once.
    """

    port: Annotated[str, msgspec.Meta(min_length=1)]
    baud: int
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=1000)]
    joints: Annotated[tuple[RigJoint, ...], msgspec.Meta(min_length=1)]
    watchdog_ms: Annotated[int, msgspec.Meta(ge=20, le=2540)] = 200
    read_hz: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    on_exit: Literal["off", "hold"] = "off"
    on_loss: Literal["stop", "go on"] = "stop"
    reconnect_s: Annotated[float, msgspec.Meta(ge=0, le=3600)] = 10.0

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
            self._refuse_doubles("id", [joint.id if self._port_of(joint) == port else None for joint in self.joints])
        self._refuse_doubles("name", [joint.name for joint in self.joints])

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
            joints = tuple(
                msgspec.structs.replace(joint, port="") for joint in self.joints if self._port_of(joint) == port
            )
            parts.append(msgspec.structs.replace(self, port=port, joints=joints))
        return tuple(parts)

    def on_ports(self, ports: Sequence[str] = ()) -> tuple[RigConfig, ...]:
        """The same as `parts`, on these ports in place of the rig file's own if there are any.

        Raises:
            RigError: if their number is not that of the rig's ports.
        """
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
        """The silence after which the servos count as stopped, s.

        It is one unit shorter than theirs: rather stopped here and not there than the reverse.
        """
        return self.watchdog_ms * 1e-3 - _WATCHDOG_UNIT

    @property
    def protocols(self) -> dict[int, int]:
        """The protocol (1 or 2) of each ID, for the rig of one port."""
        return {joint.id: joint.table.protocol for joint in self.joints}

    def only(self, joints: Sequence[int]) -> RigConfig:
        """The rig reduced to the joints with these indices."""
        return msgspec.structs.replace(self, joints=tuple(self.joints[index] for index in joints))

    def _port_of(self, joint: RigJoint) -> str:
        return joint.port or self.port

    def _refuse_doubles(self, key: str, values: Sequence[object]) -> None:
        twice = [value for value, count in Counter(values).items() if count > 1 and value is not None]
        if twice:
            where = ", ".join(
                f"joint {number} ({joint.name}, id {joint.id})"
                for number, (joint, value) in enumerate(zip(self.joints, values, strict=True), 1)
                if value in twice
            )
            raise ValueError(f"{key} {', '.join(map(str, twice))} is used more than once: {where}")


def load_rig(path: str | Path) -> RigConfig:
    """Reads a rig file.

    Raises:
        RigFileError: if it cannot be read, is not TOML, or has an unknown key or an impossible value.
    """
    try:
        text, tree = parse_toml(Path(path))
    except FileFormatError as error:
        raise RigFileError(str(error)) from None
    for keys, problem in impossible_numbers(tree, SMALLEST):
        where = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in keys[:-1])
        raise RigFileError(_explain(path, text, f"{keys[-1]} {problem} - at `${where}`"))
    try:
        return msgspec.convert(tree, RigConfig)
    except msgspec.ValidationError as error:
        raise RigFileError(_explain(path, text, str(error))) from error


def _explain(path: str | Path, text: str, message: str) -> str:
    """msgspec's message with the line and place in the file, and the allowed keys where one is unknown."""
    what, _, where = message.partition(" - at `$")
    place = re.sub(r"\[(\d+)\]", lambda found: f" {int(found[1]) + 1}", where.rstrip("`").lstrip("."))
    place = place.replace("joints ", "joint ", 1)
    unknown = re.search(r"unknown field `(.*)`", what)
    if unknown:
        keys = (RigJoint if where.startswith(".joints[") else RigConfig).__struct_fields__
        hint = did_you_mean(unknown[1], keys, 1)
        what = f"unknown key '{unknown[1]}'.{hint} The keys here are {', '.join(keys)}"
    elif what.startswith("Invalid enum value"):
        allowed = {"on_exit": "'off' and 'hold'", "on_loss": "'stop' and 'go on'"}.get(place, "-1 and 1")
        what = f"{what.removeprefix('Invalid enum value ')} is not allowed; {allowed} are"
    key = unknown[1] if unknown else where.rpartition(".")[2].rstrip("`")
    line = _line(text, where, key, what)
    what = in_file_words(what)
    end = "" if what.endswith("?") else "."
    return f"{path}{f' line {line}' if line else ''}: {f'{place}: ' if place else ''}{what}{end}"


def _line(text: str, where: str, key: str, what: str) -> int | None:
    """The line of the mistake: that of the key, of the joint, or of what the message names first or last."""
    joint = re.search(r"joints\[(\d+)\]", where)
    if joint:
        return _line_of(text, key if not key.startswith("joints[") else what.split(" ", 1)[0], int(joint[1]) + 1)
    named = re.findall(r"joint (\d+) \(", what)
    if named:
        return _line_of(text, "", int(named[-1]))
    return _line_of(text, key or what.split(" ", 1)[0])


def _line_of(text: str, key: str, joint: int | None = None) -> int | None:
    """The line, counted from 1, of a key of the file or of its joint number `joint` (from 1); None if it is not found.

    Where the joint lacks that key, the line on which the joint begins.
    """
    lines = [_QUOTED.sub('""', line).partition("#")[0] for line in text.splitlines()]
    starts = _joint_starts(lines)
    if joint is None:
        return _find(lines, key, 0, starts[0][0] if starts else len(lines)) or _find(lines, key, 0, len(lines))
    if joint > len(starts):
        return None
    row, column = starts[joint - 1]
    end_row, end_column = starts[joint] if joint < len(starts) else (len(lines) - 1, None)
    part = [*lines[: end_row + 1]]
    part[end_row] = part[end_row][:end_column]
    part[row] = " " * column + part[row][column:]
    return (_find(part, key, row, end_row + 1) if key else None) or row + 1


def _joint_starts(lines: list[str]) -> list[tuple[int, int]]:
    headed = [(row, 0) for row, line in enumerate(lines) if re.match(r"\s*\[\[\s*joints\s*\]\]", line)]
    if headed:
        return headed
    first = next((row for row, line in enumerate(lines) if re.match(r"\s*joints\s*=", line)), len(lines))
    return [(row, brace.start()) for row in range(first, len(lines)) for brace in re.finditer("{", lines[row])]


def _find(lines: list[str], key: str, start: int, end: int) -> int | None:
    given = re.compile(rf"(?:^|[\s{{,]){re.escape(key)}\s*=")
    return next((row + 1 for row in range(start, end) if given.search(lines[row])), None)
