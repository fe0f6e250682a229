"""A clip player: plays recorded frames one after the other; what any network has to be compared with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import Channels


class ClipPlayer:
    """Plays recorded frames; fits `base.PhaseNetwork`.

    Args:
        frames: of each motion, shape (T, channels); a loop as one period.
        loops: whether each motion is a loop; else it holds its last frame.
    """

    def __init__(self, frames: Mapping[str, NDArray[np.floating]], loops: Mapping[str, bool]) -> None:
        self._frames, self._loops = {name: part.astype(np.float32) for name, part in frames.items()}, loops
        self.motions = tuple(frames)
        self.channels = self._frames[self.motions[0]].shape[1]
        self.cue(self.motions[0], 0)

    def twin(self) -> ClipPlayer:
        """The same recordings with a place of its own."""
        return ClipPlayer(self._frames, self._loops)

    def anchors(self, motion: str) -> Channels:
        """All frames."""
        return self._frames[motion].astype(np.float64)

    def cue(self, motion: str, anchor: int) -> None:
        """Goes to a frame."""
        self._motion, self._at = motion, anchor

    @property
    def phase(self) -> float:
        """How far the motion is: [0, 1) in a loop, 0 to 1 in a one-shot."""
        frames = len(self._frames[self._motion])
        return self._at / (frames if self._loops[self._motion] else max(1, frames - 1))

    def seek(self, motion: str, phase: float) -> None:
        """Goes to the frame nearest to a phase."""
        frames = len(self._frames[motion])
        self.cue(motion, round(phase * frames) % frames if self._loops[motion] else round(phase * (frames - 1)))

    def advance(self, out: Channels) -> None:
        """Steps one frame on and writes it into out, shape (channels,)."""
        self._go(1, out)

    def retreat(self, out: Channels) -> None:
        """Steps one frame back and writes it into out, shape (channels,)."""
        self._go(-1, out)

    def snapshot(self) -> tuple[str, int]:
        """Motion and frame."""
        return self._motion, self._at

    def restore(self, snapshot: tuple[str, int]) -> None:
        """Goes back to a snapshot."""
        self._motion, self._at = snapshot

    def _go(self, by: int, out: Channels) -> None:
        frames = self._frames[self._motion]
        at = self._at + by
        self._at = at % len(frames) if self._loops[self._motion] else min(max(at, 0), len(frames) - 1)
        np.copyto(out, frames[self._at])
