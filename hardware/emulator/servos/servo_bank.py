"""A bank of servos of one model: their memories side by side, and their behaviour in time.

The memory of all servos is one block of bytes. numpy sees it as a table with a column for each register, so motion is
computed on columns (see `drive`), and the bus reads and writes rows as plain bytes: nothing is ever copied.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.emulator.servos.drive import CURRENT, POSITION_MODES, PWM, VELOCITY, MotorDrive, motor_of
from hardware.families.models import MAPPED_TO, TRAITS
from hardware.families.register import Register
from hardware.families.series import HEAT, OVERLOAD, VOLTAGE
from hardware.families.table import ControlTable

TRIPPED = -1  # the bus watchdog register after it has stopped the servo

_CONTROL = ("position_p_gain", "position_i_gain", "position_d_gain", "velocity_p_gain", "velocity_i_gain",
            "feedforward_1st_gain", "feedforward_2nd_gain", "profile_velocity", "profile_acceleration")  # fmt: skip
_SHORTEST_STEP = 0.001
_IN_POSITION = 0x01
_PROFILE_ONGOING = 0x02
_NOT_FOLLOWING = 0x08
_FOLLOWING_WINDOW = 200 / 4096  # of a turn, more than a free servo lags at full speed; the manual gives no figure
_IN_POSITION_WINDOW = 20 / 4096  # of a turn; the manual gives no figure
_RECTANGLE, _TRIANGLE, _TRAPEZOID = 0x10, 0x20, 0x30
_OFFSET_IN_ONE_TURN = 0.25  # of a turn: position mode ignores homing offsets beyond
_OVERLOADED = 0.8  # of the stall current ...
_OVERLOAD_TIME = 1.0  # s ... for so long; estimates, the manual gives no figure
_LOWEST_VOLTAGE = 0.45  # of the nominal voltage: below, the servo restarts; an estimate


class ServoBank:
    """n servos of one model; of the `drive`, shaft, load, jammed, supply and temperature may be set from outside."""

    def __init__(self, table: ControlTable, ids: Sequence[int], shaft: Sequence[float]) -> None:
        """Switches the servos on, each horn at `shaft` pulses."""
        count, motor = len(ids), motor_of(table.model)
        self.public = table  # as far as the bus reaches
        self.table = table = whole_table(table)  # with what the bank needs besides
        self.mapped = table is not self.public
        self.memory = bytearray(count * table.size)
        self.registers = np.frombuffer(self.memory, dtype=table.dtype())  # the same bytes, shape (n,)
        self._traits = TRAITS[table.model]
        for register in table.registers.values():
            self.registers[register.name] = self._at_first(register)
        self.registers["id"] = ids
        self.browned_out: set[int] = set()  # rows whose voltage has broken down since the bus last looked
        self.drive = MotorDrive(motor, table.pulses_per_turn, np.array(shaft, dtype=np.float64))
        self.shaft = self.drive.shaft  # where each horn really is, shape (n,), pulses, any number of turns
        self._shape = np.zeros(count, dtype=np.int64)  # of the profile under way, as the moving status shows it
        self._overload = np.zeros(count)  # s
        self.deaf_since = np.full(count, np.inf)  # s when each servo's cable was cut; infinite where none is
        self._time = 0.0
        self._shown = False
        self._measures_current = "present_current" in table.registers
        self._limits_current = "goal_current" in table.registers
        self._wraps = self._traits.series.wraps
        self._pulses_per_radian = table.pulses_per_turn / (2.0 * math.pi)
        for row in range(count):
            self.to_one_turn(row)
        self.settle()
        self.show()
        self.registers["goal_position"] = self.registers["present_position"]

    def restart(self, row: int, restored: dict[str, int] | None = None) -> None:
        """Sets a servo's memory as after power-up: its EEPROM stays, its position is within one turn again.

        The startup configuration brings back the RAM registers that are `restored`.
        """
        for register in self.table.registers.values():
            if register.memory == "RAM":
                self.registers[register.name][row] = self._at_first(register)
        self.restore_control(row)
        if "torque_limit" in self.table.registers:
            self.registers["torque_limit"][row] = self.registers["max_torque"][row]
        for name, value in (restored or {}).items():
            self.registers[name][row] = value
        self._overload[row] = 0.0
        self.to_one_turn(row)
        self.settle()
        self._shown = False
        self.show()
        self.registers["goal_position"][row] = self.registers["present_position"][row]

    def _at_first(self, register: Register) -> int:
        """The factory value of a register; 0 where it is unknown, but a motor needs a gain."""
        unknown = self._traits.stiffness if register.name == "position_p_gain" else 0
        return unknown if register.default is None else register.default

    def restore_control(self, row: int) -> None:
        """Puts gains, profile, goal PWM and goal current of a servo back, as power-up and a change of mode do."""
        for name in _CONTROL:
            self.registers[name][row] = self._at_first(self.table[name])
        self.registers["goal_pwm"][row] = self.registers["pwm_limit"][row]
        if self._limits_current:
            self.registers["goal_current"][row] = self.registers["current_limit"][row]

    def reset(self, row: int, keep: Sequence[str]) -> None:
        """Puts the EEPROM of a servo back to its defaults, but for the registers in `keep`."""
        for register in self.table.registers.values():
            fixed = register.access == "R" or register.name in keep
            if register.memory == "EEPROM" and not fixed and register.default is not None:
                self.registers[register.name][row] = register.default

    def to_one_turn(self, row: int) -> None:
        """Forgets whole turns: position mode starts from within one."""
        self._forget_turns(row)
        self.halt(row)

    def _forget_turns(self, row: int) -> None:
        start, turn, place = self.table.one_turn[0], self.table.pulses_per_turn, self.drive.shaft[row]
        if self._wraps:
            place += self.drive.offset[row]
        self.drive.forgotten[row] = turn * np.floor((place - start) / turn)

    def cut_off(self, row: int, cut: bool) -> None:
        """Cuts a servo's watchdog off from the bus, or connects it again."""
        self.deaf_since[row] = self._time if cut else np.inf

    def halt(self, row: int) -> None:
        """Makes the servo stay where it comes to rest, regardless of its goal registers."""
        self.drive.halt(row)
        self._shown = False

    def settle(self) -> None:
        """Copies the registers that matter to the motors to them, after one was written."""
        registers, drive = self.registers, self.drive
        self._shown = False
        if self.mapped:
            follow(registers, self.table, drive)
        sign = np.where(registers["drive_mode"] & 1, -1.0, 1.0).astype(np.float64)
        drive.mode = registers["operating_mode"].astype(np.int64)
        drive.sign = sign
        offset = signed(registers["homing_offset"], self.table["homing_offset"])
        farthest = _OFFSET_IN_ONE_TURN * self.table.pulses_per_turn
        one_turn = (drive.mode == 3) & (np.abs(offset) > farthest) & (not self._wraps)
        drive.offset = np.where(one_turn, 0.0, -offset if self._traits.series.offset_subtracts else offset)
        drive.on = registers["torque_enable"] != 0
        gain = self._traits.series.gain_unit
        if not self.mapped:
            usual = self._at_first(self.table["position_p_gain"])
            gain *= usual / (self._traits.stiffness or usual)
            drive.p_gain = registers["position_p_gain"] / gain
            drive.i_gain = registers["position_i_gain"] / (gain * 0.512)  # a 1 kHz loop sums 512ths of it
            drive.d_gain = registers["position_d_gain"] / (gain * 125.0)  # and takes differences over 1 ms
        drive.ff_gain = registers["feedforward_1st_gain"] / (gain * 31.25)
        drive.most_pwm = np.abs(registers["goal_pwm"].astype(np.float64))
        drive.goal_pwm = sign * registers["goal_pwm"].astype(np.float64)
        unit = self.table["goal_velocity"].si * self._pulses_per_radian
        drive.goal_speed = sign * registers["goal_velocity"].astype(np.float64) * unit
        if self._limits_current:
            stall = drive.motor.stall_current / self.table["goal_current"].scale
            drive.goal_current = sign * registers["goal_current"].astype(np.float64) / stall
        drive.plan()

    def pursue(self, row: int) -> None:
        """Starts towards the goal registers, with the present profile."""
        registers, drive = self.registers, self.drive
        if drive.mode[row] not in POSITION_MODES:
            return
        if self._wraps:
            self._forget_turns(row)
        counted = drive.sign[row] * (float(registers["goal_position"][row]) - drive.offset[row])
        drive.target[row] = counted + drive.forgotten[row]
        speed, acceleration = self._profile(row, abs(float(drive.target[row] - drive.path[row])))
        drive.top_speed[row], drive.acceleration[row] = speed, acceleration
        if speed == math.inf:
            self._shape[row] = 0
        elif acceleration == math.inf:
            self._shape[row] = _RECTANGLE
        else:
            short = abs(drive.target[row] - drive.path[row]) < speed * speed / acceleration
            self._shape[row] = _TRIANGLE if short else _TRAPEZOID

    def accelerate(self, row: int) -> None:
        """Takes over the acceleration for velocity mode."""
        if self.drive.mode[row] == VELOCITY:
            self.drive.acceleration[row] = self._profile(row, 0.0)[1]

    def live_until(self, now: float, fed: float) -> None:
        """Advances to `now` (or 1 ms less); the bus was last heard at `fed`."""
        # A bus watchdog that has heard nothing for too long trips at its own time on the way.
        while (due := self._next_trip(fed)) is not None and due[0] <= now:
            self._advance(due[0] - self._time)
            self._trip(due[1])
        if now - self._time >= _SHORTEST_STEP:
            self._advance(now - self._time)

    def _profile(self, row: int, distance: float) -> tuple[float, float]:
        """Top speed (pulses/s) and acceleration (pulses/s^2) of the profile registers for a distance in pulses."""
        top, rate = int(self.registers["profile_velocity"][row]), int(self.registers["profile_acceleration"][row])
        if self.registers["drive_mode"][row] & 4:
            # Time-based: the registers are ms for the whole way and ms of it for speeding up, at most half.
            whole, ramp = top * 1e-3, min(rate, top / 2) * 1e-3
            if whole == 0.0:
                return math.inf, math.inf
            speed = max(distance / (whole - ramp), 1e-6)
            return speed, speed / ramp if ramp else math.inf
        speed = top * self.table["profile_velocity"].si * self._pulses_per_radian if top else math.inf
        limited = rate > 0 and (top > 0 or self.drive.mode[row] == VELOCITY)
        return speed, rate * self.table["profile_acceleration"].si * self._pulses_per_radian if limited else math.inf

    def _next_trip(self, fed: float) -> tuple[float, int] | None:
        """When which watchdog trips next if the bus stays silent; None while none counts."""
        limit = self.registers["bus_watchdog"]
        counting = (limit > 0) & self.drive.on
        if not counting.any():
            return None
        due = np.where(counting, np.minimum(fed, self.deaf_since) + limit * self.table["bus_watchdog"].si, np.inf)
        row = int(np.argmin(due))
        return float(due[row]), row

    def _trip(self, row: int) -> None:
        """Stops a servo and has it hold, torque still on, until a 0 is written to the watchdog."""
        self.registers["bus_watchdog"][row] = TRIPPED
        self.registers["profile_velocity"][row] = self.registers["profile_acceleration"][row] = 0
        self.registers["goal_velocity"][row] = 0
        if self.drive.mode[row] in (CURRENT, PWM):
            # These modes command a torque, and only zero torque stands still.
            self.registers["goal_pwm"][row] = 0
            if self._limits_current:
                self.registers["goal_current"][row] = 0
        self.settle()
        self.halt(row)

    def _advance(self, seconds: float) -> None:
        if seconds <= 0.0:
            return
        self._time += seconds
        self._shown = False
        self.drive.advance(seconds)
        self._protect(seconds)

    def _protect(self, seconds: float) -> None:
        """Notices heat, overload and a wrong voltage, and shuts down the servos whose shutdown mask asks for it."""
        registers, drive = self.registers, self.drive
        self._overload = np.where(np.abs(drive.current) > _OVERLOADED, self._overload + seconds, 0.0)
        tenths = drive.supply * 10.0
        voltage, heat, overload = (self.table.series.own_problems(bit) for bit in (VOLTAGE, HEAT, OVERLOAD))
        found = heat * (drive.temperature > registers["temperature_limit"])
        found |= overload * (self._overload > _OVERLOAD_TIME)
        found |= voltage * ((tenths > registers["max_voltage_limit"]) | (tenths < registers["min_voltage_limit"]))
        if not found.any():
            return
        registers["hardware_error_status"] |= found.astype(np.uint8)
        down = (registers["hardware_error_status"] & registers["shutdown"] != 0) & drive.on
        if down.any():
            self.let_go(down)
        self.browned_out |= set(np.flatnonzero(drive.supply < _LOWEST_VOLTAGE * drive.motor.voltage).tolist())

    def let_go(self, rows: NDArray[np.bool_] | int) -> None:
        """Shuts servos down; one that loses its torque limit may get another, the others need a reboot."""
        self.registers[self.table.series.shuts_down_by][rows] = 0
        self.settle()

    def show(self) -> None:
        """Updates the registers that a servo measures."""
        if self._shown:
            return
        self._shown = True
        registers, table, drive = self.registers, self.table, self.drive
        per_speed = 1.0 / (table["present_velocity"].si * self._pulses_per_radian)
        velocity = np.rint(drive.sign * drive.speed * per_speed)
        position = np.rint(drive.sign * (drive.shaft - drive.forgotten) + drive.offset)
        if self._wraps:
            position %= table.pulses_per_turn
        registers["present_position"] = np.clip(position, *table.one_turn) if self.mapped else position
        registers["present_velocity"] = with_sign(velocity, table["present_velocity"])
        registers["position_trajectory"] = np.rint(drive.sign * (drive.path - drive.forgotten) + drive.offset)
        registers["velocity_trajectory"] = np.rint(drive.sign * drive.path_speed * per_speed)
        registers["present_pwm"] = np.rint(drive.sign * drive.pwm)
        if self._measures_current:
            row = table["present_current"]
            stall = drive.motor.stall_current / row.scale
            current = np.clip(np.rint(drive.sign * drive.current * stall), -row.largest, row.largest)
            registers["present_current"] = with_sign(current, row)
        if "present_load" in table.registers:
            load = np.clip(np.rint(drive.sign * drive.current * 1e3), -1000, 1000)
            registers["present_load"] = with_sign(load, table["present_load"])
        registers["moving"] = np.abs(velocity) > registers["moving_threshold"]
        arrived = np.abs(drive.target - drive.shaft) <= _IN_POSITION_WINDOW * table.pulses_per_turn
        ongoing = (np.abs(drive.target - drive.path) > 0.5) & drive.on
        behind = (np.abs(drive.path - drive.shaft) > _FOLLOWING_WINDOW * table.pulses_per_turn) & drive.on
        registers["moving_status"] = (
            _IN_POSITION * arrived + (_PROFILE_ONGOING | self._shape) * ongoing + _NOT_FOLLOWING * behind
        )
        registers["realtime_tick"] = int(self._time * 1e3) % 32768
        registers["present_input_voltage"] = np.rint(drive.supply * 10.0)
        registers["present_temperature"] = np.rint(drive.temperature)


