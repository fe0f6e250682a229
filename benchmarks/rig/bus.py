"""The servo bus beside dynamixel-sdk and rustypot: 20 servos, one run.

A responder process answers every client with the same prepared bytes and stays awake between two calls, so what is
timed is the client and the operating system. The floor knows the bytes beforehand and only writes, waits and reads:
what no Python client can go below. A call that fails, because the machine was too busy for its deadline, is not timed.
On a busy machine the fastest tenth (p10) tells more than the median. Paced (1 and 4 Mbps) the responder takes the time
that the bytes need on the wire; these figures are medians of five rounds in which every client has its turn.

Ours is measured twice: as a rig uses it (`motiondeck`: the answer of all servos becomes an array of numbers), and with
a status a servo as the others have it (`motiondeck statuses`); in a loop both send goals and question in one write.
`whole rig` has limits, units, health and counters too. Peers that are not installed are left out (pip install
motiondeck[benchmark]).
"""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import platform
import pty
import select
import statistics
import time
import tty
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection
from typing import Annotated, Any, TypeVar

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks import command
from benchmarks.rig._wire_time import rate_limit
from hardware.bus.port import SerialPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.families.dynamixel2 import frames as wire
from hardware.families.dynamixel2.group_reply import GroupReply, WholeReply, fast_reply_length, status_length
from hardware.families.models import USUAL
from hardware.rig.driving.servo_port import SyncWrite
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.state_block import row_layout
from hardware.rig.supervision.rig import Rig

IDS = list(range(1, 21))
GOAL, STATE = (116, 4), (126, 10)
ROUNDS, CALLS = 5, 300
AWAKE = 1e-3  # s
T = TypeVar("T")
Call = Callable[[], bool]
Client = tuple[dict[str, Call], Callable[[], object]]


def rig(baud: int) -> RigConfig:
    joints = tuple(RigJoint(f"joint_{id}", id, "XM430-W350", 1, 2048, -1.5, 1.5, 4.0) for id in IDS)
    return RigConfig("emulated", baud, 100.0, joints)


def respond(announce: Connection, baud: int) -> None:
    """Serves prepared replies on a pseudo-terminal for ever; with a baud rate of 0 they take no time.

    It stays awake for a while after each piece, because a wire and a servo have no wake-up time.
    """
    servos = EmulatedBus(rig(baud or 4_000_000))
    servos.longest_gap = None
    for device in servos.devices:
        device["return_delay_time"] = 0
    memory = servos.devices[0].bank.memory
    master, slave = pty.openpty()
    tty.setraw(slave)
    os.set_blocking(master, False)
    announce.send(os.ttyname(slave))
    replies: dict[bytes, bytes] = {}
    free = asleep_from = 0.0
    while True:
        try:
            data = os.read(master, 65536)
        except BlockingIOError:
            if time.perf_counter() > asleep_from:
                select.select([master], [], [])
            continue
        began = time.perf_counter()
        reply = replies.get(data)
        if reply is None:
            # Servos answer what they understand: a read, or several writes in one piece, which get no answer.
            held = bytes(memory)
            reply = b"".join(answer.data for answer in servos.exchange(data, 0.0))
            if len(replies) > 100 or memory != held:  # what was written may change the answers
                replies.clear()
            replies[data] = reply
        if baud:
            free = max(free, began) + 10.0 * (len(data) + len(reply)) / baud
            while time.perf_counter() < free and reply:
                pass
        if reply:
            os.write(master, reply)
        asleep_from = time.perf_counter() + AWAKE


class Responder:
    """A responder process for the length of a `with` block."""

    def __init__(self, baud: int) -> None:
        here, there = multiprocessing.Pipe()
        self._process = multiprocessing.Process(target=respond, args=(there, baud), daemon=True)
        self._process.start()
        self._port = here

    def __enter__(self) -> str:
        return self._port.recv()

    def __exit__(self, *raised: object) -> None:
        self._process.kill()
        self._process.join()


