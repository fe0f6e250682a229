"""The network beside the body: orbits of its neurons, a ball for their state, and a card with overlaps and phases."""

import colorsys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Self

import numpy as np

from controller.library.motion_library import load_library
from controller.motion.rotations import Array
from controller.networks.orbits import Orbits, orbits
from motiondeck.page.web.parts import PageParts
from motiondeck_base.errors import MotiondeckError

TURN = 2.0 * np.pi


@dataclass(frozen=True)
class InnerLife:
    """Orbits and phase courses of a network."""

    orbits: Orbits | None  # of its neurons; None if it has none
    # Of each motion with centers, their phases at its beginning and its end, shape (2, n), rad.
    courses: dict[str, Array]

    @classmethod
    def of(cls, library: Path) -> Self:
        """Plays each motion of a library's file once to find it; MotiondeckError if the file is no library any more."""
        loaded = load_library(library)
        network = loaded.network
        frames = {motion.name: motion.frames for motion in loaded.info.motions}
        found = orbits(network, frames) if network.activation is not None else None
        courses = {name: course for name in frames if (course := network.center_phases(name)) is not None}
        return cls(found, courses)

    def centers(self, motion: str, phase: float | None) -> list[float]:
        """The phases of the centers at the phase of a motion, in revolutions from 0 to 1; empty if it has none."""
        course = self.courses.get(motion)
        if course is None or phase is None:
            return []
        first, last = course
        return [float(turns) for turns in np.round((first + phase * (last - first)) / TURN % 1.0, 3)]


PLACE = (-0.7, -0.19, 0.75)  # of the middle of the orbits, in heights of the robot
REACH = 0.36  # of nearly all of them, in heights of the robot
CARDS_PER_SECOND = 4.0
THIN, THICK = 1.2, 4.0  # lines on the screen, pixels
PLAYING, DARK = (38, 110, 200), (16, 50, 110)
PALE = 0.55  # how far the colours of motions that are not played are on their way to the background's
BACKGROUND = np.array([238.0, 242.0, 247.0])


class NetworkView:
    """The orbits of a network beside a robot of a height, m; hidden until they are switched on."""

    def __init__(self, parts: PageParts, library: Path, height: float) -> None:
        self._scene, self._height = parts.page.scene, height
        self._inside: InnerLife | None = None
        self._card = parts.add("network-card", "network-card")
        self._shown_card = -1.0  # when, s
        self._lines = {}
        self._playing = ""
        self._worker: Thread | None = None
        self._library = library

    @property
    def ball(self) -> Array | None:
        """Where the ball is, shape (3,), m from the middle of the orbits; None while nothing has been drawn."""
        return np.array(self._ball.position) if self._lines else None

    def show(self, activation: Array | None, motion: str, phase: float | None, *, visible: bool) -> None:
        """Shows where the neurons are, their activation (N,), on the orbit of the motion that is played at a phase."""
        if not visible and self._worker is None:
            return
        if self._worker is None:
            # Playing each motion once takes a moment; until then nothing is drawn.
            self._worker = Thread(target=self._compute, daemon=True)
            self._worker.start()
        if self._inside is None:
            return
        self._show_card(self._inside, motion, phase, visible=visible)
        found = self._inside.orbits
        if found is None or activation is None or len(activation) != len(found.centre):
            return  # of another length it is where the file has been replaced since the deck loaded it
        if not self._lines:
            self._draw(found)
        self._frame.visible = visible
        if not visible:
            return
        if motion != self._playing:
            for name in (self._playing, motion):
                if name in self._lines:
                    self._draw_line(found, name, playing=name == motion)
            self._playing = motion
            self._label.text = motion
        self._ball.position = self._label.position = REACH * self._height * found.point(activation)

    def _compute(self) -> None:
        # The file may have been replaced by something else since the deck loaded it.
        with suppress(MotiondeckError):
            self._inside = InnerLife.of(self._library)

    def _show_card(self, inside: InnerLife, motion: str, phase: float | None, *, visible: bool) -> None:
        now = time.monotonic()
        if not visible:
            self._card.show(None)
        elif now - self._shown_card > 1.0 / CARDS_PER_SECOND:
            self._shown_card = now
            names = list(inside.orbits.paths) if inside.orbits is not None else []
            overlap = inside.orbits.overlap.round(2).tolist() if inside.orbits is not None else []
            centers = inside.centers(motion, phase)
            self._card.show({"motion": motion, "names": names, "overlap": overlap, "centers": centers})

    def _draw(self, found: Orbits) -> None:
        scene, height = self._scene, self._height
        self._frame = scene.add_frame("/network", show_axes=False, position=height * np.array(PLACE))
        for name in found.paths:
            self._draw_line(found, name, playing=False)
        self._ball = scene.add_icosphere("/network/now", radius=0.022 * height, color=DARK, cast_shadow=False)
        self._label = scene.add_label("/network/name", "", anchor="bottom-left")

    def _draw_line(self, found: Orbits, name: str, *, playing: bool) -> None:
        path = REACH * self._height * found.paths[name]
        self._lines[name] = self._scene.add_line_segments(
            f"/network/orbit {list(found.paths).index(name)}",
            np.stack([path[:-1], path[1:]], axis=1),
            PLAYING if playing else _pale(list(found.paths).index(name), len(found.paths)),
            thickness=THICK if playing else THIN,
            thickness_units="screen",
        )


def _pale(index: int, count: int) -> tuple[int, int, int]:
    colour = 255.0 * np.array(colorsys.hsv_to_rgb(index / count, 0.75, 0.8))
    red, green, blue = (colour + PALE * (BACKGROUND - colour)).round().astype(int).tolist()
    return red, green, blue
