"""Scan of a bus for servos: every baud rate, both protocols."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from hardware.bus.servo_bus import Bus, Identity

LIKELY_BAUDS = (57600, 1_000_000, 4_000_000, 2_000_000, 3_000_000, 115_200, 9600)
"""Where a servo is looked for, the likely rates first."""


class Found(NamedTuple):
    """A servo that answered a scan."""

    baud: int
    identity: Identity


def scan(
    open_bus: Callable[[int], Bus],
    bauds: Iterable[int] = LIKELY_BAUDS,
    on_garbled: Callable[[int], object] = lambda baud: None,
) -> list[Found]:
    """The servos that answer at each baud rate, in both protocols; the likely rates first.

    Args:
        open_bus: opens the port at a baud rate.
        bauds: where to look.
        on_garbled: called with each baud rate at which some bytes are no answer: two servos may share an ID.
    """
    found: list[Found] = []
    for baud in bauds:
        bus = open_bus(baud)
        try:
            found += [Found(baud, identity) for identity in bus.ping_all()]
            if bus.garbled:
                on_garbled(baud)
            found += [Found(baud, identity) for identity in bus.ping_each()]
        finally:
            bus.close()
    return found
