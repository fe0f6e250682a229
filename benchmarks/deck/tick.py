"""CPU time of one tick, part by part, and the Python calls of a tick.

A phase-driven reservoir, retargeting, safety, and the servos' frame.

Each part is measured within the same run of the deck on servo20 at 200 Hz; `all` is their sum. The servos' frame is the
sync write of 20 goal positions, encoded with its CRC and byte stuffing, not sent. The last row is a whole tick of
`play` with simulated servos and masses, without a rig, back to back.

With --calls the calls of Python functions in a tick of `play` with simulated servos and masses are counted instead
(`sys.setprofile`, the mean of 200 ticks, no time is measured): in all, for each room, and the functions that are called
most. With --rig the servos of an emulated rig are driven, too, in real time.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType

for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import numpy as np  # noqa: E402

from controller.cli.session.robot_on_deck import RobotSetup, open_robots  # noqa: E402
from controller.cli.session.session import RunSettings, Session  # noqa: E402
from controller.deck.deck import Deck  # noqa: E402
from controller.library.motion_library import MotionLibrary, load_library  # noqa: E402
from controller.loop.clock import Ticker, VirtualClock  # noqa: E402
from controller.loop.gc_and_blas import undisturbed  # noqa: E402
from controller.loop.safety.safety_envelope import SafetyEnvelope  # noqa: E402
from controller.mocap.posture import Pose  # noqa: E402
from controller.rotations import Array  # noqa: E402
from hardware.bus.sync_write import SyncWrite  # noqa: E402
from hardware.rig.rig_file import load_rig  # noqa: E402
from hardware.rig.scale import RigScale  # noqa: E402
from motiondeck_base.shipped import find_library, find_rig, find_robot  # noqa: E402
from sim.robots.robot import load_robot  # noqa: E402

RATE = 200.0
APPROACH = 1000  # ticks after which the joints have approached the motion
COUNTED = 200  # ticks whose calls are counted


def encoder(joints: tuple[str, ...]) -> Callable[[Array], bytes]:
    """Makes the sync write of goal positions for the shipped rig, out of targets (J,), rad, in the robot's order."""
    config = load_rig(find_rig("servo20"))
    scale = RigScale(config)
    order = np.array([joints.index(joint.name) for joint in config.joints])
    goal = config.joints[0].table["goal_position"]
    write = SyncWrite([joint.id for joint in config.joints], goal.address, goal.length)

    def encode(targets: Array) -> bytes:
        write.values[:] = scale.pulses(np.clip(targets[order], scale.lower, scale.upper))
        return write.frame()

    return encode


def play(library: MotionLibrary, motion: str, clock: Ticker | VirtualClock, ticks: int, *, rig: bool) -> None:
    """Plays a motion on servo20 with simulated servos and masses for so many ticks after the approach."""
    setup = RobotSetup(find_robot("servo20"), find_rig("servo20") if rig else None, emulated=True)
    with Session(
        library,
        lambda opening: open_robots(opening, [setup], library, RATE),
        lambda retarget: Deck(library, retarget, motion),
        RunSettings(rate=RATE, seconds=ticks / RATE),
        clock=clock,
    ) as session:
        session.run()


