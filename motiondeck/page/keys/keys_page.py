"""The page on which keyframes are written: sliders pose joints, a strip has the keys, the rig's figure plays them."""

import contextlib
import io
import math
import threading
import time
from collections.abc import Callable, Mapping
from html import escape
from typing import Any, get_args

import numpy as np
import viser

from controller.motion.formats.keyframes import Easing
from motiondeck.page.clip_page import PICTURES_PER_SECOND, Playhead
from motiondeck.page.figures import BAD
from motiondeck.page.keys.draft import Draft
from motiondeck.page.keys.key_sheet import KeySheet
from motiondeck.page.keys.rehearsal import Rehearsal
from motiondeck.page.scene import Scene
from motiondeck.page.web.page_style import CURRENT, STOPS
from motiondeck.page.web.parts import PageParts, ask
from motiondeck.page.web.private_page import PrivatePage
from motiondeck_base.counted import counted
from motiondeck_base.errors import MotiondeckError
from sim.robots.robot import Robot

ReadRig = Callable[[], Mapping[str, float]]
"""Where the joints of the rig stand, deg; MotiondeckError if they cannot be read."""

STEP, SNAP = 0.5, 0.05  # deg, of a slider; s, of a pause
PANEL_WIDTH = 332  # pixels
HAND_ON = 0.5  # s for which a hand keeps what it has set
SHOWN_EVERY = 0.12  # s: sliders and hand while it plays
CURVE_POINTS = 160
CURRENT_TEXT = "#1c7ed6"
POSED = "This pose is no key yet: choose its time and set it, or press Play to leave it."
REAL = "The servos move. Keep clear of the rig, and know how to cut its power."


def show_keys(draft: Draft, robot: Robot, read_rig: ReadRig, rehearsal: Rehearsal, port: int) -> None:
    """Shows the page until the program is ended; PortError if the port is taken."""
    # viser announces itself on standard output, which is kept for results.
    with contextlib.redirect_stdout(io.StringIO()):
        page = PrivatePage(port, label=f"Motiondeck · {draft.file.name}")
    try:
        desk = KeysPage(page, draft, robot, read_rig, rehearsal)
        last = time.monotonic()
        while True:
            now = time.monotonic()
            desk.show(min(now - last, 0.25))
            last = now
            time.sleep(max(0.0, now + 1.0 / PICTURES_PER_SECOND - time.monotonic()))
    finally:
        rehearsal.stop()
        page.stop()


