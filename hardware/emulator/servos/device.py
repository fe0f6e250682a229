"""One emulated servo as the bus sees it: which reads and writes it allows, and their effects.

Where the e-Manual is silent: a goal beyond the user's limits is error 6 and one beyond the register's range error 4; a
watchdog that has tripped takes nothing but 0; torque on a servo in shutdown is refused with error 1; a servo changes to
its new baud rate after it has answered at the one before.
"""

from hardware.emulator.servos.servo_bank import TRIPPED, ServoBank
from hardware.families import emulation
from hardware.families.models import FAMILIES, TRAITS
from hardware.families.register import Register

_FOLLOWER, _ON_BY_GOAL = 2, 8
_TORQUE_AT_START, _RESTORE_RAM = 1, 2
_RESTORED = ("led", "bus_watchdog", "position_p_gain", "position_i_gain", "position_d_gain", "velocity_i_gain",
             "velocity_p_gain", "feedforward_1st_gain", "feedforward_2nd_gain", "profile_velocity",
             "profile_acceleration")  # fmt: skip
# By what a factory reset is to keep, the registers that it does.
_KEPT: dict[int, tuple[str, ...]] = {
    emulation.RESET_ALL: (), emulation.RESET_BUT_ID: ("id",), emulation.RESET_BUT_ID_AND_BAUD: ("id", "baud_rate")
}  # fmt: skip
_NEWER_FIRMWARE = 45  # startup configuration, backup, torque on by goal update
# The motors copy these when they change.
_MATTERS = frozenset({"torque_enable", "operating_mode", "drive_mode", "homing_offset", "goal_pwm", "goal_current",
                      "goal_velocity", "position_p_gain", "position_i_gain", "position_d_gain",
                      "feedforward_1st_gain"})  # fmt: skip
_GOALS = frozenset({"goal_pwm", "goal_current", "goal_velocity", "goal_position"})
_LIMITED_BY = {"goal_pwm": "pwm_limit", "goal_current": "current_limit", "goal_velocity": "velocity_limit"}
_PROFILE_LIMITED_BY = {"profile_velocity": "velocity_limit", "profile_acceleration": "acceleration_limit"}


