"""Online recognition, frame by frame at constant cost.

Each expert's squared error is averaged over the last `memory` seconds,

    E_m(t) = (1 - k) E_m(t-1) + k |y(t) - W_m x(t)|^2 / C,      cost_m = log E_m - centre_m

(of a committee for each group of neurons and each joint, and the mean of their logarithms). A frame costs one step of
the reservoir and one product with all readouts.
"""

import math
from collections.abc import Iterator

import numpy as np

from controller.learning.recognition.experts import SMALLEST_ERROR, ExpertBank
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

MEMORY = 0.15  # s
GRACE = 0.7  # s after a switch
BEHIND = 0.5  # log error behind the best expert from which the commanded motion counts as not done


class FrameTimes:
    """Times of frames at a rate, Hz, between measurements at any pace; the first is at the first measurement."""

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate
        self._since = 0.0

    def due(self, dt: float) -> Iterator[float]:
        """Advances by dt >= 0 s; yields the shares of dt at which frames are due, in (0, 1]. Exhaust the iterator."""
        due = self._period - self._since
        while due <= dt:
            yield due / dt if dt > 0.0 else 1.0
            due += self._period
        self._since = self._period - (due - dt)


class OnlineRecognizer:
    """Recognizes a stream of feature frames, at the `rate` of the training, Hz, averaged over the time `memory`, s.

    A motion is unknown where its confidence (`ExpertBank.confidences`) is below the threshold.
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
        # One matrix for state and frame, in single precision.
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
        self.costs = np.full(experts, np.nan)  # centred log error of each expert; NaN until a frame is predicted
        self.frames = 0  # processed
        self.skipped = 0  # with NaN or infinite values

    def update(self, frame: Array) -> None:
        """Processes the next frame, shape (C,); one that is not finite is skipped and counted."""
        if not math.isfinite(frame.sum()):  # half the time of checking each number
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
        """Whether a frame has been predicted."""
        return self._weight > 0.0

    @property
    def motion(self) -> str | None:
        """The nearest class, or None before the first verdict; reliable if `known`."""
        return self.classes[int(self.costs.argmin())] if self.ready else None

    @property
    def margin(self) -> float:
        """The difference of log errors between the second-best and the best expert."""
        if not self.ready or len(self.costs) < 2:
            return 0.0
        first, second = sorted(self.costs.tolist())[:2]
        return second - first

    @property
    def confidence(self) -> float:
        """1 - exp(-margin), in [0, 1)."""
        return -math.expm1(-self.margin)

    @property
    def known(self) -> bool:
        """Whether the confidence reaches the threshold."""
        return self.ready and self.margin - self._doubt * float(self.costs.min()) >= self.threshold

    def behind(self, motion: str) -> float:
        """The difference of log errors between a motion's expert and the best one."""
        if not self.ready:
            return 0.0
        return float(self.costs[self.classes.index(motion)] - self.costs.min())


class MismatchWatch:
    """Detects that another motion than the commanded one is recognized for longer than the patience, s.

    `mismatch` is its duration so far, s. Time does not count during a switch and for GRACE after it.
    """

    def __init__(self, recognizer: OnlineRecognizer, patience: float) -> None:
        self._recognizer, self._patience = recognizer, patience
        self._commanded: str | None = None
        self._since_switch = 0.0
        self.mismatch = 0.0

    @property
    def counting(self) -> bool:
        """Whether the grace after the last switch is over."""
        return self._since_switch > GRACE

    def update(self, commanded: str, settled: bool, dt: float) -> bool:
        """Advances by dt seconds; whether a mismatch has outlasted the patience.

        An unknown commanded motion is not checked. `settled` means that no switch is under way.
        """
        if commanded != self._commanded or not settled:
            self._commanded, self._since_switch, self.mismatch = commanded, 0.0, 0.0
            return False
        self._since_switch += dt
        recognizer = self._recognizer
        wrong = commanded in recognizer.classes and recognizer.behind(commanded) > BEHIND
        self.mismatch = self.mismatch + dt if wrong and self.counting else 0.0
        return self.mismatch > self._patience
