# pyright: strict
"""Recognition of motions: of whole clips, and of streams of frames or poses."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from controller.learning.recognition.experts import STRETCHES, committee_recipe
from controller.learning.recognition.features import FeatureRecipe
from controller.learning.recognition.labelled_recordings import Dataset, Example, read_dataset
from controller.learning.recognition.online_recognizer import OnlineRecognizer
from controller.learning.recognition.recognizer import (
    BodyRecognizer,
    RecognitionVerdict,
    save_recognizer,
    train_recognizer,
)
from controller.learning.recognition.recognizer import Recognizer as TrainedRecognizer
from controller.learning.recognition.recognizer import load_recognizer as load_recognizer_file
from controller.motion.clip import Clip
from controller.motion.skeleton import Skeleton
from motiondeck.recordings import the_clip
from motiondeck_base.errors import MotiondeckError

__all__ = ["PoseStream", "RecognitionStream", "RecognitionVerdict", "Recognizer", "learn_recognizer", "load_recognizer"]


LONGEST_STEP = 10.0  # s


@dataclass(frozen=True)
class Recognizer:
    """Recognizes motions; made by `learn_recognizer` or `load_recognizer`."""

    model: TrainedRecognizer  # its features, experts and threshold

    @property
    def motions(self) -> tuple[str, ...]:
        """The motions it knows."""
        return self.model.bank.classes

    def recognize(self, clip: Clip) -> RecognitionVerdict:
        """The motion of a clip, with its margin, and whether it is a known one.

        MotiondeckError if the clip's skeleton lacks a joint that is compared, or the clip is too short.
        """
        return self.model.recognize(the_clip(clip))

    def stream(self) -> RecognitionStream:
        """Recognizes frame by frame."""
        return RecognitionStream(self)

    def watch(self, skeleton: Skeleton) -> PoseStream:
        """Recognizes the poses of a body one by one, at any rate. MotiondeckError if a compared joint is missing."""
        return PoseStream(BodyRecognizer(self.model, skeleton), len(skeleton))

    def frames(self, clip: Clip) -> NDArray[np.float64]:
        """The input of a stream: the features of a clip at `rate` frames per second, shape (T, C)."""
        return self.model.features(the_clip(clip))

    @property
    def rate(self) -> float:
        """Frames per second that are compared, Hz."""
        return self.model.recipe.rate

    def save(self, path: str | Path, licence: str = "") -> None:
        """Writes the recognizer into one file (.safetensors). MotiondeckError if the folder cannot be written."""
        save_recognizer(self.model, Path(path), licence)


@dataclass
class RecognitionStream:
    """Recognition of a stream of features, on the evidence of the last 0.15 s."""

    recognizer: Recognizer

    def __post_init__(self) -> None:
        self.reset()

    def update(self, frame: NDArray[np.float64]) -> str | None:
        """The motion that is seen at the next frame (C,), or None while unsure. MotiondeckError for another shape."""
        channels = self._online.channels
        if np.shape(frame) != (channels,):
            takes = f"this recognizer takes ({channels},): rows of Recognizer.frames(clip)"
            raise MotiondeckError(f"a frame of shape {np.shape(frame)}; {takes}")
        self._online.update(np.asarray(frame))
        return self.motion

    @property
    def motion(self) -> str | None:
        """The motion that is seen, or None while nothing is sure."""
        return self._online.motion if self._online.known else None

    @property
    def nearest(self) -> str | None:
        """The most similar motion, even if it is not sure; None before the second frame."""
        return self._online.motion

    @property
    def confidence(self) -> float:
        """The lead of the best motion over the second, in [0, 1)."""
        return self._online.confidence

    def reset(self) -> None:
        """Forgets everything that was seen."""
        model = self.recognizer.model
        self._online = OnlineRecognizer(model.bank, model.threshold, model.recipe.rate)


@dataclass
class PoseStream:
    """Recognition of a stream of poses."""

    _body: BodyRecognizer = field(repr=False)
    _bones: int = field(repr=False)

    def update(self, root_position: NDArray[np.float64], rotation: NDArray[np.float64], dt: float) -> str | None:
        """Takes the next pose; the motion that is seen, or None while nothing is sure.

        A pose with a NaN or infinite number is skipped. MotiondeckError if a shape is wrong, or dt is negative or
        longer than LONGEST_STEP.

        Args:
            root_position: m, z up, shape (3,).
            rotation: of the root and of each bone in the world, unit quaternions, shape (1 + B, 4), as in `Clip`.
            dt: time since the last pose, s.
        """
        shapes = (np.shape(root_position), np.shape(rotation))
        if shapes != ((3,), (1 + self._bones, 4)):
            raise MotiondeckError(f"a pose of this body has shapes (3,) and ({1 + self._bones}, 4), not {shapes}")
        if not 0.0 <= dt <= LONGEST_STEP:
            raise MotiondeckError(f"a pose {dt:g} s after the last one cannot be recognized; at most {LONGEST_STEP:g}")
        return self._body.update(root_position, rotation, dt)

    @property
    def motion(self) -> str | None:
        """The motion that is seen, or None while nothing is sure."""
        return self._body.seen

    @property
    def confidence(self) -> float:
        """The lead of the best motion over the second, in [0, 1)."""
        return self._body.online.confidence


def learn_recognizer(
    recordings: str | Path | Mapping[str, Collection[Clip]],
    *,
    rate: float = 30.0,
    stretches: Collection[float] = STRETCHES,
    seed: int = 1,
) -> Recognizer:
    """Learns to recognize motions, as `motiondeck recognize train` does.

    MotiondeckError if there are fewer than two motions, or a recording cannot be used.

    Args:
        recordings: a folder with one folder of recordings per motion, or the clips of each motion by its name.
        rate: frames per second that are compared, Hz.
        stretches: factors of duration; each clip is learned once for each.
        seed: of the reservoir.
    """
    dataset = read_dataset(Path(recordings)) if isinstance(recordings, str | Path) else _labelled(recordings)
    stretches = tuple(dict.fromkeys(stretches))
    experts = committee_recipe(stretches, seed=seed)
    return Recognizer(train_recognizer(dataset, FeatureRecipe(rate=rate), experts, stretches))


def load_recognizer(path: str | Path) -> Recognizer:
    """A recognizer that was saved, by its path. MotiondeckError says in one line which file is wrong, and why."""
    return Recognizer(load_recognizer_file(Path(path)))


def _labelled(clips: Mapping[str, Collection[Clip]]) -> Dataset:
    """Clips as a dataset, in which each skeleton is one actor."""
    for motion, own in clips.items():
        if isinstance(own, Clip | str | Path):
            raise MotiondeckError(f"motion '{motion}': give a list of its clips, even of one")
    examples = [
        Example(clip, motion, clip.skeleton.name, Path(clip.source or clip.name))
        for motion, own in clips.items()
        for clip in map(the_clip, own)
    ]
    return Dataset(examples, [])
