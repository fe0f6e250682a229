"""A relay between a deck's serial port and an emulated rig: passes bytes on unchanged, and records when which passed.

A process of its own that imports nothing but the standard library, so that nothing of the project can delay or blind
it. It prints the port for the deck. Lines on its standard input: `cut` (whatever comes is lost, both ways), `join`;
its end ends the relay. The record is a sequence of

    time (CLOCK_MONOTONIC, ns, uint64) | way (uint8) | length (uint32) | the bytes

What is written to a pseudo-terminal is handed over by a worker of the kernel without priority, on a busy machine tens
of milliseconds later: frames that were sent in time then come in a bunch. So the relay also sends itself a byte on a
pseudo-terminal of its own every few milliseconds, and records how late a slow one came (PROBE, in ns, uint64).
"""

from __future__ import annotations

import contextlib
import os
import pty
import select
import struct
import sys
import termios
import time
import tty
from collections.abc import Iterator
from pathlib import Path

ENTRY = struct.Struct("<QBI")
TO_SERVOS, FROM_SERVOS, LOST = 0, 1, 2  # LOST is added to the way of bytes that came while the bus was cut
PROBE = 4
_PROBED_EVERY, _SLOW = 3_000_000, 1_000_000  # ns
_SPEED = 4, 5  # places of the speeds in a terminal's settings


def relay(device: str, baud: int, record: str) -> None:
    """Relays between a new pseudo-terminal, whose name it prints, and a device until standard input ends."""
    with contextlib.suppress(OSError):  # where that is permitted, a busy machine does not make frames look late
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
    servos = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(servos)
    settings = termios.tcgetattr(servos)
    for place in _SPEED:
        settings[place] = getattr(termios, f"B{baud}")
    termios.tcsetattr(servos, termios.TCSANOW, settings)
    deck, kept_open = pty.openpty()
    probed, probing = pty.openpty()
    for terminal in (kept_open, probing):
        tty.setraw(terminal)
    os.set_blocking(deck, False)
    file = os.open(record, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    print(os.ttyname(kept_open), flush=True)
    ways = {deck: (TO_SERVOS, servos), servos: (FROM_SERVOS, deck)}
    cut, probed_at, probe_due = False, 0, 0
    with select.epoll() as ready:
        for source in (0, deck, servos, probed):
            ready.register(source, select.EPOLLIN)
        while True:
            for source, _ in ready.poll(1e-9 * _PROBED_EVERY):
                if source == 0:
                    words = os.read(0, 4096).split()
                    if not words:
                        return
                    cut = words[-1] == b"cut"
                    continue
                if source == probed:
                    os.read(probed, 1)
                    took, probed_at = time.monotonic_ns() - probed_at, 0
                    if took > _SLOW:
                        os.write(file, ENTRY.pack(time.monotonic_ns(), PROBE, 8) + took.to_bytes(8, "little"))
                    continue
                way, target = ways[source]
                try:
                    data = os.read(source, 65536)
                except BlockingIOError:
                    continue
                now = time.monotonic_ns()
                if not cut:
                    # A wire does not wait: bytes for which there is no room are lost.
                    with contextlib.suppress(BlockingIOError):
                        os.write(target, data)
                os.write(file, ENTRY.pack(now, way + LOST * cut, len(data)) + data)
            if probed_at == 0 and (now := time.monotonic_ns()) >= probe_due:
                # From when it was due: the host of a virtual machine may have taken the cores away meanwhile.
                probed_at, probe_due = probe_due or now, now + _PROBED_EVERY
                os.write(probing, b"?")


def slowest_handover(record: Path, start: float, end: float) -> float:
    """How long the slowest probe took that was under way between two times, s."""
    slowest = 0.0
    for now, way, data in entries(record):
        if way == PROBE:
            took = 1e-9 * int.from_bytes(data, "little")
            if 1e-9 * now > start and 1e-9 * now - took < end:
                slowest = max(slowest, took)
    return slowest


def entries(record: Path) -> Iterator[tuple[int, int, bytes]]:
    """Time (ns), way and bytes of each whole entry of a record."""
    data, at = record.read_bytes(), 0
    while at + ENTRY.size <= len(data):
        now, way, length = ENTRY.unpack_from(data, at)
        at += ENTRY.size
        if at + length > len(data):
            return
        yield now, way, data[at : at + length]
        at += length


def main() -> None:
    """Relays as the command line says: DEVICE BAUD RECORD."""
    device, baud, record = sys.argv[1:]
    relay(device, int(baud), record)
