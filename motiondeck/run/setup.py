"""What `play`, `replay` and `rig play` do alike before a run: names become files, and mistakes are found at once."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from controller.library.motion_library import MotionLibrary
from controller.loop.clock import period_ns
from motiondeck.run.robots.robot_on_deck import RobotSetup
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_rig, find_robot

EMULATED = "emulated"
TIMED_FRAMES = 100
_TIMED_AT_ONCE = 20  # the quickest of these batches counts: others were disturbed


def check_seconds(seconds: float | None) -> None:
    """Refuses a length of time that cannot be; None is no limit.

    Raises:
        MotiondeckError: if it is not above 0 and below 1e8 s.
    """
    if seconds is not None and not 0.0 < seconds < 1e8:
        raise MotiondeckError(f"--seconds {seconds:g} is not a length of time above 0")


def frame_seconds(library: MotionLibrary, motion: str, clock: Callable[[], float] = time.thread_time) -> float:
    """What a frame of a library's network costs, in s of a clock; nothing that plays is changed."""
    network = library.network.twin()
    network.cue(motion, 0)
    frame = np.empty(network.channels)
    batches: list[float] = []
    for _ in range(TIMED_FRAMES // _TIMED_AT_ONCE):
        began = clock()
        for _ in range(_TIMED_AT_ONCE):
            network.advance(frame)
        batches.append((clock() - began) / _TIMED_AT_ONCE)
    return min(batches)


def checked_rate(
    library: MotionLibrary, motion: str, rate: float, *, lower: bool = False, cost: float | None = None
) -> float:
    """The rate at which a library is played: as wanted, unless its network needs more than half of a period for a tick.

    A tick has as many frames as fall into it at the recorded tempo.

    Args:
        library: what is played.
        motion: which of its motions is timed.
        rate: as wanted, ticks a second, Hz.
        lower: play at the rate that the network can hold, instead of refusing.
        cost: of a frame, s; measured if not given.

    Raises:
        RateError: if no loop runs at this rate.
        MotiondeckError: if it is too much for the network; it names the rate that the network can hold.
    """
    period_ns(rate)  # refuses a rate at which no loop runs
    cost = frame_seconds(library, motion) if cost is None else cost
    recorded = library.info.rate
    needs = cost * math.ceil(recorded / rate)
    if needs <= 0.5 / rate:
        return rate
    said = f"the network of {library.info.name} needs {1e3 * needs:.2f} ms of the {1e3 / rate:.2f} ms of a tick"
    held = math.floor(0.5 / cost)
    if held < recorded:
        raise MotiondeckError(f"{said}; on this machine it is too large to be played live at any rate: make a film")
    if lower:
        return float(held)
    raise MotiondeckError(f"{said}, and half of it is the most; it can hold --rate {held} (or give --lower-rate)")


def first_motion(library: MotionLibrary, motion: str | None) -> str:
    """What a library plays first: the given motion, else `walk`, else its first one.

    Raises:
        UnknownNameError: if the library has no such motion; it names the nearest.
    """
    names = library.network.motions
    if motion is not None and motion not in names and Path(motion).is_file():
        if Path(motion).suffix.lower() == ".safetensors":
            raise MotiondeckError(
                f"{motion}: a file, not a motion of {library.info.name}. Play it: motiondeck play --library {motion}"
            )
        learned = Path(motion).with_suffix(".safetensors").name
        raise MotiondeckError(
            f"{motion}: a file, not a motion of {library.info.name}. Learn it: motiondeck learn {motion} --out "
            f"{learned}; then play it: motiondeck play --library {learned}"
        )
    if motion is not None and motion not in names:
        raise UnknownNameError.among("motion", motion, names)
    return motion or ("walk" if "walk" in names else names[0])


def robot_setup(
    robot: str,
    rig: str | None,
    *,
    physics: bool = True,
    root: str = "gantry",
    balance: bool = False,
    walk: bool = False,
    solver: str | None = None,
    keep_apart: bool = False,
) -> RobotSetup:
    """A robot and its rig by their names or files.

    Args:
        robot: a shipped robot, or a robot file.
        rig: a shipped rig, a rig file, "emulated" for emulated servos of the robot, or None.
        physics, root, balance, walk, solver, keep_apart: as in `RobotSetup`.

    Raises:
        MotiondeckError: if there is no such robot or rig; it names the nearest.
    """
    file = find_robot(robot)
    return RobotSetup(file, _rig_file(rig, robot), rig == EMULATED, physics, root, balance, walk, solver, keep_apart)


def _rig_file(rig: str | None, robot: str) -> Path | None:
    """The rig file; for emulated servos the one with the robot's own name."""
    if rig is None:
        return None
    if rig != EMULATED:
        return find_rig(rig, also=[EMULATED])
    try:
        return find_rig(Path(robot).stem)
    except MotiondeckError:
        raise MotiondeckError(
            f"there is no rig for robot '{Path(robot).stem}' to be emulated. Try: --rig emulated --robot servo20. "
            "For your own robot write a rig file, emulate it with motiondeck rig emulate, and name it with --rig FILE"
        ) from None
