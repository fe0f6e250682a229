"""The two largest parts of a tick in plain Python, beside the same in C.

The rotations of the bones and the angles of the limbs, for 3 s each of four motions of thesis15 on servo20, as `play`
asks for them. `_compiled_parts.c` is compiled with cc, which has to be there, and called by ctypes. Each call in Python
is followed by the same in C, whose answer has to be the same but for rounding.
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import controller.motion.encodings.bone_directions as bone_directions
from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import Array, best_fit
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library, find_robot
from sim.retargeting.retarget import LimbAngles
from sim.robots.robot import load_robot

RATE, SECONDS, SETTLING = 200.0, 3.0, 20
MOTIONS = ("walk", "jog", "box1", "waltz")
ROUNDING = 1e-9  # rad


def compile_parts(folder: Path) -> ctypes.CDLL:
    """The parts in C, compiled into a folder."""
    compiler = shutil.which("cc")
    if compiler is None:
        raise MotiondeckError("there is no C compiler (cc) on this machine")
    library = folder / "parts.so"
    source = Path(__file__).with_name("_compiled_parts.c")
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    return ctypes.CDLL(str(library))


def pointers(*arrays: Any) -> list[ctypes.c_void_p]:
    return [ctypes.c_void_p(array.ctypes.data) for array in arrays]


class Orient:
    """`orientation.orient` for one frame, its walk along the bones in C."""

    def __init__(self, parts: ctypes.CDLL, skeleton: Skeleton) -> None:
        self._call, self._bones = parts.orient, ctypes.c_long(len(skeleton))
        children = [children for _, _, children in skeleton.walk]
        self._first, self._rest = skeleton.first, skeleton.rest_direction[skeleton.first]
        self._kept = (
            np.array([parent for parent, _, _ in skeleton.walk]),
            np.array([rest for _, rest, _ in skeleton.walk]),
            np.cumsum([0, *map(len, children)]),
            np.array([child for those in children for child in those]),
        )
        self._pointers = pointers(*self._kept)

    def __call__(self, direction: Array) -> Array:
        """Rotations (1 + B, 4) of bones that point in the directions (B, 3)."""
        rotation = np.empty((len(direction) + 1, 4))
        rotation[0] = best_fit(direction.take(self._first, axis=0).T @ self._rest)
        if self._call(self._bones, *self._pointers, *pointers(direction, rotation)):
            raise MotiondeckError("a rare case came up that was left to Python")
        return rotation


class Limbs:
    """`LimbAngles` in C, going on from where one in Python is."""

    def __init__(self, parts: ctypes.CDLL, before: LimbAngles) -> None:
        self._call, self._up, self.angles = parts.limbs, np.zeros(3), np.zeros(20)
        limits = [np.array(before._lower), np.array(before._upper)]
        state = [np.array(before._direction), np.array(before._across), np.array(before._last), self.angles]
        self._kept = (*limits, *state)
        p = pointers(self._up, *self._kept)
        self._arguments = [*p[:3], ctypes.c_double(FOOT_SLOPE), *p[3:]]

    def __call__(self, direction: Array, up: Any) -> Array:
        """The angles (20,), rad, of limbs that point in the directions (14, 3)."""
        self._up[:] = up
        self._call(*pointers(direction), *self._arguments)
        return self.angles


def main() -> int:
    argparse.ArgumentParser(
        prog="python -m benchmarks compiled", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    ).parse_args()
    library = load_library(find_library("thesis15"))
    spent: dict[str, list[tuple[int, int]]] = {"rotations of the bones": [], "angles of the limbs": []}
    worst = 0.0

    def compare(part: str, python: Callable[[], Any], compiled: Callable[[], Array]) -> Any:
        nonlocal worst
        start = time.perf_counter_ns()
        answer = python()
        middle = time.perf_counter_ns()
        same = compiled()
        spent[part].append((middle - start, time.perf_counter_ns() - middle))
        worst = max(worst, float(np.abs(np.array(answer) - same).max()))
        return answer

    orient, call = bone_directions.orient, LimbAngles.__call__
    with tempfile.TemporaryDirectory() as folder:
        parts = compile_parts(Path(folder))
        turn = Orient(parts, library.skeleton)
        for motion in MOTIONS:
            robot = load_robot(find_robot("servo20"), library.skeleton)
            deck = Deck(library, robot.retarget, motion)
            for _ in range(SETTLING):
                deck.update(1.0 / RATE)
            limbs: list[Limbs] = []

            def both_orient(skeleton: Skeleton, direction: Array) -> Array:
                return compare("rotations of the bones", lambda: orient(skeleton, direction), lambda: turn(direction))

            def both_limbs(self: LimbAngles, direction: Array, up: Any, limbs: list[Limbs] = limbs) -> Any:
                if self._aims:  # an arm goes over to another solution, which is left to Python
                    limbs.clear()
                    return call(self, direction, up)
                limbs[:] = limbs or [Limbs(parts, self)]
                return compare(
                    "angles of the limbs", lambda: call(self, direction, up), lambda: limbs[0](direction, up)
                )

            bone_directions.orient, LimbAngles.__call__ = both_orient, both_limbs
            for _ in range(round(SECONDS * RATE)):
                deck.update(1.0 / RATE)
            bone_directions.orient, LimbAngles.__call__ = orient, call
    print("| part | Python p50, us | C p50, us |\n|---|---|---|")
    for part, times in spent.items():
        python, compiled = 1e-3 * np.median(times, axis=0)
        print(f"| {part} | {python:.1f} | {compiled:.1f} |")
    print(f"\nlargest difference {worst:.1e}")
    return 0 if worst < ROUNDING else 1


if __name__ == "__main__":
    sys.exit(main())