class Device:
    """A servo: row `row` of a bank."""

    def __init__(self, bank: ServoBank, row: int) -> None:
        self.bank = bank
        self.row = row
        self._dead = False
        self.asleep_until = 0.0  # the servo is deaf before this time, s, as after a reboot
        self.model = bank.table.model
        self._table = bank.table
        self._modes = TRAITS[self.model].modes
        self.series = bank.table.series
        self._limited_by = _LIMITED_BY | (_PROFILE_LIMITED_BY if self.series.checks_profiles else {})
        self._backup: bytes | None = None
        size = bank.table.size
        self._memory = memoryview(bank.memory)[row * size : (row + 1) * size]
        self._places = {
            name: (slice(register.address, register.address + register.length), register.signed)
            for name, register in bank.table.registers.items()
        }
        self._by_address = {register.address: register for register in bank.public.registers.values()}
        self.family = bank.table.family  # as which it speaks; see `choose_family`
        self._cells = {
            register.address: bank.table[name.replace("data", "address")].address
            for name, register in bank.table.registers.items()
            if name.startswith("indirect_data")
        }
        self._end = bank.public.size
        self._first_cell = min(self._cells, default=size)
        self._registered: tuple[int, bytes] | None = None
        self._unsaved: dict[Register, int] = {}  # what EEPROM has that was written while it was locked

    @property
    def dead(self) -> bool:
        """If set, the servo (its watchdog too) neither hears nor answers, as with its cable cut."""
        return self._dead

    @dead.setter
    def dead(self, dead: bool) -> None:
        self._dead = dead
        self.bank.cut_off(self.row, dead)

    def __getitem__(self, name: str) -> int:
        self.bank.show()
        return self._get(name)

    def __setitem__(self, name: str, value: int) -> None:
        """Puts a value into a register without any rule or effect: for the servo itself, and for tests."""
        self._store(self._table[name], value)
        if name in _MATTERS or self.bank.mapped:
            self.bank.settle()

    @property
    def id(self) -> int:
        """Its ID."""
        return self._get("id")

    @property
    def shadow_id(self) -> int:
        """The second ID it listens to, without answering; above 252 for none."""
        return self._get("secondary_id")

    @property
    def baud(self) -> int:
        """The speed at which it hears and answers, bits/s."""
        return self.series.baud_of(self._get("baud_rate")) or 0

    @property
    def return_delay(self) -> float:
        """How long it waits before it answers, s."""
        return 2e-6 * self._get("return_delay_time")

    @property
    def answers_fast_reads(self) -> bool:
        """Whether its model and firmware know the fast reads."""
        since = TRAITS[self.model].fast_read
        return since is not None and self._get("firmware_version") >= since

    @property
    def moving(self) -> bool:
        """Whether it reports that it moves: it turns faster than its moving threshold."""
        return self["moving"] != 0

    @property
    def torque(self) -> bool:
        """Whether torque is on."""
        return self._get("torque_enable") != 0 and self._get(self.series.shuts_down_by) != 0

    @property
    def alert(self) -> bool:
        """Whether the servo reports a hardware problem."""
        return self._get("hardware_error_status") != 0

    @property
    def shut_down(self) -> bool:
        """Whether a hardware problem has taken the torque away until the next reboot."""
        return self._get("hardware_error_status") & self._get("shutdown") != 0

    def choose_family(self) -> None:
        """Speaks from now on as the family that its register says, if it has one."""
        for family in FAMILIES:
            if family.choice is not None and family.choice[0] in self._places:
                name, value = family.choice
                if self._get(name) == value:
                    self.family = family
                    return
        self.family = self._table.family

    def fail(self, bits: int) -> None:
        """Gives the servo a hardware problem: 1 voltage, 4 heat, 8 encoder, 16 shock, 32 overload."""
        self["hardware_error_status"] = self._get("hardware_error_status") | self.series.own_problems(bits)
        if self.shut_down and self._get("torque_enable"):
            self.bank.let_go(self.row)

    def hide_cells(self) -> None:
        """Makes the indirect cells plain memory, as if this servo's firmware had them elsewhere."""
        self._cells, self._first_cell = {}, self._table.size

    def read(self, address: int, length: int) -> bytes | None:
        """Bytes of the control table, indirect data resolved; None if they are not all in it."""
        end = address + length
        if length == 0 or end > self._end:
            return None
        self.bank.show()
        if end <= self._first_cell:
            return bytes(self._memory[address:end])
        data = bytearray(self._memory[address:end])
        for cell in range(max(address, self._first_cell), end):
            if cell in self._cells:
                data[cell - address] = self._memory[self._behind(cell)]
        return bytes(data)

    def write(self, address: int, data: bytes, shadow: bool = False) -> int:
        """Writes bytes if every rule allows all of them; the error number, 0 for none.

        As a `shadow` (addressed by its second ID) it keeps its EEPROM as it is.
        """
        plan = self._plan(address, data, shadow)
        if isinstance(plan, int):
            return plan
        was_on, mode = self._get("torque_enable"), self._get("operating_mode")
        for register, value in plan:
            self._remember(register)
            self._store(register, value)
        if self._get("operating_mode") != mode:
            self.bank.restore_control(self.row)
        by_goal = not was_on and self._get("drive_mode") & _ON_BY_GOAL and not self.shut_down
        if by_goal and any(register.name in _GOALS for register, _ in plan):
            self._store(self._table["torque_enable"], 1)
            plan.insert(0, (self._table["torque_enable"], 1))
        if self.bank.mapped or any(register.name in _MATTERS for register, _ in plan):
            self.bank.settle()
        for register, value in plan:
            self._take_effect(register.name, value, switched_on=not was_on)
        return 0

    def register(self, address: int, data: bytes, shadow: bool = False) -> int:
        """Keeps a write for `act`; the error number, 0 for none. `shadow` as of `write`."""
        if isinstance(plan := self._plan(address, data, shadow), int):
            return plan
        self._registered = (address, data)
        self["registered_instruction"] = 1
        return 0

    def act(self) -> int:
        """Carries out the write kept by `register`; the error number, 0 for none."""
        if self._registered is None:
            return emulation.INSTRUCTION
        address, data = self._registered
        self._registered = None
        self["registered_instruction"] = 0
        return self.write(address, data)

    def reboot(self, deaf_until: float) -> None:
        """Restarts the servo; it hears nothing for a while."""
        startup = self._get("startup_configuration") if self._newer else 0
        kept = {name: self._get(name) for name in _RESTORED if name in self._places} if startup & _RESTORE_RAM else {}
        kept["bus_watchdog"] = max(0, kept.get("bus_watchdog", 0))
        for register, value in self._unsaved.items():
            self._store(register, value)
        self._unsaved.clear()
        self.bank.restart(self.row, kept)
        self._registered = None
        self.asleep_until = deaf_until
        if startup & _TORQUE_AT_START:
            self["torque_enable"] = 1

    def factory_reset(self, keep: int, deaf_until: float) -> bool:
        """Puts the EEPROM back to its defaults and restarts; whether `keep` is one of the known ways."""
        kept = _KEPT.get(keep)
        if kept is None:
            return False
        self.bank.reset(self.row, kept)
        self.reboot(deaf_until)
        return True

    def swap(self, model_number: int, deaf_until: float) -> None:
        """Puts another servo in its place, as from the box but for id and baud rate, whose model number is this."""
        self.factory_reset(emulation.RESET_BUT_ID_AND_BAUD, deaf_until)
        self["model_number"] = model_number

    def clear(self) -> int:
        """Makes the present position one within a turn; the error number, 0 for none."""
        if self.moving:
            return emulation.RESULT_FAIL
        self.bank.to_one_turn(self.row)
        return 0

    def back_up(self, restore: bool | None, deaf_until: float) -> int:
        """Stores the EEPROM, or restores it and restarts; the error number, 0 for none. None for neither."""
        if not self._newer:
            return emulation.INSTRUCTION
        if restore is None:
            return emulation.RANGE
        end = self._table["torque_enable"].address
        if self._get("torque_enable") or (restore and self._backup is None):
            return emulation.RESULT_FAIL
        if not restore:
            self._backup = bytes(self._memory[:end])
            self["backup_ready"] = 1
        elif self._backup is not None:
            self._memory[:end] = self._backup
            self.reboot(deaf_until)
            self["backup_ready"] = 1
        return 0

    @property
    def _newer(self) -> bool:
        return "startup_configuration" in self._places and self._get("firmware_version") >= _NEWER_FIRMWARE

    @property
    def _locked(self) -> bool:
        if self.family.eeprom_lock:
            return False
        return self._get("torque_enable") != 0 or ("lock" in self._places and self["lock"] != 0)

    def _remember(self, register: Register) -> None:
        """Keeps what a restart brings back, if this register is written while what it gets is not kept."""
        lock = self.family.eeprom_lock
        if lock and register.memory == "EEPROM":
            if self._get(lock):
                self._unsaved.setdefault(register, self._get(register.name))
            else:
                self._unsaved.pop(register, None)

    def _get(self, name: str) -> int:
        place, signed = self._places[name]
        return int.from_bytes(self._memory[place], "little", signed=signed)

    def _store(self, register: Register, value: int) -> None:
        self._memory[register.address : register.address + register.length] = register.raw(value)

    def _plan(self, address: int, data: bytes, shadow: bool = False) -> list[tuple[Register, int]] | int:
        """The registers these bytes fill and the values they get, or the error number for the first that refuses."""
        if address in self._cells and self._behind(address) != address:
            return self._plan_indirect(address, data, shadow)
        plan: list[tuple[Register, int]] = []
        offset = 0
        while offset < len(data):
            register = self._by_address.get(address + offset)
            if register is None or register.access == "R":
                return emulation.ACCESS
            if register.memory == "EEPROM" and (shadow or self._locked):
                return emulation.ACCESS
            if offset + register.length > len(data):
                return emulation.LENGTH
            value = register.decode(data[offset : offset + register.length])
            if error := self._refusal(register, value):
                return error
            plan.append((register, value))
            offset += register.length
        return plan or emulation.LENGTH

    def _plan_indirect(self, address: int, data: bytes, shadow: bool) -> list[tuple[Register, int]] | int:
        """As `_plan` for bytes that go through indirect data cells: runs of neighbouring targets count as one write."""
        runs: list[tuple[int, bytes]] = []
        for cell, byte in enumerate(data, address):
            if cell not in self._cells:
                return emulation.ACCESS
            place = self._behind(cell)
            if place in self._cells and place != cell:
                return emulation.ACCESS
            if runs and runs[-1][0] + len(runs[-1][1]) == place:
                runs[-1] = (runs[-1][0], runs[-1][1] + bytes((byte,)))
            else:
                runs.append((place, bytes((byte,))))
        plan: list[tuple[Register, int]] = []
        for place, run in runs:
            part = self._plan(place, run, shadow)
            if isinstance(part, int):
                return part
            plan += part
        return plan

    def _refusal(self, register: Register, value: int) -> int:
        name = register.name
        if not register.least <= value <= register.maximum:
            return emulation.RANGE
        if name in _GOALS and self._get("bus_watchdog") == TRIPPED:
            return emulation.RANGE
        if name == "goal_position" and self._get("operating_mode") == 3:
            return 0 if self._get("min_position_limit") <= value <= self._get("max_position_limit") else emulation.LIMIT
        if name in self._limited_by:
            return 0 if abs(value) <= self._get(self._limited_by[name]) else emulation.LIMIT
        if name == "bus_watchdog":
            return emulation.RANGE if value < 0 or (value and self._get(name) == TRIPPED) else 0
        if name == "operating_mode":
            return 0 if value in self._modes else emulation.RANGE
        if name == "drive_mode":
            return emulation.RANGE if value & _FOLLOWER and not self.series.follows else 0
        if name == "baud_rate":
            return 0 if self.series.baud_of(value) else emulation.RANGE
        if name == "lock" and name != self.family.eeprom_lock:
            return 0 if value or not self._get("lock") else emulation.RANGE  # only power-up unlocks
        if name == "torque_enable":
            return emulation.RESULT_FAIL if value and self.shut_down and self.series.shuts_down_by == name else 0
        return 0

    def _take_effect(self, name: str, value: int, switched_on: bool) -> None:
        bank, row = self.bank, self.row
        if name == "goal_position" and self._get("torque_enable"):
            bank.pursue(row)
        elif name == "torque_limit" and value:
            self["hardware_error_status"] = 0
        elif name == "goal_velocity":
            bank.accelerate(row)
        elif name == "torque_enable" and value and switched_on:
            if self._get("operating_mode") == 3:
                bank.to_one_turn(row)
            bank.halt(row)
            if self._get("bus_watchdog") != TRIPPED:
                # A real servo lunges for whatever goal is left from before; so does this one.
                bank.pursue(row)
        elif name == "operating_mode":
            bank.to_one_turn(row) if value == 3 else bank.halt(row)

    def _behind(self, cell: int) -> int:
        pointer = self._cells[cell]
        return self._memory[pointer] | self._memory[pointer + 1] << 8
