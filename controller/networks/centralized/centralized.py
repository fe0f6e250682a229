"""A centralized network plays motions in continuous time (Vakulenko et al. 2017).

    x(t) = rest + W Phi(q(t)),   q_i(t) = (cos, sin)(omega_i t + phi_i)            (eqs 1, 2)

Each motion has its own frequencies, satellites and weights; the switching module's z selects which one plays. In the
paper z drives omega(z) and W(z) directly (eqs 12, 13), which passes through whatever motions lie between source and
target and is many times rougher than the recordings. Here z goes slowly, only source and target are mixed, by how far z
has come from the one to the other, and the target is entered where it is most like what the source is about to do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from controller.motion.quintic import rise
from controller.motion.rotations import Array
from controller.networks.base import Channels, NamedMotions
from controller.networks.centralized.centers import pairs_at, require_frequencies
from controller.networks.centralized.low_rank import LowRankWeights
from controller.networks.centralized.satellites import GaussianSatellites
from controller.networks.centralized.switching_design import design_module
from controller.networks.centralized.switching_module import SwitchingModule, clamp
from motiondeck_base.errors import MotiondeckError

# How long z takes for all but 1/e of its way, s, and the gain of the current that pulls it there.
TIME_CONSTANT = 0.2
GAIN = 5.0

ENTRIES = 50  # entry points of a loop that are compared
WINDOW_FRAMES, WINDOW_SECONDS = 12, 0.45  # what follows an entry point, and is compared


@dataclass(frozen=True, eq=False)
class CentralizedMotion:
    """One motion with n centers, m satellites and D channels.

    MotiondeckError if shapes disagree, or a loop does not close: in its seconds every center must make whole turns.
    """

    frequency: Array  # of the centers, shape (n,), rad/s
    phase: Array  # of the centers at the beginning, shape (n,), rad
    satellites: GaussianSatellites  # in the 2 n coordinates of the centers
    weights: Array | LowRankWeights  # W, shape (D, m), or its two factors
    rest: Array  # shape (D,)
    seconds: float  # of the motion, or of one round of it
    loop: bool  # whether its centers return after that time, so that it goes on for ever; otherwise it holds its end

    def __post_init__(self) -> None:
        n, (m, d) = len(self.frequency), self.satellites.places.shape
        if self.phase.shape != (n,) or d != 2 * n:
            raise MotiondeckError(f"{n} centers do not fit satellites at places of shape {(m, d)}")
        if self.matrix.shape != (len(self.rest), m):
            raise MotiondeckError(f"{m} satellites and {len(self.rest)} channels do not fit W of {self.matrix.shape}")
        require_frequencies(self.frequency)
        turns = self.frequency * self.seconds / (2.0 * np.pi)
        if self.loop and np.abs(turns - np.round(turns)).max() > 1e-6:
            raise MotiondeckError(f"a loop whose centers make {turns} turns does not close; they must be whole numbers")

    @cached_property
    def matrix(self) -> Array:
        """W, shape (D, m)."""
        return self.weights.matrix if isinstance(self.weights, LowRankWeights) else self.weights

    @property
    def largest_weight(self) -> float:
        """max |W|: a network that would explode where it has not been trained shows it here."""
        return float(np.abs(self.matrix).max())

    def at(self, time: Array) -> Channels:
        """The channels at times (T,) since the beginning, shape (T, D)."""
        if not self.loop:
            time = np.clip(time, 0.0, self.seconds)
        return self.satellites.respond(pairs_at(self.frequency, self.phase, time)) @ self.matrix.T + self.rest

    @cached_property
    def linear_form(self) -> tuple[Array, Array]:
        """-b^2 |q - q_j|^2 / 2 as a product with (q, 1), (m, 2 n + 1), and x as one with (Phi, 1), (D, m + 1)."""
        # For centers of unit amplitude |q|^2 = n.
        square = np.square(self.satellites.sharpness)
        reach = np.square(self.satellites.places).sum(1) + len(self.frequency)
        exponent = np.column_stack([square[:, None] * self.satellites.places, -0.5 * square * reach])
        return exponent, np.column_stack([self.matrix, self.rest])


class CentersPlayer:
    """A motion while it plays: its centers, and how far it is; of several runs all at one time.

    What rounding or noise does to the amplitude of a center is undone in the next step; what it does to a phase is
    undone at the end of the round, where every center begins anew.
    """

    def __init__(self, motion: CentralizedMotion, time: float, runs: tuple[int, ...] = ()) -> None:
        self.motion, self._runs = motion, runs
        self._exponent, weights = motion.linear_form
        self._weights = weights.T
        self._turn, self._start = 1j * motion.frequency, 1j * motion.phase
        coordinates = np.ones((*runs, self._exponent.shape[1]))
        self.centers: NDArray[np.complex128] = coordinates[..., :-1].view(np.complex128)
        self._amplitude = np.ones((*runs, len(self._turn)))
        # Responses are held by rows of satellites, so that all but the last row, of ones, is contiguous.
        responses = np.ones((weights.shape[1], *runs))
        self._coordinates, self._response, self._responses = coordinates.T, responses[:-1], responses.T
        self._step, self._rotation = 0.0, np.ones(len(self._turn), dtype=np.complex128)
        self._begin(time)

    def _begin(self, time: float) -> None:
        self.time = time
        np.exp(self._turn * time + self._start, out=self.centers)

    def advance(self, dt: float, noise: NDArray[np.float32] | None = None) -> None:
        """Goes dt seconds on; a one-shot stops at its end. Noise (*runs, 2 n) is added to (q, p / omega)."""
        time, seconds = self.time + dt, self.motion.seconds
        if time >= seconds:
            self._begin(time % seconds if self.motion.loop else seconds)
            if noise is None:
                return
        else:
            self.time = time
            if dt != self._step:
                self._step, self._rotation = dt, np.exp(self._turn * dt)
            self.centers *= self._rotation
        if noise is not None:
            self.displace(noise)
        np.abs(self.centers, out=self._amplitude)
        self.centers /= self._amplitude

    def displace(self, noise: NDArray[np.float32]) -> None:
        """Adds noise (*runs, 2 n) to (q, p / omega) of the centers."""
        self.centers += noise[..., ::2] + 1j * noise[..., 1::2].astype(np.float64)

    def read(self, out: Channels) -> None:
        """Writes the channels into out, shape (*runs, D)."""
        response = self._response
        np.dot(self._exponent, self._coordinates, out=response)
        np.exp(response, out=response)
        np.dot(self._responses, self._weights, out=out)

    def copy(self) -> CentersPlayer:
        """An independent player in the same state."""
        twin = CentersPlayer(self.motion, self.time, self._runs)
        twin.centers[...] = self.centers
        return twin


class Passage:
    """The switching module while it goes from one motion to another; its state k is the k-th of `motions`."""

    def __init__(self, motions: int) -> None:
        self.module = SwitchingModule(design_module(motions), time_scale=GAIN * TIME_CONSTANT)
        self.way = 0.0, 0.0  # of z, from and to

    def begin(self, target: int) -> None:
        """Begins to cross to a motion, by a clamp current."""
        goal = float(self.module.design.targets[target])
        if abs(self.module.z - goal) < 0.1:
            # The same state again: z comes from beside it, so that its way has a length.
            self.module.place(goal - 1.0)
        self.way = self.module.z, goal
        self.module.command(clamp(self.module.design, target, GAIN))

    def advance(self, dt: float) -> bool:
        """Goes dt seconds on; whether the way still lasts."""
        self.module.advance(dt)
        return self.module.commanded

    @property
    def share(self) -> float:
        """The share of the target in the mixture."""
        origin, goal = self.way
        return rise(min(1.0, max(0.0, (self.module.z - origin) / (goal - origin))))


def shared_channels(motions: dict[str, CentralizedMotion]) -> int:
    """The number of channels of some motions; MotiondeckError if there is no motion, or the numbers differ."""
    numbers = {len(motion.rest) for motion in motions.values()}
    if len(numbers) != 1:
        raise MotiondeckError("a centralized network needs motions, all with the same number of channels")
    return numbers.pop()


def channel_scale(spread: Array) -> Array:
    """The spread of channels (D,) to divide them by: no less than a thousandth of the largest, and never 0."""
    return np.maximum(spread, 1e-3 * max(1e-12, float(spread.max())))


class CentralizedGenerator(NamedMotions[CentralizedMotion]):
    """Plays centralized motions and switches between them; fits `base.Generator`.

    Args:
        motions: by name, all with the same channels.
        noise: on z at rest, its standard deviation after one second. While z stays in its state nothing of it is heard;
            where it drives z into another, the generator goes over to that motion.
        seed: of the noise.
    """

    def __init__(self, motions: dict[str, CentralizedMotion], noise: float = 0.0, seed: int = 0) -> None:
        self.channels = shared_channels(motions)
        if not 0.0 <= noise < np.inf:
            raise MotiondeckError(f"noise of {noise} on z; it is not negative")
        super().__init__(motions)
        self.tempo = 1.0  # multiplies all frequencies
        self._passage = Passage(len(motions))
        self.module = self._passage.module  # state k is the k-th motion
        self._noise, self._random = noise, np.random.default_rng(seed)
        self._out, self._left = np.zeros((2, self.channels))
        self._ahead = np.linspace(0.0, WINDOW_SECONDS, WINDOW_FRAMES)
        windows: dict[str, Array] = {}
        for name, part in motions.items():
            starts = np.arange(ENTRIES if part.loop else 1) / ENTRIES * part.seconds
            windows[name] = part.at(np.add.outer(starts, self._ahead).ravel()).reshape(len(starts), WINDOW_FRAMES, -1)
        self._scale = channel_scale(np.concatenate([w.reshape(-1, self.channels) for w in windows.values()]).std(0))
        # What follows each entry point of a motion, each channel over its spread, shape (E, WINDOW_FRAMES, D).
        self._windows = {name: window / self._scale for name, window in windows.items()}
        self.cue(self.motions[0])

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        return self._source is None and self._waiting is None

    def cue(self, motion: str, phase: float = 0.0) -> None:
        """Starts a motion at a phase in [0, 1), without a transition."""
        part = self[motion]
        self.motion = motion  # the one that plays or is being switched to
        self._player = CentersPlayer(part, phase * part.seconds)
        self._source: CentersPlayer | None = None  # what it leaves
        self._waiting: str | None = None
        self.module.reset(self.motions.index(motion))

    def switch(self, to: str) -> None:
        """Goes over to a motion; while a switch is under way, the latest other wish waits for its end.

        UnknownNameError if there is no such motion; it names the nearest.
        """
        part = self[to]
        if self._source is not None:
            self._waiting = to if to != self.motion else None
            return
        if to == self.motion and part.loop:
            return
        # It is entered where it is most like the course of the motion before.
        coming = self._player.motion.at(self._player.time + self._ahead) / self._scale
        entry = int(np.square(self._windows[to] - coming).sum((1, 2)).argmin())
        self._passage.begin(self.motions.index(to))
        self._source = self._player
        self._player, self.motion = CentersPlayer(part, entry / ENTRIES * part.seconds), to

    def step(self, dt: float) -> Channels:
        """Goes dt >= 0 seconds on and gives the channels there, shape (D,); the array is reused by the next step."""
        self._player.advance(dt * self.tempo)
        self._player.read(self._out)
        if self._source is not None:
            self._mix(self._source, dt)
        elif self._noise:
            self.module.advance(dt, self._noise * dt**0.5 * self._random.standard_normal())
            if self.module.state != self.motions.index(self.motion):
                self.switch(self.motions[self.module.state])
        return self._out

    def frequency_at(self, z: float) -> Array:
        """omega(z) of eq. 12, shape (n,), for motions with equally many centers: exact where the module rests."""
        return self.module.design.memberships(z) @ np.stack([part.frequency for part in self._of.values()])

    def weights_at(self, z: float) -> Array:
        """W(z) of eq. 13 over the satellites of all motions side by side, shape (D, sum of m)."""
        shares = self.module.design.memberships(z)
        return np.concatenate([s * part.matrix for s, part in zip(shares, self._of.values(), strict=True)], axis=1)

    def snapshot(self) -> tuple[Any, ...]:
        """A copy of the state: two runs from one snapshot are identical."""
        source = self._source.copy() if self._source is not None else None
        noise, module = self._random.bit_generator.state, self.module.snapshot()
        return self.motion, self._player.copy(), self._waiting, source, module, self._passage.way, noise

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Puts the state back to a snapshot."""
        self.motion, player, self._waiting, source, module, self._passage.way, noise = snapshot
        self._random.bit_generator.state, self._player = noise, player.copy()
        self._source = source.copy() if source is not None else None
        self.module.restore(module)

    def _mix(self, source: CentersPlayer, dt: float) -> None:
        if self._passage.advance(dt):
            out, left = self._out, self._left
            source.advance(dt * self.tempo)
            source.read(left)
            np.subtract(out, left, out=out)
            np.multiply(out, self._passage.share, out=out)
            np.add(out, left, out=out)
            return
        self._source = None
        self.module.reset(self.motions.index(self.motion))
        if self._waiting is not None:
            waiting, self._waiting = self._waiting, None
            self.switch(waiting)
