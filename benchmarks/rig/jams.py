"""True currents of jammed servos, for every model with a limit of current.

Eight joints of each model move and are blocked: in motion both ways, at rest under targets both ways, released and
blocked again; at the lowest and the highest supply that the maker allows, with and without a load, with two limits.
What a count of current means is transcribed here from each model's page; the current follows from voltage and speed:

    I = (U / U_nominal - speed / no_load_speed) * counts at stall * A per count

A joint fails if its current is above the rig file's limit after the first 20 ms of a jam, or at all while it is free.
The exit code is 1 if one does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import cycle
from typing import Annotated, NamedTuple

import numpy as np
import typer

from benchmarks import command
from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.servos.device import Device
from hardware.errors import RigError
from hardware.families.models import MODELS
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.tools.doctor import fix_settings

# Of the maker's pages: mA a count, stall current (A; of the P series the current limit), lowest and highest supply (V).
_PAGES = """
2.69  2.3   10.0 14.8  XM430-W350 XM430-W210
2.69  1.3   10.0 14.8  XH430-W350 XH430-W210 XD430-T350 XD430-T210 XW430-T200 XW430-T333
1.34  0.7   24.0 29.0  XH430-V350 XH430-V210
2.69  4.4   10.0 14.8  XM540-W270 XM540-W150
2.69  4.9   10.0 14.8  XH540-W270 XH540-W150 XD540-T270 XD540-T150 XW540-T260 XW540-T140
2.69  2.4   24.0 29.0  XH540-V270 XH540-V150 XW540-H260
1.0   1.47  3.7  6.0   XL330-M077 XL330-M288
1.0   1.8   3.7  6.0   XC330-M181 XC330-M288
1.0   0.88  6.5  12.0  XC330-T181 XC330-T288
1.0   0.80  6.5  12.0  XM335-T323
3.36  4.1   10.0 14.8  MX-64
3.36  5.2   10.0 14.8  MX-106
1.0   22.74 24.0 24.0  PH54-200-S500 H54-200-S500-RA
1.0   15.9  24.0 24.0  PH54-100-S500 H54-100-S500-RA
1.0   4.5   24.0 24.0  PH42-020-S300 H42-20-S300-RA
1.0   7.98  24.0 24.0  PM54-060-S250 M54-60-S250-RA
1.0   4.47  24.0 24.0  PM54-040-S250 M54-40-S250-RA
1.0   1.461 24.0 24.0  PM42-010-S260 M42-10-S260-RA
"""
STEP = 0.002  # s from one look at the current to the next
ALLOWED = 0.02  # s above the limit from the beginning of a jam
_TOLERANCE = 1.01  # of the limit: a register may hold so much
_TICKS = 100  # a second
_BAUD = 3_000_000


class Page(NamedTuple):
    """What a model's page says: A a count, stall current (A), lowest and highest supply (V)."""

    count: float
    stall: float
    volts: tuple[float, float]


def _pages() -> Iterator[tuple[str, Page]]:
    for line in filter(None, _PAGES.splitlines()):
        unit, stall, low, high, *models = line.split()
        for model in models:
            yield model, Page(float(unit) * 1e-3, float(stall), (float(low), float(high)))


PAGES = dict(_pages())


class Phase(NamedTuple):
    """A part of a run: whether the joint is blocked, for how long (s), and its target, "sine" or an angle (rad)."""

    blocked: bool
    seconds: float
    target: str | float = "sine"


PHASES = (
    Phase(False, 0.75), Phase(True, 1.0), Phase(False, 0.8), Phase(True, 1.0), Phase(False, 1.5, 0.0),
    Phase(True, 0.3, 0.0), Phase(True, 0.8, 0.9), Phase(True, 0.8, -0.9), Phase(False, 1.0, -0.9), Phase(False, 1.0),
    Phase(True, 0.5), Phase(False, 0.1), Phase(True, 0.8),
)  # fmt: skip


class Way(NamedTuple):
    """One joint: its limit of current and its load, in parts of those at stall, and its supply, 0 for the lowest."""

    limit: float
    load: float
    supply: float


WAYS = tuple(Way(limit, load, supply) for limit in (0.15, 0.5) for load in (0.0, 0.1) for supply in (0.0, 1.0))


class Found(NamedTuple):
    """What the currents of the joints of one model did, in parts of their limits.

    Attributes:
        mode: in which the servos ran.
        at_first, later: the highest within the first 20 ms of a jam, and at any other time.
        above: the longest time above the limit in a jam, s.
        stopped: why the rig stopped; "" if it did not.
        yielded: whether the rig said of each joint that it gives way.
    """

    mode: int
    at_first: float
    later: float
    above: float
    stopped: str
    yielded: bool

    @property
    def wrong(self) -> bool:
        """Whether a limit was not kept, or a joint never gave way."""
        return bool(self.later > _TOLERANCE or self.above > ALLOWED or self.stopped or not self.yielded)


