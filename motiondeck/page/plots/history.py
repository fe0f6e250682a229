"""What the pictures of the last minutes held, in arrays of fixed size, and the curves that can be drawn of it."""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import mujoco
import numpy as np

from controller.motion.rotations import Array, Indices, to_rotation_vector
from motiondeck.page.web.page_state import PageDescription, Picture
from motiondeck_base.errors import FileFormatError
from sim.models.joint_layout import JointLayout

SECONDS = 180.0
PICTURES = round(25 * SECONDS)  # kept: the page draws 25 a second
MOST_POINTS = 600  # of a line
_KEPT = ("qpos", "target", "human_root", "human_rotation", "activation", "servos", "bus")
_GOAL, _MEASURED = 0, 1  # rows of `ServoStates`
_OTHERS = {"current": (2, "A"), "temperature": (3, "°C"), "voltage": (4, "V")}
Take = Callable[[Indices], Array]
"""The values at the places of T pictures, shape (T,)."""


class Curve(NamedTuple):
    """What is drawn under one name: lines by their labels, in a unit."""

    unit: str
    lines: dict[str, Take]


class History:
    """The pictures of the last minutes, and their curves by group and name."""

    def __init__(self, about: PageDescription, model: mujoco.MjModel) -> None:
        shapes = {name: about.shapes[name] for name in _KEPT if name in about.shapes}
        self.kept = {name: np.full((PICTURES, *shape), np.nan, np.float32) for name, shape in shapes.items()}
        self.motions = [""] * PICTURES
        self.at, self.run_s, self._late, self._work, self.phase = numbers = np.full((5, PICTURES), np.nan)
        self._numbers, self._count = numbers, 0
        loop = {"lateness": self._late, "work": self._work}
        lines = {name: Curve("µs", {name: kept.__getitem__}) for name, kept in loop.items()}
        if "bus" in shapes:
            lines["bus load"] = Curve("%", {"bus load": self._bus_load})
        self.curves: dict[str, dict[str, Curve]] = {"angle": {}, "error": {}, "loop": lines}
        for name, angle in _angles(model).items():
            goal = partial(self._simulated, angle, "target") if "target" in shapes else None
            self._add_joint(name, partial(self._simulated, angle, "qpos"), goal)
        for place, servo in enumerate(about.rig.servos if about.rig is not None else ()):
            name, column = servo.joint, partial(self._column, "servos")
            self._add_joint(name, *(partial(self._degrees, (row, place)) for row in (_MEASURED, _GOAL)))
            for group, (row, unit) in _OTHERS.items():
                curve = Curve(unit, {f"{name} {group}": partial(column, (row, place))})
                self.curves.setdefault(group, {})[name] = curve
        for place in range(shapes.get("activation", [0])[0]):
            curve = Curve("", {f"neuron {place + 1}": partial(self._column, "activation", (place,))})
            self.curves.setdefault("neuron", {})[f"{place + 1}"] = curve
        self.curves = {group: curves for group, curves in self.curves.items() if curves}

    def _add_joint(self, name: str, measured: Take, goal: Take | None) -> None:
        self.curves["angle"][name] = Curve("°", {f"{name} measured": measured})
        if goal is not None:
            self.curves["angle"][name].lines[f"{name} goal"] = goal
            self.curves["error"][name] = Curve("°", {f"{name} error": lambda at: goal(at) - measured(at)})

    def _column(self, kept: str, place: tuple[int, ...], at: Indices) -> Array:
        return self.kept[kept][at, *place].astype(np.float64)

    def _degrees(self, place: tuple[int, int], at: Indices) -> Array:
        return np.degrees(self._column("servos", place, at))

    def _simulated(self, angle: Callable[[Array], Array], kept: str, at: Indices) -> Array:
        return np.degrees(angle(self.kept[kept][at].astype(np.float64)))

    def _bus_load(self, at: Indices) -> Array:
        """From each picture to the next of these, %; NaN where a bus was opened anew."""
        busy = np.diff(self._column("bus", (0,), at), prepend=np.nan)
        passed = np.diff(self.run_s[at], prepend=np.nan)
        return 100.0 * np.where((busy >= 0.0) & (passed > 0.0), busy, np.nan) / passed

    def keep(self, picture: Picture, now: float) -> None:
        """Keeps a picture of a time, s."""
        place, state = self._count % PICTURES, picture.snapshot
        phase = math.nan if state.phase is None else state.phase
        self._numbers[:, place] = now, state.run_s, state.late_us, state.work_us, phase
        self.motions[place] = state.playing
        for name, kept in self.kept.items():
            kept[place] = getattr(picture.arrays, name)
        self._count += 1

    def places(self, begins: float, ends: float) -> Indices:
        """The places of the pictures between two times, s, in order, MOST_POINTS of them at most."""
        numbers = np.arange(max(self._count - PICTURES, 0), self._count)
        at = self.at[numbers % PICTURES]
        numbers = numbers[(at >= begins) & (at <= ends)]
        every = -(-len(numbers) // MOST_POINTS) or 1
        return numbers[numbers % every == 0] % PICTURES  # the same ones whenever it is asked


def _angles(model: mujoco.MjModel) -> dict[str, Callable[[Array], Array]]:
    """By joint what takes its angles (T,), rad, from qpos (T, nq); none for a model that is no robot."""
    try:
        layout = JointLayout.of(model)
    except FileFormatError:
        return {}

    def turn(place: Indices, axis: int, qpos: Array) -> Array:
        return to_rotation_vector(qpos[:, place])[:, axis]

    found: dict[str, Callable[[Array], Array]] = {}
    for joint, place in zip(layout.hinge.tolist(), layout.hinge_qpos.tolist(), strict=True):
        found[layout.joints[joint]] = lambda qpos, place=place: qpos[:, place]
    for joints, place in zip(layout.ball.tolist(), layout.ball_qpos, strict=True):
        found |= {layout.joints[joint]: partial(turn, place, axis) for axis, joint in enumerate(joints)}
    return found
