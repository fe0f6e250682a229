"""Random fault schedules against rigs of mixed models.

Time is simulated; judged is what the shafts really do.

Each schedule is a rig of three or four joints on one or two ports, each left somewhere with an old goal; pairs of
servos, several turns, grippers, weights, limits of current and gains (see `burdens`); targets that reach beyond the
ends of range and speed, or stand still; faults that overlap; recovery in the loop's thread or beside it; and one of
several ends. See `schedule_judge`.
"""

from __future__ import annotations

import random
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from itertools import count as counted
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks import command
from benchmarks.rig._schedules import SECONDS, Schedule, kinds_of, schedule, strikes
from benchmarks.rig.burdens import leave_gains
from benchmarks.rig.schedule_judge import JudgedBus, JudgedPort, ShaftJudge
from benchmarks.rig.source_mutants import MUTANTS, mutated
from benchmarks.rig.taking_turns import Turns
from hardware.bus.servo_bus import Bus
from hardware.emulator.faults import Fault, FaultPlan
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.scale import Array
from hardware.rig.supervision.rig import Rig
from hardware.rig.supervision.turn_keeper import LOOKS_EVERY
from hardware.rig.turn_file import Turn, TurnFile

_TICK = 0.01
_FOLLOWS = 0.15  # rad
_CATCHES_UP = 0.1  # part of its speed limit at which a joint that is still far off must turn towards its target
_BLAME = 5.0  # s after a fault in which it may stop the rig
_GIVEN_UP = 3.0  # s after a fault in which a servo that it has put elsewhere has been given up
_RELEASED = 1.5  # s after a jam in which a shaft may snap back to its path
_MISLED = 0.5  # s after a servo was cut off, or took another's ID, until it is set up again


@dataclass
class Outcome:
    """What came of a schedule.

    Attributes:
        problems: what was wrong.
        recoveries: how often the rig came back.
        stopped: the message of a safe stop; "" for none.
        fastest, hardest: the largest speed and acceleration of a free shaft as a part of its limit.
    """

    problems: list[str] = field(default_factory=list)
    recoveries: int = 0
    stopped: str = ""
    fastest: float = 0.0
    hardest: float = 0.0


def run(seed: int, until_wrong: bool = False) -> Outcome:
    """Plays one schedule, or only until something is wrong; nothing but a RigError may leave the loop."""
    return play(schedule(seed), seed, until_wrong)


def play(plan: Schedule, seed: int, until_wrong: bool = False) -> Outcome:
    """Plays a schedule as `run` does; the seed is that of damage on the wire."""
    turns = Turns("rig-recovery")
    try:
        # A recovery that is abandoned may still store a turn.
        with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            return _play(plan, seed, until_wrong, turns, Path(folder))
    finally:
        turns.abandon()


