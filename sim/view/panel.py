"""The panel of the page: a button for each motion, speed, pause, home, halt and stop, and how the loop is doing."""

from __future__ import annotations

import time
from threading import Lock

import numpy as np
import viser

from controller.rotations import Array
from controller.wire.command_socket import (
    Blend,
    CommandClient,
    EmergencyStop,
    Home,
    Message,
    Pause,
    Queue,
    Refused,
    Reset,
    Resume,
    SetSpeed,
    Stop,
    Switch,
)
from controller.wire.messages import FASTEST, SLOWEST
from controller.wire.run_recording import MODES
from motiondeck_base.errors import MotiondeckError
from sim.view.ghost import WAYS
from sim.view.private_page import PrivatePage
from sim.view.recognition_text import what_is_seen

ANSWER_WITHIN = 1.0
# A hand on the slider keeps it for so long before the deck's own speed is shown again, s.
HAND_ON = 1.0

CURRENT = (38, 110, 200)
OTHERS = (120, 130, 145)


class Panel:
    """Buttons and figures beside the scene; with `has_human` the human whose motion is played can be shown, too."""

    def __init__(
        self,
        page: PrivatePage,
        motions: list[str],
        joints: list[str],
        commands: CommandClient,
        *,
        has_human: bool = False,
    ) -> None:
        self._page, self._commands = page, commands
        self._motions, self._joints = motions, joints
        self._lock = Lock()
        self._current = -1
        self._paused = self._halted = False
        self._moved = 0.0
        gui = page.gui
        gui.configure_theme(show_share_button=False, show_logo=False, brand_color=CURRENT)
        self._health = gui.add_html("")
        self._seen = gui.add_html("")
        # Above the motions, so that it need not be looked for below the edge of a small window.
        self._halt = gui.add_button(
            "Halt", icon=viser.Icon.ALERT_OCTAGON, color="orange", hint="Emergency stop: brake at once and hold"
        )
        self._halt.on_click(lambda _: self._send(Reset() if self._halted else EmergencyStop()))
        self._buttons = [gui.add_button(motion, color=OTHERS) for motion in motions]
        for motion, button in zip(motions, self._buttons, strict=True):
            button.on_click(lambda _, motion=motion: self._send(Queue(motion) if self._queue.value else Switch(motion)))
        self._queue = gui.add_checkbox("after the present one", False, hint="Queue a motion instead of switching now")
        with gui.add_folder("blend", expand_by_default=False):
            self._second = gui.add_dropdown("with", motions, hint="Mixed into the motion that is played")
            self._share = gui.add_slider("share", min=0.0, max=1.0, step=0.05, initial_value=0.0)
            self._share.on_update(self._share_moved)
        self._motions = motions
        gui.add_divider()
        self._speed = gui.add_slider("speed", min=SLOWEST, max=FASTEST, step=0.05, initial_value=1.0)
        self._speed.on_update(self._speed_moved)
        self._pause = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE, color="gray")
        self._pause.on_click(lambda _: self._send(Resume() if self._paused else Pause()))
        gui.add_button("Home", icon=viser.Icon.HOME, color="gray").on_click(lambda _: self._send(Home()))
        with gui.add_folder("view", expand_by_default=False):
            self._human = gui.add_dropdown("human", WAYS, hint="The pose that the network plays") if has_human else None
            self._steps = gui.add_checkbox("footprints and contacts", False)
            self._follow = gui.add_checkbox("camera follows", True)
        gui.add_button("Stop", icon=viser.Icon.PLAYER_STOP, color="red").on_click(lambda _: self._send(Stop()))

    @property
    def human(self) -> str:
        """Where the human is to be seen."""
        return str(self._human.value) if self._human is not None else WAYS[0]

    @property
    def marks_steps(self) -> bool:
        """Whether prints and contacts of the feet are to be seen."""
        return bool(self._steps.value)

    @property
    def follows(self) -> bool:
        """Whether the camera goes along with the robot."""
        return bool(self._follow.value)

    def show(self, state: dict[str, Array]) -> None:
        """Brings buttons, slider and figures up to date."""
        motion = int(_number(state, "motion", -1.0))
        if motion != self._current:
            for index, button in enumerate(self._buttons):
                colour = CURRENT if index == motion else OTHERS
                if button.color != colour:
                    button.color = colour
            self._current = motion
            self._share.value = 0.0  # nothing is mixed into a motion that was switched to
        paused = bool(_number(state, "paused", 0.0))
        if paused != self._paused:
            self._paused = paused
            self._pause.label = "Resume" if paused else "Pause"
            self._pause.icon = viser.Icon.PLAYER_PLAY if paused else viser.Icon.PLAYER_PAUSE
        halted = int(_number(state, "mode", 0.0)) == MODES.index("emergency stop")
        if halted != self._halted:
            self._halted = halted
            self._halt.label = "Reset" if halted else "Halt"
        speed = round(_number(state, "speed", 1.0), 2)
        if abs(speed - self._speed.value) > 0.024 and time.monotonic() - self._moved > HAND_ON:
            self._speed.value = min(max(speed, SLOWEST), FASTEST)
        self._health.content = _health(state)
        if "seen" in state:
            self._seen.content = what_is_seen(state, self._motions, self._joints)

    def _speed_moved(self, event: viser.GuiEvent) -> None:
        # A slider set by this program, not by a hand, reports no client.
        if event.client is not None:
            self._moved = time.monotonic()
            self._send(SetSpeed(factor=float(self._speed.value)))

    def _share_moved(self, event: viser.GuiEvent) -> None:
        if event.client is not None and 0 <= self._current < len(self._motions):
            self._send(Blend(self._motions[self._current], str(self._second.value), float(self._share.value)))

    def _send(self, message: Message) -> None:
        """Sends a command and shows a refusal on the page; page callbacks come from many threads, the socket is one."""
        try:
            with self._lock:
                reply = self._commands.request(message, timeout_s=ANSWER_WITHIN)
            refusal = reply.reason if isinstance(reply, Refused) else ""
        except MotiondeckError as error:
            refusal = str(error)
        if refusal:
            for client in self._page.get_clients().values():
                client.add_notification("Refused", refusal, auto_close_seconds=6.0, color="red")