class Rows:
    """Goals and states of all servos on a bus, as a rig sends and takes them."""

    def __init__(self, port: str, baud: int) -> None:
        self.bus = Bus(SerialPort(port, baud), baud, margin=0.5)
        self.blocks = tuple((id, *STATE) for id in IDS)
        self._buffers: dict[bool, bytearray] = {}
        self._rows: dict[bool, NDArray[Any]] = {}
        for fast, stride, error in ((True, STATE[1] + 4, 0), (False, status_length(STATE[1]), 8)):
            layout = row_layout(np.dtype("<u2,<i4,<i4"), stride, error, error + 1 + fast)
            self._buffers[fast] = bytearray(stride * len(IDS))
            self._rows[fast] = np.frombuffer(self._buffers[fast], dtype=layout)
        self.goals = SyncWrite(IDS, *GOAL, USUAL, slice(None))
        self.wanted = np.full(len(IDS), 2048.0)

    def write(self) -> bool:
        """Sends the goals."""
        return self.bus.port.send(self.goals.frame(self.wanted))

    def ask(self, fast: bool = True) -> None:
        """Asks for the states."""
        self.bus.request(self.blocks, fast)

    def answer(self) -> WholeReply | GroupReply:
        """Waits for the states."""
        while (reply := self.bus.collect()) is None:
            self.bus.port.wait(0.5)
        return reply

    def numbers(self, reply: WholeReply | GroupReply, fast: bool = True) -> bool:
        """Fills an array of records (current, velocity, position), one for each servo; False if some are missing."""
        if not isinstance(reply, WholeReply):
            return False
        self._buffers[fast][:] = reply.rows
        return True


def ours(port: str, baud: int) -> Client:
    servos = Rows(port, baud)

    def read(fast: bool) -> bool:
        servos.ask(fast)
        servos.bus.port.wait(0.5)
        return servos.numbers(servos.answer(), fast)

    calls: dict[str, Call] = {"sync write 4 B": servos.write}
    calls |= {"sync read 10 B": lambda: read(False), "fast sync read 10 B": lambda: read(True)}
    return calls, servos.bus.close


def ours_with_statuses(port: str, baud: int) -> Client:
    bus = Bus(SerialPort(port, baud), baud, margin=0.5)
    goals, wanted = SyncWrite(IDS, *GOAL, USUAL, slice(None)), np.full(len(IDS), 2048.0)
    blocks = tuple((id, *STATE) for id in IDS)

    def sync_write() -> bool:
        return bus.port.send(goals.frame(wanted))

    def fast_read() -> bool:
        return len(bus.bulk_read(blocks, fast=True)) == len(IDS)

    def read() -> bool:
        return len(bus.bulk_read(blocks)) == len(IDS)

    return {"sync write 4 B": sync_write, "sync read 10 B": read, "fast sync read 10 B": fast_read}, bus.close


def floor(port: str, baud: int) -> Client:
    """Writes, waits and reads bytes that it knows beforehand."""
    device = SerialPort(port, baud)
    write = wire.sync_write(*GOAL, b"".join(bytes((id, 0, 8, 0, 0)) for id in IDS))
    reads = {
        "sync read 10 B": (wire.sync_read(*STATE, IDS), len(IDS) * status_length(STATE[1])),
        "fast sync read 10 B": (wire.sync_read(*STATE, IDS, fast=True), fast_reply_length(len(IDS), STATE[1])),
    }

    def exchange(request: bytes, length: int) -> bool:
        device.send(request)
        count = 0
        while count < length and device.wait(0.5):
            count += len(device.receive())
        return count == length

    calls: dict[str, Call] = {"sync write 4 B": lambda: device.send(write)}
    calls |= {what: partial(exchange, *read) for what, read in reads.items()}
    return calls, device.close


def dynamixel_sdk(port: str, baud: int) -> Client:
    import dynamixel_sdk as sdk

    handler, packets = sdk.PortHandler(port), sdk.PacketHandler(2.0)
    handler.setBaudRate(baud)
    writer = sdk.GroupSyncWrite(handler, packets, *GOAL)
    reader = sdk.GroupSyncRead(handler, packets, *STATE)
    data = list((2048).to_bytes(4, "little"))
    for id in IDS:
        writer.addParam(id, data)
        reader.addParam(id)

    def sync_write() -> bool:
        for id in IDS:
            writer.changeParam(id, data)
        return writer.txPacket() == sdk.COMM_SUCCESS

    def read() -> bool:
        return reader.txRxPacket() == sdk.COMM_SUCCESS

    def fast_read() -> bool:
        return reader.fastSyncRead() == sdk.COMM_SUCCESS

    return {"sync write 4 B": sync_write, "sync read 10 B": read, "fast sync read 10 B": fast_read}, handler.closePort


