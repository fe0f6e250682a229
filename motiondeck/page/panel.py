"""The panel of the page: buttons for motions and commands, and the state of the loop."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any, cast

import viser

from controller.wire.command_socket import CommandClient
from controller.wire.messages import commands as say
from controller.wire.messages.arguments import TEMPO
from controller.wire.messages.command_table import BY_WORD, parse_command
from controller.wire.messages.commands import SIDES, DeckCommand, Side
from controller.wire.messages.deck_snapshot import DeckSnapshot
from controller.wire.messages.replies import Event, Refused
from motiondeck.page.alarms import Notices
from motiondeck.page.bodies import View
from motiondeck.page.event_looks import LOOKS, ROUTINE
from motiondeck.page.ghost import WAYS
from motiondeck.page.motions.motion_controls import MotionControls
from motiondeck.page.operate import Operate, deck_buttons, deck_cues
from motiondeck.page.scene import CAMERAS
from motiondeck.page.web.page_state import PageDescription
from motiondeck.page.web.page_style import CURRENT, QUIET, STOPS, STYLE
from motiondeck.page.web.parts import PageParts, Then
from motiondeck.page.web.private_page import PrivatePage
from motiondeck.page.web.state_line import StateLine, ended_line, state_line
from motiondeck_base.errors import MotiondeckError

TARGET = "The pose that the servos are to reach, translucent"
FORCES = "Of the floor on the body; an arrow half as long as the robot is its weight"
NETWORK = "The orbits of its neurons, in the three directions that show most"
ANSWER_WITHIN = 1.0  # s
HAND_ON = 1.0  # a hand on a slider keeps it for so long before the deck's own value is shown again, s
PANEL_WIDTH = 332  # pixels
STEP = 1.0 / 30.0  # s, of a step; a tick alone is hardly to be seen
DIGITS = ("1", "2", "3", "4", "5", "6", "7", "8", "9")  # keys for the first motions


def view_choices(
    page: PrivatePage, look_from: Callable[[viser.ClientHandle, str], None], about: PageDescription
) -> Callable[[], View]:
    """Adds what the viewer may choose to see of a run, and returns what is chosen; `look_from` moves a camera."""
    gui = page.gui
    with gui.add_folder("view", expand_by_default=False):
        hint = "The pose that the network plays"
        humans = gui.add_dropdown("human", WAYS, hint=hint) if about.human is not None else None
        boxes = {
            "target": gui.add_checkbox("target pose", False, hint=TARGET) if "target" in about.shapes else None,
            "network": gui.add_checkbox("network", False, hint=NETWORK) if about.network_file else None,
            "steps": gui.add_checkbox("footprints and contacts", False) if about.walks else None,
            "forces": gui.add_checkbox("contact forces", False, hint=FORCES) if about.weight is not None else None,
            "follows": gui.add_checkbox("camera follows", True) if about.walks else None,
        }
        cameras = gui.add_button_group("camera", tuple(CAMERAS))

    @cameras.on_click
    def _(event: viser.GuiEvent) -> None:
        if event.client is not None:  # the browser that pressed it
            look_from(event.client, str(cameras.value))

    def chosen() -> View:
        human = str(humans.value) if humans is not None else WAYS[0]
        return View(human, **{name: box is not None and bool(box.value) for name, box in boxes.items()})

    return chosen


class Panel:
    """Buttons and figures beside the scene."""

    def __init__(
        self,
        page: PrivatePage,
        about: PageDescription,
        commands: CommandClient,
        *,
        look_from: Callable[[viser.ClientHandle, str], None],
        before: Callable[[], None] = lambda: None,
    ) -> None:
        """Puts them on a page; `before` is called before each command."""
        self._page, self._commands, self._before = page, commands, before
        self._motions = about.motions
        self._state = DeckSnapshot(motion="")
        self._moved = 0.0  # when a hand was on the tempo, s
        gui = page.gui
        gui.main_panel.dock_right()  # the scene has what is left, and nothing covers the robot
        gui.main_panel.set_width(PANEL_WIDTH)
        gui.add_html(STYLE)
        self.parts = PageParts(page)
        self._notices = Notices(self.parts)
        tempo = [TEMPO.lowest if about.has_phase else 0.0, TEMPO.highest]
        groups = about.groups if about.library_file else []
        fixed = {"motions": self._motions, "verdicts": about.verdicts, "groups": groups, "tempo": tempo}
        self._operate, self._layers = Operate(self.parts, fixed, self.send), ""
        # What happens and how to stop it stand first, so that they are visible in a small window too.
        self._line = gui.add_html("")
        icons, helps = viser.Icon, {word: command.help for word, command in BY_WORD.items()}
        stop, pause, step = f"{helps['estop']} Key: Esc.", f"{helps['pause']} Key: space.", "A moment on. Key: S."
        self._estop = gui.add_button("Emergency stop", icon=icons.ALERT_OCTAGON, color=STOPS, hint=stop)
        self._estop.on_click(self._stop_or_ask)
        self._pause = gui.add_button("Pause", icon=icons.PLAYER_PAUSE, color=QUIET, hint=pause)
        self._pause.on_click(lambda _: self._pause_or_resume())
        self._home = gui.add_button("Home", icon=icons.HOME, color=QUIET, hint=helps["home"])
        self._home.on_click(lambda _: self.send(say.Home()))
        self._end = gui.add_button("End run", icon=icons.PLAYER_STOP, color=QUIET, hint=helps["stop"])
        self._end.on_click(self._ask_to_end)
        self._step = gui.add_button("Step", icon=icons.PLAYER_SKIP_FORWARD, color=QUIET, disabled=True, hint=step)
        self._step.on_click(lambda _: self.send(say.StepOn(seconds=STEP)))
        self.motion_controls = MotionControls(self.parts, about, self.send)
        marks = tuple((at, f"{at:g}") for at in (tempo[0], 1.0, tempo[1]))
        self._tempo = gui.add_slider("tempo", *tempo, step=0.05, initial_value=1.0, marks=marks)
        self._tempo.on_update(self._tempo_moved)
        self._tap = self._add_tap() if about.has_phase else None
        if groups:
            with gui.add_folder("layer", expand_by_default=False):
                gui.add_html('<div class="part" data-part="layers" data-of="operate"></div>')
        if (about.live or about.gazes) and about.library_file:
            with gui.add_folder("live values", expand_by_default=False):
                fixed = {"groups": about.live, "gaze": about.gazes}
                self.parts.add("live-values", "live-values", fixed, self._follow_hand).show({})
        self.view = view_choices(page, look_from, about)
        if about.push_ns:
            self._add_pushes(about.push_ns)
        with gui.add_folder("loop", expand_by_default=False):
            self._health = self.parts.add("loop-figures", "health")
        fixed = {"unrecognized": about.unrecognized}
        self._recognition = self.parts.add("recognition", "seen", fixed) if about.recognizable else None
        self._add_keys()
        controls = {"tempo": self._tempo, "pause": self._pause, "home": self._home, "beat": self._tap}
        self._controls = [(control, BY_WORD[word]) for word, control in controls.items() if control is not None]

    def _follow_hand(self, said: Any, _: viser.GuiEvent) -> None:
        match said:
            case [str(group), float(value) | int(value)]:
                self.send(say.SetInput(group, float(value)))
            case {"gaze": [float(left) | int(left), float(up) | int(up)]}:
                self.send(say.Gaze(float(left), float(up)))

    def _add_pushes(self, usual: float) -> None:
        gui = self._page.gui
        with gui.add_folder("push", expand_by_default=False):
            step = float(f"{usual / 20.0:.1g}")
            impulse = gui.add_slider("N s", step, round(60.0 * step, 6), step, round(round(usual / step) * step, 6))
            sides = gui.add_button_group("from the", SIDES, hint=BY_WORD["push"].help)
        sides.on_click(lambda _: self.send(say.Push(cast(Side, sides.value), float(impulse.value))))

    def _add_keys(self) -> None:
        gui = self._page.gui
        gui.add_command("Emergency stop", hotkey="escape").on_trigger(lambda _: self.send(say.EmergencyStop()))
        gui.add_command("Pause or resume", hotkey="space").on_trigger(lambda _: self._pause_or_resume())
        gui.add_command("Step", hotkey="S").on_trigger(lambda _: self.send(say.StepOn(seconds=STEP)))
        for digit, motion in zip(DIGITS, self._motions, strict=False):
            gui.add_command(motion, hotkey=digit).on_trigger(lambda _, motion=motion: self.send(say.Switch(motion)))

    def _add_tap(self) -> viser.GuiButtonHandle:
        gui = self._page.gui
        with gui.add_folder("beat", expand_by_default=False):
            tap = gui.add_button("Tap", color=QUIET, hint=BY_WORD["beat"].help)
            unlock = gui.add_button("Unlock", color=QUIET, hint=BY_WORD["unlock"].help)
        tap.on_click(lambda _: self.send(say.GiveBeat()))
        unlock.on_click(lambda _: self.send(say.Unlock()))
        return tap

    def show(self, now: DeckSnapshot) -> None:
        """Brings buttons, slider and figures up to date."""
        self._state = now
        self.show_line(state_line(now))
        self._notices.show()
        self.motion_controls.show(now)
        self._pause.label = "Resume" if now.paused else "Pause"
        self._pause.icon = viser.Icon.PLAYER_PLAY if now.paused else viser.Icon.PLAYER_PAUSE
        self._step.disabled = not (now.paused and now.mode == "playing")
        stopped = now.mode == "emergency stop"
        self._estop.label, self._estop.color = ("Reset", CURRENT) if stopped else ("Emergency stop", STOPS)
        for control, command in self._controls:
            control.disabled = now.mode not in command.modes
        tempo = round(now.commanded_tempo, 2)
        if abs(tempo - self._tempo.value) > 0.024 and time.monotonic() - self._moved > HAND_ON:
            self._tempo.value = min(max(tempo, self._tempo.min), self._tempo.max)
        health = {name: value and round(value) for name, value in now.health._asdict().items()}
        health |= {"rate": round(now.rate_hz, 1), "overruns": now.overruns, "lock": str(now.lock or "")}
        self._health.show(health | {"restarts": now.restarts, "kept_apart": now.kept_apart})
        if self._recognition is not None:
            wrong = {"mismatch_s": round(now.mismatch_s, 1), "stuck": now.stuck}
            self._recognition.show({"seen": now.seen and [now.seen.motion, round(now.seen.confidence, 2)], **wrong})

    def show_line(self, line: StateLine) -> None:
        """Shows a line over what the deck said last."""
        now = self._state
        buttons, cues, tempo = deck_buttons(now), deck_cues(now), round(now.commanded_tempo, 2)
        self._line.content = self._operate.show(line, buttons, cues, tempo=tempo, layers=self._layers)

    def show_event(self, event: Event) -> None:
        """Shows an event that nothing else on the page shows."""
        if event.kind == "layer":
            self._layers = event.text
        if (look := LOOKS.get(event.kind, ROUTINE)).title:
            self._notices.add(look.title, event.text, alarming=look.alarming)

    def refuse(self, reason: str) -> None:
        """Shows why something was not done."""
        self._notices.add("Refused", reason)

    def _stop_or_ask(self, event: viser.GuiEvent) -> None:
        if self._state.mode != "emergency stop":
            self.send(say.EmergencyStop())
            return
        text = "Check that all people are clear. Nothing moves yet; Resume, Home or a motion then starts slowly."
        self.ask(event, "Release the emergency stop?", text, "Release", say.Reset())

    def end(self, reason: str) -> None:
        """Shows that the run has ended, and why; nothing can be commanded any more."""
        self._line.content = self._operate.show(ended_line(reason), [])
        self.motion_controls.end()
        for control, _ in self._controls:
            control.disabled = True
        self._estop.disabled = self._end.disabled = True

    def _pause_or_resume(self) -> None:
        self.send(say.Resume() if self._state.paused else say.Pause())

    def _ask_to_end(self, event: viser.GuiEvent) -> None:
        text = "The robot comes to rest, and the deck ends. This page then keeps its last picture."
        self.ask(event, "End the run?", text, "End the run", say.Stop(), no="Play on")

    def ask(self, event: viser.GuiEvent, title: str, text: str, yes: str, then: Then, no: str = "Cancel") -> None:
        """Asks for confirmation in the browser that clicked; `yes` sends a message or calls a function."""
        self.parts.ask(event, title, text, yes, then if callable(then) else partial(self.send, then), no)

    def _tempo_moved(self, event: viser.GuiEvent) -> None:
        # A slider set by this program, not by a hand, reports no client.
        if event.client is not None:
            self._moved = time.monotonic()
            self.send(say.SetTempo(factor=float(self._tempo.value)))

    def send(self, message: DeckCommand | list[str]) -> None:
        """Sends a command, perhaps as typed, and shows a refusal; an emergency stop waits for no other command."""
        self._before()
        try:
            command = parse_command(message) if isinstance(message, list) else message
            reply = self._commands.request(command, timeout_s=ANSWER_WITHIN)
            refusal = reply.reason if isinstance(reply, Refused) else ""
        except MotiondeckError as error:
            refusal = str(error)
        if refusal:
            self.refuse(refusal)