def _play(plan: Schedule, seed: int, until_wrong: bool, turns: Turns, folder: Path) -> Outcome:
    config, outcome = plan.config, Outcome()
    parts = config.parts
    buses = [JudgedBus(part) for part in parts]
    ports = [
        JudgedPort(bus, part.port, _faults_of(plan, part, seed), turns) for bus, part in zip(buses, parts, strict=True)
    ]
    # Of each servo of a port the joint; judges know joints by their servos.
    places = [np.array([config.names.index(joint.joint_name) for joint in part.servos.joints]) for part in parts]
    files = {part.port: TurnFile(folder / f"{part.port}.json") for part in parts}
    for part, bus, place in zip(parts, buses, places, strict=True):
        _leave(
            part.servos, bus, files[part.port], plan.start[place], plan.old_goal[place], plan.burdens.gains_left[place]
        )
    judges = [
        ShaftJudge(part.servos, port, bus, partial(_struck_at, plan, place), plan.burdens.of(place))
        for part, port, bus, place in zip(parts, ports, buses, places, strict=True)
    ]

    def elapse(time: float) -> None:
        """Lets time pass on every port, one that has been waited on is ahead of the others; and gives turns."""
        end = max(port.now() for port in ports) + time
        while True:
            at = min(end, max(turns.next_due(), max(port.now() for port in ports)))
            for port in ports:
                port.elapse(at - port.now())
            if not turns.give(at):
                break

    by_name = {port.name: port for port in ports}
    sleep = ports[0].elapse if plan.beside else elapse
    open_bus = partial(_open_bus, by_name)
    rig = Rig(config, open_bus, plan.beside, sleep, turns=lambda part: files[part.port])
    stalls = sorted((fault for fault in plan.faults if fault.kind == "silence"), key=lambda fault: fault.at)
    limits = np.array([joint.lower for joint in config.joints]), np.array([joint.upper for joint in config.joints])
    elapse(0.0)
    for judge in judges:
        judge.switched_on()
    looked = 0.0
    while (now := ports[0].now()) < SECONDS:
        targets = plan.targets(now)
        for judge, place in zip(judges, places, strict=True):
            judge.ask(np.clip(targets, *limits)[place])
        try:
            rig.collect_state()
            rig.write(targets)
        except RigError as error:
            outcome.stopped = str(error)
            for judge in judges:
                judge.stopped()
            break
        if stalls and now >= stalls[0].at:
            elapse(stalls.pop(0).lasts)
        elapse(_TICK)
        if not plan.beside and now >= looked + LOOKS_EVERY:
            looked = now
            for keeper in rig.turn_keepers:
                keeper.look()
        for judge, place in zip(judges, places, strict=True):
            judge.look(np.clip(targets, *limits)[place], rig.faults.unsent[place])
            if until_wrong and judge.is_wrong:
                return Outcome(judge.problems)
    outcome.recoveries = rig.recoveries
    lasting = next((fault for fault in plan.faults if fault.lasts == float("inf")), None)
    if outcome.stopped:
        _judge_stop(plan, outcome, ports[0].now())
    elif lasting is not None:
        outcome.problems.append(f"{lasting.kind} of id {lasting.id} did not stop the rig")
    else:
        angles = _of_all([judge.angles for judge in judges], places)
        turning = _of_all([judge.speeds for judge in judges], places)
        targets = np.clip(plan.targets(ports[0].now() - _TICK), *limits)
        pace = np.abs(plan.targets(ports[0].now()) - plan.targets(ports[0].now() - _TICK)) / _TICK
        sag = _of_all([judge.sag for judge in judges], places)
        # A gripper that holds something is judged by how it presses.
        angles = np.where(_struck(plan, ("jam",), 0.0, ports[0].now()), targets, angles)
        outcome.problems += forgotten(config.joints, angles, turning, targets, pace, sag)
    closed = plan.end != "kill" or bool(outcome.stopped)
    if closed:
        turns.set_free()
        rig.close()
    for part, judge in zip(parts, judges, strict=True):
        # A thread keeps turns beside a loop, in real time.
        judge.end(closed, plan.end == "hold", None if plan.beside else files[part.port])
        outcome.problems += judge.problems
        outcome.fastest = max(outcome.fastest, judge.fastest)
        outcome.hardest = max(outcome.hardest, judge.hardest)
    return outcome


def _leave(
    part: RigConfig, bus: JudgedBus, file: TurnFile, start: Array, old_goal: Array, gains_left: NDArray[np.bool_]
) -> None:
    """Puts the servos where the rig finds them, with goals, gains and kept turns left from before."""
    for joint, device, angle, goal, left in zip(part.joints, bus.devices, start, old_goal, gains_left, strict=True):
        if left:
            leave_gains(joint, device)
        device.bank.shaft[device.row] = joint.pulses(angle)
        device["goal_position"] = round(joint.pulses(goal))
        if joint.several_turns:
            device.bank.to_one_turn(device.row)
            file.keep({joint.id: Turn(joint.zero, round(joint.pulses(angle)), True)})
    bus.advance(0.001)


