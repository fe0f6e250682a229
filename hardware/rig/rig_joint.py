"""A joint of a rig: the row of a rig file, and what it means for its servo."""

import math
from typing import Annotated, Literal, Self

import msgspec

from hardware.errors import RigError
from hardware.families.models import MODELS, TRAITS, WHY_NO_JOINT
from hardware.families.table import ControlTable
from motiondeck_base.words import near_names

GAINS = ("position_p_gain", "position_i_gain", "position_d_gain")  # the gains that a rig file may ask for, by register
POSITION_MODE, EXTENDED_MODE = 3, 4
"""Operating modes without a limit of current: within one turn of the servo, and through many."""
NEAR = 0.05  # rad that a joint may stand outside its limits when switched on: play, and the rounding of pulses
_SECOND = "'s second servo"
_FARTHEST = 4.0 * math.pi  # rad; farther are limits in degrees


class SecondServo(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The other servo of a joint that two turn; all else is as of the first."""

    id: Annotated[int, msgspec.Meta(ge=0, le=252)]  # this and the next two are as of a `RigJoint`
    direction: Literal[-1, 1]
    zero: int


class RigJoint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One servo as a joint: angle = direction * (pulses - zero) * 2 pi / (pulses_per_turn * gear)."""

    name: str  # the robot's joint
    id: Annotated[int, msgspec.Meta(ge=0, le=252)]  # on the bus, 0 to 252
    model: str  # the maker's name, as in `MODELS`
    direction: Literal[-1, 1]  # +1 or -1, which way the servo turns when the joint's angle grows
    zero: int  # the servo's position at angle 0, pulses; of a servo that counts turns, in any of them
    # Position limits, rad; beyond the servo's own one turn it is driven in a mode that counts turns.
    lower: float
    upper: float
    velocity: Annotated[float, msgspec.Meta(gt=0)]  # its limit, rad/s
    acceleration: Annotated[float, msgspec.Meta(ge=0)] = 0.0  # its limit, rad/s^2; 0 for none
    current: Annotated[float, msgspec.Meta(ge=0)] = 0.0  # its limit, A, that the servo itself keeps; 0 for none
    grip: bool = False  # whether it may be held up by what it grips: it then holds on with its limit of current
    gear: Annotated[float, msgspec.Meta(gt=0)] = 1.0  # turns of the horn for one turn of the joint
    port: str = ""  # of the serial adapter that its servo is on; the rig's own if empty
    # A servo of the same model on the same port that turns the joint too; None without.
    second: SecondServo | None = None
    # Count of this register, as the next two; None for what the servo has.
    position_p_gain: Annotated[int, msgspec.Meta(ge=0)] | None = None
    position_i_gain: Annotated[int, msgspec.Meta(ge=0)] | None = None
    position_d_gain: Annotated[int, msgspec.Meta(ge=0)] | None = None
    # How late its shaft is behind its targets while it plays, s; see `tools.identify`.
    lag: Annotated[float, msgspec.Meta(ge=0, le=0.5)] = 0.0
    # The current that turns it slowly without a load, A; None where it is unknown.
    friction: Annotated[float, msgspec.Meta(ge=0)] | None = None
    # How it turns when left and right are exchanged: as its twin (or, without one, as before), 1, or against it, -1.
    mirror: Literal[-1, 1] | None = None
    # What the servo takes from its position, counts; only where its count begins anew after a turn.
    homing_offset: int = 0

    def __post_init__(self) -> None:
        if not (self.name.strip() and self.name.isprintable()):
            raise ValueError(f"name {self.name!r} must be printable, and not empty")
        if self.model in WHY_NO_JOINT:
            raise ValueError(f"model '{self.model}' cannot be a joint of a rig: {WHY_NO_JOINT[self.model]}")
        if self.model not in MODELS:
            near = near_names(self.model, MODELS)
            raise ValueError(
                f"model '{self.model}' is unknown. "
                + (f"Did you mean {' or '.join(near)}?" if near else "motiondeck rig scan names the servos on a port")
            )
        if not math.isfinite(self.velocity):
            raise ValueError(f"velocity is {self.velocity}; it must be a finite number")
        if not self.lower < self.upper:
            raise ValueError(f"lower is {self.lower} rad and upper {self.upper} rad; lower must be below upper")
        if self.model not in TRAITS:
            raise ValueError(f"model '{self.model}' cannot be a joint of a rig: its motor and its limits are not known")
        if not (math.isfinite(self.acceleration) and math.isfinite(self.current) and math.isfinite(self.gear)):
            raise ValueError("acceleration, current and gear must be finite numbers")
        if self.acceleration and "profile_acceleration" not in self.table.registers:
            raise ValueError(f"model '{self.model}' has no limit of acceleration: leave acceleration out")
        if self.current and "current_limit" not in self.table.registers:
            raise ValueError(f"model '{self.model}' measures no current, so it takes no limit of it")
        if self.current and self.current > (most := (limit := self.table["current_limit"]).maximum * limit.si):
            raise ValueError(f"current is {self.current:g} A; the most that model '{self.model}' takes is {most:.3g} A")
        if self.grip and not self.current:
            raise ValueError("grip needs current: the A with which it holds")
        if self.homing_offset:
            if not self.table.series.wraps:
                raise ValueError(f"model '{self.model}' needs no homing_offset: leave it out")
            if abs(self.homing_offset) > (most := self.table["homing_offset"].largest):
                raise ValueError(f"homing_offset is {self.homing_offset}; model '{self.model}' takes -{most} to {most}")
        for key, value, unit, register, gear in (
            ("velocity", self.velocity, "rad/s", "profile_velocity", self.gear),
            ("acceleration", self.acceleration, "rad/s^2", "profile_acceleration", self.gear),
            ("current", self.current, "A", "current_limit", 1.0),
        ):  # in a register 0 means no limit
            if value and value < (least := self.table[register].si / gear):
                raise ValueError(f"{key} is {value:g} {unit}; the least that '{self.model}' can keep is {least:.3g}")
        for name, gain in self.gains.items():
            if name not in self.table.registers:
                raise ValueError(f"model '{self.model}' has no {name}: leave it out")
            if gain > (most := self.table[name].maximum):
                raise ValueError(f"{name} is {gain}; the most that model '{self.model}' takes is {most}")
        if max(abs(self.lower), abs(self.upper)) > _FARTHEST:
            raise ValueError(f"limits {self.lower} to {self.upper} rad are beyond two turns of the joint: give radians")
        if not self.in_one_turn and EXTENDED_MODE not in self.modes:
            (bottom, top), (low, high) = self.table.one_turn, self.ends
            raise ValueError(
                f"limits {self.lower} to {self.upper} rad with zero {self.zero} reach from {low:.0f} to {high:.0f} "
                f"pulses, outside the servo's one turn ({bottom} to {top}), and model '{self.model}' counts no turns"
            )
        if self.second is not None:
            _ = self.servos

    @property
    def gains(self) -> dict[str, int]:
        """The gains that the rig file asks for, by register."""
        asked = {name: getattr(self, name) for name in GAINS}
        return {name: gain for name, gain in asked.items() if gain is not None}

    def check_restartable(self) -> None:
        """Checks that the servo can be restarted; raises a RigError if its model cannot."""
        if not self.table.series.reboots:
            raise RigError(f"{self.name} ({self.model}) cannot be restarted. Switch its power off and on.")

    @property
    def servos(self) -> tuple[Self, ...]:
        """Each of its servos as a joint with that one alone."""
        if (second := self.second) is None:
            return (self,)
        one = msgspec.structs.replace(self, second=None)
        name = self.name + _SECOND
        return one, msgspec.structs.replace(one, name=name, id=second.id, direction=second.direction, zero=second.zero)

    @property
    def joint_name(self) -> str:
        """Of the joint, for one of its servos as `servos` has it too."""
        return self.name.removesuffix(_SECOND)

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
        plain = POSITION_MODE if self.in_one_turn else EXTENDED_MODE
        limited = self.table.series.current_limited
        return plain if not self.current or plain in limited else limited[0]

    @property
    def modes(self) -> tuple[int, ...]:
        """The operating modes of the model; () where it has no register for them."""
        return TRAITS[self.model].modes if "operating_mode" in self.table.registers else ()

    @property
    def ends(self) -> tuple[float, float]:
        """The lowest and the highest position of the servo, pulses, not rounded, from the zero of the rig file."""
        low, high = sorted((self.pulses(self.lower), self.pulses(self.upper)))
        return low, high

    @property
    def in_one_turn(self) -> bool:
        """Whether the range lies within the one turn of position mode."""
        (bottom, top), (low, high) = self.table.one_turn, self.ends
        return bottom <= low and high <= top

    @property
    def several_turns(self) -> bool:
        """Whether the place of the horn in one turn leaves open where in its range the joint stands."""
        low, high = self.ends
        near = 2.0 * NEAR * abs(self.pulses_per_radian)
        return not self.in_one_turn and high - low + near > self.table.pulses_per_turn

    @property
    def hottest(self) -> float:
        """The temperature at which the servo shuts down as delivered, degC."""
        register = self.table.registers.get("temperature_limit")
        return float(register.default) if register is not None and register.default else 80.0

    def slack(self, position_p_gain: int | None = None) -> float:
        """How far from its goal the servo drives with its full voltage, rad; infinite without a gain.

        The gain is as the servo keeps it; as delivered if None.
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
        """The pulses of the whole turns between a position and the turn in which the joint is driven."""
        # In position mode that is the servo's own one turn, else the one around the middle of the range.
        turn = self.table.pulses_per_turn
        start = self.table.one_turn[0] if self.mode == POSITION_MODE else (sum(self.ends) - turn) / 2.0
        return math.floor((pulses - start) / turn) * turn

    def pulses(self, angle: float) -> float:
        """The servo's position (not rounded) at a joint angle in rad."""
        return self.zero + angle * self.pulses_per_radian

    def angle(self, pulses: float) -> float:
        """The joint angle, rad, at a position of the servo."""
        return (pulses - self.zero) / self.pulses_per_radian
