"""Plots of the last minutes: each browser has the curves that it has chosen, and only while it shows them."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import viser

from controller.motion.rotations import Array
from motiondeck.page.plots.history import SECONDS, History
from motiondeck.page.web.parts import OwnPart, PageParts

EVERY = 1.0  # s from one drawing to the next
MOST_CURVES = 12
DIGITS = {"°": 3, "A": 4, "V": 2, "°C": 1, "µs": 1, "%": 2, "mm": 2, "": 4}


class _Wanted(NamedTuple):
    curves: list[tuple[str, str]]  # group and name
    seconds: float


class Plots:
    """One part of the page, where its widgets are being added.

    `moment` has the time, s, that a browser looks back to; None for one that sees what happens now.
    """

    def __init__(self, parts: PageParts, history: History, moment: Callable[[int], float | None]) -> None:
        self._history, self._moment = history, moment
        groups = {group: [*curves] for group, curves in history.curves.items()}
        parts.add("plots", "plots", {"groups": groups, "most": MOST_CURVES}, self._hear).show({})
        self._lines = OwnPart(parts, "plot-lines")
        self._wanted: dict[int, _Wanted] = {}  # by browser
        self._drawn: dict[int, tuple[float, _Wanted, float | None]] = {}

    def _hear(self, said: Any, event: viser.GuiEvent) -> None:
        match said:
            case {"curves": list(chosen), "seconds": float(seconds) | int(seconds)} if event.client_id is not None:
                known = self._history.curves
                pairs = [tuple(str(one).split("/", 1)) for one in chosen[:MOST_CURVES]]
                curves = [(group, name) for group, name in pairs if name in known.get(group, ())]
                self._wanted[event.client_id] = _Wanted(curves, min(max(seconds, 1.0), SECONDS))

    def show(self, clients: Mapping[int, viser.ClientHandle], now: float) -> None:
        """Draws in each browser what it has chosen, at a time, s; where it looks back, about that moment."""
        for number, wanted in [*self._wanted.items()]:
            client, moment = clients.get(number), self._moment(number)
            if client is None:
                del self._wanted[number]
                continue
            at, *before = self._drawn.get(number, (-EVERY, None, None))
            due = before != [wanted, moment] or (moment is None and now - at >= EVERY)  # what is past stays as it is
            if not (wanted.curves and due):
                continue
            self._drawn[number] = now, wanted, moment
            self._lines.show(client, self._state(wanted, now, moment))

    def _state(self, wanted: _Wanted, now: float, moment: float | None) -> dict[str, Any]:
        history = self._history
        ends = now if moment is None else min(now, moment + 0.5 * wanted.seconds)
        at = history.places(ends - wanted.seconds, ends)
        ago = ends - history.at[at]
        curves = [(group, name, history.curves[group][name]) for group, name in wanted.curves]
        lines = [
            [f"{group}/{name}", label, curve.unit, _numbers(take(at), DIGITS[curve.unit])]
            for group, name, curve in curves
            for label, take in curve.lines.items()
        ]
        return {
            "seconds": wanted.seconds,
            "ends": round(ends - now, 2),
            "hand": None if moment is None else round(moment - ends, 2),
            "at": _numbers(-ago, 3),
            "run": _numbers(history.run_s[at], 4),
            "lines": [line for line in lines if any(value is not None for value in line[3])],
        }


def _numbers(values: Array, digits: int) -> list[float | None]:
    rounded = np.round(values, digits).tolist()
    return [value if value == value else None for value in rounded]