def rustypot(port: str, baud: int) -> Client:
    from rustypot import Xl330PyController

    plain, values = Xl330PyController(port, baud, 0.1), [2048] * len(IDS)

    def sync_write() -> bool:
        plain.sync_write_raw_goal_position(IDS, values)
        return True

    def read() -> bool:
        plain.set_fast_sync_read(False)
        return len(plain.sync_read_raw_data(IDS, *STATE)) == len(IDS)

    def fast_read() -> bool:
        plain.set_fast_sync_read(True)
        return len(plain.sync_read_raw_data(IDS, *STATE)) == len(IDS)

    calls = {"sync write 4 B": sync_write, "sync read 10 B": read, "fast sync read 10 B": fast_read}
    return calls, getattr(plain, "close", lambda: None)


CLIENTS: dict[str, Callable[[str, int], Client]] = {
    "motiondeck": ours,
    "motiondeck statuses": ours_with_statuses,
    "dynamixel-sdk": dynamixel_sdk,
    "rustypot": rustypot,
    "floor": floor,
}


Turn = tuple[Call, Callable[[], object]]
Loop = Callable[[str, int], Turn]


def waiting(make: Callable[[str, int], Client], port: str, baud: int) -> Turn:
    """One turn of a loop: a write, and a read that is waited for."""
    calls, close = make(port, baud)
    write, read = calls["sync write 4 B"], calls["fast sync read 10 B"]
    return lambda: answered(write) and answered(read), close


def in_turns(with_statuses: bool, port: str, baud: int) -> Turn:
    """One turn of a loop: the answer to the last question, then goals and the next question in one write.

    While the wire is busy with these, the answer becomes an array of numbers, or a status a servo.
    """
    servos = Rows(port, baud)
    bus, write, wanted, blocks = servos.bus, servos.goals, servos.wanted, servos.blocks
    servos.ask()

    def turn() -> bool:
        while (reply := bus.collect()) is None:
            bus.port.wait(0.5)
        bus.request(blocks, True, write.frame(wanted))
        if with_statuses and isinstance(reply, WholeReply):
            return len(reply.statuses(IDS)) == len(IDS)
        return servos.numbers(reply)

    return turn, bus.close


def whole_rig(port: str, baud: int) -> Turn:
    """One turn of a loop with a rig."""
    driven = Rig(rig(baud), lambda part: Bus(SerialPort(port, baud), baud))
    targets = np.zeros(len(IDS))

    def turn() -> bool:
        fresh = driven.collect_state()
        driven.write(targets)
        return fresh

    return turn, driven.close


def answered(call: Call) -> bool:
    """Whether a call was answered in time; some clients raise where they were not."""
    try:
        return call()
    except RuntimeError:
        return False


def microseconds(call: Call, count: int = CALLS) -> list[float]:
    taken = []
    for turn in range(count):
        if turn % 8 == 0:
            time.sleep(0.002)  # what is only written must be read, or the pseudo-terminal fills up
        since = time.perf_counter_ns()
        if not answered(call):
            continue
        taken.append((time.perf_counter_ns() - since) * 1e-3)
    return taken


def unpaced(clients: dict[str, Callable[[str, int], Client]]) -> dict[str, dict[str, list[float]]]:
    """How long each call of each client took, us."""
    taken: dict[str, dict[str, list[float]]] = {}
    for _ in range(ROUNDS):
        for name, make in clients.items():
            with Responder(0) as port:
                calls, close = make(port, 4_000_000)
                for what, call in calls.items():
                    answered(call)
                    taken.setdefault(what, {}).setdefault(name, []).extend(microseconds(call))
                close()
    return taken


def at_percentile(taken: dict[str, dict[str, list[float]]], percent: float) -> dict[str, dict[str, float]]:
    """A percentile of each call of each client, us."""
    return {
        what: {name: float(np.percentile(times, percent)) for name, times in of.items()} for what, of in taken.items()
    }


