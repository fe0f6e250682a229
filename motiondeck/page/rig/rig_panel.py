"""The rig on the page: a card for each servo, the last minute of one, its registers, and what can be done with it."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
import viser
from viser import uplot

from controller.motion.rotations import Array
from controller.wire.messages.commands import ReadRegisters, RestartServo, ServoTorque
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.rig.servo_look import ServoLook, ServoLooks
from motiondeck.page.rig.servo_tables import Look, ServoTables
from motiondeck.page.web.page_state import RigDescription, ServoDescription
from motiondeck.page.web.parts import Ask, PageParts
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


FALLS = "The joint goes limp: hold what would fall. The others play on."
SETS_UP = "The servo is checked and switched on where it stands; then it comes slowly to where it should be."
RESTARTS = "All servos hold for half a second; this one is limp for as long, then it is set up again."


class RigPanel:
    """The widgets of the rig, where the page's widgets are being added."""

    def __init__(self, page: PrivatePage, parts: PageParts, rig: RigDescription, ask: Ask, look: Look) -> None:
        self._servos = rig.servos
        self._looks = ServoLooks(rig)
        self._chosen = 0
        gui = page.gui
        self._summary = gui.add_html("")
        self._cards = parts.add("servo-cards", "servos", {"servos": msgspec.to_builtins(rig.servos)}, self._choose)
        self._title = gui.add_html("")
        self._deeds = parts.add("button-row", "servo-deeds", heard=self._do)
        self._plot = ServoPlot(page)
        self._ask = ask
        self._tables = ServoTables(page, look, ask)
        self._off = False  # whether the chosen servo was switched off

    @property
    def joint(self) -> str:
        """The joint of the chosen servo."""
        return self._servos[self._chosen].joint

    def show(self, servos: ServoStates, now: float) -> list[ServoLook]:
        """Brings everything up to date at a time, s; the looks of the servos."""
        looks = self._looks.of(servos, now)
        if not looks:
            return looks
        self._plot.remember(servos, now)
        self._plot.show(self._chosen, now)
        columns = servos.goals, servos.positions, servos.currents, servos.temperatures, servos.voltages, servos.torque
        rows = [
            [*(_number(column[place], 3) for column in columns), look.level, look.words]
            for place, look in enumerate(looks)
        ]
        self._cards.show({"servos": rows, "chosen": self._chosen})
        self._off = looks[self._chosen].level == "off"
        limp = self._off or not servos.torque[self._chosen]
        deeds = [["on", "Torque on"] if limp else ["off", "Torque off"], ["restart", "Restart"]]
        self._deeds.show([*deeds, ["registers", "Registers"], ["scan", "Scan ports"]])
        self._title.content = f'<div class="part"><b>{self.joint}</b>, the last minute</div>'
        self._summary.content = f'<div class="part" id="rig-summary">{_summary(self._servos, looks)}</div>'
        return looks

    def _do(self, said: Any, event: viser.GuiEvent) -> None:
        joint = self.joint
        if said == "off":
            self._ask(event, f"Take the torque off {joint}?", FALLS, "Torque off", ServoTorque(joint, "off"))
        elif said == "on":
            self._ask(event, f"Switch {joint} on?", SETS_UP, "Torque on", ServoTorque(joint, "on"))
        elif said == "restart":
            self._ask(event, f"Restart {joint}?", RESTARTS, "Restart", RestartServo(joint))
        elif said == "registers":
            self._tables.show_registers(ReadRegisters(joint), event, off=self._off)
        elif said == "scan":
            self._tables.scan(event)

    def _choose(self, said: Any, event: viser.GuiEvent) -> None:
        choice = said.get("choose") if isinstance(said, dict) else None
        if isinstance(choice, int) and 0 <= choice < len(self._servos):
            self._chosen = choice


def _number(value: float, digits: int) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None


def _summary(servos: Sequence[ServoDescription], looks: Sequence[ServoLook]) -> str:
    wrong = [f"{servo.joint} {look.words}" for servo, look in zip(servos, looks, strict=True) if look.level != "ok"]
    more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
    return f"<b>{'; '.join(wrong[:3])}{more}</b>" if wrong else f"all {len(servos)} servos are well"