_BEHIND = 1024  # bytes: farther than the memory of these servos reaches
_LACKING = ("indirect_", "present_current", "goal_current", "current_limit", "startup_configuration", "backup_ready",
            "protocol_type", "model_information", "acceleration_limit")  # fmt: skip
_FULL_PWM = 885.0

# Servos without an operating mode on the registers of those that have one: a bank computes with the registers of
# `MAPPED_TO`. Those that a servo lacks stand behind its own memory, out of reach of the bus, and follow its own
# registers: the torque limit is a goal PWM, and both angle limits at 0, or control mode 1, make a wheel. Of its gains P
# and the compliance slopes count; dividers do nothing.


def whole_table(table: ControlTable) -> ControlTable:
    """The table with the registers of `MAPPED_TO` that it lacks, out of reach; the same where it has the mode."""
    if "operating_mode" in table.registers:
        return table
    hidden = {
        name: replace(register, address=_BEHIND + register.address)
        for name, register in MAPPED_TO.registers.items()
        if name not in table.registers and not name.startswith(_LACKING)
    }
    return replace(table, registers=table.registers | hidden)


def follow(registers: np.ndarray[Any, Any], table: ControlTable, drive: MotorDrive) -> None:
    """Makes the hidden registers and the motors of a bank follow the servos' own registers."""
    wheel = (registers["min_position_limit"] == 0) & (registers["max_position_limit"] == 0)
    if "control_mode" in table.registers:
        wheel = registers["control_mode"] == 1
    registers["operating_mode"] = np.where(wheel, VELOCITY, 3)
    per_count = table["profile_velocity"].si / table["goal_velocity"].si
    registers["goal_velocity"] = np.rint(
        signed(registers["profile_velocity"], table["profile_velocity"]) * per_count * wheel
    )
    registers["goal_pwm"] = np.rint(registers["torque_limit"] * _FULL_PWM / table["torque_limit"].maximum)
    if "cw_compliance_slope" in table.registers:
        slope = np.maximum(registers["cw_compliance_slope"], registers["ccw_compliance_slope"])
        drive.p_gain = _FULL_PWM / np.maximum(slope, 2)  # the least counts as 2
    else:
        usual = TRAITS[table.model].stiffness / table.series.gain_unit
        drive.p_gain = registers["position_p_gain"] * usual / (table["position_p_gain"].default or 1)
    drive.i_gain, drive.d_gain = np.zeros(len(registers)), np.zeros(len(registers))


def signed(counts: np.ndarray[Any, Any], register: Register) -> np.ndarray[Any, np.dtype[np.float64]]:
    """What the counts of a register mean as numbers, where one bit of it may be their sign."""
    if not (bit := register.sign_bit):
        return counts.astype(np.float64)
    return np.where(counts >> bit & 1, -1.0, 1.0) * (counts & (1 << bit) - 1).astype(np.float64)


def with_sign(values: np.ndarray[Any, np.dtype[np.float64]], register: Register) -> np.ndarray[Any, np.dtype[Any]]:
    """The inverse of `signed`."""
    if not (bit := register.sign_bit):
        return values
    size = np.minimum(np.abs(values), (1 << bit) - 1).astype(np.uint16)
    return size | np.where(values < 0.0, 1 << bit, 0).astype(np.uint16)
