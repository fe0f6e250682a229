"""Register counts in words or units, mostly those of the maker's manual."""

from hardware.families.register import Register
from hardware.families.table import ControlTable

_HARDWARE_ERRORS = {1: "input voltage", 4: "overheated", 8: "encoder", 16: "electrical shock", 32: "overload"}
_OPERATING_MODES = {0: "current", 1: "velocity", 3: "position", 4: "extended position", 5: "current-based position",
                    16: "PWM"}  # fmt: skip
_SWITCHES = ("torque_enable", "led", "moving", "registered_instruction", "backup_ready", "lock")


def describe_errors(bits: int, none: str = "no error") -> str:
    """The bits of a hardware error status, or of a shutdown mask, in words."""
    return ", ".join(text for bit, text in _HARDWARE_ERRORS.items() if bits & bit) or none


def meaning(table: ControlTable, register: Register, count: int) -> str:
    """What a count means in a register of a model; "" where it is just a number."""
    name = register.name
    if name == "baud_rate":
        baud = table.series.baud_of(count)
        return f"{baud} baud" if baud else "no baud rate"
    if name == "operating_mode":
        return _OPERATING_MODES.get(count, "unknown")
    if name == "hardware_error_status":
        return describe_errors(table.series.usual_problems(count))
    if name == "shutdown":
        return f"at {describe_errors(table.series.usual_problems(count), 'nothing')}"
    if name in _SWITCHES:
        return "on" if count else "off"
    if register.unit == "pulse":
        return f"{360.0 * count * register.scale / table.pulses_per_turn:.1f} deg"
    if register.unit == "rev/min2":
        return f"{count * register.si:.5g} rad/s2"
    return f"{count * register.scale:.5g} {register.unit}" if register.unit else ""