def at_100_hz(loop: Loop, seconds: float = 1.0) -> float:
    """Part of a core that a loop needs to write and read at 100 Hz on 1 Mbps; turns without an answer do not count."""
    with Responder(1_000_000) as port:
        turn, close = loop(port, 1_000_000)
        turn()
        began, used, heard = time.perf_counter(), time.process_time(), 0
        due = began
        while due - began < seconds:
            heard += turn()
            due += 0.01
            time.sleep(max(0.0, due - time.perf_counter()))
        used = time.process_time() - used
        close()
    return used / heard * 100.0 if heard else math.nan


def free_running(loop: Loop, seconds: float = 0.5) -> tuple[float, float]:
    """How often a loop writes and reads on 4 Mbps, Hz, and what it computes meanwhile, us a turn.

    The rest of a turn is the wire and the pseudo-terminal, whose kernel worker has to wait on a busy machine.
    """
    with Responder(4_000_000) as port:
        turn, close = loop(port, 4_000_000)
        turn()
        began, used, count = time.perf_counter(), time.process_time(), 0
        while time.perf_counter() - began < seconds:
            count += turn()
        used, lasted = time.process_time() - used, time.perf_counter() - began
        close()
    return count / lasted, used / max(count, 1) * 1e6


def in_rounds(measure: Callable[[Loop], T], loops: dict[str, Loop]) -> dict[str, list[T]]:
    """What each loop takes, over rounds in which all have their turn: a machine is not the same all the time."""
    rounds = [{name: measure(loop) for name, loop in loops.items()} for _ in range(ROUNDS)]
    return {name: [taken[name] for taken in rounds] for name in loops}


def main(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of lines.")] = False,
) -> None:
    clients = {
        name: make
        for name, make in CLIENTS.items()
        if name in ("motiondeck", "motiondeck statuses", "floor") or _installed(name)
    }
    loops: dict[str, Loop] = {name: partial(waiting, make) for name, make in clients.items()}
    loops |= {"motiondeck": partial(in_turns, False), "motiondeck statuses": partial(in_turns, True)}
    loops |= {"whole rig": whole_rig}
    taken = unpaced(clients)
    medians, quiet = at_percentile(taken, 50.0), at_percentile(taken, 10.0)
    limit = rate_limit(len(IDS), 4_000_000, STATE[1])
    busy = in_rounds(at_100_hz, loops)
    free = in_rounds(free_running, {name: loop for name, loop in loops.items() if name != "whole rig"})
    report = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}",
        "unpaced_median_us": medians,
        "unpaced_p10_us": quiet,
        "ratio_to_motiondeck": {
            what: {name: round(us / of["motiondeck"], 2) for name, us in of.items()} for what, of in medians.items()
        },
        "core_at_100_hz_1_mbps": {name: statistics.median(taken) for name, taken in busy.items()},
        "free_running_hz_4_mbps": {name: statistics.median(hz for hz, _ in taken) for name, taken in free.items()}
        | {"wire limit": limit},
        "computing_us_a_turn_4_mbps": {name: statistics.median(us for _, us in taken) for name, taken in free.items()},
    }
    if as_json:
        print(json.dumps(report))
        return
    print(report["machine"])
    for percent, times in (("p50", medians), ("p10", quiet)):
        for what, of in times.items():
            print(
                f"{what:<19} {percent}  "
                + "   ".join(f"{name} {us:7.1f} us (x{us / of['motiondeck']:.2f})" for name, us in of.items())
            )
    for what, unit, scale in (
        ("core_at_100_hz_1_mbps", "% of a core", 100.0),
        ("free_running_hz_4_mbps", "Hz", 1.0),
        ("computing_us_a_turn_4_mbps", "us", 1.0),
    ):
        print(f"{what:<24} " + "   ".join(f"{name} {value * scale:.1f} {unit}" for name, value in report[what].items()))


def _installed(name: str) -> bool:
    import importlib.util

    return importlib.util.find_spec(name.replace("-", "_")) is not None


if __name__ == "__main__":
    command.run("bus", main, __doc__)
