"""Record the rig by hand: torque off, move the joints, stop; what was seen becomes a recording to trim and learn."""

from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import Any

import msgspec
import numpy as np
import viser

from controller.wire.messages.commands import Pause, ServoTorque
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.learning.learning_process import HAND, HandRecording
from motiondeck.page.web.page_state import RigDescription
from motiondeck.page.web.parts import Ask, PageParts, Send

Take = Callable[[Path], None]
LONGEST = 120.0  # s
LOOSENS = (
    "The deck pauses, and the torque of all servos goes off: hold what would fall. To record some joints only, switch "
    "those off on their cards instead."
)
TIGHTENS = "Each servo is checked and switched on where it stands; then it comes slowly to where it should be."


class HandRecorder:
    """The widgets for it, where the page's widgets are being added; `take` is called with a finished recording.

    The joints that are switched off are recorded, as often as the deck publishes where they are.
    """

    def __init__(self, parts: PageParts, rig: RigDescription, folder: Path, ask: Ask, send: Send, take: Take) -> None:
        self._joints = [servo.joint for servo in rig.servos]
        self._rate, self._off = rig.rate_hz, rig.conditions.index("is off on command")
        self._folder, self._ask, self._send, self._take = folder, ask, send, take
        self._loose = np.zeros(len(self._joints), dtype=np.bool_)
        self._recorded = self._loose  # whose joints
        self._seen: list[tuple[float, list[float]]] = []  # time, s, and angles
        self.recording = False
        self._count = 0
        self._deeds = parts.add("button-row", "hand-deeds", heard=self._do)
        self._text = parts.page.gui.add_html("")

    def record(self, run_s: float, servos: ServoStates) -> None:
        """Takes the states of the servos at a time of the run while it records; each once, in order."""
        self._seen.append((run_s, servos.positions[self._recorded].tolist()))
        if self.recording and self._seen[-1][0] - self._seen[0][0] > LONGEST:
            self.recording = False
            Thread(target=self._finish, daemon=True).start()

    def show(self, servos: ServoStates) -> None:
        """Brings the buttons up to date with the latest states of the servos."""
        self._loose = servos.conditions == self._off
        if self.recording:
            self._deeds.show([["stop", "Stop recording"]])
            seconds = self._seen[-1][0] - self._seen[0][0] if self._seen else 0.0
            self._say(f"Recording {self._recorded.sum()} joints: {seconds:.0f} s")
        elif self._loose.any():
            self._deeds.show([["record", "Start recording"], ["hold", "Torque on"]])
            self._say(f"{self._loose.sum()} of {len(self._joints)} joints are loose: move them by hand.")
        else:
            self._deeds.show([["loosen", "Record the rig by hand"]])
            self._say("Or record the rig: torque off, move its joints, stop.")

    def _do(self, said: Any, event: viser.GuiEvent) -> None:
        if said == "loosen":
            self._ask(event, "Record the rig by hand?", LOOSENS, "Torque off", self._loosen)
        elif said == "hold":
            self._ask(event, "Switch all servos on?", TIGHTENS, "Torque on", self._tighten)
        elif said == "record" and not self.recording and self._loose.any():
            self._recorded, self._seen = self._loose.copy(), []
            self.recording = True
        elif said == "stop" and self.recording:
            self._finish()

    def _say(self, text: str) -> None:
        self._text.content = f'<div class="part" id="hand-recording">{text}</div>'

    def _loosen(self) -> None:
        self._send(Pause())
        for joint in self._joints:
            self._send(ServoTorque(joint, "off"))

    def _tighten(self) -> None:
        for joint, off in zip(self._joints, self._loose.tolist(), strict=True):
            if off:
                self._send(ServoTorque(joint, "on"))

    def _finish(self) -> None:
        self.recording = False
        self._count += 1
        self._folder.mkdir(mode=0o700, exist_ok=True)
        file = self._folder / f"by-hand-{self._count}{HAND}"
        joints = [name for name, wanted in zip(self._joints, self._recorded.tolist(), strict=True) if wanted]
        seen = [*self._seen]
        times = [at - seen[0][0] for at, _ in seen]
        file.write_bytes(msgspec.json.encode(HandRecording(joints, self._rate, times, [angles for _, angles in seen])))
        self._take(file)
