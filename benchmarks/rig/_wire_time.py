"""How often a bus can be written to and read: the arithmetic of bytes, return delay and USB latency.

    bytes       sync write 14 + n (L + 1)    read request 14 + n    sync reply n (11 + L)    fast reply 8 + n (L + 4)
    seconds     10 bits a byte / baud; a sync read waits the return delay of each servo, a fast one only once

n servos, L data bytes each; stuffing, gaps and what the servos think beyond their return delay are left out.
"""

from __future__ import annotations

from hardware.families.dynamixel2.group_reply import fast_reply_length, status_length

_GROUP_HEAD = 14  # header, ID, length, instruction, address, data length, checksum
_GOAL = 4


def write_time(servos: int, baud: int, length: int = _GOAL) -> float:
    """How long a sync write takes, s."""
    return 10.0 * (_GROUP_HEAD + servos * (length + 1)) / baud


def read_time(
    servos: int, baud: int, length: int, fast: bool = True, return_delay: float = 0.0, latency: float = 0.0
) -> float:
    """How long a group read takes, s, with one whole period of the USB latency timer (s)."""
    request = _GROUP_HEAD + servos
    if fast:
        return 10.0 * (request + fast_reply_length(servos, length)) / baud + return_delay + latency
    reply = servos * status_length(length)
    return 10.0 * (request + reply) / baud + servos * return_delay + latency


def rate_limit(
    servos: int, baud: int, length: int, fast: bool = True, return_delay: float = 0.0, latency: float = 0.0
) -> float:
    """How often goals can be written and the state be read, Hz."""
    return 1.0 / (write_time(servos, baud) + read_time(servos, baud, length, fast, return_delay, latency))
