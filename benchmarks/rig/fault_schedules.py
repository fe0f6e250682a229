"""Random faults against a rig on one port and on two, in simulated time."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated

import numpy as np
import typer

from benchmarks import command
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import Fault, FaultPlan
from hardware.emulator.port import EmulatedPort
from hardware.errors import RigError
from hardware.protocol2 import instructions as wire
from hardware.protocol2.frames import Parser
from hardware.rig.joined_rig import JoinedRig
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervised_rig import SupervisedRig

_TICK = 0.01
_LOST_FOR_GOOD = ("dead", "overheat", "alert", "unplug")
_PASSING = ("drop", "corrupt", "truncate", "delay", "dead", "reboot", "brownout", "jam", "duplicate", "unplug",
            "latency", "silence")  # fmt: skip
_ABOUT_ONE = ("dead", "reboot", "jam", "duplicate")
_OFF_COURSE = 0.15  # rad


@dataclass
class Outcome:
    """What came of one schedule.

    Attributes:
        faults: that were planned; "silence" is a loop that stalls.
        recoveries: how often the rig came back.
        longest_s: how long after a passing fault's end the rig took targets again and followed them, at worst.
        stopped: the message of a safe stop; "" for none.
        named: whether that message names the servo (or the port) that was the cause.
        beyond: goals on the wire outside the joints' limits.
    """

    faults: list[Fault]
    recoveries: int = 0
    longest_s: float = 0.0
    stopped: str = ""
    named: bool = True
    beyond: int = 0
    problems: list[str] = field(default_factory=list)


def schedule(seed: int, ids: Sequence[int], seconds: float) -> list[Fault]:
    """Faults at random with time to recover between; one schedule in four ends with a lasting one."""
    rng = random.Random(seed)
    faults: list[Fault] = []
    at = rng.uniform(0.5, 2.0)
    while at < seconds - 6.0:
        kind = rng.choice(_PASSING)
        lasts = rng.uniform(0.05, 0.8)
        id = rng.choice(list(ids)) if kind in _ABOUT_ONE else None
        faults.append(Fault(kind, id, at, lasts, rng.uniform(0.1, 0.9), None))
        at += lasts + rng.uniform(3.0, 5.0)
    if seed % 4 == 3:
        kind = rng.choice(_LOST_FOR_GOOD)
        value = 32.0 if kind == "alert" else None
        faults.append(Fault(kind, None if kind == "unplug" else rng.choice(list(ids)), seconds - 5.0, value=value))
    return faults


def run(seed: int, joints: int = 4, seconds: float = 20.0, ports: int = 1) -> Outcome:
    """Plays one schedule against a rig that follows sines; nothing but a RigError may leave the loop.

    Args:
        seed: of the schedule.
        joints: how many, with the ids 1 to so many.
        seconds: how long.
        ports: on how many ports the joints are, in turn; 1 or 2.
    """
    config = RigConfig(
        "emulated-1",
        1_000_000,
        100.0,
        tuple(
            RigJoint(f"joint_{id}", id, "XM430-W350", 1, 2048, -1.5, 1.5, 4.0, port=f"emulated-{1 + id % ports}")
            for id in range(1, joints + 1)
        ),
        reconnect_s=3.0,
    )
    planned = schedule(seed, range(1, joints + 1), seconds)
    outcome = Outcome(planned)
    stalls = [fault for fault in planned if fault.kind == "silence"]
    lines = _lines(config, [fault for fault in planned if fault.kind != "silence"], seed)

    def elapse(time: float) -> None:
        """Lets time pass on every port; one that has been waited on is ahead of the others."""
        at = max(line.now() for line in lines) + time
        for line in lines:
            line.elapse(at - line.now())

    parts = [
        SupervisedRig(part, partial(_open, line, config.baud), beside=False, sleep=elapse)
        for part, line in zip(config.parts, lines, strict=True)
    ]
    rig = parts[0] if ports == 1 else JoinedRig(config, parts)
    phase = np.linspace(0.0, np.pi, joints)
    elapse(0.0)
    while (now := lines[0].now()) < seconds:
        targets = 0.5 * np.sin(now + phase)
        try:
            rig.collect_state()
            rig.write(targets)
            rig.request_state()
        except RigError as error:
            outcome.stopped = str(error)
            break
        if stalls and now >= stalls[0].at:
            elapse(stalls.pop(0).lasts)
        elapse(_TICK)
        mending = any(part.mending for part in parts)
        _keep_time(outcome, lines[0].now(), np.abs(rig.positions - targets).max() < _OFF_COURSE and not mending)
    outcome.recoveries = sum(part.recoveries for part in parts)
    rig.close()
    _judge(outcome, b"".join(data for line in lines for data in line.sent))
    return outcome


def _lines(config: RigConfig, faults: Sequence[Fault], seed: int) -> list[EmulatedPort]:
    """A port for each part of the rig, with the faults of its own servos; those of no servo take the ports in turn."""
    lines: list[EmulatedPort] = []
    for turn, part in enumerate(config.parts):
        ids = [joint.id for joint in part.joints]
        own = [
            fault
            for index, fault in enumerate(faults)
            if (fault.id in ids if fault.id is not None else index % len(config.parts) == turn)
        ]
        line = EmulatedPort(EmulatedBus(part), paced=True, faults=FaultPlan(own, seed))
        line.name = part.port
        lines.append(line)
    return lines


def _open(port: EmulatedPort, baud: int) -> Bus:
    port.receive()  # an adapter that is out cannot be opened
    return Bus(port, baud)


def _keep_time(outcome: Outcome, now: float, following: bool) -> None:
    """Notes how long the rig has not followed since the last passing fault ended."""
    over = [fault.at + fault.lasts for fault in outcome.faults if fault.at + fault.lasts <= now]
    under_way = any(fault.at <= now < fault.at + fault.lasts for fault in outcome.faults)
    if over and not under_way and not following:
        outcome.longest_s = max(outcome.longest_s, now - max(over))


def _judge(outcome: Outcome, sent: bytes) -> None:
    """Compares what happened, and all that was sent, with what must."""
    lasting = next((fault for fault in outcome.faults if fault.lasts == float("inf")), None)
    if lasting is not None:
        culprit = "emulated" if lasting.kind == "unplug" else f"(id {lasting.id})"
        outcome.named = culprit in outcome.stopped or f"(id {lasting.id}:" in outcome.stopped
        if not outcome.stopped:
            outcome.problems.append(f"{lasting.kind} of id {lasting.id} did not stop the rig")
        elif not outcome.named:
            outcome.problems.append(f"{lasting.kind} of id {lasting.id} was not named: {outcome.stopped}")
    elif outcome.stopped:
        outcome.problems.append(f"stopped without a lasting fault: {outcome.stopped}")
    if outcome.longest_s > 2.0:
        outcome.problems.append(f"took {outcome.longest_s:.2f} s to recover")
    low, high = (round(2048 + angle * 2048 / np.pi) for angle in (-1.5, 1.5))
    for frame in Parser().feed(sent):
        if frame.instruction == wire.SYNC_WRITE and frame.params[:4] == wire.words(116, 4):
            goals = np.frombuffer(frame.params[4:], dtype=[("id", "u1"), ("goal", "<i4")])["goal"]
            outcome.beyond += int(((goals < low) | (goals > high)).sum())
    if outcome.beyond:
        outcome.problems.append(f"{outcome.beyond} goals beyond the limits")


def main(
    count: Annotated[int, typer.Argument(help="Schedules to run, seeds 0 to COUNT - 1.")] = 500,
    seconds: Annotated[float, typer.Argument(help="Length of each, s.")] = 20.0,
) -> None:
    """Runs many schedules; exit code 1 if one of them went wrong."""
    kinds: Counter[str] = Counter()
    wrong, recoveries, stops, longest = 0, 0, 0, 0.0
    for seed in range(count):
        outcome = run(seed, seconds=seconds, ports=1 + seed // 2 % 2)
        kinds.update(fault.kind for fault in outcome.faults)
        recoveries += outcome.recoveries
        stops += bool(outcome.stopped)
        longest = max(longest, outcome.longest_s)
        if outcome.problems:
            wrong += 1
            print(f"schedule {seed}: {'; '.join(outcome.problems)}")
    print(f"{count} schedules of {seconds:g} s: {wrong} went wrong, {recoveries} recoveries, {stops} safe stops,")
    print(f"longest recovery {longest:.2f} s; faults: {', '.join(f'{kind} {n}' for kind, n in sorted(kinds.items()))}")
    if wrong:
        raise typer.Exit(1)


if __name__ == "__main__":
    command.run("fault_schedules", main, __doc__)