def time_play(library: MotionLibrary, motion: str, ticks: int = 4000) -> Array:
    """How long whole ticks of play take back to back, without a rig and without sleep, shape (ticks,), us."""
    clock = VirtualClock(RATE)
    wait, spent, began = clock.wait, list[int](), 0

    def timed() -> int:
        nonlocal began
        spent.append(time.perf_counter_ns() - began)
        late = wait()
        began = time.perf_counter_ns()
        return late

    clock.wait = timed
    play(library, motion, clock, ticks, rig=False)
    return 1e-3 * np.array(spent[APPROACH : APPROACH + ticks // 2])


def count_calls(
    library: MotionLibrary, motion: str, *, rig: bool = False, shown: int = 12
) -> dict[str, dict[str, float]]:
    """Python calls a tick: in all, for each room of the project (numpy is one, too), and of the busiest functions."""
    counts: Counter[tuple[str, str]] = Counter()

    def note(frame: FrameType, event: str, argument: object) -> None:
        if event == "call":
            counts[frame.f_code.co_filename, frame.f_code.co_qualname] += 1

    clock = Ticker(RATE) if rig else VirtualClock(RATE)
    wait, ticks = clock.wait, 0

    def counting() -> int:
        nonlocal ticks
        ticks += 1
        if ticks == APPROACH:
            sys.setprofile(note)
        elif ticks == APPROACH + COUNTED:
            sys.setprofile(None)
        return wait()

    clock.wait = counting
    play(library, motion, clock, APPROACH + COUNTED, rig=rig)
    del counts[__file__, counting.__qualname__]
    rooms: Counter[str] = Counter()
    for (file, _), count in counts.items():
        parts = Path(file).parts
        known = [k for k, part in enumerate(parts) if part in ("controller", "sim", "hardware", "numpy")]
        rooms["/".join(parts[known[-1] :][: 1 if parts[known[-1]] == "numpy" else 2]) if known else "elsewhere"] += (
            count
        )
    busiest = {f"{Path(file).stem}: {name}": count / COUNTED for (file, name), count in counts.most_common(shown)}
    total = {"all": sum(counts.values()) / COUNTED}
    return {"calls": total | {room: n / COUNTED for room, n in rooms.most_common()}, "busiest": busiest}


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks tick", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--library", default="thesis15")
    parser.add_argument("--motion", default="walk")
    parser.add_argument("--ticks", type=int, default=20_000)
    parser.add_argument("--calls", action="store_true", help="count the Python calls of a tick of play instead")
    parser.add_argument("--rig", action="store_true", help="with --calls: drive an emulated rig, too")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    library = load_library(find_library(options.library))
    if options.calls:
        counted = count_calls(library, options.motion, rig=options.rig)
        if options.json:
            print(json.dumps({"library": library.info.name, "motion": options.motion} | counted))
            return 0
        for title, rows in counted.items():
            print(f"| {title} | a tick |\n|---|---|")
            print("".join(f"| {name} | {calls:.1f} |\n" for name, calls in rows.items()))
        return 0
    robot = load_robot(find_robot("servo20"), library.skeleton)
    retargeting = 0

    def retarget(pose: Pose) -> Array:
        nonlocal retargeting
        began = time.perf_counter_ns()
        targets = robot.retarget(pose)
        retargeting = time.perf_counter_ns() - began
        return targets

    deck = Deck(library, retarget, options.motion)
    envelope = SafetyEnvelope(robot.limits, 1.0 / RATE)
    envelope.start(np.clip(deck.update(1.0 / RATE)[0], robot.limits.lower, robot.limits.upper))
    frame = encoder(robot.joints)
    spent = np.empty((options.ticks, 5))
    clock = time.perf_counter_ns
    with undisturbed():
        for row in spent:
            start = clock()
            targets, _ = deck.update(1.0 / RATE)
            played = clock()
            safe = envelope(targets)
            saved = clock()
            frame(safe)
            encoded = clock()
            row[:] = (
                *(played - start - retargeting, retargeting, saved - played, encoded - saved),
                encoded - start,
            )
    names = ("deck (network, posture)", "retarget", "safety envelope", "sync write of 20", "all")
    rows = {
        name: dict(zip(("p50", "p99"), (1e-3 * np.percentile(column, (50, 99))).tolist(), strict=True))
        for name, column in zip(names, spent.T, strict=True)
    }
    whole = time_play(library, options.motion)
    rows["play with simulated servos and masses"] = dict(
        zip(("p50", "p99"), np.percentile(whole, (50, 99)).tolist(), strict=True)
    )
    if options.json:
        print(json.dumps({"library": library.info.name, "motion": options.motion, "us": rows}))
        return 0
    print(f"{library.info.name}, {options.motion}, {options.ticks} ticks\n")
    print("| part | p50 us | p99 us |\n|---|---|---|")
    for name, row in rows.items():
        print(f"| {name} | {row['p50']:.0f} | {row['p99']:.0f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
