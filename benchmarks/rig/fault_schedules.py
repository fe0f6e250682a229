"""Random fault schedules against rigs of mixed models.

Time is simulated; judged is what the shafts really do.

Each schedule is a rig of three or four servos on one or two ports, each left somewhere with an old goal; weights,
limits of current and gains (see `burdens`); targets that reach beyond the ends of range and speed, or stand still;
faults that overlap; recovery in the loop's thread or beside it; and one of several ends. See `schedule_judge`.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray

from benchmarks import command
from benchmarks.rig.burdens import Burdens, burdened, leave_gains
from benchmarks.rig.schedule_judge import JudgedBus, JudgedPort, ShaftJudge
from benchmarks.rig.source_mutants import MUTANTS, mutated
from benchmarks.rig.taking_turns import Turns
from hardware.bus.servo_bus import Bus
from hardware.emulator.faults import Fault, FaultPlan
from hardware.errors import RigError
from hardware.families.models import MODELS as TABLES
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.scale import Array
from hardware.rig.supervision.rig import Rig

_TICK = 0.01
SECONDS = 12.0
_MODELS = ("XM430-W350", "XL330-M288", "XL430-W250", "XC330-T288", "MX-64", "XW540-T260")
_OTHER_MODELS = ("MX-28(1.0)", "AX-12A", "XL-320", "PH54-200-S500", "STS3215")
_WITH_OTHERS = 0.4  # part of the schedules whose rigs may have old servos and a P servo too
_PASSING = ("drop", "corrupt", "truncate", "delay", "dead", "reboot", "brownout", "jam", "duplicate", "duplicate",
            "swap", "swap", "unplug", "latency", "silence")  # fmt: skip
_ABOUT_ONE = ("dead", "reboot", "jam", "duplicate", "swap")
_LASTING = ("dead", "overheat", "alert", "unplug", "swap", "swap")
_ENDS = ("close", "hold", "kill", "lasting", "lasting")
_QUIET = 4.0  # s without faults before the end, in which every joint must come to follow
_FOLLOWS = 0.15  # rad
_ACCELERATES = 0.5  # part of its acceleration limit that a joint's sine needs
_CATCHES_UP = 0.1  # part of its speed limit at which a joint that is still far off must turn towards its target
_BLAME = 5.0  # s after a fault in which it may stop the rig
_RELEASED = 1.5  # s after a jam in which a shaft may snap back to its path
_MISLED = 0.5  # s after a servo was cut off, or took another's ID, until it is set up again
_ALERT = 32.0


@dataclass
class Schedule:
    """What happens to a rig.

    Attributes:
        config: the rig.
        faults: passing ones, and at most one that lasts; "silence" is a loop that stalls.
        end: "close", "hold" (close, and the joints hold), "kill" (the bus falls silent) or "lasting".
        start, old_goal: where each joint stands and which goal it has when the rig is switched on, shape (J,), rad.
        targets: over time.
        beside: whether a rig is mended in a thread beside its loop, or in the loop's own.
        burdens: of the joints.
    """

    config: RigConfig
    faults: list[Fault]
    end: str
    start: Array
    old_goal: Array
    targets: Callable[[float], Array]
    beside: bool
    burdens: Burdens


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


def schedule(seed: int) -> Schedule:
    """The schedule of this seed."""
    rng = random.Random(seed)
    ports = rng.choice((1, 2))
    models = _MODELS + _OTHER_MODELS if rng.random() < _WITH_OTHERS else _MODELS
    joints = tuple(_joint(rng, id, models, f"emulated-{1 + id % ports}") for id in range(1, rng.choice((4, 5))))
    joints, burdens, about_burdens = burdened(seed, joints, SECONDS - _QUIET)
    end = rng.choice(_ENDS)
    hold = "hold" if end == "hold" else "off"
    config = RigConfig("emulated-1", 1_000_000, 100.0, joints, reconnect_s=2.9, on_exit=hold)
    faults = [_passing(rng, [joint.id for joint in joints]) for _ in range(rng.randint(2, 6))] + about_burdens
    alone = {part.joints[0].id for part in config.parts if len(part.joints) == 1}
    faults = [fault for fault in faults if not (fault.kind == "duplicate" and fault.id in alone)]
    doubles = [fault for fault in faults if fault.kind == "duplicate"]
    # A jam meanwhile would hit both servos with the ID, and the judge knows of one.
    faults = [
        fault for fault in faults if fault.kind != "jam" or not any(_overlap(fault, double) for double in doubles)
    ]
    if end == "lasting":
        kind, id = rng.choice(_LASTING), rng.choice(joints).id
        at = rng.uniform(SECONDS - _QUIET, SECONDS - 3.0)
        if kind == "swap" and rng.random() < 0.5:
            faults.append(Fault("unplug", None, at, 0.5))
        value = _ALERT if kind == "alert" else None
        faults.append(Fault(kind, None if kind == "unplug" else id, at, value=value))
    start = np.array([rng.uniform(joint.lower, joint.upper) for joint in joints])
    old_goal = np.array([rng.uniform(joint.lower, joint.upper) for joint in joints])
    targets = _targets(rng, joints, burdens.poses)
    return Schedule(config, faults, end, start, old_goal, targets, rng.random() < 0.5, burdens)


def _joint(rng: random.Random, id: int, models: tuple[str, ...], port: str) -> RigJoint:
    model, direction = rng.choice(models), rng.choice((-1, 1))
    table = TABLES[model]
    zero = (sum(table.one_turn) + 1) // 2 + round(rng.uniform(-0.07, 0.07) * table.pulses_per_turn)
    lower, upper = -rng.uniform(0.6, 1.4), rng.uniform(0.6, 1.4)
    velocity = rng.choice((0.8, 1.5, 2.5))
    acceleration = rng.choice((0.0, 4.0, 20.0)) if table.place("profile_acceleration") else 0.0
    return RigJoint(f"joint_{id}", id, model, direction, zero, lower, upper, velocity, acceleration, port=port)


def _targets(rng: random.Random, joints: tuple[RigJoint, ...], poses: NDArray[np.bool_]) -> Callable[[float], Array]:
    """Sines to the ends of range and speed and beyond; some are squares at first: jumps from one end to the other.

    Joints in `poses` stand still.
    """
    lower, upper = np.array([joint.lower for joint in joints]), np.array([joint.upper for joint in joints])
    reach = 0.5 * (upper - lower) * rng.uniform(1.0, 1.3)
    speed = np.array([joint.velocity for joint in joints]) * rng.uniform(0.5, 0.95)
    # A sine that a joint can follow: a larger part of its acceleration leaves nothing to catch up with.
    most = np.array([joint.acceleration or np.inf for joint in joints])
    speed = np.minimum(speed, np.sqrt(_ACCELERATES * most * reach))
    phase = np.array([rng.uniform(0.0, 2.0 * np.pi) for _ in joints])
    square = np.array([rng.random() < 0.3 for _ in joints])

    def targets(now: float) -> Array:
        sine = np.sin(now * speed / reach * ~poses + phase)
        return 0.5 * (lower + upper) + reach * np.where(square & (now < SECONDS - _QUIET), np.sign(sine), sine)

    return targets


def _overlap(one: Fault, other: Fault) -> bool:
    return one.at <= other.at + other.lasts and other.at <= one.at + one.lasts


def _passing(rng: random.Random, ids: list[int]) -> Fault:
    kind = rng.choice(_PASSING)
    id = rng.choice(ids) if kind in _ABOUT_ONE else None
    lasts = rng.uniform(0.05, 0.8)
    return Fault(kind, id, rng.uniform(0.5, SECONDS - _QUIET - lasts), lasts, rng.uniform(0.1, 0.9))


def run(seed: int, until_wrong: bool = False) -> Outcome:
    """Plays one schedule, or only until something is wrong; nothing but a RigError may leave the loop."""
    turns = Turns("rig-recovery")
    try:
        return _play(seed, until_wrong, turns)
    finally:
        turns.abandon()


def _play(seed: int, until_wrong: bool, turns: Turns) -> Outcome:
    plan = schedule(seed)
    config, outcome = plan.config, Outcome()
    parts = config.parts
    buses = [JudgedBus(part) for part in parts]
    ports = [
        JudgedPort(bus, part.port, _faults_of(plan, part, seed), turns) for bus, part in zip(buses, parts, strict=True)
    ]
    places = [np.array([config.names.index(name) for name in part.names]) for part in parts]
    for part, bus, place in zip(parts, buses, places, strict=True):
        _leave(part, bus, plan.start[place], plan.old_goal[place], plan.burdens.gains_left[place])
    judges = [
        ShaftJudge(part, port, bus, partial(_struck_at, plan, place), plan.burdens.of(place))
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
    rig = Rig(config, lambda part: _open(by_name[part.port], part.baud), plan.beside, sleep)
    stalls = sorted((fault for fault in plan.faults if fault.kind == "silence"), key=lambda fault: fault.at)
    limits = np.array([joint.lower for joint in config.joints]), np.array([joint.upper for joint in config.joints])
    elapse(0.0)
    for judge in judges:
        judge.switched_on()
    while (now := ports[0].now()) < SECONDS:
        targets = plan.targets(now)
        for judge, place in zip(judges, places, strict=True):
            judge.ask(np.clip(targets, *limits)[place])
        try:
            rig.collect_state()
            rig.write(targets)
        except RigError as error:
            outcome.stopped = str(error)
            break
        if stalls and now >= stalls[0].at:
            elapse(stalls.pop(0).lasts)
        elapse(_TICK)
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
        outcome.problems += forgotten(config.joints, angles, turning, targets, pace, sag)
    closed = plan.end != "kill" or bool(outcome.stopped)
    if closed:
        turns.set_free()
        rig.close()
    for judge in judges:
        judge.end(closed, plan.end == "hold")
        outcome.problems += judge.problems
        outcome.fastest = max(outcome.fastest, judge.fastest)
        outcome.hardest = max(outcome.hardest, judge.hardest)
    return outcome


def _leave(part: RigConfig, bus: JudgedBus, start: Array, old_goal: Array, gains_left: NDArray[np.bool_]) -> None:
    """Puts the servos where the rig finds them, with goals and gains left from before."""
    for joint, device, angle, goal, left in zip(part.joints, bus.devices, start, old_goal, gains_left, strict=True):
        if left:
            leave_gains(joint, device)
        device.bank.shaft[device.row] = joint.pulses(angle)
        device["goal_position"] = round(joint.pulses(goal))
    bus.advance(0.001)


def _faults_of(plan: Schedule, part: RigConfig, seed: int) -> FaultPlan:
    """The faults of a port: its own servos', and by rotation those of none."""
    ids = [joint.id for joint in part.joints]
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
    return np.array([misled or joint.id in ids for joint in plan.config.joints])