def _faults_of(plan: Schedule, part: RigConfig, seed: int) -> FaultPlan:
    """The faults of a port: its own servos', and by rotation those of none."""
    ids = [joint.id for joint in part.servos.joints]
    turn, ports = plan.config.ports.index(part.port), len(plan.config.ports)
    last = plan.faults[-1] if plan.faults else None
    swapped = last.id if last is not None and last.kind == "swap" and last.lasts == float("inf") else None
    own = []
    for index, fault in enumerate(plan.faults):
        here = fault.id in ids if fault.id is not None else index % ports == turn
        if fault.kind == "unplug" and swapped is not None and index == len(plan.faults) - 2:
            here = swapped in ids  # the servo is swapped while its own adapter is out
        if here and fault.kind != "silence":
            own.append(fault)
    return FaultPlan(own, seed)


def _struck_at(plan: Schedule, place: NDArray[np.int64], now: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which joints of a port a jam holds, or held a moment ago; which were cut off; see `schedule_judge.Struck`."""
    return _struck(plan, ("jam",), _RELEASED, now)[place], _struck(plan, ("dead", "duplicate", "swap"), _MISLED, now)[
        place
    ]


def _struck(plan: Schedule, kinds: tuple[str, ...], after: float, now: float) -> NDArray[np.bool_]:
    """The joints that suffer one of these faults, or did less than `after` s ago."""
    active = [
        fault for fault in plan.faults if fault.kind in kinds and fault.at <= now < fault.at + fault.lasts + after
    ]
    # A servo that takes another's ID misleads that one too.
    misled = any(fault.kind == "duplicate" for fault in active)
    ids = {fault.id for fault in active}
    return np.array([misled or any(servo.id in ids for servo in joint.servos) for joint in plan.config.joints])


def _open_bus(ports: dict[str, JudgedPort], part: RigConfig) -> Bus:
    port = ports[part.port]
    port.receive()  # an adapter that is out cannot be opened
    port.closed = False
    return Bus(port, part.baud)


def _of_all(parts: list[Array], places: list[NDArray[np.int64]]) -> Array:
    """What the servos of each port have, by joint in the order of the rig file."""
    joined = np.empty(1 + max(int(place.max()) for place in places))
    for part, place in zip(parts, places, strict=True):
        joined[place] = part
    return joined


def _judge_stop(plan: Schedule, outcome: Outcome, at: float) -> None:
    """Whether the rig stopped for a reason that it named."""
    guilty = [fault for fault in plan.faults if fault.at <= at <= fault.at + fault.lasts + _BLAME]
    joints = plan.config.joints
    # What it grips is no reason for a gripper to stop.
    grippers = {joint.id for joint in joints if joint.grip}
    guilty = [fault for fault in guilty if fault.kind != "jam" or fault.id not in grippers]
    ids = {servo.id: [one.id for one in joint.servos] for joint in joints for servo in joint.servos}
    about = [fault._replace(id=id) for fault in guilty for id in ids.get(fault.id or -1, [fault.id])]
    if "rad apart" in outcome.stopped:
        # Two servos are on one shaft; one can seem elsewhere only where another answers in its name.
        about = [fault for fault in about if fault.kind == "duplicate"]
    if "another turn" in outcome.stopped:
        # A servo without power stands; only goals of another joint, or another servo, put it elsewhere.
        about = [
            one
            for one in about
            if one.kind in ("duplicate", "swap") and f"(id {one.id})" in outcome.stopped
            if one.at + one.lasts > at - _GIVEN_UP
        ]
    if not any(_names(outcome.stopped, fault) for fault in about):
        outcome.problems.append(f"stopped without a reason: {outcome.stopped}")


def forgotten(
    joints: tuple[RigJoint, ...], angles: Array, turning: Array, targets: Array, pace: Array, sag: Array | float = 0.0
) -> list[str]:
    """Names each joint that neither follows its target nor turns towards it.

    A servo that could still brake before its goal is behind one that moves at v by v^2 / (2 a).

    Args:
        joints: J of them.
        angles: where their shafts really are, shape (J,), rad.
        turning: how fast these turn, shape (J,), rad/s.
        targets: within the limits, shape (J,), rad.
        pace: how fast the targets move, shape (J,), rad/s.
        sag: by how much their weights may hold them off, shape (J,), rad.
    """
    towards = turning * np.sign(targets - angles)
    least = _CATCHES_UP * np.array([joint.velocity for joint in joints])
    brakes = pace * pace / (2.0 * np.array([joint.acceleration or np.inf for joint in joints]))
    behind = (np.abs(angles - targets) > _FOLLOWS + brakes + sag) & (towards < least)
    return [
        f"{joints[index].name} is forgotten: {angles[index]:.2f} rad instead of {targets[index]:.2f}"
        for index in np.flatnonzero(behind).tolist()
    ]


def _names(message: str, fault: Fault) -> bool:
    """Whether a message names the servo of a fault; the port, or anybody, where the fault is about no single one."""
    if fault.id is None or fault.kind == "duplicate":
        return "emulated" in message or "(id " in message or " stands at " in message
    return f"(id {fault.id})" in message or f"(id {fault.id}:" in message or f"id {fault.id} on" in message


def main(
    count: Annotated[int, typer.Argument(help="How many schedules to run.")] = 500,
    first: Annotated[int | None, typer.Argument(help="The seed of the first; drawn by chance unless given.")] = None,
    mutants: Annotated[
        bool, typer.Option("--mutants", help="Run COUNT schedules against each broken source instead.")
    ] = False,
) -> None:
    """Runs schedules, or mutants; exit code 1 if a schedule went wrong, or a mutant was not noticed."""
    first = random.SystemRandom().randrange(10**5, 10**9) if first is None else first
    seeds = range(first, first + count)
    print(f"seeds from {first} on" if mutants else f"seeds {seeds[0]} to {seeds[-1]}", flush=True)
    if _run_mutants(first, count) if mutants else _run_schedules(seeds):
        raise typer.Exit(1)


def _run_mutants(first: int, number: int) -> int:
    """Prints which of the first schedules that strike what a mutant is about notice it; how many are unnoticed."""
    unnoticed = 0
    for name, mutant in MUTANTS.items():
        seeds = list(islice((seed for seed in counted(first) if strikes(schedule(seed), *mutant.about)), number))
        with mutated(mutant):
            found = [seed for seed in seeds if _went_wrong(seed)]
        if found and mutant.cure:
            with mutated(MUTANTS[mutant.cure]):
                found = [seed for seed in found if not _went_wrong(seed)]
        unnoticed += not found
        print(f"{name:<22} {len(found):>2} of {len(seeds)}: {', '.join(map(str, found))}", flush=True)
    return unnoticed


def _run_schedules(seeds: range) -> int:
    """Prints what came of the schedules; how many went wrong."""
    kinds: Counter[str] = Counter()
    joints: Counter[str] = Counter()
    wrong, recoveries, stops, fastest, hardest = 0, 0, 0, 0.0, 0.0
    outcomes = ProcessPoolExecutor(2).map(run, seeds)
    for seed, outcome in zip(seeds, outcomes, strict=True):
        plan = schedule(seed)
        kinds.update(fault.kind for fault in plan.faults)
        joints.update(kinds_of(plan))
        recoveries, stops = recoveries + outcome.recoveries, stops + bool(outcome.stopped)
        fastest, hardest = max(fastest, outcome.fastest), max(hardest, outcome.hardest)
        if outcome.problems:
            wrong += 1
            print(f"schedule {seed}: {'; '.join(outcome.problems)}", flush=True)
    print(f"{len(seeds)} schedules of {SECONDS:g} s: {wrong} went wrong, {recoveries} recoveries, {stops} safe stops,")
    print(
        f"free shafts at most {fastest:.2f} of their speed limit, {hardest:.2f} of their acceleration limit; faults:",
        *(f"{k} {n}" for k, n in sorted(kinds.items())),
    )
    print("\n| schedules with | |\n|---|---|", *(f"| {kind} | {n} |" for kind, n in joints.most_common()), sep="\n")
    return wrong


def _went_wrong(seed: int) -> bool:
    """Whether a schedule has a problem; a broken source may also raise what no rig should."""
    try:
        return bool(run(seed, until_wrong=True).problems)
    except Exception:
        return True


if __name__ == "__main__":
    command.run("fault_schedules", main, __doc__)