def _number(state: dict[str, Array], field: str, default: float) -> float:
    values = state.get(field)
    return float(values[0]) if values is not None and len(values) and np.isfinite(values[0]) else default


def _health(state: dict[str, Array]) -> str:
    """The loop's figures as a small table."""

    def figure(field: str, form: str) -> str:
        value = _number(state, field, float("nan"))
        return form.format(value) if np.isfinite(value) else "-"

    late = f"{figure('lateness_p50_us', '{:.0f}')} / {figure('lateness_p999_us', '{:.0f} µs')}"
    cells = [
        ("rate", figure("rate_hz", "{:.1f} Hz")),
        ("late p50 / p99.9", late),
        ("overruns", figure("overruns", "{:.0f}")),
        ("work p50", figure("work_p50_us", "{:.0f} µs")),
    ]
    if _number(state, "recues", 0.0) > 0.0:
        cells.append(("network re-cued", figure("recues", "{:.0f}")))
    if _number(state, "kept_apart", 0.0) > 0.0:
        cells.append(("limbs kept apart", figure("kept_apart", "{:.0f} times")))
    boxes = "".join(
        f'<div><div style="opacity:.6;font-size:11px">{name}</div>'
        f'<div style="font-variant-numeric:tabular-nums;font-weight:600">{value}</div></div>'
        for name, value in cells
    )
    style = (
        "display:grid;grid-template-columns:1fr 1.3fr;gap:2px 12px;padding:2px 14px 6px;font-size:13px;line-height:1.35"
    )
    return f'<div id="health" style="{style}">{boxes}</div>'
