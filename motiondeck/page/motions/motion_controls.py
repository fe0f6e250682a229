"""The motions on the page: a grid with pictures, the queue, the phase as a ring, and blends on a pad in it."""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
import viser

from controller.wire.messages.arguments import WEIGHT
from controller.wire.messages.command_table import BY_WORD
from controller.wire.messages.commands import Blend, DeckCommand, Jump, Queue, Switch
from controller.wire.messages.deck_snapshot import DeckSnapshot
from motiondeck.page.motions.library_glance import LibraryGlance, Partners
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.state_line import button_labels

SEARCHED = 12  # motions from which on one can be searched for
NONE, NO_VERDICTS = Partners(), dict[str, tuple[str, str]]()
HAND_ON = 1.0  # s that a hand on the ring or pad is believed before the deck's own value


class MotionControls:
    """The widgets of the motions, where the page's widgets are being added.

    Without a library's file there are neither pictures nor blends; a `direct` deck plays no motions in between; a
    verdict is the answer of a motion, and the same with its reasons.
    """

    def __init__(
        self,
        parts: PageParts,
        motions: list[str],
        library: Path | None,
        *,
        has_phase: bool,
        direct: bool = False,
        verdicts: Mapping[str, tuple[str, str]] = NO_VERDICTS,
        send: Callable[[DeckCommand], None],
    ) -> None:
        self._motions, self._has_phase, self._send = motions, has_phase, send
        self._state = DeckSnapshot(motion="")
        self._touched = 0.0
        self.glance = LibraryGlance(library, direct=direct) if library is not None else None
        fixed = {"motions": motions, "searched": SEARCHED, "verdicts": dict(verdicts)}
        self._grid = parts.add("motion-grid", "motions", fixed, self._pressed)
        self._pictures = parts.add("motion-pictures", "motion-pictures")
        self._dial = parts.add("motion-dial", "motion-dial", heard=self._turned)

    def show(self, now: DeckSnapshot) -> None:
        """Brings everything up to date."""
        self._state = now
        looks = ["playing" if name == now.playing else "next" if name == now.motion else "" for name in self._motions]
        enabled = now.mode in BY_WORD["switch"].modes
        self._grid.show(
            {
                "labels": button_labels(now, self._motions),
                "looks": looks,
                "enabled": enabled,
                "queue": list(now.queue),
                "orders": not now.switching,
            }
        )
        if self.glance is not None and self.glance.pictures:
            self._pictures.show({"grid": "motions", "pictures": self.glance.pictures})
        if time.monotonic() - self._touched > HAND_ON:
            phase = round(now.phase or 0.0, 2) if self._has_phase else None
            partners = self.glance.blends.get(now.playing, NONE) if self.glance is not None else NONE
            blend = [[name, round(weight, 2)] for name, weight in now.blend]
            weights = [WEIGHT.lowest, WEIGHT.highest]
            pad = {"playing": now.playing, **msgspec.to_builtins(partners), "blend": blend, "weights": weights}
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
