"""Recognition while it happens: one frame in, the state of the verdict out, at the same small cost every frame.

Each expert's squared error is averaged over the recent past,

    E_m(t) = (1 - k) E_m(t-1) + k |y(t) - W_m x(t)|^2 / C,      cost_m = log E_m - centre_m

(of a committee for each group of neurons and each joint, and the mean of their logarithms),
so that the evidence is that of the last `memory` seconds. Nothing grows, and a frame costs one step of the reservoir
and one product with all readouts.
"""

from __future__ import annotations

import math

import numpy as np

from controller.learning.recognition.expert_bank import ExpertBank
from controller.learning.recognition.experts import SMALLEST_ERROR
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

MEMORY = 0.15  # s


class OnlineRecognizer:
    """Recognizes a stream of feature frames.

    Args:
        bank: the experts.
        threshold: the confidence (`ExpertBank.confidences`) below which nothing is claimed.
        rate: frames per second the experts were trained at, Hz.
        memory: over how long the evidence is averaged, s.

    Attributes:
        classes: the motions it knows.
        costs: the centred log error of each expert, shape (M,); NaN until the first frame is predicted.
        frames: how many frames were taken.
        skipped: how many were not, for a number in them that is not finite.
    """

    def __init__(self, bank: ExpertBank, threshold: float, rate: float, memory: float = MEMORY) -> None:
        if not (np.isfinite(memory) and memory > 0.0):
            raise MotiondeckError(f"a memory of {memory} s is not possible; it must be positive")
        reservoir = bank.reservoir
        self.classes = bank.classes
        self.threshold = threshold
        self.rate = rate
        experts, groups, self.channels, size = bank.readouts.shape
        neurons = len(reservoir.bias)
        # One matrix for all that is linear in the state, one for all that is linear in the frame; single precision.
        self._step = np.ascontiguousarray(np.hstack([reservoir.weights, reservoir.input_weights]), dtype=np.float32)
        self._bias = reservoir.bias.astype(np.float32)
        by_group = bank.readouts.transpose(1, 0, 2, 3).reshape(groups, -1, size)
        self._readouts = np.ascontiguousarray(by_group, dtype=np.float32)
        self._doubt = bank.recipe.doubt
        self._centre = bank.centre
        self._leak = np.float32(reservoir.leak)
        self._gain = 1.0 - np.exp(-1.0 / (memory * rate))
        self._neurons = neurons
        self._state = np.zeros(neurons + self.channels, dtype=np.float32)
        self._drive = np.zeros(neurons, dtype=np.float32)
        self._together = bank.together
        self._guess = np.zeros((groups, experts, self.channels), dtype=np.float32)
        self._read = [
            (self._readouts[group], self._state[size * group : size * (group + 1)], self._guess[group].reshape(-1))
            for group in range(groups)
        ]
        joints = self._guess.reshape(groups, experts, -1, self._together)
        self._by_joint, self._error = joints, np.zeros(joints.shape[:-1])
        # A sum into double precision takes twice as long.
        self._square = np.zeros(joints.shape[:-1], dtype=np.float32)
        self._log = np.zeros(joints.shape[:-1])
        self._weight = 0.0
        self.costs = np.full(experts, np.nan)
        self.frames = 0
        self.skipped = 0

    def reset(self) -> None:
        """Forgets everything that was seen."""
        self._state[:] = 0.0
        self._error[:] = 0.0
        self._weight = 0.0
        self.costs[:] = np.nan
        self.frames = self.skipped = 0

    def update(self, frame: Array) -> None:
        """Takes the next frame, shape (C,); one with a number that is not finite is skipped and counted."""
        if not math.isfinite(frame.sum()):  # half the time of asking each number
            self.skipped += 1
            return
        neurons, state = self._neurons, self._state
        state[neurons:] = frame
        if self.frames:
            for readouts, seen, guess in self._read:
                np.dot(readouts, seen, out=guess)
            self._guess -= state[neurons:]
            square = self._square
            np.einsum("gmjc,gmjc->gmj", self._by_joint, self._by_joint, out=square)
            square *= self._gain / self._together
            self._error *= 1.0 - self._gain
            self._error += square
            self._weight += self._gain * (1.0 - self._weight)
            logs = self._log
            np.multiply(self._error, 1.0 / self._weight, out=logs)
            np.maximum(logs, SMALLEST_ERROR, out=logs)
            np.log(logs, out=logs)
            np.mean(logs, axis=(0, 2), out=self.costs)
            self.costs -= self._centre
        np.dot(self._step, state, out=self._drive)
        self._drive += self._bias
        np.tanh(self._drive, out=self._drive)
        self._drive -= state[:neurons]
        self._drive *= self._leak
        state[:neurons] += self._drive
        self.frames += 1

    @property
    def ready(self) -> bool:
        """Whether anything has been predicted yet."""
        return self._weight > 0.0

    @property
    def motion(self) -> str | None:
        """The nearest class, or None before the first verdict; see `known` for whether to believe it."""
        return self.classes[int(self.costs.argmin())] if self.ready else None

    @property
    def margin(self) -> float:
        """How far the best expert is ahead of the second, in log error."""
        if not self.ready or len(self.costs) < 2:
            return 0.0
        first, second = sorted(self.costs.tolist())[:2]
        return second - first

    @property
    def confidence(self) -> float:
        """How much smaller the best expert's error is than the second's, in [0, 1): 1 - exp(-margin)."""
        return -math.expm1(-self.margin)

    @property
    def known(self) -> bool:
        """Whether the verdict is sure enough to be believed."""
        return self.ready and self.margin - self._doubt * float(self.costs.min()) >= self.threshold

    def behind(self, motion: str) -> float:
        """How far a motion's expert is behind the best one, in log error; 0 if it is the best."""
        if not self.ready:
            return 0.0
        return float(self.costs[self.classes.index(motion)] - self.costs.min())


class MismatchWatch:
    """Notices when what is done is not what was commanded, for longer than a set time.

    Time does not count while a switch is under way, nor for `grace` seconds after it.

    Args:
        recognizer: what sees the measured joints.
        behind: from this many log units behind the best expert on, the commanded motion is not the one that is done.
        patience: how long that must last, s.
        grace: how long after a switch nothing counts, s.

    Attributes:
        mismatch: s for which it has lasted.
    """

    def __init__(
        self, recognizer: OnlineRecognizer, *, behind: float = 0.5, patience: float = 0.5, grace: float = 0.7
    ) -> None:
        self._recognizer = recognizer
        self._behind, self._patience, self._grace = behind, patience, grace
        self._commanded: str | None = None
        self._since_switch = 0.0
        self.mismatch = 0.0

    @property
    def counting(self) -> bool:
        """Whether a mismatch would count: the last switch is long enough ago."""
        return self._since_switch > self._grace

    def update(self, commanded: str, settled: bool, dt: float) -> bool:
        """Goes dt seconds on; whether a mismatch has lasted for longer than the patience.

        Args:
            commanded: the motion that should be done; one the recognizer does not know is not watched.
            settled: whether no switch is under way.
            dt: s since the last call.
        """
        if commanded != self._commanded or not settled:
            self._commanded, self._since_switch, self.mismatch = commanded, 0.0, 0.0
            return False
        self._since_switch += dt
        recognizer = self._recognizer
        wrong = commanded in recognizer.classes and recognizer.behind(commanded) > self._behind
        self.mismatch = self.mismatch + dt if wrong and self.counting else 0.0
        return self.mismatch > self._patience