def _open(port: JudgedPort, baud: int) -> Bus:
    port.receive()  # an adapter that is out cannot be opened
    port.closed = False
    return Bus(port, baud)


def _of_all(parts: list[Array], places: list[NDArray[np.int64]]) -> Array:
    """What the joints of each port have, in the order of the rig file."""
    joined = np.empty(sum(len(place) for place in places))
    for part, place in zip(parts, places, strict=True):
        joined[place] = part
    return joined


def _judge_stop(plan: Schedule, outcome: Outcome, at: float) -> None:
    """Whether the rig stopped for a reason that it named."""
    guilty = [fault for fault in plan.faults if fault.at <= at <= fault.at + fault.lasts + _BLAME]
    if not any(_names(outcome.stopped, fault) for fault in guilty):
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
    print(f"seeds {seeds[0]} to {seeds[-1]}", flush=True)
    if (_run_mutants if mutants else _run_schedules)(seeds):
        raise typer.Exit(1)


def _run_mutants(seeds: range) -> int:
    """Prints which schedules notice each mutant; how many none of them notices."""
    unnoticed = 0
    for name, mutant in MUTANTS.items():
        with mutated(mutant):
            found = [seed for seed in seeds if _went_wrong(seed)]
        unnoticed += not found
        print(f"{name:<22} {len(found):>2} of {len(seeds)}: {', '.join(map(str, found))}", flush=True)
    return unnoticed


def _run_schedules(seeds: range) -> int:
    """Prints what came of the schedules; how many went wrong."""
    kinds: Counter[str] = Counter()
    wrong, recoveries, stops, fastest, hardest = 0, 0, 0, 0.0, 0.0
    outcomes = ProcessPoolExecutor(2).map(run, seeds)
    for seed, outcome in zip(seeds, outcomes, strict=True):
        kinds.update(fault.kind for fault in schedule(seed).faults)
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
    return wrong


def _went_wrong(seed: int) -> bool:
    """Whether a schedule has a problem; a broken source may also raise what no rig should."""
    try:
        return bool(run(seed, until_wrong=True).problems)
    except Exception:
        return True


if __name__ == "__main__":
    command.run("fault_schedules", main, __doc__)
