"""A clip player: plays frames one after the other, recorded or drawn from keys; the baseline of every network."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from controller.motion.clip import nearest
from controller.networks.base import Activation, Channels, Network, PhaseNetwork, lead_shape
from controller.networks.keys import Keys
from controller.networks.storage import StoredNetwork, arrays_of
from motiondeck_base.errors import MotiondeckError

Frames = NDArray[np.float32]


class ClipPlayer(Network[Frames]):
    """Plays recorded frames, (T, channels) each, a loop as one period; others hold the last. Fits `base.PhaseNetwork`.

    It cannot be disturbed. Only one of keys is stored.
    """

    kind = "clip"
    pace = 1.0
    every = 1  # frames from anchor to anchor

    def __init__(
        self, frames: Mapping[str, NDArray[np.floating]], loops: Mapping[str, bool], runs: tuple[int, ...] = ()
    ) -> None:
        super().__init__({name: part.astype(np.float32, copy=False) for name, part in frames.items()})
        self.loops, self.runs = loops, runs
        self.keys: dict[str, Keys] = {}  # that the frames were drawn from
        self.channels = self._of[self.motions[0]].shape[1]
        self.cue(self.motions[0], 0)

    @classmethod
    def of_keys(cls, keys: dict[str, Keys], lengths: Mapping[str, int], loops: Mapping[str, bool]) -> Self:
        """A player of motions, drawn from their keys."""
        player = cls({name: part.drawn(lengths[name], loop=loops[name]) for name, part in keys.items()}, loops)
        player.keys = keys
        return player

    def twin(self, runs: int | None = None) -> Self:
        twin = type(self)(self._of, self.loops, lead_shape(runs))
        twin.keys, twin.every = self.keys, self.every
        return twin

    @property
    def as_phase_network(self) -> PhaseNetwork:
        return self

    @property
    def inputs(self) -> dict[str, tuple[float, float]]:
        return {}

    def set_input(self, name: str, value: float) -> None:
        raise MotiondeckError(f"there is no input '{name}': recorded frames have none")

    def anchors(self, motion: str) -> Channels:
        return self[motion][:: self.every].astype(np.float64)

    def period(self, motion: str) -> int:
        return len(self[motion])

    def cue(self, motion: str, anchor: int) -> None:
        self._playing = self[motion]
        self._motion, self._at = motion, anchor * self.every

    @property
    def phase(self) -> float:
        """The share of the motion that is played: [0, 1) in a loop, 0 to 1 in a one-shot."""
        frames = len(self._playing)
        return self._at / (frames if self.loops[self._motion] else max(1, frames - 1))

    def seek(self, motion: str, phase: float) -> None:
        frames = len(self[motion])
        self.cue(motion, 0)
        self._at = nearest(phase * frames) % frames if self.loops[motion] else nearest(phase * (frames - 1))

    def advance(self, out: Channels, noise: Activation | None = None) -> None:
        self._go(1, out)

    def retreat(self, out: Channels) -> None:
        self._go(-1, out)

    def snapshot(self) -> tuple[str, int]:
        return self._motion, self._at

    def restore(self, snapshot: tuple[str, int]) -> None:
        self.cue(snapshot[0], 0)
        self._at = snapshot[1]

    def noise_size(self, motion: str) -> int:
        return 0

    def displace(self, noise: Activation, weights: Activation | None = None) -> None:
        """Nothing to displace."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        if not self.keys:
            raise MotiondeckError("recorded frames are not stored in a library; train a network or a clip of keys")
        parts = [arrays_of(keys, f"motion/{name}/") for name, keys in self.keys.items()]
        return {name: array for part in parts for name, array in part.items()}

    @classmethod
    def load(cls, stored: StoredNetwork) -> Self:
        lengths = {motion.name: motion.frames for motion in stored.header.motions}
        loops = {motion.name: motion.plays == "loop" for motion in stored.header.motions}
        keys = {name: Keys.load(stored, f"motion/{name}/", length) for name, length in lengths.items()}
        return cls.of_keys(keys, lengths, loops)

    def _go(self, by: int, out: Channels) -> None:
        frames = self._playing
        at = self._at + by
        self._at = at % len(frames) if self.loops[self._motion] else min(max(at, 0), len(frames) - 1)
        np.copyto(out, frames[self._at])


KIND = ClipPlayer
