"""A clip player: plays recorded frames one after the other; the baseline of every network."""

# ruff: noqa: D102 (`base.Network` and `reservoirs.phase_driven` document the methods)

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.networks.base import Activation, Channels, Network, PhaseNetwork
from controller.networks.storage import StoredNetwork
from motiondeck_base.errors import MotiondeckError

Frames = NDArray[np.float32]


class ClipPlayer(Network[Frames]):
    """Plays recorded frames, (T, channels) each, a loop as one period; others hold the last. Fits `base.PhaseNetwork`.

    It is neither stored nor disturbed.
    """

    kind = "clip"
    pace = 1.0

    def __init__(self, frames: Mapping[str, NDArray[np.floating]], loops: Mapping[str, bool]) -> None:
        super().__init__({name: part.astype(np.float32) for name, part in frames.items()})
        self._loops = loops
        self.channels = self._of[self.motions[0]].shape[1]
        self.cue(self.motions[0], 0)

    def twin(self, runs: int | None = None) -> ClipPlayer:
        return ClipPlayer(self._of, self._loops)

    @property
    def as_phase_network(self) -> PhaseNetwork:
        return self

    @property
    def inputs(self) -> dict[str, tuple[float, float]]:
        return {}

    def set_input(self, name: str, value: float) -> None:
        raise MotiondeckError(f"there is no input '{name}': recorded frames have none")

    def anchors(self, motion: str) -> Channels:
        return self[motion].astype(np.float64)

    def period(self, motion: str) -> int:
        return len(self[motion])

    def cue(self, motion: str, anchor: int) -> None:
        self._motion, self._at = motion, anchor

    @property
    def phase(self) -> float:
        """The share of the motion that is played: [0, 1) in a loop, 0 to 1 in a one-shot."""
        frames = len(self[self._motion])
        return self._at / (frames if self._loops[self._motion] else max(1, frames - 1))

    def seek(self, motion: str, phase: float) -> None:
        frames = len(self[motion])
        self.cue(motion, round(phase * frames) % frames if self._loops[motion] else round(phase * (frames - 1)))

    def advance(self, out: Channels, noise: Activation | None = None) -> None:
        self._go(1, out)

    def retreat(self, out: Channels) -> None:
        self._go(-1, out)

    def snapshot(self) -> tuple[str, int]:
        return self._motion, self._at

    def restore(self, snapshot: tuple[str, int]) -> None:
        self._motion, self._at = snapshot

    def noise_size(self, motion: str) -> int:
        """0: it has no state that noise could reach."""
        return 0

    def displace(self, noise: Activation, weights: Activation | None = None) -> None:
        """Nothing to displace."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        raise MotiondeckError("recorded frames are not stored in a library; train a network")

    @classmethod
    def load(cls, stored: StoredNetwork) -> Self:
        raise stored.error("holds recorded frames")

    def _go(self, by: int, out: Channels) -> None:
        frames = self[self._motion]
        at = self._at + by
        self._at = at % len(frames) if self._loops[self._motion] else min(max(at, 0), len(frames) - 1)
        np.copyto(out, frames[self._at])
