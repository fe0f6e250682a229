"""The page on which keyframes are written: sliders pose joints, a strip has the keys, the rig's figure plays them."""

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from html import escape
from pathlib import Path
from typing import Any, get_args

import numpy as np
import viser

from controller.motion.formats.keyframes import Easing
from motiondeck.page.clip_page import Playhead, draw
from motiondeck.page.keys.draft import Draft
from motiondeck.page.scene import Scene
from motiondeck.page.web.page_style import BAD, QUIET
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage, served
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.words import counted
from sim.robots.robot import Robot

_COMMAND = [sys.executable, "-P", "-m", "motiondeck"]


class Rehearsal:
    """One motion that is learned and played, again and again; a thread waits for the processes."""

    def __init__(self, file: Path, rig: str) -> None:
        self.library = file.with_suffix(".safetensors")
        self._file, self._rig = file, rig
        self._thread, self._wanted = threading.Thread(), False
        self._process: subprocess.Popen[str] | None = None
        self.learned = False  # whether the library is ours
        self.said, self.address = "", ""  # how it is, in words, and the page of the run that plays

    @property
    def busy(self) -> bool:
        """Whether it is learned or played."""
        return self._thread.is_alive()

    def start(self, *, emulated: bool) -> None:
        """Begins anew, with emulated servos or the rig itself; it must not be busy."""
        self._wanted = True
        self._thread = threading.Thread(target=self._run, args=("emulated:" * emulated + self._rig,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Has what learns or plays end, and nothing play after it; joints come to rest."""
        self._wanted = False
        if self._process is not None:
            self._process.terminate()

    def end(self) -> None:
        """Ends what learns or plays, and waits for that."""
        self.stop()
        if self.busy:
            self._thread.join()

    def _begun(self, *command: str) -> subprocess.Popen[str]:
        """A process that `stop` ends, also where it was called just before."""
        none, pipe = subprocess.DEVNULL, subprocess.PIPE
        process = subprocess.Popen([*_COMMAND, *command], stdin=none, stdout=none, stderr=pipe, text=True)
        self._process = process
        if not self._wanted:
            process.terminate()
        return process

    def _run(self, rig: str) -> None:
        self.said = "learning …"
        with self._begun("learn", str(self._file), "--out", str(self.library), "--force") as learning:
            _, said = learning.communicate()
        if not self._wanted or learning.returncode:
            self.said = said.strip().rpartition("\n")[2] if self._wanted else "stopped"
            return
        self.learned, self.said = True, "learned; the rig comes to its first pose …"
        port = self.address.rpartition(":")[2] or "0"  # the tab that shows the last run shows the next one
        last = ""
        with self._begun("play", str(self.library), "--rig", rig, "--port", port) as playing:
            assert playing.stderr is not None
            for last in playing.stderr:
                if last.startswith("page: "):
                    self.said, self.address = f"{self.library.name} plays", last.split()[1]
        self.said = last.strip() if playing.returncode else "the run has ended"


# Where the joints of the rig stand, deg; MotiondeckError if they cannot be read.
ReadRig = Callable[[], Mapping[str, float]]
STEP, SNAP = 0.5, 0.05  # deg, of a slider; s, of a pause
HAND_ON = 0.5  # s for which a hand keeps what it has set
SHOWN_EVERY = 0.12  # s: sliders and hand while it plays
CURVE_POINTS, PANEL_WIDTH = 160, 332  # pixels
POSED = "This pose is no key yet: choose its time and set it, or press Play to leave it."
BACK = "From its last key on, a loop goes back to its first: write it as once, which stays there, and loop in the end."
REAL = "The servos move. Keep clear of the rig, and know how to cut its power."


def show_keys(draft: Draft, robot: Robot, read_rig: ReadRig, rehearsal: Rehearsal, port: int) -> None:
    """Shows the page until the program is ended; MotiondeckError if the port is taken."""
    with served(port, f"Motiondeck · {draft.file.name}") as page:
        try:
            draw(KeysPage(page, draft, robot, read_rig, rehearsal).show)
        finally:
            rehearsal.end()


class KeysPage:
    """The controls of one draft; what browsers do is done in threads of viser's, one after the other."""

    def __init__(self, page: PrivatePage, draft: Draft, robot: Robot, read_rig: ReadRig, rehearsal: Rehearsal) -> None:
        self._page, self._draft, self._robot = page, draft, robot
        self._read_rig, self._rehearsal = read_rig, rehearsal
        self._head = Playhead(len(draft.course), draft.rate, playing=False)
        self._posed: dict[str, float] = {}  # joints that hands have posed since the last key, deg
        self._copied = dict(draft.rest)
        self._said, self._shown = ("", ""), 0.0  # what is said, and its colour
        # By input: when a hand was on it, and what it was brought to last.
        self._touched, self._brought = dict[int, float](), dict[int, float | str]()
        self._lock = threading.RLock()
        self._scene, self._qpos = Scene(page, robot.model), robot.model.qpos0.copy()
        gui = page.gui
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
            hint = "From rig: as its joints stand, which you move by hand while no program plays on it"
            ways = gui.add_button_group("pose", ("copy", "paste", "rest", "from rig"), hint=hint)
            self._hear(ways, lambda _: self._take(ways.value))
        gui.add_html('<div id="set-key"></div>')
        self._set = gui.add_button("Set key")
        self._hear(self._set, lambda _: self._set_key())
        hint = "A key of the joints that were moved; the others go their way between their own keys"
        self._only = gui.add_checkbox("only moved", False, hint=hint)
        hint = "Of the way to the key: smooth passes through it, the others come to rest there"
        self._easing = gui.add_dropdown("easing", get_args(Easing), hint=hint)
        self._hear(self._easing, lambda _: self._ease())
        self._delete = gui.add_button("Delete key", color="gray")
        self._hear(self._delete, lambda _: draft.change(lambda sheet: sheet.delete(self._here)))
        self._hear(gui.add_button("Undo", color="gray"), lambda _: draft.undo())
        self._length = gui.add_number("length, s", draft.sheet.length, min=0.1, max=3600.0, step=0.5)
        self._hear(
            self._length, lambda _: draft.change(lambda sheet: setattr(sheet, "length", float(self._length.value)))
        )
        self._plays = gui.add_dropdown("plays", ("loop", "once"), initial_value=draft.sheet.plays)
        self._hear(self._plays, lambda _: draft.change(lambda sheet: setattr(sheet, "plays", self._plays.value)))
        self._hear(gui.add_button("Save"), lambda _: self._say(draft.save()))
        self._learn = gui.add_button_group("learn and play", ("emulated", "on the rig"), hint="Saves the keys first")
        self._hear(self._learn, self._learn_and_play)
        self._stop = gui.add_button("Stop playing", color=QUIET, hint="Ends the run; its joints come to rest")
        self._hear(self._stop, lambda _: rehearsal.stop())
        self._parts = parts = PageParts(page)
        heard = partial(self._do, self._hear_strip)
        self._strip = parts.add("key-strip", "key-strip", heard=lambda said, event: heard(event, said))
        self._hand = parts.add("key-hand", "key-hand")
        self._refresh()

    def _slider(self, joint: str, low: float, high: float) -> viser.GuiSliderHandle[float]:
        low, high = math.ceil(low / STEP) * STEP, math.floor(high / STEP) * STEP
        slider = self._page.gui.add_slider(joint, low, high, STEP, min(max(0.0, low), high))
        self._hear(slider, lambda _: self._pose({joint: float(slider.value)}))
        return slider

    def _hear(self, handle: Any, action: Callable[[viser.GuiEvent], object]) -> None:
        on = handle.on_click if hasattr(handle, "on_click") else handle.on_update
        on(lambda event: self._do(action, event, event))

    def _do(self, action: Callable[..., object], event: viser.GuiEvent, *arguments: object) -> None:
        # What this program sets reports no client.
        if event.client is None:
            return
        with self._lock:
            self._touched[id(event.target)] = time.monotonic()
            self._brought.pop(id(event.target), None)
            self._say("")
            try:
                action(*arguments)
            except MotiondeckError as error:
                self._say(str(error), BAD)
            self._refresh()

    def _bring(self, handle: Any, value: float | str) -> None:
        """Brings an input up to date, unless a hand is on it, or has just changed it, which is not yet known here."""
        hand = time.monotonic() - self._touched.get(id(handle), 0.0) < HAND_ON
        if not hand and self._brought.get(id(handle)) != value:
            self._brought[id(handle)] = value
            if handle.value != value:
                handle.value = value

    def _say(self, text: str, colour: str = "inherit") -> None:
        self._said = text, colour

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

    def _take(self, way: str) -> None:
        if way == "copy":
            self._copied = self._pose_here()
        else:
            self._pose(self._read_rig() if way == "from rig" else self._copied if way == "paste" else self._draft.rest)

    def _set_key(self) -> None:
        self._head.playing = False
        pose = {joint: round(value, 1) for joint, value in self._pose_here().items()}
        if self._posed and (self._only.value or self._here in self._draft.sheet.keys):
            pose = {joint: pose[joint] for joint in self._posed}
        self._draft.change(lambda sheet: sheet.set(self._here, pose, self._easing.value))
        self._posed = {}

    def _ease(self) -> None:
        key, easing = self._draft.sheet.keys.get(self._here, {}), self._easing.value
        pose = {joint: value for joint, (value, _) in key.items()}
        self._draft.change(lambda sheet: sheet.set(self._here, pose, easing))

    def _hear_strip(self, said: Any) -> None:
        """Does what was done on the strip; anything else comes from no strip of ours."""
        self._head.playing = False
        match said:
            case {"at": float(at) | int(at)}:
                self._head.seek(at)
            case {"move": [float(at) | int(at), float(to) | int(to)]}:
                self._draft.change(lambda sheet: sheet.move(at, to))
                self._head.seek(to)
            case {"remove": float(at) | int(at)}:
                self._draft.change(lambda sheet: sheet.delete(at))

    def _learn_and_play(self, event: viser.GuiEvent) -> None:
        if self._rehearsal.busy:
            raise MotiondeckError("It is learned or played already: press Stop playing first.")
        library, emulated = self._rehearsal.library, self._learn.value == "emulated"
        self._say(self._draft.save())
        doubts = [] if emulated else [REAL]
        if library.exists() and not self._rehearsal.learned:
            doubts.append(f"{library.name} is there already, and is replaced.")
        start = partial(self._rehearsal.start, emulated=emulated)
        self._parts.ask(event, "Learn and play?", " ".join(doubts), "Go on", start) if doubts else start()

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
        head, sheet, run = self._head, self._draft.sheet, self._rehearsal
        self._hand.show({"length": sheet.length, "at": round(head.seconds, 2)})
        for joint, value in self._pose_here().items():
            slider = self._sliders[joint]
            self._bring(slider, min(max(round(value, 1), slider.min), slider.max))
        for _, easing in [*sheet.keys.get(self._here, {}).values()][:1]:
            self._bring(self._easing, easing)
        self._bring(self._time, round(head.seconds, 3))
        self._bring(self._length, sheet.length)
        self._bring(self._plays, sheet.plays)
        page = f' · <a href="{run.address}" target="_blank" rel="noopener">its page</a>' if run.address else ""
        page = page if run.busy else ""
        line = f'{self._about}<div id="rehearsal">{escape(run.said)}{page}</div></div>'
        self._line.content, self._stop.disabled = line, not run.busy

    def _refresh(self) -> None:
        draft, sheet = self._draft, self._draft.sheet
        self._head.frames, self._head.rate = len(draft.course), draft.rate
        self._head.place = min(self._head.place, self._head.frames - 1.0)
        here = self._here
        self._play.label = "Pause" if self._head.playing else "Play"
        self._play.icon = viser.Icon.PLAYER_PAUSE if self._head.playing else viser.Icon.PLAYER_PLAY
        self._set.label = f"{'Change' if here in sheet.keys else 'Set'} key at {here:g} s"
        self._delete.disabled = here not in sheet.keys
        self._time.max = sheet.length
        back = sheet.plays == "loop" and here > max(sheet.keys, default=here) and not self._head.playing
        lines = [self._said, *([(POSED, "#1c7ed6")] if self._posed else []), *([(BACK, "inherit")] if back else [])]
        lines += [(f"{text}, from {begins:.2f} to {ends:.2f} s", BAD) for begins, ends, text in draft.held]
        said = "".join(
            f'<div style="color:{colour};margin-top:3px">{escape(text)}</div>' for text, colour in lines if text
        )
        state = f"{sheet.length:g} s, {sheet.plays} · {counted(len(sheet.keys), 'key')}{' · not saved' * draft.unsaved}"
        self._about = (
            f'<div id="draft" style="padding:2px 14px;height:6em;overflow-y:auto;font-size:13px;line-height:1.35">'
            f"<b>{escape(draft.file.name)}</b> · {state}{said}"
        )
        ways = ((at, key, dict.fromkeys(way for _, way in key.values())) for at, key in sheet.keys.items())
        keys = [(at, f"{at:g} s, {', '.join(easings)}: {', '.join(key)}") for at, key, easings in ways]
        self._strip.show({"length": sheet.length, "keys": keys, "curves": self._curves(), "held": draft.held})
        self._show_place()

    def _curves(self) -> list[tuple[str, list[float]]]:
        """Where the joints shall be over the time, each from 0 to 1 of its range."""
        limits, wanted = self._robot.limits, self._draft.wanted
        rows = np.linspace(0, len(wanted) - 1, CURVE_POINTS).astype(int)
        shares = np.clip((wanted[rows] - limits.lower) / np.maximum(limits.upper - limits.lower, 1e-9), 0.0, 1.0)
        return list(zip(self._robot.joints, np.round(shares.T, 3).tolist(), strict=True))
