"""The motions on the page: a grid with pictures, the queue, the phase as a ring, and blends on a pad in it."""

import time
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from threading import Thread
from typing import Any

import msgspec
import numpy as np
import viser

from controller.deck.routes import Routes
from controller.learning.measures.self_test import run_free
from controller.library.motion_library import MotionLibrary, load_library
from controller.wire.messages.arguments import WEIGHT
from controller.wire.messages.command_table import BY_WORD
from controller.wire.messages.commands import Blend, Jump, Queue, Switch
from controller.wire.messages.deck_snapshot import DeckSnapshot
from motiondeck.page.web.page_state import PageDescription
from motiondeck.page.web.parts import PageParts, Send
from motiondeck.page.web.state_line import button_labels
from motiondeck_base.errors import MotiondeckError

MOMENTS = (0.1, 0.25, 0.4)  # of a motion, the last drawn darkest
MOST = 9  # motions around the middle of the pad


class Partners(msgspec.Struct, frozen=True):
    """What a motion can be blended with, and why not with the others."""

    others: list[str] = []  # on the pad, at most MOST, those that resemble each other side by side
    # For each of them, why it and the next one around the pad cannot be blended at once; "" if they can be.
    apart: list[str] = []
    refused: dict[str, str] = {}  # the other loops, with the reasons
    never: str = ""  # why it cannot be blended at all; "" if it can be


def pictures_of(library: MotionLibrary) -> dict[str, Any]:
    """Some `poses` of each motion as the network plays it, m, and `parents` of bones; none without a body to draw."""
    skeleton = library.skeleton
    if skeleton.is_rig:
        return {}
    network, found = library.network.twin(), dict[str, list[Any]]()
    for motion in library.info.motions:
        played = run_free(network, motion.name, motion.frames)
        rows = [round(share * (motion.frames - 1)) for share in MOMENTS]
        rotation = library.encoding.decode(played[rows]).rotation
        joints = skeleton.joints(np.zeros((len(rows), 3)), rotation)
        found[motion.name] = joints.round(2).tolist()
    return {"poses": found, "parents": skeleton.parent.tolist()}


def blends_of(motions: Sequence[str], routes: Routes) -> dict[str, Partners]:
    """By motion, what it can be blended with, as the deck decides it."""
    loops = [name for name in motions if name not in routes.bridges]
    return {name: _partners(name, loops, routes) for name in motions}


def _partners(one: str, loops: Sequence[str], routes: Routes) -> Partners:
    if why := routes.blend_obstacle([one]):
        return Partners(never=why)
    refused = {other: routes.blend_obstacle([one, other]) for other in loops if other != one}
    near = _side_by_side(one, [other for other, why in refused.items() if not why], routes)
    apart = [routes.blend_obstacle([one, *pair]) for pair in pairwise([*near, *near[:1]])]
    return Partners(near, apart, {other: why for other, why in refused.items() if why})


def _side_by_side(one: str, others: Sequence[str], routes: Routes) -> list[str]:
    """The nearest MOST of the others: next to a motion, first next to `one`, stands the one with the shortest leap."""
    found, left = [one], sorted(others, key=routes.leaps[one].__getitem__)[:MOST]
    while left:
        found.append(min(left, key=routes.leaps[found[-1]].__getitem__))
        left.remove(found[-1])
    return found[1:]


SEARCHED = 12  # motions from which on one can be searched for
HAND_ON = 1.0  # s that a hand on the ring or pad is believed before the deck's own value


class MotionControls:
    """The widgets of the motions, where the page's widgets are being added.

    Without a library's file there are neither pictures nor blends.
    """

    def __init__(self, parts: PageParts, about: PageDescription, send: Send) -> None:
        self._motions, self._has_phase, self._send = about.motions, about.has_phase, send
        self._state = DeckSnapshot(motion="")
        self._touched = 0.0
        # as `pictures_of`, once they are known.
        self.pictures: dict[str, Any] = {}
        self.blends: dict[str, Partners] = {}  # by motion, what it can be blended with
        if about.library_file:
            Thread(target=self._look_into, args=(Path(about.library_file), about.direct), daemon=True).start()
        fixed = {"motions": about.motions, "searched": SEARCHED, "verdicts": about.verdicts}
        self._grid = parts.add("motion-grid", "motions", fixed, self._pressed)
        self._pictures = parts.add("motion-pictures", "motion-pictures")
        self._dial = parts.add("motion-dial", "motion-dial", heard=self._turned)

    def _look_into(self, library_file: Path, direct: bool) -> None:
        with suppress(MotiondeckError):  # it may have been replaced by something else since the deck loaded it
            library = load_library(library_file)
            self.pictures = pictures_of(library)
            routes = Routes.of(library)
            self.blends = blends_of([*library.network.motions], routes.direct if direct else routes)

    def show(self, now: DeckSnapshot) -> None:
        """Brings everything up to date."""
        self._state = now
        looks = ["playing" if name == now.playing else "next" if name == now.motion else "" for name in self._motions]
        enabled = now.mode in BY_WORD["switch"].modes
        grid = {"labels": button_labels(now, self._motions), "looks": looks, "enabled": enabled}
        self._grid.show(grid | {"queue": list(now.queue), "orders": not now.switching})
        if self.pictures:
            self._pictures.show({"grid": "motions", **self.pictures})
        if time.monotonic() - self._touched > HAND_ON:
            phase = round(now.phase or 0.0, 2) if self._has_phase else None
            partners = msgspec.to_builtins(self.blends.get(now.playing, Partners()))
            blend = [[name, round(weight, 2)] for name, weight in now.blend]
            pad = {"playing": now.playing, **partners, "blend": blend, "weights": [WEIGHT.lowest, WEIGHT.highest]}
            self._dial.show({"phase": phase, **pad, "enabled": enabled})

    def end(self) -> None:
        """Shows that nothing can be commanded any more."""
        self._grid.show({"labels": self._motions, "looks": [""] * len(self._motions), "enabled": False, "queue": []})

    def _pressed(self, said: Any, event: viser.GuiEvent) -> None:
        match said:
            case {"play": str(name)} if name in self._motions:
                self._send(Switch(name))
            case {"queue": str(name)} if name in self._motions:
                self._send(Queue(name))
            case {"order": [*names]} if all(name in self._motions for name in names):
                self._order([str(name) for name in names])

    def _order(self, names: list[str]) -> None:
        """Queues these motions in place of those that wait: the motion that plays, commanded anew, clears the queue."""
        if self._state.motion:
            self._send(Switch(self._state.motion))
            for name in names:
                self._send(Queue(name))

    def _turned(self, said: Any, event: viser.GuiEvent) -> None:
        match said:
            case {"phase": float(phase) | int(phase)}:
                self._touched = 0.0
                self._send(Jump(phase=min(max(float(phase), 0.0), 1.0)))
            case {"blend": [*parts]} if parts and self._state.playing:
                with suppress(msgspec.ValidationError):  # whatever else a browser may say
                    (other, weight), *also = msgspec.convert(parts, list[tuple[str, float]])
                    self._touched = time.monotonic()
                    self._send(Blend(self._state.playing, other, weight, also=tuple(also)))
