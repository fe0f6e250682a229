"""The control tables of the P series and of PRO(A) (e-Manual, each model's page): one layout, each model's own limits.

PRO(A) is the older series, with the same limits and without the newest registers. Both count positions from half a turn
below 0 to half a turn above, and refuse a profile beyond their velocity or acceleration limit. The pages of PRO(A) tell
no gains; those are left as they are. The indirect addresses are in EEPROM.
"""

from dataclasses import replace

from hardware.families.dynamixel2.traits import TRAITS
from hardware.families.rows import file_beside
from hardware.families.table import ControlTable, parse_table
from hardware.families.traits import Traits

_LAYOUT = file_beside(__file__, "p_series.txt")

_NOT_IN_PRO_A = ("protocol_type", "startup_configuration", "backup_ready")
_GAINS = ("velocity_i_gain", "velocity_p_gain", "position_p_gain")
_NO_GAINS = ("position_d_gain", "position_i_gain", "feedforward_2nd_gain", "feedforward_1st_gain")  # 0 as delivered


def _table(model: str, traits: Traits) -> ControlTable:
    number, current, velocity, half_turn, ends, most_acceleration, acceleration, shutdown, threshold, *gains = (
        traits.figures
    )
    table = parse_table(model, number, 2 * half_turn, _LAYOUT, traits.series)

    def limit(name: str, minimum: int, maximum: int, default: int | None) -> None:
        table.registers[name] = replace(table[name], minimum=minimum, maximum=maximum, default=default)

    limit("model_number", 0, 65535, number)
    limit("moving_threshold", 0, velocity, threshold)
    limit("current_limit", 0, current, current)
    limit("acceleration_limit", 0, most_acceleration, acceleration)
    limit("velocity_limit", 0, velocity, velocity)
    limit("max_position_limit", -half_turn, half_turn, ends)
    limit("min_position_limit", -half_turn, half_turn, -ends)
    limit("shutdown", 0, 63 if gains else 255, shutdown)
    limit("goal_current", -current, current, current)
    limit("present_current", -current, current, None)
    limit("goal_velocity", -velocity, velocity, 0)
    limit("profile_acceleration", 0, most_acceleration, 0)
    limit("profile_velocity", 0, velocity, 0)
    for name, gain in zip(_GAINS, gains, strict=False):
        table.registers[name] = replace(table[name], default=gain)
    if not gains:  # PRO(A)
        limit("drive_mode", 0, 1, 0)
        for name in (*_GAINS, *_NO_GAINS):
            table.registers[name] = replace(table[name], default=None)
        for name in _NOT_IN_PRO_A:
            del table.registers[name]
    return table


P_SERIES: dict[str, ControlTable] = {
    model: _table(model, traits) for model, traits in TRAITS.items() if traits.series.name == "P"
}
"""By model name."""
