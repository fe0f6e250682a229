"""The load of a rig's tick on its wire, and the refusal of rigs whose goals would collide with replies.

Goals, the read request behind them and all replies must fit into one tick, also into the one of each second that sends
speeds and watchdogs again: bytes sent during a reply destroy both.
"""

from collections.abc import Sequence

import numpy as np

from hardware.bus.sync_write import SyncWrite
from hardware.errors import RigError
from hardware.rig.counters import RigFaults
from hardware.rig.driving.readings import Measurements, Readings
from hardware.rig.registers import same_place
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import RigScale
from hardware.rig.state_block import StateBlock

_WRITTEN = ("goal_position", "profile_velocity", "bus_watchdog")
_SHORT_DELAY = 20e-6  # s; a servo's answer that starts so soon costs nothing that could be saved


def longest_tick(config: RigConfig, blocks: Sequence[StateBlock], fast: bool, return_delays: Sequence[float]) -> float:
    """The longest time of goals, a request and its replies while all servos of one port answer, s.

    For the block read of each joint and the return delay of its servo, s; `fast` if servos may answer in a joint reply.
    """
    config = config.servos
    count = len(config.joints)
    readings = Readings(config, range(count), RigScale(config), Measurements(count), RigFaults.none(count))
    readings.start(range(count), np.zeros(count), blocks, 0.0)
    written = sum(
        len(SyncWrite([config.joints[index].id for index in members], address, length, family).frame())
        for name in _WRITTEN
        for (family, address, length), members in same_place(config, name).items()
    )
    longest = 0.0
    for request in readings.every_request():
        read = config.joints[request.joints[0]].table.family.group_read(request.blocks, fast)
        delays = [return_delays[index] for index in request.joints]
        answered_after = max(delays) if read.fast else sum(delays)
        longest = max(longest, 10.0 * (written + len(read.frame) + read.needed) / config.baud + answered_after)
    return longest


def refuse_slow_wire(
    config: RigConfig, blocks: Sequence[StateBlock], fast: bool, return_delays: Sequence[float]
) -> None:
    """Raises a RigError with the remedy if a rig's ticks do not fit on its wire; arguments as of `longest_tick`."""
    longest = longest_tick(config, blocks, fast, return_delays)
    if longest * config.rate_hz <= 1.0:
        return
    slow = max(return_delays)
    quicker = "motiondeck rig doctor --fix shortens their return delay; or lower" if slow > _SHORT_DELAY else "Lower"
    raise RigError(
        f"the wire is too slow for rate_hz {config.rate_hz:g}: goals and answers of {len(blocks)} servos take "
        f"{longest * 1e3:.1f} ms at {config.baud} baud, a tick is {1e3 / config.rate_hz:.1f} ms. "
        f"{quicker} rate_hz to {int(1.0 / longest)}, or raise baud."
    )
