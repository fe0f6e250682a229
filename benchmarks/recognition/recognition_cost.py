"""The cost of recognition: training of a whole set, and one frame of the online recognizer, in processor time.

Processor time is what a loop has to set aside; what other processes take meanwhile is not in it.
"""

from __future__ import annotations

import time

import msgspec
import numpy as np

from controller.learning.recognition.experts import ExpertBank, ExpertRecipe, teach
from controller.learning.recognition.features import FeatureRecipe, features
from controller.learning.recognition.labelled_recordings import Dataset
from controller.learning.recognition.online_recognizer import OnlineRecognizer
from controller.motion.rotations import Array

REPEATS = 7
BLOCKS, FRAMES = 20, 100  # single frames are too short for the clock


class RecognitionCost(msgspec.Struct, frozen=True, kw_only=True):
    """Medians of repeated measurements in plain NumPy, processor time of one thread.

    Attributes:
        train_ms: from features to readouts, all clips of the set, ms.
        classes: how many there are.
        frame_us: a frame of the online recognizer with its verdict, us.
        frame_us_15: the same for 15 classes (the last ones repeated), us.
        channels: of a frame.
        neurons: of the reservoir.
    """

    train_ms: float
    classes: int
    frame_us: float
    frame_us_15: float
    channels: int
    neurons: int


def cost(dataset: Dataset, look: FeatureRecipe, experts: ExpertRecipe) -> RecognitionCost:
    """Measures with the clips of a dataset."""
    signals = [features(example.clip, look) for example in dataset.examples]
    labels = [example.label for example in dataset.examples]
    bank = teach(experts, signals, labels)
    took = [_training(signals, labels, experts) for _ in range(REPEATS)]
    frames = np.concatenate(signals)
    frames = np.resize(frames, (BLOCKS * FRAMES, frames.shape[1]))
    fifteen = tuple(f"{m}" for m in range(15))
    parts = tuple(bank.moments[m % len(bank.moments)] for m in range(15))
    return RecognitionCost(
        train_ms=float(np.median(took)) * 1e3,
        classes=len(bank.classes),
        frame_us=_frame_us(bank, frames, look.rate),
        frame_us_15=_frame_us(ExpertBank(experts, bank.reservoir, fifteen, parts), frames, look.rate),
        channels=signals[0].shape[1],
        neurons=experts.neurons,
    )


def _training(signals: list[Array], labels: list[str], experts: ExpertRecipe) -> float:
    start = time.thread_time()
    bank = teach(experts, signals, labels)
    assert np.isfinite(bank.centre).all()  # readouts and centre are made when they are first asked for
    return time.thread_time() - start


def _frame_us(bank: ExpertBank, frames: Array, rate: float) -> float:
    online = OnlineRecognizer(bank, 0.0, rate)
    took = np.empty(BLOCKS)
    for number, block in enumerate(np.split(frames, BLOCKS)):
        start = time.thread_time()
        for frame in block:
            online.update(frame)
            _ = online.motion, online.margin
        took[number] = time.thread_time() - start
    return float(np.median(took)) / FRAMES * 1e6
