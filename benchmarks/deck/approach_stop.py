"""Approach and stop moves beside those of ruckig.

Random moves of servo20's joints. Both are judged by what reaches a servo, targets at 200 Hz: their differences from
tick to tick over the limits of velocity, acceleration and jerk (1 is the limit), and how far they leave the range of a
joint, rad. Approaches go from rest to rest, all joints arriving together; stops begin in the midst of a motion within
the limits. `time` is the median of a move, s, `begin` and `tick` the CPU time to begin it and of each tick, us.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.deck.interfaces import JointLimits  # noqa: E402
from controller.library.motion_library import load_library  # noqa: E402
from controller.loop.safety.approach import Approach  # noqa: E402
from controller.loop.safety.safety_envelope import SafetyEnvelope  # noqa: E402
from controller.motion.rotations import Array  # noqa: E402
from motiondeck_base.shipped import find_library, find_robot  # noqa: E402
from sim.robots.robot import load_robot  # noqa: E402

DT = 0.005
Course = Callable[[], Iterator[Array]]
"""Makes the targets of a move, tick by tick."""


def quintic(limits: JointLimits, start: Array, goal: Array, slowness: float) -> Iterator[Array]:
    """Our approach."""
    approach = Approach.within(limits, start, goal, slowness)
    for tick in range(int(np.ceil(approach.duration / DT))):
        yield approach.at((tick + 1) * DT)


def enveloped(limits: JointLimits, start: Array, goal: Array) -> Iterator[Array]:
    """The goal given at once: the envelope brings each joint there as fast as it knows how."""
    envelope = SafetyEnvelope(limits, DT)
    envelope.start(start)
    for _ in range(round(20.0 / DT)):
        yield envelope(goal).copy()
        if envelope.at_rest and np.allclose(envelope.position, goal, atol=1e-6):
            return


def ruckig_approach(peer: Any, limits: JointLimits, start: Array, goal: Array) -> Iterator[Array]:
    """Ruckig's: time-optimal within velocity, acceleration and jerk, all joints arriving together."""
    joints = len(start)
    asked, out, otg = peer.InputParameter(joints), peer.OutputParameter(joints), peer.Ruckig(joints, DT)
    asked.current_position, asked.target_position = start.tolist(), goal.tolist()
    asked.current_velocity = asked.target_velocity = [0.0] * joints
    asked.max_velocity, asked.max_acceleration = limits.velocity.tolist(), limits.acceleration.tolist()
    asked.max_jerk = limits.jerk.tolist()
    yield from ruckig_ticks(peer, otg, asked, out)


def ruckig_ticks(peer: Any, otg: Any, asked: Any, out: Any) -> Iterator[Array]:
    while True:
        result = otg.update(asked, out)
        yield np.array(out.new_position)
        if result != peer.Result.Working:
            return
        out.pass_to_input(asked)


def ruckig_stop(peer: Any, limits: JointLimits, past: Array) -> Iterator[Array]:
    """Ruckig's stop by velocity, each joint for itself, from the state that three positions (3, J) tell."""
    joints = past.shape[1]
    asked, out, otg = peer.InputParameter(joints), peer.OutputParameter(joints), peer.Ruckig(joints, DT)
    asked.control_interface = peer.ControlInterface.Velocity
    asked.synchronization = peer.Synchronization.No
    velocity, acceleration = (past[2] - past[1]) / DT, (past[2] - 2.0 * past[1] + past[0]) / DT**2
    # A difference is the velocity half a tick ago.
    asked.current_position = past[2].tolist()
    asked.current_velocity = (velocity + 0.5 * DT * acceleration).tolist()
    asked.current_acceleration = acceleration.tolist()
    asked.target_velocity = asked.target_acceleration = [0.0] * joints
    asked.max_acceleration, asked.max_jerk = limits.acceleration.tolist(), limits.jerk.tolist()
    yield from ruckig_ticks(peer, otg, asked, out)


def braked(envelope: SafetyEnvelope) -> Iterator[Array]:
    """Our stop."""
    while not envelope.at_rest:
        yield envelope.brake().copy()


def over_limits(past: Array, move: Array, limits: JointLimits) -> Array:
    """The largest differences over the limits of velocity, acceleration and jerk, after positions (3, J), and how far
    outside of the range a joint comes, rad."""
    places = np.concatenate([past, move, np.tile(move[-1], (3, 1))])
    bounds = (limits.velocity * DT, limits.acceleration * DT**2, limits.jerk * DT**3)
    rates = [np.abs(np.diff(places, n=n + 1, axis=0)[2 - n :] / bound).max() for n, bound in enumerate(bounds)]
    outside = np.maximum(limits.lower - places, places - limits.upper).max()
    return np.array([*rates, max(outside, 0.0)])


