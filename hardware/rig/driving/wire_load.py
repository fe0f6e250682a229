"""How long a tick of a rig takes on the wire, and a refusal of rigs whose goals would meet the answers to the last.

Whoever sends while servos answer loses both. So the goals, the question behind them and all answers must be over within
a tick, also in the one of each second that tells the servos their speeds and watchdogs again.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hardware.bus.group_read import group_read
from hardware.bus.sync_write import SyncWrite
from hardware.errors import RigError
from hardware.rig.driving.readings import Readings
from hardware.rig.driving.state_block import StateBlock
from hardware.rig.faults import RigFaults
from hardware.rig.registers import same_place
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import RigScale

_WRITTEN = ("goal_position", "profile_velocity", "bus_watchdog")
_SHORT_DELAY = 20e-6  # s; a servo's answer that starts so soon costs nothing that could be saved


def longest_tick(config: RigConfig, blocks: Sequence[StateBlock], fast: bool, return_delays: Sequence[float]) -> float:
    """The longest that goals, a question and its answers take while all servos answer, s.

    Args:
        config: of the servos on one port.
        blocks: what each joint is asked for.
        fast: whether the servos of Protocol 2.0 answer in one joint reply.
        return_delays: how long each joint's servo waits before it answers, s.
    """
    everybody = range(len(config.joints))
    scale = RigScale(config)
    readings = Readings(config, scale, RigFaults.none(len(everybody)))
    readings.start(everybody, np.zeros(len(everybody)), blocks, 0.0)
    written = sum(
        len(SyncWrite([config.joints[index].id for index in members], address, length, old=protocol == 1).frame())
        for name in _WRITTEN
        for (protocol, address, length), members in same_place(config, name).items()
    )
    longest = 0.0
    for question in readings.every_question():
        read = group_read(question.asked, fast, config.joints[question.joints[0]].table.protocol == 1)
        delays = [return_delays[index] for index in question.joints]
        answered_after = max(delays) if fast and not read.old else sum(delays)
        longest = max(longest, 10.0 * (written + len(read.frame) + read.needed) / config.baud + answered_after)
    return longest


def refuse_slow_wire(
    config: RigConfig, blocks: Sequence[StateBlock], fast: bool, return_delays: Sequence[float]
) -> None:
    """Refuses a rig whose ticks do not fit on its wire; the arguments are those of `longest_tick`.

    Raises:
        RigError: it says how long a tick takes, and what makes it shorter.
    """
    longest = longest_tick(config, blocks, fast, return_delays)
    if longest * config.rate_hz <= 1.0:
        return
    slow = max(return_delays)
    quicker = "motiondeck rig doctor --fix shortens their return delay; or lower" if slow > _SHORT_DELAY else "Lower"
    raise RigError(
        f"the wire is too slow for rate_hz {config.rate_hz:g}: goals and answers of {len(config.joints)} servos take "
        f"{longest * 1e3:.1f} ms at {config.baud} baud, a tick is {1e3 / config.rate_hz:.1f} ms. "
        f"{quicker} rate_hz to {int(1.0 / longest)}, or raise baud."
    )
