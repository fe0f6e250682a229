"""Plots of the last minutes: a browser asks each second for the curves that it shows; nothing else is sent."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import viser

from controller.motion.rotations import Array, Indices
from motiondeck.page.web.page_state import PageDescription, Picture
from motiondeck.page.web.parts import OwnPart, PageParts
from motiondeck_base.errors import FileFormatError
from sim.models.joint_layout import JointLayout

SECONDS = 180.0
PICTURES = round(25 * SECONDS)  # kept: the page draws 25 a second
MOST_POINTS = 600  # of a curve
_LOOP = ("late_us", "work_us", "phase")  # of a snapshot
_SERVO_ROWS = ("goal", "measured", "current", "temperature", "voltage")  # the first of `ServoStates`
_ANGLES = {"qpos": "measured", "target": "goal"}  # of simulated joints
_WHOLE = {"bus": "busy", "activation": "neuron", "human_root": "root", "human_rotation": "rotation"}


class History:
    """Numbers of the pictures of the last minutes, by names, in arrays of fixed size.

    Attributes:
        columns: of each number its place, by a name such as `l_knee goal`, `neuron 7` or `late_us`; angles are in rad.
        values: of each picture the numbers, shape (PICTURES, columns).
        at, run_s: when each picture was drawn, and the time of the run then, shape (PICTURES,), s.
        motions: what played then.
        now, now_s: both times of the latest picture, s.
        derived: by name what is found from these where it is asked for: at some of the pictures, shape (T,).
    """

    def __init__(self, about: PageDescription, model: mujoco.MjModel) -> None:
        names = [*_LOOP]
        try:
            self._layout = JointLayout.of(model)
        except FileFormatError:  # it is no robot's
            self._layout = None
        joints = self._layout.joints if self._layout is not None else ()
        self._near = {kept: np.zeros(len(joints)) for kept in _ANGLES if kept in about.shapes and joints}
        names += [f"{joint} {_ANGLES[kept]}" for kept in self._near for joint in joints]
        servos = [servo.joint for servo in about.rig.servos] if about.rig is not None else []
        names += [f"{joint} {row}" for row in _SERVO_ROWS for joint in servos]
        self._whole = [kept for kept in _WHOLE if kept in about.shapes]
        for kept in self._whole:
            names += [f"{_WHOLE[kept]} {place + 1}" for place in range(int(np.prod(about.shapes[kept])))]
        self.columns = {name: place for place, name in enumerate(names)}  # servos' angles are the later ones
        self.values = np.full((PICTURES, len(names)), np.nan, np.float32)
        self.at, self.run_s = np.full((2, PICTURES), np.nan)
        self.motions, self._count, self.now, self.now_s = [""] * PICTURES, 0, 0.0, 0.0
        self.derived: dict[str, Callable[[Indices], Array]] = {}

    def keep(self, picture: Picture, now: float) -> None:
        """Keeps a picture of a time, s."""
        place, state, arrays = self._count % PICTURES, picture.snapshot, picture.arrays
        self.now, self.now_s = now, state.run_s
        self.at[place], self.run_s[place], self.motions[place] = now, state.run_s, state.playing
        for kept, near in self._near.items():
            if self._layout is not None:
                self._layout.read(getattr(arrays, kept), near, near)
        loop = np.array([np.nan if (value := getattr(state, name)) is None else value for name in _LOOP])
        servos = [arrays.servos[: len(_SERVO_ROWS)].ravel()] if arrays.servos is not None else []
        whole = (getattr(arrays, name).ravel() for name in self._whole)
        np.concatenate([loop, *self._near.values(), *servos, *whole], out=self.values[place], casting="same_kind")
        self._count += 1

    def places(self, begins: float, ends: float) -> Indices:
        """The places of the pictures between two times, s, in order, MOST_POINTS of them at most."""
        numbers = np.arange(max(self._count - PICTURES, 0), self._count)
        at = self.at[numbers % PICTURES]
        numbers = numbers[(at >= begins) & (at <= ends)]
        every = -(-len(numbers) // MOST_POINTS) or 1
        return numbers[numbers % every == 0] % PICTURES  # the same ones whenever it is asked

    def column(self, name: str, at: Indices) -> Array:
        """The numbers of a name at some of the pictures, shape (T,)."""
        if name in self.derived:
            return self.derived[name](at)
        return self.values[at, self.columns[name]].astype(np.float64)

    def block(self, kept: str, at: Indices) -> Array:
        """All numbers of an array of pictures at some of them, shape (T, numbers)."""
        places = [place for name, place in self.columns.items() if name.startswith(f"{_WHOLE[kept]} ")]
        return self.values[at][:, places].astype(np.float64)


MOST_CURVES = 24
DIGITS = 5


def add_plots(parts: PageParts, history: History, moment: Callable[[int], float | None]) -> None:
    """Adds them where the page's widgets are being added.

    `moment` has the time, s, that a browser looks back to; None for one that sees what happens now.
    """

    def answer(said: Any, event: viser.GuiEvent) -> None:
        match said:
            case {"curves": list(chosen), "seconds": float(seconds) | int(seconds)} if event.client is not None:
                seconds, now, hand = min(max(seconds, 1.0), SECONDS), history.now, moment(event.client.client_id)
                ends = now if hand is None else min(now, hand + 0.5 * seconds)
                at = history.places(ends - seconds, ends)
                state = {"seconds": seconds, "ends": ends - now, "hand": None if hand is None else hand - ends}
                state |= {"at": _numbers(history.at[at] - ends), "run": _numbers(history.run_s[at])}
                names = [name for name in chosen[:MOST_CURVES] if name in history.columns | history.derived]
                own.show(event.client, state | {"curves": {name: _numbers(history.column(name, at)) for name in names}})

    columns = "\n".join([*history.columns, *history.derived])
    parts.add("plots", "plots", {"columns": columns, "most": MOST_CURVES}, answer).show({})
    own = OwnPart(parts, "plot-curves")


def _numbers(values: Array) -> list[float | None]:
    return [value if value == value else None for value in values.round(DIGITS).tolist()]
