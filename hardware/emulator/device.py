"""One emulated servo as the bus sees it: which reads and writes it allows, and what they set off.

Where the e-Manual is silent: a goal beyond the user's limits is error 6 and one beyond the register's range error 4; a
watchdog that has tripped takes nothing but 0; torque on a servo in shutdown is refused with error 1.
"""

from __future__ import annotations

from hardware.control_table.register import Register
from hardware.emulator.bank import TRIPPED, ServoBank

RESULT_FAIL, INSTRUCTION, RANGE, LENGTH, LIMIT, ACCESS = 1, 2, 4, 5, 6, 7

_POSITION_MODES = (3, 4, 5)
_GOALS = frozenset({"goal_pwm", "goal_current", "goal_velocity", "goal_position"})
_LIMITED_BY = {"goal_pwm": "pwm_limit", "goal_current": "current_limit", "goal_velocity": "velocity_limit"}


class Device:
    """A servo: row `row` of a bank.

    Attributes:
        dead: set it, and the servo neither hears nor answers, like one whose cable is cut.
        asleep_until: the servo is deaf before this time, s, as after a reboot.
    """

    def __init__(self, bank: ServoBank, row: int) -> None:
        self.bank = bank
        self.row = row
        self.dead = False
        self.asleep_until = 0.0
        self._table = bank.table
        size = bank.table.size
        self._memory = memoryview(bank.memory)[row * size : (row + 1) * size]
        self._places = {
            name: (slice(register.address, register.address + register.length), register.signed)
            for name, register in bank.table.registers.items()
        }
        self._by_address = {register.address: register for register in bank.table.registers.values()}
        self._cells = {
            register.address: bank.table[name.replace("data", "address")].address
            for name, register in bank.table.registers.items()
            if name.startswith("indirect_data")
        }
        self._first_cell = min(self._cells, default=size)
        self._registered: tuple[int, bytes] | None = None

    def __getitem__(self, name: str) -> int:
        """What a register holds."""
        self.bank.show()
        return self._get(name)

    def __setitem__(self, name: str, value: int) -> None:
        """Puts a value into a register, with no rule asked and no effect: for the servo itself, and for tests."""
        self._store(self._table[name], value)

    @property
    def alert(self) -> bool:
        """Whether the servo reports a hardware problem."""
        return self._get("hardware_error_status") != 0

    @property
    def shut_down(self) -> bool:
        """Whether a hardware problem has taken the torque away until the next reboot."""
        return self._get("hardware_error_status") & self._get("shutdown") != 0

    def fail(self, bits: int) -> None:
        """Gives the servo a hardware problem: 1 voltage, 4 heat, 8 encoder, 16 shock, 32 overload."""
        self["hardware_error_status"] = self._get("hardware_error_status") | bits
        if self.shut_down:
            self["torque_enable"] = 0

    def read(self, address: int, length: int) -> bytes | None:
        """Bytes of the control table, indirect data resolved; None if they are not all in it."""
        end = address + length
        if length == 0 or end > len(self._memory):
            return None
        self.bank.show()
        data = bytearray(self._memory[address:end])
        for cell in range(max(address, self._first_cell), end):
            if cell in self._cells:
                data[cell - address] = self._memory[self._behind(cell)]
        return bytes(data)

    def write(self, address: int, data: bytes) -> int:
        """Writes bytes if every rule allows all of them; the error number, 0 for none."""
        plan = self._plan(address, data)
        if isinstance(plan, int):
            return plan
        was_on = self._get("torque_enable")
        for register, value in plan:
            self._store(register, value)
        for register, value in plan:
            self._take_effect(register.name, value, switched_on=not was_on)
        return 0

    def register(self, address: int, data: bytes) -> int:
        """Keeps a write for `act`; the error number, 0 for none."""
        if isinstance(plan := self._plan(address, data), int):
            return plan
        self._registered = (address, data)
        self["registered_instruction"] = 1
        return 0

    def act(self) -> int:
        """Carries out the write kept by `register`; the error number, 0 for none."""
        if self._registered is None:
            return INSTRUCTION
        address, data = self._registered
        self._registered = None
        self["registered_instruction"] = 0
        return self.write(address, data)

    def reboot(self, deaf_until: float) -> None:
        """Starts the servo anew; it hears nothing for a while."""
        self.bank.restart(self.row)
        self._registered = None
        self.asleep_until = deaf_until

    def _get(self, name: str) -> int:
        """What a register holds that the servo does not measure."""
        place, signed = self._places[name]
        return int.from_bytes(self._memory[place], "little", signed=signed)

    def _store(self, register: Register, value: int) -> None:
        data = value.to_bytes(register.length, "little", signed=register.signed)
        self._memory[register.address : register.address + register.length] = data

    def _plan(self, address: int, data: bytes) -> list[tuple[Register, int]] | int:
        """The registers these bytes fill and the values they get, or the error number for the first that refuses."""
        if address in self._cells and self._behind(address) != address:
            return self._plan_indirect(address, data)
        plan: list[tuple[Register, int]] = []
        offset = 0
        while offset < len(data):
            register = self._by_address.get(address + offset)
            if register is None or register.access == "R":
                return ACCESS
            if register.memory == "EEPROM" and self._get("torque_enable"):
                return ACCESS
            if offset + register.length > len(data):
                return LENGTH
            value = register.decode(data[offset : offset + register.length])
            if error := self._refusal(register, value):
                return error
            plan.append((register, value))
            offset += register.length
        return plan or LENGTH

    def _plan_indirect(self, address: int, data: bytes) -> list[tuple[Register, int]] | int:
        """As `_plan` for bytes that go through indirect data cells: runs of neighbouring targets count as one write."""
        runs: list[tuple[int, bytes]] = []
        for cell, byte in enumerate(data, address):
            if cell not in self._cells:
                return ACCESS
            place = self._behind(cell)
            if place in self._cells and place != cell:
                return ACCESS
            if runs and runs[-1][0] + len(runs[-1][1]) == place:
                runs[-1] = (runs[-1][0], runs[-1][1] + bytes((byte,)))
            else:
                runs.append((place, bytes((byte,))))
        plan: list[tuple[Register, int]] = []
        for place, run in runs:
            part = self._plan(place, run)
            if isinstance(part, int):
                return part
            plan += part
        return plan

    def _refusal(self, register: Register, value: int) -> int:
        """The error number with which the servo refuses a value, 0 if it takes it."""
        name = register.name
        if not register.minimum <= value <= register.maximum:
            return RANGE
        if name in _GOALS and self._get("bus_watchdog") == TRIPPED:
            return RANGE
        if name == "goal_position" and self._get("operating_mode") == 3:
            return 0 if self._get("min_position_limit") <= value <= self._get("max_position_limit") else LIMIT
        if name in _LIMITED_BY:
            return 0 if abs(value) <= self._get(_LIMITED_BY[name]) else LIMIT
        if name == "bus_watchdog":
            return RANGE if value < 0 or (value and self._get(name) == TRIPPED) else 0
        if name == "operating_mode":  # the other modes of this model are not emulated yet
            return 0 if value in _POSITION_MODES else RANGE
        if name == "drive_mode":
            return 0 if value in (0, 1) else RANGE
        if name == "torque_enable":
            return RESULT_FAIL if value and self.shut_down else 0
        return 0

    def _take_effect(self, name: str, value: int, switched_on: bool) -> None:
        """What follows from a register having been written; `switched_on`: torque was off before."""
        if name == "goal_position" and self._get("torque_enable"):
            self.bank.pursue(self.row)
        elif name == "torque_enable" and value and switched_on:
            if self._get("operating_mode") == 3:
                self.bank.to_one_turn(self.row)
            self.bank.halt(self.row)
            if self._get("bus_watchdog") != TRIPPED:
                # A real servo lunges for whatever goal is left from before; so does this one.
                self.bank.pursue(self.row)
        elif name == "operating_mode" and value == 3:
            self.bank.to_one_turn(self.row)

    def _behind(self, cell: int) -> int:
        """The address that an indirect data cell stands for."""
        pointer = self._cells[cell]
        return self._memory[pointer] | self._memory[pointer + 1] << 8
