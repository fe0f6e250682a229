"""Retrieval by frequency vectors: the class of the clip whose centers turn most alike (Vakulenko 2017, section 4).

The centralized network of a motion knows it by the frequencies of its centers, so that motions can be looked up by
them. Here legs, arms and trunk have one center each, as in `benchmarks frequencies similar`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from benchmarks.centralized.motion_signature import NUMBERS_A_PART, PARTS, signature
from benchmarks.recognition.baselines import nearest
from benchmarks.recognition.methods import Prepare, Scorer
from controller.learning.recognition.labelled_recordings import Example
from controller.motion.encodings.encoding import encoding_of
from controller.motion.rotations import Array, Indices

# Of the numbers of each part: the best center and the mean frequency; the third says how far it moves.
FREQUENCIES = np.array([n for n in range(NUMBERS_A_PART * len(PARTS)) if n % NUMBERS_A_PART < 2])
ALL_NUMBERS = np.arange(NUMBERS_A_PART * len(PARTS))


def frequency_vector(example: Example, stretch: float) -> Array:
    """What a clip is known by (see `signature`), shape (1, 9).

    Raises:
        MotiondeckError: if the clip is too short to tell frequencies.
    """
    encoding = encoding_of(example.clip.skeleton)
    return signature(encoding, encoding.encode(example.clip), example.clip.rate / stretch)[None]


def nearest_frequencies(numbers: NDArray[np.int64]) -> Prepare:
    """The class of the learned clip with the nearest frequency vector, by the logarithms of some of its numbers."""

    def prepare(signals: list[Array], labels: Indices, classes: int) -> Scorer:
        known_by = np.log(np.concatenate(signals)[:, numbers])
        return nearest(cdist(known_by, known_by).astype(np.float64), labels, classes)

    return prepare