def timed(course: Course, past: Array, limits: JointLimits) -> tuple[Array, float, float, float]:
    """How far over the limits a move goes, how long it takes, s, and CPU time to begin it and of a tick, us."""
    began = time.thread_time()
    ticks = course()
    move = [next(ticks)]
    first = time.thread_time()
    move += list(ticks)
    cost = 1e6 * (time.thread_time() - first) / max(1, len(move) - 1)
    places = np.array(move)
    moving = np.flatnonzero(np.abs(places - places[-1]).max(axis=1) > 1e-9)
    seconds = DT * (int(moving[-1]) + 2 if len(moving) else 1)
    return over_limits(past, places, limits), seconds, 1e6 * (first - began), cost


def moving(limits: JointLimits, rng: np.random.Generator) -> tuple[SafetyEnvelope, Array]:
    """An envelope in the midst of a random motion, and its last three positions (3, J)."""
    envelope = SafetyEnvelope(limits, DT)
    middle = 0.5 * (limits.lower + limits.upper)
    reach, turn, phase = (rng.uniform(low, high, len(middle)) for low, high in ((0.3, 1.3), (1.0, 9.0), (0.0, 6.28)))
    swing = reach * (limits.upper - limits.lower) / 2.0
    envelope.start(middle)
    ticks = int(rng.integers(300, 500))
    return envelope, np.array([envelope(middle + swing * np.sin(turn * DT * k + phase)).copy() for k in range(ticks)])[
        -3:
    ]


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks approach_stop",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--moves", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    try:
        peer = import_module("ruckig")
    except ImportError:
        print("ruckig is not installed: pip install 'motiondeck[benchmark]'", file=sys.stderr)
        return 1
    skeleton = load_library(find_library("thesis15")).skeleton
    limits = load_robot(find_robot("servo20"), skeleton).limits
    rng = np.random.default_rng(options.seed)
    found: dict[str, list[tuple[Array, float, float, float]]] = {}
    for _ in range(options.moves):
        start, goal = rng.uniform(limits.lower, limits.upper, (2, len(limits.lower)))
        still = np.tile(start, (3, 1))
        courses: dict[str, Course] = {
            "approach: ours (4 times slower)": lambda s=start, g=goal: quintic(limits, s, g, 4.0),
            "approach: ours, as fast as allowed": lambda s=start, g=goal: quintic(limits, s, g, 1.0),
            "approach: ours, goal at once": lambda s=start, g=goal: enveloped(limits, s, g),
            "approach: ruckig": lambda s=start, g=goal: ruckig_approach(peer, limits, s, g),
        }
        for name, course in courses.items():
            found.setdefault(name, []).append(timed(course, still, limits))
        envelope, past = moving(limits, rng)
        if not envelope.at_rest:
            stops: dict[str, Course] = {
                "stop: ruckig": lambda p=past: ruckig_stop(peer, limits, p),
                "stop: ours": lambda e=envelope: braked(e),
            }
            for name, course in stops.items():
                found.setdefault(name, []).append(timed(course, past, limits))
    rows = {}
    for name, moves in sorted(found.items()):
        worst = np.max([over for over, *_ in moves], axis=0)
        beyond = float(np.mean([over[:3].max() > 1.0 + 1e-6 or over[3] > 1e-6 for over, *_ in moves]))
        seconds, begin, tick = np.median([rest for _, *rest in moves], axis=0).tolist()
        rows[name] = {
            "velocity": worst[0],
            "acceleration": worst[1],
            "jerk": worst[2],
            "outside_rad": worst[3],
            "moves_beyond": beyond,
            "seconds": seconds,
            "begin_us": begin,
            "tick_us": tick,
        }
    if options.json:
        print(json.dumps(rows))
        return 0
    print(
        f"{'':36}{'velocity':>9}{'accel.':>8}{'jerk':>8}{'outside':>9}{'beyond':>8}{'time':>8}{'begin':>8}{'tick':>7}"
    )
    for name, row in rows.items():
        v, a, j, outside, beyond, seconds, begin, tick = row.values()
        print(f"{name:36}{v:9.4f}{a:8.4f}{j:8.4f}{outside:9.4f}{beyond:8.0%}{seconds:8.3f}{begin:8.0f}{tick:7.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
