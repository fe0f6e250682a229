"""The panel of the page: buttons for motions and commands, and the state of the loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Lock
from typing import cast

import numpy as np
import viser

from controller.rotations import Array
from controller.wire.command_socket import CommandClient
from controller.wire.messages.arguments import TEMPO
from controller.wire.messages.command_table import BY_WORD
from controller.wire.messages.commands import (
    SIDES,
    DeckCommand,
    EmergencyStop,
    GiveBeat,
    Home,
    Pause,
    Push,
    Reset,
    Resume,
    SetTempo,
    Side,
    StepOn,
    Stop,
    Switch,
    Unlock,
)
from controller.wire.messages.events import Event
from controller.wire.messages.lock_state import LOCK_SOURCES, LOCK_STAGES, LockState
from controller.wire.messages.replies import Refused
from motiondeck_base.errors import MotiondeckError
from sim.view.ghost import WAYS
from sim.view.motions.motion_controls import MotionControls
from sim.view.recognition_text import what_is_seen
from sim.view.scene import CAMERAS
from sim.view.web.page_style import CURRENT, NOTICE_SECONDS, STOPS, STYLE
from sim.view.web.parts import PageParts
from sim.view.web.private_page import PrivatePage
from sim.view.web.state_line import RunState, ended_line, number_in, state_line

ANSWER_WITHIN = 1.0
# A hand on a slider keeps it for so long before the deck's own value is shown again, s.
HAND_ON = 1.0

_TOLD = ("via", "gave up", "fault", "fell", "stands", "push", "lost", "replayed")
_ALARMING = ("fault", "fell", "lost", "replayed")
PANEL_WIDTH = 332  # pixels
MOST_NOTICES = 3  # at a time; what a rig does has its own tab

STEP = 1.0 / 30.0  # s, of a step; a tick alone is hardly to be seen
STEPS = "The motion goes on for 1/30 s."

# Keys for the first motions.
DIGITS = ("1", "2", "3", "4", "5", "6", "7", "8", "9")
TARGET = "The pose that the simulated servos are to reach, translucent"
FORCES = "Of the floor on the body; an arrow half as long as the robot is its weight"
MORE = "All of them are marks in the strip of the last minutes, with their text."


class Panel:
    """Buttons and figures beside the scene; with `has_human` the human whose motion is played can be shown, too.

    With `has_phase` motions can be played backwards and sent to a phase; with `has_network` one can look inside it. A
    body in physics can be pushed; a good push is `push_ns`, N s, and 0 means that there is none. With `has_forces` the
    forces of the floor on it are known, with `has_target` the pose that its servos are to reach. A `direct` deck
    switches and blends without motions in between.
    """

    def __init__(
        self,
        page: PrivatePage,
        motions: list[str],
        joints: list[str],
        commands: CommandClient,
        *,
        look_from: Callable[[viser.ClientHandle, str], None],
        has_human: bool = False,
        has_phase: bool = False,
        has_network: bool = False,
        push_ns: float = 0.0,
        has_forces: bool = False,
        has_target: bool = False,
        library: Path | None = None,
        direct: bool = False,
        recognizable: Sequence[str] = (),
    ) -> None:
        self._page, self._commands = page, commands
        self._motions, self._joints, self._recognizable = motions, joints, recognizable
        self._lock = Lock()
        self._state = RunState()
        self._moved = 0.0  # when a hand was on the tempo, s
        self._noticed: dict[str, float] = {}  # when a notice was shown last, s
        gui = page.gui
        gui.configure_theme(show_share_button=False, show_logo=False, brand_color=CURRENT)
        gui.main_panel.dock_right()  # the scene has what is left, and nothing covers the robot
        gui.main_panel.set_width(PANEL_WIDTH)
        gui.add_html(STYLE)
        self.parts = PageParts(page)
        # What happens and how to stop it stand first, so that they are visible in a small window too.
        self._line = gui.add_html("")
        self._estop = gui.add_button(
            "Emergency stop", icon=viser.Icon.ALERT_OCTAGON, color=STOPS, hint=BY_WORD["estop"].help + " Key: Esc."
        )
        self._estop.on_click(self._stop_or_ask)
        self._pause = gui.add_button(
            "Pause", icon=viser.Icon.PLAYER_PAUSE, color="gray", hint=BY_WORD["pause"].help + " Key: space."
        )
        self._pause.on_click(lambda _: self._pause_or_resume())
        self._home = gui.add_button("Home", icon=viser.Icon.HOME, color="gray", hint=BY_WORD["home"].help)
        self._home.on_click(lambda _: self.send(Home()))
        self._end = gui.add_button("End run", icon=viser.Icon.PLAYER_STOP, color="gray", hint=BY_WORD["stop"].help)
        self._end.on_click(self._ask_to_end)
        self._step = gui.add_button(
            "Step", icon=viser.Icon.PLAYER_SKIP_FORWARD, color="gray", visible=False, hint=STEPS + " Key: S."
        )
        self._step.on_click(lambda _: self.send(StepOn(seconds=STEP)))
        self._controls_of_motions = MotionControls(
            self.parts, motions, library, has_phase=has_phase, direct=direct, send=self.send
        )
        self._tempo = gui.add_slider(
            "tempo", min=TEMPO.lowest if has_phase else 0.0, max=TEMPO.highest, step=0.05, initial_value=1.0
        )
        self._tempo.on_update(self._tempo_moved)
        self._tap = self._add_tap() if has_phase else None
        with gui.add_folder("view", expand_by_default=False):
            self._human = gui.add_dropdown("human", WAYS, hint="The pose that the network plays") if has_human else None
            self._target = gui.add_checkbox("target pose", False, hint=TARGET) if has_target else None
            self._network = (
                gui.add_checkbox(
                    "network", False, hint="The orbits of its neurons, in the three directions that show most"
                )
                if has_network
                else None
            )
            self._steps = gui.add_checkbox("footprints and contacts", False)
            self._forces = gui.add_checkbox("contact forces", False, hint=FORCES) if has_forces else None
            self._follow = gui.add_checkbox("camera follows", True)
            self._add_cameras(look_from)
        if push_ns:
            self._add_pushes(push_ns)
        with gui.add_folder("loop", expand_by_default=False):
            self._health = gui.add_html("")
        self._seen = gui.add_html("")
        self._add_keys()
        self._controls = [
            (self._tempo, BY_WORD["tempo"]),
            (self._pause, BY_WORD["pause"]),
            (self._home, BY_WORD["home"]),
        ]
        if self._tap is not None:
            self._controls.append((self._tap, BY_WORD["beat"]))

    def _add_pushes(self, usual: float) -> None:
        """A button for each side to push the body from, and how hard, N s."""
        gui = self._page.gui
        with gui.add_folder("push", expand_by_default=False):
            step = usual / 20.0
            impulse = gui.add_slider("N s", min=step, max=3.0 * usual, step=step, initial_value=usual)
            sides = gui.add_button_group("from the", SIDES, hint=BY_WORD["push"].help)
        sides.on_click(lambda _: self.send(Push(cast(Side, sides.value), float(impulse.value))))

    def _add_cameras(self, look_from: Callable[[viser.ClientHandle, str], None]) -> None:
        """A button for each place to look from; it moves the camera of the browser that pressed it."""
        cameras = self._page.gui.add_button_group("camera", tuple(CAMERAS))

        @cameras.on_click
        def _(event: viser.GuiEvent) -> None:
            if event.client is not None:
                look_from(event.client, str(cameras.value))

    def _add_keys(self) -> None:
        """Esc, space and the digits, also found in the page's command palette."""
        gui = self._page.gui
        gui.add_command("Emergency stop", hotkey="escape").on_trigger(lambda _: self.send(EmergencyStop()))
        gui.add_command("Pause or resume", hotkey="space").on_trigger(lambda _: self._pause_or_resume())
        gui.add_command("Step", hotkey="S").on_trigger(lambda _: self.send(StepOn(seconds=STEP)))
        for digit, motion in zip(DIGITS, self._motions, strict=False):
            gui.add_command(motion, hotkey=digit).on_trigger(lambda _, motion=motion: self.send(Switch(motion)))

    def _add_tap(self) -> viser.GuiButtonHandle:
        """A button to tap a beat, and one to end the lock."""
        gui = self._page.gui
        with gui.add_folder("beat", expand_by_default=False):
            tap = gui.add_button("Tap", color="gray", hint=BY_WORD["beat"].help)
            unlock = gui.add_button("Unlock", color="gray", hint=BY_WORD["unlock"].help)
        tap.on_click(lambda _: self.send(GiveBeat()))
        unlock.on_click(lambda _: self.send(Unlock()))
        return tap

    @property
    def _stopped(self) -> bool:
        return self._state.mode == "emergency stop"

    @property
    def human(self) -> str:
        """Where the human is shown."""
        return str(self._human.value) if self._human is not None else WAYS[0]

    @property
    def shows_network(self) -> bool:
        """Whether the network is shown beside the body."""
        return self._network is not None and bool(self._network.value)

    @property
    def shows_target(self) -> bool:
        """Whether the pose that the servos are to reach is shown."""
        return self._target is not None and bool(self._target.value)

    @property
    def marks_steps(self) -> bool:
        """Whether prints and contacts of the feet are shown."""
        return bool(self._steps.value)

    @property
    def shows_forces(self) -> bool:
        """Whether the forces of the floor on the body are shown."""
        return self._forces is not None and bool(self._forces.value)

    @property
    def follows(self) -> bool:
        """Whether the camera follows the robot."""
        return bool(self._follow.value)

    def show(self, state: dict[str, Array]) -> None:
        """Brings buttons, slider and figures up to date."""
        now, before = RunState.of(state, self._motions), self._state
        self._state = now
        self._line.content = state_line(now).as_html()
        self._controls_of_motions.show(now, state)
        if now.paused != before.paused:
            self._pause.label = "Resume" if now.paused else "Pause"
            self._pause.icon = viser.Icon.PLAYER_PLAY if now.paused else viser.Icon.PLAYER_PAUSE
        if (now.paused, now.mode) != (before.paused, before.mode):
            self._step.visible = now.paused and now.mode == "playing"
        if now.mode != before.mode:
            self._estop.label = "Reset" if self._stopped else "Emergency stop"
            for control, command in self._controls:
                control.disabled = now.mode not in command.modes
        tempo = round(number_in(state, "tempo", 1.0), 2)
        if abs(tempo - self._tempo.value) > 0.024 and time.monotonic() - self._moved > HAND_ON:
            self._tempo.value = min(max(tempo, self._tempo.min), self._tempo.max)
        self._health.content = _health(state)
        if "seen" in state:
            self._seen.content = what_is_seen(state, self._recognizable, self._joints)

    def tell(self, event: Event) -> None:
        """Shows an event that nothing else on the page shows."""
        if event.kind in _TOLD:
            self._notify(event.kind, event.text, alarming=event.kind in _ALARMING)

    def refuse(self, reason: str) -> None:
        """Shows why something was not done."""
        self._notify("Refused", reason)

    def _stop_or_ask(self, event: viser.GuiEvent) -> None:
        """Stops at once; a reset is asked about first."""
        if not self._stopped:
            self.send(EmergencyStop())
            return
        text = "See that nobody is near. Nothing moves yet; Resume, Home or a motion then starts slowly."
        self.ask(event, "Release the emergency stop?", text, "Release", Reset())

    def end(self, reason: str) -> None:
        """Shows that the run has ended, and why; nothing can be commanded any more."""
        self._line.content = ended_line(reason).as_html()
        self._controls_of_motions.end()
        for control, _ in self._controls:
            control.disabled = True
        self._estop.disabled = self._end.disabled = True

    def _pause_or_resume(self) -> None:
        self.send(Resume() if self._state.paused else Pause())

    def _ask_to_end(self, event: viser.GuiEvent) -> None:
        text = "The robot comes to rest, and the deck ends. This page then shows nothing any more."
        self.ask(event, "End the run?", text, "End the run", Stop(), no="Play on")

    def ask(
        self,
        event: viser.GuiEvent,
        title: str,
        text: str,
        yes: str,
        then: DeckCommand | Callable[[], None],
        *,
        no: str = "Cancel",
    ) -> None:
        """Asks the one who clicked; the first answer sends a message, or does something; the second does nothing."""
        gui = event.client.gui if event.client is not None else self._page.gui
        with gui.add_modal(title) as question:
            gui.add_markdown(text)
            agree = gui.add_button(yes, color=STOPS)
            gui.add_button(no, color="gray").on_click(lambda _: question.close())

        @agree.on_click
        def _(_: viser.GuiEvent) -> None:
            question.close()
            if callable(then):
                then()
            else:
                self.send(then)

    def _notify(self, title: str, text: str, *, alarming: bool = True) -> None:
        """Shows a notice; not twice while the same is still on the page."""
        now = time.monotonic()
        if now - self._noticed.get(text, -NOTICE_SECONDS) < NOTICE_SECONDS:
            return
        self._noticed = {old: at for old, at in self._noticed.items() if now - at < NOTICE_SECONDS} | {text: now}
        if title == "fault" and len(self._noticed) > MOST_NOTICES:
            title, text = "more faults", MORE
            if text in self._noticed:
                return
            self._noticed[text] = now
        for client in self._page.get_clients().values():
            client.add_notification(title, text, auto_close_seconds=NOTICE_SECONDS, color="red" if alarming else "blue")

    def _tempo_moved(self, event: viser.GuiEvent) -> None:
        # A slider set by this program, not by a hand, reports no client.
        if event.client is not None:
            self._moved = time.monotonic()
            self.send(SetTempo(factor=float(self._tempo.value)))

    def send(self, message: DeckCommand) -> None:
        """Sends a command and shows a refusal on the page; page callbacks come from many threads, the socket is one."""
        try:
            with self._lock:
                reply = self._commands.request(message, timeout_s=ANSWER_WITHIN)
            refusal = reply.reason if isinstance(reply, Refused) else ""
        except MotiondeckError as error:
            refusal = str(error)
        if refusal:
            self.refuse(refusal)