class KeysPage:
    """The controls of one draft; what browsers do is done in threads of viser's, one after the other."""

    def __init__(self, page: PrivatePage, draft: Draft, robot: Robot, read_rig: ReadRig, rehearsal: Rehearsal) -> None:
        self._page, self._draft, self._robot = page, draft, robot
        self._read_rig, self._rehearsal = read_rig, rehearsal
        self._head = Playhead(len(draft.course), draft.rate, playing=False)
        self._posed: dict[str, float] = {}  # joints that hands have posed since the last key, deg
        self._copied = dict(draft.rest)
        self._said, self._bad, self._shown = "", False, 0.0
        self._touched, self._put = (
            dict[int, float](),
            dict[int, float | str](),
        )  # by input: when by a hand; the last value
        self._lock = threading.RLock()
        self._scene, self._qpos = Scene(page, robot.model), robot.model.qpos0.copy()
        gui = page.gui
        gui.configure_theme(show_share_button=False, show_logo=False, brand_color=CURRENT)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self._line = gui.add_html("")
        hint = "The figure plays the keys, held back where the limits of the rig do that"
        self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY, color="gray", hint=hint)
        self._hear(self._play, self._play_or_pause)
        self._time = gui.add_number("time, s", 0.0, min=0.0, max=draft.sheet.length, step=0.05)
        self._hear(self._time, lambda _: self._head.seek(float(self._time.value)))
        with gui.add_folder("pose, degrees"):
            ends = zip(robot.joints, *np.degrees((robot.limits.lower, robot.limits.upper)).tolist(), strict=True)
            self._sliders = {joint: self._slider(joint, low, high) for joint, low, high in ends}
            ways = {"copy": self._copy, "paste": self._paste, "rest": self._rest, "from rig": self._from_rig}
            hint = "From rig: as its joints stand, which you move by hand while no program plays on it"
            group = gui.add_button_group("pose", tuple(ways), hint=hint)
            self._hear(group, lambda _: ways[str(group.value)]())
        gui.add_html('<div id="set-key"></div>')
        self._set = gui.add_button("Set key")
        self._hear(self._set, lambda _: self._set_key())
        hint = "A key of the joints that were moved; the others go their way between their own keys"
        self._only = gui.add_checkbox("only moved", False, hint=hint)
        hint = "Of the way to the key: smooth passes through it, the others come to rest there"
        self._easing = gui.add_dropdown("easing", get_args(Easing), hint=hint)
        self._delete = gui.add_button("Delete key", color="gray")
        self._hear(self._delete, lambda _: self._change(lambda sheet: sheet.delete(self._here)))
        self._hear(gui.add_button("Undo", color="gray"), lambda _: draft.undo())
        self._length = gui.add_number("length, s", draft.sheet.length, min=0.1, max=3600.0, step=0.5)
        self._hear(self._length, lambda _: self._change(self._set_length))
        self._plays = gui.add_dropdown("plays", ("loop", "once"), initial_value=draft.sheet.plays)
        self._hear(self._plays, lambda _: self._change(self._set_plays))
        self._hear(gui.add_button("Save"), lambda _: self._say(draft.save()))
        emulated, real = (gui.add_button(f"Learn and play{how}", color="gray") for how in (", emulated", " on the rig"))
        self._hear(emulated, lambda event: self._try(event, emulated=True))
        self._hear(real, lambda event: self._try(event, emulated=False))
        self._stop = gui.add_button("Stop playing", color=STOPS, hint="Ends the run; its joints come to rest")
        self._hear(self._stop, lambda _: threading.Thread(target=rehearsal.stop, daemon=True).start())
        self._rehearsal_line = gui.add_html("")
        parts = PageParts(page)
        self._strip = parts.add(
            "key-strip", "key-strip", heard=lambda said, event: self._do(event, self._strip_said, said)
        )
        self._hand = parts.add("key-hand", "key-hand")
        self._refresh()

    def _slider(self, joint: str, low: float, high: float) -> viser.GuiSliderHandle[float]:
        low, high = math.ceil(low / STEP) * STEP, math.floor(high / STEP) * STEP
        slider = self._page.gui.add_slider(joint, low, high, STEP, min(max(0.0, low), high))
        self._hear(slider, lambda _: self._pose({joint: float(slider.value)}))
        return slider

    def _hear(self, handle: Any, action: Callable[[viser.GuiEvent], object]) -> None:
        on = handle.on_update if not hasattr(handle, "on_click") else handle.on_click
        on(lambda event: self._do(event, action, event))

    def _do(self, event: viser.GuiEvent, action: Callable[..., object], *arguments: object) -> None:
        # What this program sets reports no client.
        if event.client is None:
            return
        with self._lock:
            self._touched[id(event.target)] = time.monotonic()
            self._put.pop(id(event.target), None)
            try:
                self._said = ""
                action(*arguments)
            except MotiondeckError as error:
                self._say(str(error), bad=True)
            self._refresh()

    def _bring(self, handle: Any, value: float | str) -> None:
        """Brings an input up to date, unless a hand is on it or has just changed it, which is not yet known here."""
        just = time.monotonic() - self._touched.get(id(handle), 0.0) < HAND_ON
        if not just and self._put.get(id(handle)) != value:
            self._put[id(handle)] = value
            if handle.value != value:
                handle.value = value

    def _say(self, text: str, *, bad: bool = False) -> None:
        self._said, self._bad = text, bad

    @property
    def _here(self) -> float:
        """The time of the key at this place, or this time, s."""
        sheet, at = self._draft.sheet, round(self._head.seconds, 3)
        return 0.0 if sheet.plays == "loop" and at >= round(sheet.length, 3) else at

    def _play_or_pause(self, _: object) -> None:
        head = self._head
        head.playing = not head.playing
        if not head.playing:
            head.seek(round(head.seconds / SNAP) * SNAP)
        elif self._posed:
            self._copied, self._posed = self._pose_here(), {}
            self._say("The pose was no key: `paste` brings it back.")
        elif head.frame == head.frames - 1:
            head.place = 0.0

    def _pose_here(self) -> dict[str, float]:
        return self._draft.pose(self._head.seconds) | self._posed

    def _pose(self, pose: Mapping[str, float]) -> None:
        self._head.playing = False
        self._posed |= pose

    def _copy(self) -> None:
        self._copied = self._pose_here()
        self._say("copied")

    def _paste(self) -> None:
        self._pose(self._copied)

    def _rest(self) -> None:
        self._pose(self._draft.rest)

    def _from_rig(self) -> None:
        self._pose(self._read_rig())
        self._say("as the joints of the rig stand")

    def _set_key(self) -> None:
        head = self._head
        head.playing = False
        pose = {joint: round(value, 1) for joint, value in self._pose_here().items()}
        if self._only.value and self._posed:
            pose = {joint: pose[joint] for joint in self._posed}
        self._change(lambda sheet: sheet.set(self._here, pose, self._easing.value))
        self._posed = {}

    def _change(self, edit: Callable[[KeySheet], object]) -> None:
        self._draft.change(edit)

    def _set_length(self, sheet: KeySheet) -> None:
        sheet.length = float(self._length.value)

    def _set_plays(self, sheet: KeySheet) -> None:
        sheet.plays = self._plays.value

    def _strip_said(self, said: Any) -> None:
        """What was done on the strip; anything else comes from no strip of ours."""
        match said:
            case {"at": float(at) | int(at)}:
                self._head.playing = False
                self._head.seek(at)
            case {"move": [float(at) | int(at), float(to) | int(to)]}:
                to = min(max(to, 0.0), self._draft.sheet.length)
                self._change(lambda sheet: sheet.move(at, to))
                self._head.seek(to)
            case {"remove": float(at) | int(at)}:
                self._change(lambda sheet: sheet.delete(at))

    def _try(self, event: viser.GuiEvent, *, emulated: bool) -> None:
        draft, rehearsal = self._draft, self._rehearsal
        self._say(draft.save())
        doubts = [] if emulated else [REAL]
        if rehearsal.library.exists() and not rehearsal.learned:
            doubts.append(f"{rehearsal.library.name} is there already, and is replaced.")
        if doubts:
            ask(
                self._page,
                event,
                "Learn and play?",
                " ".join(doubts),
                "Go on",
                lambda: rehearsal.start(emulated=emulated),
            )
        else:
            rehearsal.start(emulated=emulated)

    def show(self, dt: float) -> None:
        """Lets time pass and draws the figure."""
        with self._lock:
            head, before = self._head, self._head.place
            head.advance(dt)
            if head.place < before and self._draft.sheet.plays == "once":
                head.playing, head.place = False, head.frames - 1.0
                self._refresh()
            angles = self._draft.course[head.frame]
            if self._posed:
                pose = self._pose_here()
                angles = np.radians([pose[joint] for joint in self._robot.joints])
            self._robot.layout.place(angles, self._qpos)
            self._scene.show(self._qpos, np.zeros(2))
            if time.monotonic() - self._shown > SHOWN_EVERY:
                self._shown = time.monotonic()
                self._show_place()

    def _show_place(self) -> None:
        """Brings up to date what follows the hand, and what is said of the run."""
        head, rehearsal = self._head, self._rehearsal
        self._hand.show({"length": self._draft.sheet.length, "at": round(head.seconds, 2)})
        for joint, value in self._pose_here().items():
            slider = self._sliders[joint]
            self._bring(slider, min(max(round(value, 1), slider.min), slider.max))
        sheet = self._draft.sheet
        for handle, value in (
            (self._time, round(head.seconds, 3)),
            (self._length, sheet.length),
            (self._plays, sheet.plays),
        ):
            self._bring(handle, value)
        address = (
            f' · <a href="{rehearsal.address}" target="_blank" rel="noopener">its page</a>'
            if rehearsal.playing and rehearsal.address
            else ""
        )
        line = f'<div id="rehearsal" style="padding:2px 14px;font-size:13px">{escape(rehearsal.said)}{address}</div>'
        if self._rehearsal_line.content != line:
            self._rehearsal_line.content, self._stop.disabled = line, not rehearsal.playing

    def _refresh(self) -> None:
        """Brings the page up to date after a change."""
        draft, sheet = self._draft, self._draft.sheet
        self._head.frames, self._head.rate = len(draft.course), draft.rate
        self._head.place = min(self._head.place, self._head.frames - 1.0)
        here = self._here
        self._play.label = "Pause" if self._head.playing else "Play"
        self._play.icon = viser.Icon.PLAYER_PAUSE if self._head.playing else viser.Icon.PLAYER_PLAY
        self._set.label = f"{'Change' if here in sheet.keys else 'Set'} key at {here:g} s"
        self._delete.disabled = here not in sheet.keys
        self._time.max = sheet.length
        lines = [(self._said, BAD if self._bad else "inherit")] if self._said else []
        lines += [(POSED, CURRENT_TEXT)] if self._posed else []
        lines += [(f"{one.text}, from {one.begins:.2f} to {one.ends:.2f} s", BAD) for one in draft.held]
        said = "".join(f'<div style="color:{colour};margin-top:3px">{escape(text)}</div>' for text, colour in lines)
        state = f"{sheet.length:g} s, {sheet.plays} · {counted(len(sheet.keys), 'key')}"
        saved = " · not saved" if draft.unsaved else ""
        self._line.content = (
            f'<div id="draft" style="padding:2px 14px;height:6em;overflow-y:auto;font-size:13px;line-height:1.35">'
            f"<b>{escape(draft.file.name)}</b> · {state}{saved}{said}</div>"
        )
        self._strip.show({"length": sheet.length, "keys": self._keys(), "curves": self._curves(), "held": self._held()})
        self._show_place()

    def _keys(self) -> list[tuple[float, str]]:
        found: list[tuple[float, str]] = []
        for at, key in self._draft.sheet.keys.items():
            ways = ", ".join(dict.fromkeys(way for _, way in key.values()))
            joints = "all joints" if len(key) == len(self._sliders) else ", ".join(key)
            found.append((at, f"{at:g} s: {joints}; {ways}"))
        return found

    def _held(self) -> list[tuple[float, float, str]]:
        return [(one.begins, one.ends, one.text) for one in self._draft.held]

    def _curves(self) -> list[tuple[str, list[float]]]:
        """Where the joints shall be over the time, each from 0 to 1 of its range."""
        limits, wanted = self._robot.limits, self._draft.wanted
        rows = np.linspace(0, len(wanted) - 1, CURVE_POINTS).astype(int)
        shares = np.clip((wanted[rows] - limits.lower) / np.maximum(limits.upper - limits.lower, 1e-9), 0.0, 1.0)
        return list(zip(self._robot.joints, np.round(shares.T, 3).tolist(), strict=True))
