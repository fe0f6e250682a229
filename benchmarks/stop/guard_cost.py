"""The cost of a rig's guard: delay, start, processor time and memory.

Targets of servo20's rig are written as a deck writes them, once through the guard and once to a rig in this process, in
turn. `delay` is from writing the targets to the bytes at the far end of the port, us. `start` is from nothing to
torque on, s; with the guard that includes its process. `tick` is the processor time of a tick, us: with the guard that
of the deck's side and that of the guard's process. `memory` is the guard's own (proportional set size), MB.
"""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, Protocol

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks.command import run
from controller.library.motion_library import load_library
from controller.loop.permissions import FIFO_PRIORITY, request_realtime
from hardware.emulator.process import start_emulator
from hardware.rig.rig_file import RigConfig, load_rig
from hardware.rig.supervision.rig import Rig
from motiondeck.run.guard.guarded_rig import connect, guard_process
from motiondeck.run.robots.rig_output import narrowed
from motiondeck_base.shipped import find_library, find_rig, find_robot
from sim.robots.robot import load_robot

Array = NDArray[np.float64]
_SYNC_WRITE, _GOAL = b"\x83", 116  # the instruction, and the address of the goal position


class Driven(Protocol):
    """A rig, or one behind its guard."""

    positions: Array

    def collect_state(self) -> bool:
        """Takes what has been measured."""
        ...

    def write(self, targets: Array) -> None:
        """Writes the targets of a tick."""

    def close(self) -> list[str]:
        """Switches off."""
        ...


class Tap:
    """A pseudo-terminal before the emulator's, which notes when each sync write of goals comes."""

    def __init__(self, port: str, baud: int) -> None:
        self._servos = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self._deck, slave = os.openpty()
        self.port, self._slave = os.ttyname(slave), slave
        tty.setraw(slave)
        tty.setraw(self._servos)
        settings = termios.tcgetattr(self._servos)
        settings[4:6] = [getattr(termios, f"B{baud}")] * 2
        termios.tcsetattr(self._servos, termios.TCSANOW, settings)
        self.times: list[float] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._pass_on)
        self._thread.start()

    def _pass_on(self) -> None:
        with select.epoll() as ready:
            ready.register(self._deck, select.EPOLLIN)
            ready.register(self._servos, select.EPOLLIN)
            while not self._over.is_set():
                for source, _ in ready.poll(0.05):
                    data = os.read(source, 65536)
                    if source == self._deck and _SYNC_WRITE + bytes([_GOAL, 0]) in data:
                        self.times.append(time.monotonic())
                    os.write(self._servos if source == self._deck else self._deck, data)

    def close(self) -> None:
        """Ends it."""
        self._over.set()
        self._thread.join()
        for file in (self._servos, self._deck, self._slave):
            os.close(file)


@contextmanager
def directly(config: RigConfig, port: str) -> Iterator[tuple[Driven, int]]:
    """The rig in this process."""
    rig = Rig.connect(config, [port])
    try:
        yield rig, 0
    finally:
        rig.close()


@contextmanager
def guarded(config: RigConfig, port: str) -> Iterator[tuple[Driven, int]]:
    """The rig behind its guard, and the guard's process."""
    library = load_library(find_library("thesis15"))
    robot = load_robot(find_robot("servo20"), library.skeleton)
    limits = narrowed(robot.limits, robot, config)
    places = [robot.joints.index(name) for name in config.names]
    with guard_process() as (link, process):
        rig = connect(link, process, config, limits, places, [port], None)
        try:
            yield rig, process.pid
        finally:
            rig.close()


def measure(
    driver: Callable[[RigConfig, str], AbstractContextManager[tuple[Driven, int]]],
    config: RigConfig,
    port: str,
    seconds: float,
) -> dict[str, list[float]]:
    """The figures of one run."""
    began = time.monotonic()
    with ExitStack() as opened:
        tap = Tap(port, config.baud)
        opened.callback(tap.close)
        rig, pid = opened.enter_context(driver(config, tap.port))
        started = time.monotonic() - began
        period = 1.0 / config.rate_hz
        targets, due = rig.positions.copy(), time.monotonic()
        delays: list[float] = []
        spent, of_guard, ticks = 0.0, 0.0, 0
        for tick in range(round(seconds * config.rate_hz)):
            due += period
            time.sleep(max(0.0, due - time.monotonic()))
            if tick == config.rate_hz:
                of_guard, spent, ticks = cpu(pid), 0.0, 0
            if tick > config.rate_hz:
                targets[0] += 0.05 * period * (1 if tick // config.rate_hz % 2 else -1)
            known = len(tap.times)
            before, at = time.thread_time(), time.monotonic()
            rig.collect_state()
            rig.write(targets)
            spent, ticks = spent + time.thread_time() - before, ticks + 1
            time.sleep(0.6 * period)
            delays += [come - at for come in tap.times[known:] if come - at > 0.0]
        of_guard = cpu(pid) - of_guard
        memory = pss(pid)
    us = 1e6 * np.array(delays[round(config.rate_hz) :])
    return {
        "start s": [started],
        "delay us": us.tolist(),
        "tick, here us": [1e6 * spent / ticks],
        "tick, guard us": [1e6 * of_guard / ticks],
        "memory MB": [memory],
    }


def cpu(pid: int) -> float:
    """The processor time of a process so far, s; 0 for none."""
    if not pid:
        return 0.0
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def pss(pid: int) -> float:
    """The proportional set size of a process, MB; 0 for none."""
    if not pid:
        return 0.0
    rollup = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return next(int(line.split()[1]) for line in rollup if line.startswith("Pss:")) / 1024.0


def main(
    rounds: Annotated[int, typer.Option(help="Runs of each kind.")] = 3,
    seconds: Annotated[float, typer.Option(help="Of a run.")] = 5.0,
) -> None:
    """The cost of a rig's guard: delay, start, processor time and memory."""
    config = load_rig(find_rig("servo20"))
    request_realtime(FIFO_PRIORITY - 1)  # as a deck
    found: dict[str, dict[str, list[float]]] = {"in the deck": {}, "behind the guard": {}}
    with start_emulator(find_rig("servo20")) as emulator:
        for _ in range(rounds):
            for name, driver in zip(found, (directly, guarded), strict=True):
                for figure, values in measure(driver, config, emulator.port, seconds).items():
                    found[name].setdefault(figure, []).extend(values)
    print(f"| {'the rig':18}| start s | delay us p50 | p99 | tick, here us | tick, guard us | memory MB |")
    print("|---|---|---|---|---|---|---|")
    for name, figures in found.items():
        p50, p99 = np.percentile(figures["delay us"], (50.0, 99.0))
        start, here, there, memory = (
            float(np.median(figures[key])) for key in ("start s", "tick, here us", "tick, guard us", "memory MB")
        )
        print(f"| {name:18}| {start:.2f} | {p50:.0f} | {p99:.0f} | {here:.0f} | {there:.0f} | {memory:.0f} |")


if __name__ == "__main__":
    sys.exit(run("guard_cost", main))