def jam(model: str, across: bool = False, ways: Sequence[Way] = WAYS) -> Found:
    """Plays all phases with a joint for each way, on one bus; every other one is turned round.

    Where the range of the joints is `across` the ends of the servo's one turn, it runs in a mode that counts turns.
    """
    page = PAGES[model]
    limits = np.array([way.limit * page.stall for way in ways])
    middle = 0 if "-RA" in model or model.startswith("P") else 2048
    zero = MODELS[model].one_turn[0] if across else middle
    joints = tuple(
        RigJoint(f"joint_{id}", id, model, 1 - 2 * (id % 2), zero, -1.3, 1.3, 2.0, current=float(limit))
        for id, limit in enumerate(limits, 1)
    )
    config = RigConfig("emulated", _BAUD, float(_TICKS), joints)
    port = EmulatedPort(EmulatedBus(config), True)
    servos = port.bus.devices
    drive = servos[0].bank.drive  # all servos of a model are in one bank
    drive.supply[:] = [page.volts[0] + way.supply * (page.volts[1] - page.volts[0]) for way in ways]
    fix_settings(config, Bus(port, config.baud))  # the P series comes without protection against heat
    rig = Rig(config, lambda part: Bus(port, config.baud), False, sleep=port.elapse)
    drive.load[:] = [way.load * joint.direction for way, joint in zip(ways, joints, strict=True)]
    at_first = later = above = since = time = 0.0
    over = np.zeros(len(ways))  # s above the limit so far
    stopped = ""
    for phase in PHASES:
        if phase.blocked and not drive.jammed[0]:
            since = 0.0
        drive.jammed[:] = phase.blocked
        for _ in range(round(phase.seconds * _TICKS)):
            time += 1.0 / _TICKS
            angle = 0.8 * math.sin(3.0 * time) if isinstance(phase.target, str) else phase.target
            try:
                rig.collect_state()
                rig.write(np.full(len(ways), angle))
            except RigError as error:
                stopped = stopped or str(error)
            for _ in range(round(1.0 / _TICKS / STEP)):
                port.elapse(STEP)
                shares = page.count * np.array([true_current(servo) for servo in servos]) / limits
                since += STEP
                highest = float(shares.max())
                if phase.blocked and since <= ALLOWED + 0.5 * STEP:
                    at_first = max(at_first, highest)
                else:
                    later = max(later, highest)
                over = np.where(phase.blocked & (shares > _TOLERANCE), over + STEP, 0.0)
                above = max(above, float(over.max()))
    yielded = {incident.source for incident in rig.incidents if "gives way" in incident.what}
    return Found(servos[0]["operating_mode"], at_first, later, above, stopped, len(yielded) == len(ways))


def true_current(servo: Device) -> float:
    """The size of a servo's current by voltage and speed, in counts of its registers."""
    bank, row = servo.bank, servo.row
    drive, motor = bank.drive, bank.drive.motor
    volts = drive.pwm[row] / motor.full_pwm * drive.supply[row]
    turning = drive.speed[row] / (motor.no_load_speed / 60.0 * bank.table.pulses_per_turn)
    at_stall = motor.stall_current / bank.table["goal_current"].scale
    return float(abs(volts / motor.voltage - turning) * at_stall) if drive.on[row] else 0.0


def main(
    models: Annotated[list[str] | None, typer.Argument(help="Only these models.")] = None,
) -> None:
    print("| model | mode | current / limit, first 20 ms of a jam | afterwards, and free | above the limit, ms |")
    print("|---|---|---|---|---|")
    wrong: list[str] = []
    chosen = [model for model in models or PAGES for _ in range(2)]
    with ProcessPoolExecutor(2) as pool:
        for model, found in zip(chosen, pool.map(jam, chosen, cycle((False, True))), strict=True):
            figures = f"{found.mode} | {found.at_first:.2f} | {found.later:.2f} | {found.above * 1e3:.0f}"
            print(f"| {model} | {figures} |", flush=True)
            if found.wrong:
                why = found.stopped or ("" if found.yielded else "it did not give way")
                wrong.append(f"{model}: {why or 'its current was above the limit'}")
    print(f"\n{len(chosen) // 2} models, each in one turn and across its ends, {len(wrong)} wrong", *wrong, sep="\n")
    if wrong:
        raise typer.Exit(1)


if __name__ == "__main__":
    command.run("jams", main, __doc__)
