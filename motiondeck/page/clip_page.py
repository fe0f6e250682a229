"""A clip in the browser: the human with its bones, a robot, footprints, and a time bar."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape

import mujoco
import numpy as np
import viser
from numpy.typing import NDArray

from controller.motion.clip import Decision
from controller.motion.rotations import Array
from motiondeck.page.body.footprints import Print
from motiondeck.page.body.live_marks import add_print
from motiondeck.page.scene import Follower, Scene
from motiondeck.page.web.page_style import BAD, UNSURE
from motiondeck.page.web.private_page import PrivatePage, served


@dataclass
class Playhead:
    """A place among T frames at a rate."""

    frames: int  # T, at least 1
    rate: float  # frames per second, Hz
    place: float = 0.0  # in frames, 0 to T - 1, between two of them while it plays
    tempo: float = 1.0  # 1 is as recorded
    playing: bool = True

    @property
    def frame(self) -> int:
        """The frame to show."""
        return min(int(self.place + 1e-9), self.frames - 1)

    @property
    def seconds(self) -> float:
        """Where it is, s."""
        return self.place / self.rate

    def advance(self, dt: float) -> None:
        """Lets dt seconds pass; after the last frame comes the first."""
        if self.playing:
            self.place = (self.place + dt * self.rate * self.tempo) % self.frames

    def step(self, frames: int) -> None:
        """Stops and goes some whole frames on, or back if negative; it holds at both ends."""
        self.playing = False
        self.place = float(min(max(self.frame + frames, 0), self.frames - 1))

    def seek(self, seconds: float) -> None:
        """Goes to a time, s, within the motion."""
        self.place = min(max(seconds * self.rate, 0.0), self.frames - 1.0)


PICTURES_PER_SECOND = 30.0
PRINT = (70, 110, 190)
STANDS = (235, 120, 40)
BONE = (40, 46, 56)
SLOWEST, FASTEST = 0.05, 3.0


@dataclass(frozen=True)
class Act:
    """What is shown."""

    title: str
    model: mujoco.MjModel
    qpos: Array  # a frame of them each, shape (T, nq)
    rate: float  # frames per second, Hz
    bones: Array  # start and end of the human's bones, shape (T, B, 2, 3), m; B may be 0
    prints: Sequence[Print]  # what the feet leave on the floor
    stands: NDArray[np.bool_]  # which feet stand, shape (T, F)
    soles: Array  # where their corners are, shape (T, F, 4, 3), m
    decisions: Sequence[Decision] = ()  # about the recording
    doubts: Sequence[str] = ()


def show(act: Act, port: int, ends: Callable[[], bool] = lambda: False) -> None:
    """Shows a clip on a page of this machine until it is ended; MotiondeckError if the port is taken."""
    with served(port, act.title) as page:
        draw(_Stage(page, act).show, ends)


def draw(picture: Callable[[float], None], ends: Callable[[], bool] = lambda: False) -> None:
    """Draws pictures until they are ended; each is called with the seconds that have passed."""
    last = time.monotonic()
    while not ends():
        now = time.monotonic()
        picture(min(now - last, 0.25))
        last = now
        time.sleep(max(0.0, now + 1.0 / PICTURES_PER_SECOND - time.monotonic()))


def _decided(act: Act) -> str:
    """What was decided about the recording, each with its figures and what overrules it; then the doubts."""
    rows: list[str] = []
    for one in act.decisions:
        step, decided, evidence, overrule = map(escape, (one.step, one.decided, one.evidence, one.overrule))
        colour = UNSURE if one.notable else "transparent"
        otherwise = f'<div style="opacity:.65">otherwise: {overrule}</div>' if overrule else ""
        rows.append(
            f'<div style="border-left:3px solid {colour};padding-left:6px;margin-bottom:6px"><b>{step}</b>: {decided}'
            f'<div style="opacity:.65">{evidence}</div>{otherwise}</div>'
        )
    for doubt in act.doubts:
        rows.append(f'<div style="color:{BAD};padding-left:9px;margin-bottom:6px">doubt: {escape(doubt)}</div>')
    return f'<div id="decided" style="padding:2px 8px;font-size:12px;line-height:1.35">{"".join(rows)}</div>'


class _Stage:
    def __init__(self, page: PrivatePage, act: Act) -> None:
        self._page, self._act = page, act
        self._head = Playhead(len(act.qpos), act.rate)
        self._scene, self._follower = Scene(page, act.model), Follower()
        self._shown = -1
        self._dragged = 0.0
        gui, head = page.gui, self._head
        self._where = gui.add_html("")
        longest = max((head.frames - 1) / head.rate, 1.0 / head.rate)
        self._bar = gui.add_slider("time", min=0.0, max=longest, step=1.0 / head.rate, initial_value=0.0)
        self._bar.on_update(self._drag)
        self._play = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
        self._play.on_click(lambda _: setattr(head, "playing", not head.playing))
        steps = gui.add_button_group("step", ("-10", "-1", "+1", "+10"))
        steps.on_click(lambda _: head.step(int(steps.value)))
        tempo = gui.add_slider("tempo", min=SLOWEST, max=FASTEST, step=0.05, initial_value=1.0)
        tempo.on_update(lambda _: setattr(head, "tempo", float(tempo.value)))
        self._follow = gui.add_checkbox("camera follows", True)
        self._prints_on = gui.add_checkbox("footprints and contacts", True)
        self._bones_on = gui.add_checkbox("bones", True)
        if act.decisions or act.doubts:
            with gui.add_folder("decided"):
                gui.add_html(_decided(act))
        scene = page.scene
        self._ground = scene.add_frame("/act", show_axes=False)
        self._bones = None
        height = self._scene.height
        if act.bones.shape[1]:
            bones = act.bones[0].astype(np.float32)
            self._bones = scene.add_line_segments("/act/bones", bones, BONE, thickness=0.007 * height)
        self._prints = [
            add_print(page, f"/act/print{number}", mark.corners, PRINT, visible=False)
            for number, mark in enumerate(act.prints)
        ]
        self._marks = [
            scene.add_icosphere(f"/act/contact{foot}", radius=0.04 * height, color=STANDS, opacity=0.6, visible=False)
            for foot in range(act.stands.shape[1])
        ]

    def show(self, dt: float) -> None:
        """Lets time pass and draws the present frame."""
        act, head = self._act, self._head
        head.advance(dt)
        frame = head.frame
        centre = np.zeros(2)
        if self._follow.value:
            centre = self._follower.follow(act.qpos[frame, :2], dt)
        self._scene.show(act.qpos[frame], centre)
        with self._page.atomic():
            self._ground.position = (-float(centre[0]), -float(centre[1]), 0.0)
            if self._bones is not None:
                self._bones.visible = bool(self._bones_on.value)
                self._bones.points = act.bones[frame].astype(np.float32)
            if frame != self._shown:
                self._mark(frame)
            self._controls(frame)
        self._shown = frame

    def _mark(self, frame: int) -> None:
        """Prints stay once a foot has stood; a ball under a foot says that it stands now."""
        wanted = bool(self._prints_on.value)
        for handle, mark in zip(self._prints, self._act.prints, strict=True):
            handle.visible = wanted and mark.frame <= frame
        for foot, handle in enumerate(self._marks):
            handle.visible = wanted and bool(self._act.stands[frame, foot])
            if handle.visible:
                handle.position = tuple(self._act.soles[frame, foot].mean(axis=0))

    def _controls(self, frame: int) -> None:
        head = self._head
        self._play.label = "Pause" if head.playing else "Play"
        self._play.icon = viser.Icon.PLAYER_PAUSE if head.playing else viser.Icon.PLAYER_PLAY
        if frame != self._shown:
            self._where.content = (
                f'<div id="where" style="padding:2px 14px 6px;font-size:13px;font-variant-numeric:tabular-nums">'
                f"frame {frame + 1} of {head.frames} · {head.seconds:.2f} s</div>"
            )
            if time.monotonic() - self._dragged > 0.5:
                self._bar.value = round(frame / head.rate, 4)

    def _drag(self, event: viser.GuiEvent) -> None:
        # A slider that is set by this program reports no client.
        if event.client is not None:
            self._dragged = time.monotonic()
            self._head.playing = False
            self._head.seek(float(self._bar.value))
