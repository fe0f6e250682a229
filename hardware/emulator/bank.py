"""A bank of servos of one model: their memories side by side, and their motion, advanced all at once.

The memory of all servos is one block of bytes. numpy sees it as a table with a column for each register, so motion is
computed on columns, and the bus reads and writes rows as plain bytes: nothing is ever copied between the two.

In position mode (operating modes 3, 4 and 5) each servo does, in steps of at most 2 ms:

    path   trapezoidal profile from where it is to the goal, within profile velocity and acceleration (0: at once)
    u      = clip(P / 128 * (path - shaft), +- goal PWM)           position P gain, register 84
    speed  += (u / full_pwm * no_load_speed - speed) * (1 - exp(-dt / lag))
    shaft  += speed * dt

The I, D and feed-forward gains, load and heat have no effect yet, and the drive mode knows only its reverse bit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hardware.control_table.table import ControlTable
from hardware.emulator.motor import MOTORS

TRIPPED = -1
"""What the bus watchdog register says once it has stopped the servo."""

_SHORTEST_STEP = 0.001
_LONGEST_STEP = 0.002
_SUPPLY = 120  # 0.1 V
_PROFILE_ONGOING = 0x02
_IN_POSITION = 0x01
_IN_POSITION_WINDOW = 20  # pulses; the manual gives no figure


class ServoBank:
    """n servos of one model.

    Attributes:
        table: their control table.
        memory: all their bytes, `table.size` a servo.
        registers: the same bytes as a numpy record array, shape (n,).
        shaft: where each horn really is, shape (n,), pulses, any number of turns.
        speed: of each horn, shape (n,), pulses/s.
        path: where the profile has led so far, shape (n,), pulses of the shaft.
        target: where it leads to, shape (n,), pulses of the shaft.
    """

    def __init__(self, table: ControlTable, ids: Sequence[int], shaft: Sequence[float]) -> None:
        """Switches the servos on, each horn at `shaft` pulses."""
        count = len(ids)
        self.table = table
        self.memory = bytearray(count * table.size)
        self.registers = np.frombuffer(self.memory, dtype=table.dtype())
        for register in table.registers.values():
            self.registers[register.name] = register.default or 0
        self.registers["id"] = ids
        self.shaft = np.array(shaft, dtype=np.float64)
        self.speed = np.zeros(count)
        self.path = self.shaft.copy()
        self._path_speed = np.zeros(count)
        self.target = self.shaft.copy()
        self._time = 0.0
        self._shown = False
        self._motor = MOTORS[table.model]
        self._no_load = self._motor.no_load_speed / 60.0 * table.pulses_per_turn
        self._pulses_per_radian = table.pulses_per_turn / (2.0 * math.pi)
        self.show()
        self.registers["goal_position"] = self.registers["present_position"]

    def restart(self, row: int) -> None:
        """Gives a servo the memory it has after power-up: its EEPROM stays, its horn counts from one turn again."""
        for register in self.table.registers.values():
            if register.memory == "RAM":
                self.registers[register.name][row] = register.default or 0
        self.registers["goal_pwm"][row] = self.registers["pwm_limit"][row]
        self.registers["goal_current"][row] = self.registers["current_limit"][row]
        self.to_one_turn(row)
        self._shown = False
        self.show()
        self.registers["goal_position"][row] = self.registers["present_position"][row]

    def to_one_turn(self, row: int) -> None:
        """Forgets whole turns: position mode starts from within one."""
        self.shaft[row] %= self.table.pulses_per_turn
        self.halt(row)

    def halt(self, row: int) -> None:
        """Makes the servo stay where it comes to rest, whatever its goal register says."""
        self.path[row] = self.target[row] = self.shaft[row] + self.speed[row] * self._motor.lag
        self._path_speed[row] = 0.0

    def pursue(self, row: int) -> None:
        """Sets off for the goal position that stands in the register."""
        registers = self.registers
        sign = 1.0 - 2.0 * (registers["drive_mode"][row] & 1)
        self.target[row] = sign * (float(registers["goal_position"][row]) - float(registers["homing_offset"][row]))

    def live_until(self, now: float, fed: float) -> None:
        """Lets time pass until `now` (or 1 ms less), with the last word on the bus at `fed`.

        A bus watchdog that has heard nothing for too long trips at its own time on the way.
        """
        while (due := self._next_trip(fed)) is not None and due[0] <= now:
            self._advance(due[0] - self._time)
            self._trip(due[1])
        if now - self._time >= _SHORTEST_STEP:
            self._advance(now - self._time)

    def _next_trip(self, fed: float) -> tuple[float, int] | None:
        """When which watchdog trips next if the bus stays silent; None while none counts."""
        limit = self.registers["bus_watchdog"].astype(np.int64)
        counting = (limit > 0) & (self.registers["torque_enable"] != 0)
        if not counting.any():
            return None
        row = int(np.argmin(np.where(counting, limit, 1000)))
        return fed + float(limit[row]) * self.table["bus_watchdog"].si, row

    def _trip(self, row: int) -> None:
        """Stops a servo and has it hold, torque still on, until a 0 is written to the watchdog."""
        self.registers["bus_watchdog"][row] = TRIPPED
        self.registers["profile_velocity"][row] = self.registers["profile_acceleration"][row] = 0
        self.halt(row)

    def _advance(self, seconds: float) -> None:
        self._time += max(0.0, seconds)
        if seconds > 0.0 and not self._at_rest():
            self._move(seconds)
        self._shown = False

    def _at_rest(self) -> bool:
        """Whether moving on would change nothing that anybody can see."""
        driven = self.registers["torque_enable"] != 0
        unsettled = (np.abs(self.target - self.shaft) > 0.05) & driven
        return not (unsettled | (np.abs(self.speed) > 0.05)).any()

    def _move(self, seconds: float) -> None:
        """Integrates the motion in the module's first lines."""
        registers, table = self.registers, self.table
        steps = math.ceil(seconds / _LONGEST_STEP)
        dt = seconds / steps
        driven = registers["torque_enable"] != 0
        gain = registers["position_p_gain"] / 128.0
        most = np.abs(registers["goal_pwm"].astype(np.float64)) * driven
        speed_per_pwm = self._no_load / self._motor.full_pwm
        approach = -math.expm1(-dt / self._motor.lag)
        top, rate = registers["profile_velocity"], registers["profile_acceleration"]
        to_pulses = self._pulses_per_radian
        top_speed = np.where(top > 0, top * (table["profile_velocity"].si * to_pulses), np.inf)
        acceleration = np.where((top > 0) & (rate > 0), rate * (table["profile_acceleration"].si * to_pulses), np.inf)
        self.path = np.where(driven, self.path, self.shaft)
        self._path_speed = np.where(driven, self._path_speed, 0.0)
        target = np.where(driven, self.target, self.shaft)
        for _ in range(steps):
            left = target - self.path
            distance = np.abs(left)
            # From this speed, braking in steps of dt ends at the goal; it is sqrt(2 a d) for small dt.
            braking = 2.0 * distance / (np.sqrt(0.25 * dt * dt + 2.0 * distance / acceleration) + 0.5 * dt)
            wanted = np.copysign(np.minimum(np.minimum(top_speed, braking), distance / dt), left)
            change = acceleration * dt
            self._path_speed += np.clip(wanted - self._path_speed, -change, change)
            self.path += self._path_speed * dt
            drive = np.clip(gain * (self.path - self.shaft), -most, most)
            self.speed += (drive * speed_per_pwm - self.speed) * approach
            self.shaft += self.speed * dt

    def show(self) -> None:
        """Brings the registers that a servo measures up to date."""
        if self._shown:
            return
        self._shown = True
        registers, table = self.registers, self.table
        per_speed = 1.0 / (table["present_velocity"].si * self._pulses_per_radian)
        sign = 1.0 - 2.0 * (registers["drive_mode"] & 1)
        offset = registers["homing_offset"]
        velocity = np.rint(sign * self.speed * per_speed)
        registers["present_position"] = np.rint(sign * self.shaft + offset)
        registers["present_velocity"] = velocity
        registers["position_trajectory"] = np.rint(sign * self.path + offset)
        registers["velocity_trajectory"] = np.rint(sign * self._path_speed * per_speed)
        driven = registers["torque_enable"] != 0
        most = np.abs(registers["goal_pwm"].astype(np.float64))
        pwm = np.clip(registers["position_p_gain"] / 128.0 * (self.path - self.shaft), -most, most) * driven
        stall = self._motor.stall_current / table["present_current"].scale
        current = stall * (pwm / self._motor.full_pwm - self.speed / self._no_load) * driven
        registers["present_pwm"] = np.rint(sign * pwm)
        registers["present_current"] = np.clip(np.rint(sign * current), -1193, 1193)
        registers["moving"] = np.abs(velocity) > registers["moving_threshold"]
        arrived = np.abs(self.target - self.shaft) <= _IN_POSITION_WINDOW
        ongoing = (np.abs(self.target - self.path) > 0.5) & driven
        registers["moving_status"] = _IN_POSITION * arrived + _PROFILE_ONGOING * ongoing
        registers["realtime_tick"] = int(self._time * 1e3) % 32768
        registers["present_input_voltage"] = _SUPPLY
