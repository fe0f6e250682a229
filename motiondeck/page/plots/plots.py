"""Plots of the last minutes: a browser asks each second for the curves that it shows; nothing else is sent."""

from collections.abc import Callable
from typing import Any

import viser

from controller.motion.rotations import Array
from motiondeck.page.plots.history import SECONDS, History
from motiondeck.page.web.parts import OwnPart, PageParts

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
