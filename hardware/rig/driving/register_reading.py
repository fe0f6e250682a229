"""Reads all registers of one servo while a loop drives the rig, in small parts in place of some state reads.

In such a tick no state is read, so states are one tick older; goals go out as always. A write goes out in front of the
first part, unanswered, and is verified by what is read then.

Only registers that the rig neither sets nor relies on can be written, and only of a servo that was switched off on
command. For all others there are the rig file, `rig doctor --fix` and `rig setup`.
"""

from hardware.errors import RigError
from hardware.families.register import Register, decode_block
from hardware.families.table import ControlTable
from hardware.rig.registers import parts
from hardware.rig.rig_joint import RigJoint

WRITABLE = ("led", "led_red", "led_green", "led_blue", "moving_threshold", "position_d_gain")
EVERY = 4  # requests from one part to the next
_MOST_BYTES = 32  # of a part: 0.3 ms at 1 Mbaud
_TRIES = 4  # of each part


class RegisterReading:
    """The registers of one servo, read part by part by `Readings`."""

    def __init__(self, joint: int, servo: RigJoint, write: tuple[str, int] | None = None) -> None:
        """Prepares to read, and before that to write a count into a register.

        RigError if that register cannot be written, or takes no such count; the message says what can be.
        """
        self.joint = joint  # its index in the rig file
        self.counts: dict[str, int] = {}  # read so far, by the register's name
        self.failure = ""  # why it ended early, or ""
        self._servo, self._wanted = servo, write
        self._parts = parts(shown_registers(servo.table), _MOST_BYTES)
        self._tries = _TRIES
        # The frame to send in front of the next request, once.
        self.write = b"" if write is None else _frame(servo, *write)

    @property
    def done(self) -> bool:
        """Whether all is read, or it has failed."""
        return bool(self.failure) or not self._parts

    @property
    def block(self) -> tuple[int, int, int]:
        """The next part to read: id, address, length."""
        rows = self._parts[0]
        return self._servo.id, rows[0].address, rows[-1].address + rows[-1].length - rows[0].address

    def take(self, data: bytes | None) -> None:
        """Keeps the bytes of a part; None where no answer came."""
        if data is None or len(data) != self.block[2]:
            self._tries -= 1
            if not self._tries:
                self.failure = f"{self._servo.label} does not let its registers be read"
            return
        rows, self._tries = self._parts.pop(0), _TRIES
        self.counts |= decode_block(rows, data, rows[0].address)
        if not self._parts and self._wanted is not None:
            name, count = self._wanted
            if self.counts[name] != count:
                self.failure = f"{self._servo.name} did not take {count} in {name}, it still has {self.counts[name]}"


def shown_registers(table: ControlTable) -> list[Register]:
    """The registers of a model without the indirect cells, which are the rig's own."""
    return [row for row in table.registers.values() if not row.name.startswith("indirect_")]


def _frame(servo: RigJoint, name: str, count: int) -> bytes:
    table = servo.table
    if name not in WRITABLE or name not in table.registers:
        can = ", ".join(one for one in WRITABLE if one in table.registers)
        raise RigError(
            f"{name} of {servo.name} is not written here: the rig relies on it, or it is none of its registers. "
            f"These can be written: {can}. See motiondeck rig doctor RIG --fix for what the rig needs."
        )
    register = table[name]
    try:
        entry = bytes((servo.id,)) + register.encode(count)
    except ValueError as error:
        raise RigError(f"{servo.name}: {error}") from error
    return table.family.instructions.sync_write(register.address, register.length, entry)