def _lock(state: dict[str, Array]) -> LockState | None:
    """What the phase is locked to, if it is."""
    source, stage = int(number_in(state, "lock_source", -1.0)), int(number_in(state, "lock_stage", -1.0))
    if source < 0 or stage < 0:
        return None
    error, beats = (number_in(state, field, float("nan")) for field in ("lock_error_ms", "beats_per_minute"))
    return LockState(LOCK_SOURCES[source], LOCK_STAGES[stage], _known(error), _known(beats))


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _health(state: dict[str, Array]) -> str:
    """The loop's figures as a small table."""

    def figure(field: str, form: str) -> str:
        value = number_in(state, field, float("nan"))
        return form.format(value) if np.isfinite(value) else "-"

    late = f"{figure('lateness_p50_us', '{:.0f}')} / {figure('lateness_p999_us', '{:.0f} µs')}"
    cells = [
        ("rate", figure("rate_hz", "{:.1f} Hz")),
        ("late p50 / p99.9", late),
        ("work p50", figure("work_p50_us", "{:.0f} µs")),
    ]
    if (lock := _lock(state)) is not None:
        cells.append(("lock", str(lock)))
    if number_in(state, "restarts", 0.0) > 0.0:
        cells.append(("network restarts", figure("restarts", "{:.0f}")))
    if number_in(state, "kept_apart", 0.0) > 0.0:
        cells.append(("limbs kept apart", figure("kept_apart", "{:.0f} times")))
    overruns = number_in(state, "overruns", 0.0)
    word = "On time: no tick was late." if overruns == 0.0 else f"Late: {overruns:.0f} ticks took longer than a period."
    boxes = "".join(
        f'<div><div style="opacity:.6;font-size:11px">{name}</div>'
        f'<div style="font-variant-numeric:tabular-nums;font-weight:600">{value}</div></div>'
        for name, value in cells
    )
    style = (
        "display:grid;grid-template-columns:1fr 1.3fr;gap:2px 12px;padding:2px 14px 6px;font-size:13px;line-height:1.35"
    )
    said = f'<div style="padding:2px 14px;font-size:13px">{word}</div>'
    return f'<div id="health">{said}<div style="{style}">{boxes}</div></div>'
