"""The rig on the page: a card for each servo, its registers, and what can be done with it."""

import html
from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
import viser

from controller.wire.messages.commands import ReadRegisters, RestartServo, ServoTorque
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.rig.servo_look import ServoLook, ServoLooks
from motiondeck.page.rig.servo_tables import Look, ServoTables
from motiondeck.page.web.page_state import RigDescription, ServoDescription
from motiondeck.page.web.parts import Ask, PageParts

FALLS = "The joint goes limp: hold what would fall. The others play on."
SETS_UP = "The servo is checked and switched on where it stands; then it comes slowly to where it should be."
RESTARTS = "All servos hold for half a second; this one is limp for as long, then it is set up again."


class RigPanel:
    """The widgets of the rig, where the page's widgets are being added."""

    def __init__(self, parts: PageParts, rig: RigDescription, ask: Ask, look: Look) -> None:
        self._servos = rig.servos
        self._looks = ServoLooks(rig)
        self._chosen = 0
        gui = parts.page.gui
        self._summary = gui.add_html("")
        self._cards = parts.add("servo-cards", "servos", {"servos": msgspec.to_builtins(rig.servos)}, self._choose)
        self._title = gui.add_html("")
        self._deeds = parts.add("button-row", "servo-deeds", heard=self._do)
        self._ask = ask
        self._tables = ServoTables(parts, look, ask)
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
        columns = servos.goals, servos.positions, servos.currents, servos.temperatures, servos.voltages, servos.torque
        rows = [
            [*(value if np.isfinite(value) else None for value in values), look.level, look.words]
            for values, look in zip(np.round(columns, 3).T.tolist(), looks, strict=True)
        ]
        self._cards.show({"servos": rows, "chosen": self._chosen})
        self._off = looks[self._chosen].level == "off"
        limp = self._off or not servos.torque[self._chosen]
        deeds = [["on", "Torque on"] if limp else ["off", "Torque off"], ["restart", "Restart"]]
        self._deeds.show([*deeds, ["registers", "Registers"], ["scan", "Scan ports"]])
        name, plot = html.escape(self.joint.replace("_", " ")), f'data-plot="angle/{html.escape(self.joint)}"'
        self._title.content = f'<div class="part"><b>{name}</b> <button {plot}>Plot</button></div>'
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


def _summary(servos: Sequence[ServoDescription], looks: Sequence[ServoLook]) -> str:
    looked = zip((servo.joint.replace("_", " ") for servo in servos), looks, strict=True)
    wrong = [f"{joint} {look.words}" for joint, look in looked if look.level != "ok"]
    more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
    return f"<b>{'; '.join(wrong[:3])}{more}</b>" if wrong else f"all {len(servos)} servos are well"
