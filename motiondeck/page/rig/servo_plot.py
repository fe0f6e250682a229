"""The last minute of one servo: goal and measured position."""

from __future__ import annotations

from collections import deque

import numpy as np
from viser import uplot

from controller.motion.rotations import Array
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.web.private_page import PrivatePage

SECONDS = 60.0
SAMPLES = 300  # drawn, over that time
STEP, LEAST = 5.0, 10.0  # degrees: the axis ends at multiples of the first and spans at least the second
MARGIN = 0.1  # of that, above and below
EVERY = 1.0  # s from one picture of it to the next


class ServoPlot:
    """Remembers the angles of all servos and draws those of one."""

    def __init__(self, page: PrivatePage) -> None:
        """Adds the plot where the page's widgets are being added."""
        self._kept: deque[tuple[float, Array, Array]] = deque()
        self._drawn, self._range = (-1, -EVERY), whole_range(np.empty(0))
        self._plot = page.gui.add_uplot(
            (np.array([-SECONDS, 0.0]), np.full(2, np.nan), np.full(2, np.nan)),
            (
                uplot.Series(label="s"),
                uplot.Series(label="target, °", stroke="#1c7ed6", width=2),
                uplot.Series(label="measured, °", stroke="#212529", width=1),
            ),
            scales=scales(self._range),
            axes=(uplot.Axis(), uplot.Axis(size=44, space=20)),
            legend=uplot.Legend(live=False),
            height=120,
        )

    def remember(self, servos: ServoStates, now: float) -> None:
        """Keeps the angles of a time, s."""
        goal = servos.goals
        if not np.isfinite(goal).all() or (self._kept and now - self._kept[-1][0] < SECONDS / SAMPLES):
            return
        self._kept.append((now, goal.copy(), servos.positions.copy()))
        while now - self._kept[0][0] > SECONDS:
            self._kept.popleft()

    def show(self, servo: int, now: float) -> None:
        """Draws a servo, at most once in EVERY seconds."""
        before, at = self._drawn
        if not self._kept or (servo == before and now - at < EVERY):
            return
        self._drawn = servo, now
        times, goals, positions = zip(*self._kept, strict=True)
        rows = np.degrees([[goal[servo] for goal in goals], [position[servo] for position in positions]])
        if (degrees := whole_range(rows)) != self._range:
            self._range = degrees
            self._plot.scales = scales(degrees)
        self._plot.data = (np.array(times) - now, rows[0], rows[1])


def whole_range(angles: Array) -> tuple[float, float]:
    """The least and most of the axis on which angles are drawn, degrees; NaN are left out."""
    known = angles[np.isfinite(angles)]
    if not len(known):
        return -0.5 * LEAST, 0.5 * LEAST
    least, most = STEP * np.floor(known.min() / STEP), STEP * np.ceil(known.max() / STEP)
    wanting = max(LEAST - (most - least), 0.0)
    least -= STEP * np.floor(0.5 * wanting / STEP)
    return float(least), float(max(most, least + LEAST))


def scales(degrees: tuple[float, float]) -> dict[str, uplot.Scale]:
    """The axes: the last minute, and from the least to the most degrees, with room for the numbers there."""
    least, most = degrees
    room = MARGIN * (most - least)
    y = uplot.Scale(range=(least - room, most + room))
    return {"x": uplot.Scale(time=False, range=(-SECONDS, 0.0)), "y": y}
