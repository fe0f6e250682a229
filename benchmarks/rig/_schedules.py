"""The fault schedules: rigs, what their joints shall do, and what happens to them, each from its seed."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.rig.burdens import Burdens, burdened, has_small_limit
from hardware.emulator.faults import Fault
from hardware.families.models import MODELS as TABLES
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.scale import Array

SECONDS = 12.0
_MODELS = ("XM430-W350", "XL330-M288", "XL430-W250", "XC330-T288", "MX-64", "XW540-T260")
_OTHER_MODELS = ("MX-28(1.0)", "AX-12A", "XL-320", "PH54-200-S500", "STS3215")
_WITH_OTHERS = 0.4  # part of the schedules whose rigs may have old servos and a P servo too
_PASSING = ("drop", "corrupt", "truncate", "delay", "dead", "reboot", "brownout", "jam", "duplicate", "duplicate",
            "swap", "swap", "unplug", "latency", "silence")  # fmt: skip
_ABOUT_ONE = ("dead", "reboot", "jam", "duplicate", "swap")
_LASTING = ("dead", "overheat", "alert", "unplug", "swap", "swap")
_ENDS = ("close", "hold", "kill", "lasting", "lasting")
QUIET = 4.0  # s without faults before the end, in which every joint must come to follow
_ACCELERATES = 0.5  # part of its acceleration limit that a joint's sine needs
_ALERT = 32.0
_LONG = 0.3  # s to brake
_GRIPPED = 0.4  # rad from what a gripper holds to its target


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


def schedule(seed: int) -> Schedule:
    """The schedule of this seed."""
    rng = random.Random(seed)
    ports = rng.choice((1, 2))
    models = _MODELS + _OTHER_MODELS if rng.random() < _WITH_OTHERS else _MODELS
    joints = tuple(_joint(rng, id, models, f"emulated-{1 + id % ports}") for id in range(1, rng.choice((4, 5))))
    joints, burdens, about_burdens = burdened(seed, joints, SECONDS - QUIET)
    end = rng.choice(_ENDS)
    hold = "hold" if end == "hold" else "off"
    config = RigConfig("emulated-1", 1_000_000, 100.0, joints, reconnect_s=2.9, on_exit=hold)
    faults = [_passing(rng, [joint.id for joint in joints]) for _ in range(rng.randint(2, 6))] + about_burdens
    alone = {servo.id for part in config.parts if len(part.joints) == 1 for servo in part.servos.joints}
    faults = [one for fault in faults for one in _of_servos(seed, fault, joints)]
    faults = [fault for fault in faults if not (fault.kind == "duplicate" and fault.id in alone)]
    doubles = [fault for fault in faults if fault.kind == "duplicate"]
    # A jam meanwhile would hit both servos with the ID, and the judge knows of one.
    faults = [
        fault for fault in faults if fault.kind != "jam" or not any(_overlap(fault, double) for double in doubles)
    ]
    if end == "lasting":
        kind, id = rng.choice(_LASTING), rng.choice(joints).id
        at = rng.uniform(SECONDS - QUIET, SECONDS - 3.0)
        if kind == "swap" and rng.random() < 0.5:
            faults.append(Fault("unplug", None, at, 0.5))
        value = _ALERT if kind == "alert" else None
        faults += _of_servos(seed, Fault(kind, None if kind == "unplug" else id, at, value=value), joints)[-1:]
    start = np.array([rng.uniform(joint.lower, joint.upper) for joint in joints])
    old_goal = np.array([rng.uniform(joint.lower, joint.upper) for joint in joints])
    targets = _targets(rng, joints, burdens.poses)
    held = _held_at_the_end(seed, joints, targets) if end != "lasting" else []
    if held:
        end, config = "hold", msgspec.structs.replace(config, on_exit="hold")
        faults += held
    return Schedule(config, faults, end, start, old_goal, targets, rng.random() < 0.5, burdens)


def kinds_of(plan: Schedule) -> list[str]:
    """What joints the rig of a schedule has, of those that a joint can be beside the usual one."""
    return [kind for kind, joints in _by_kind(plan).items() if joints]


def strikes(plan: Schedule, fault: str, kind: str, moving: bool = False) -> bool:
    """Whether a schedule has such a fault about joints of such a kind; "" is for any of them.

    A `moving` joint is one whose target then goes so fast that the joint needs a while to brake.
    """
    joints = _by_kind(plan)[kind] if kind else list(plan.config.joints)
    of = {servo.id: joint for joint in joints for servo in joint.servos}
    return bool(joints) and any(
        fault in ("", one.kind)
        and (one.id is None or one.id in of)
        and not (moving and (one.id is None or _brakes_for(plan, of[one.id], one.at) < _LONG))
        for one in plan.faults
    )


def _brakes_for(plan: Schedule, joint: RigJoint, at: float) -> float:
    """How long a joint that has followed its target until then needs to brake, s."""
    before, now = (
        np.clip(plan.targets(time)[plan.config.names.index(joint.joint_name)], joint.lower, joint.upper)
        for time in (at - 0.01, at)
    )
    return min(abs(now - before) / 0.01, joint.velocity) / (joint.acceleration or np.inf)


def _by_kind(plan: Schedule) -> dict[str, list[RigJoint]]:
    """The joints of each kind; a joint may be of several."""
    has: dict[str, Callable[[RigJoint, float], bool]] = {
        "two servos on a joint": lambda joint, _: joint.second is not None,
        "two servos that are read one after the other": lambda joint, _: (
            joint.second is not None and not joint.table.series.bulk_reads
        ),
        "a limit of acceleration, and no path shown": lambda joint, _: (
            joint.acceleration > 0.0 and "position_trajectory" not in joint.table.registers
        ),
        "two servos without a path": lambda joint, _: (
            joint.second is not None and "position_trajectory" not in joint.table.registers
        ),
        "several turns": lambda joint, _: joint.several_turns,
        "a gripper": lambda joint, _: joint.grip,
        "own gains": lambda joint, _: bool(joint.gains),
        "a range across the horn's zero": lambda joint, _: not joint.in_one_turn and not joint.several_turns,
        "a small limit of current": lambda joint, _: has_small_limit(joint),
        "the same, with a weight": lambda joint, weight: has_small_limit(joint) and weight > 0.0,
        "a weight": lambda _, weight: weight > 0.0,
    }
    joints = list(zip(plan.config.joints, plan.burdens.weight.tolist(), strict=True))
    return {kind: [joint for joint, weight in joints if of_kind(joint, weight)] for kind, of_kind in has.items()}


def _joint(rng: random.Random, id: int, models: tuple[str, ...], port: str) -> RigJoint:
    model, direction = rng.choice(models), rng.choice((-1, 1))
    table = TABLES[model]
    zero = (sum(table.one_turn) + 1) // 2 + round(rng.uniform(-0.07, 0.07) * table.pulses_per_turn)
    lower, upper = -rng.uniform(0.6, 1.4), rng.uniform(0.6, 1.4)
    velocity = rng.choice((0.8, 1.5, 2.5))
    acceleration = rng.choice((0.0, 4.0, 20.0)) if "profile_acceleration" in table.registers else 0.0
    return RigJoint(f"joint_{id}", id, model, direction, zero, lower, upper, velocity, acceleration, port=port)


def _of_servos(seed: int, fault: Fault, joints: tuple[RigJoint, ...]) -> list[Fault]:
    """The fault, or those of the servos of a joint with two: a jam blocks both, all else happens to one of them."""
    joint = next((joint for joint in joints if joint.id == fault.id), None)
    if joint is None or joint.second is None:
        return [fault]
    both = [fault, fault._replace(id=joint.second.id)]
    return both if fault.kind == "jam" else [random.Random(f"{fault.at} of {seed}").choice(both)]


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
        return 0.5 * (lower + upper) + reach * np.where(square & (now < SECONDS - QUIET), np.sign(sine), sine)

    return targets


def _held_at_the_end(seed: int, joints: tuple[RigJoint, ...], targets: Callable[[float], Array]) -> list[Fault]:
    """What grippers hold when the rig ends: each at a moment from which its target goes far away until then."""
    rng = random.Random(f"held at the end of {seed}")
    moments = np.arange(SECONDS - QUIET, SECONDS - 1.0, 0.1)
    lower, upper = np.array([joint.lower for joint in joints]), np.array([joint.upper for joint in joints])
    places = np.clip([targets(at) for at in moments], lower, upper)
    away = np.abs(places - np.clip(targets(SECONDS), lower, upper)) > _GRIPPED
    return [
        Fault("jam", joint.id, rng.choice(moments[away[:, index]].tolist()), SECONDS)
        for index, joint in enumerate(joints)
        if joint.grip and away[:, index].any()
    ]


def _overlap(one: Fault, other: Fault) -> bool:
    return one.at <= other.at + other.lasts and other.at <= one.at + one.lasts


def _passing(rng: random.Random, ids: list[int]) -> Fault:
    kind = rng.choice(_PASSING)
    id = rng.choice(ids) if kind in _ABOUT_ONE else None
    lasts = rng.uniform(0.05, 0.8)
    return Fault(kind, id, rng.uniform(0.5, SECONDS - QUIET - lasts), lasts, rng.uniform(0.1, 0.9))
