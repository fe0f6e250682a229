"""The file of a recognizer: safetensors with a JSON header, checked on loading, which executes nothing."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np

from controller.learning.recognition.expert_bank import ExpertBank
from controller.learning.recognition.experts import ExpertRecipe, Moments
from controller.learning.recognition.features import FeatureRecipe
from controller.learning.recognition.recognizer import LEAST_CONFIDENCE, Recognizer
from controller.motion.rotations import Array
from controller.networks.reservoirs.reservoir import Reservoir
from motiondeck_base.arrays_file import Kind, read_arrays, write_arrays
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.toml_file import shaped

VERSION = 2
OLDER = (1,)  # whose yy is a sum over the channels
KEY = "motiondeck recognizer"
KIND = Kind("recognizer", KEY, VERSION, "`motiondeck recognize train`", OLDER)


class RecognizerInfo(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The header of a recognizer; fields as in `Recognizer`, and the licence of the recordings, if given."""

    version: int
    classes: list[str]
    features: FeatureRecipe
    experts: ExpertRecipe
    threshold: float
    clips: int
    sources: list[str]
    licence: str = ""


def save_recognizer(recognizer: Recognizer, path: Path, licence: str = "") -> None:
    """Writes a recognizer atomically.

    Raises:
        FileFormatError: if the folder cannot be written.
    """
    bank = recognizer.bank
    info = RecognizerInfo(
        version=VERSION,
        classes=list(bank.classes),
        features=recognizer.recipe,
        experts=bank.recipe,
        threshold=recognizer.threshold,
        clips=recognizer.clips,
        sources=list(recognizer.sources),
        licence=licence,
    )
    arrays: dict[str, Array] = {
        "weights": bank.reservoir.weights,
        "input_weights": bank.reservoir.input_weights,
        "bias": bank.reservoir.bias,
        "xx": np.array([of.xx for of in bank.moments]),
        "xy": np.array([of.xy for of in bank.moments]),
        "yy": np.array([of.yy for of in bank.moments]),
        "count": np.array([of.count for of in bank.moments]),
    }
    write_arrays(path, KIND, info, arrays)


def load_recognizer(path: Path) -> Recognizer:
    """Reads and checks a recognizer.

    Raises:
        FileFormatError: one line that names the file and the error.
    """
    header, stored = read_arrays(path, KIND)
    info = _read_info(path, header)
    classes, neurons, channels = len(info.classes), info.experts.neurons, stored.size("input_weights", axis=1)
    reservoir = Reservoir(
        stored.take("weights", neurons, neurons, kind=np.float64),
        stored.take("input_weights", neurons, channels, kind=np.float64),
        stored.take("bias", neurons, kind=np.float64),
        info.experts.leak,
    )
    xx = stored.take("xx", classes, neurons, neurons, kind=np.float64)
    xy = stored.take("xy", classes, neurons, channels, kind=np.float64)
    count = stored.take("count", classes, kind=np.float64)
    if info.version == 1:
        yy = np.tile(stored.take("yy", classes, kind=np.float64)[:, None] / channels, channels)
    else:
        yy = stored.take("yy", classes, channels, kind=np.float64)
    stored.finish()
    if (count <= 0.0).any() or (yy < 0.0).any():
        raise FileFormatError(f"{path}: a class was trained on nothing")
    parts = tuple(Moments(xx[m], xy[m], yy[m], float(count[m])) for m in range(classes))
    bank = ExpertBank(info.experts, reservoir, tuple(info.classes), parts)
    try:
        usable = bool(np.isfinite(bank.readouts).all() and np.isfinite(bank.centre).all())
    except np.linalg.LinAlgError:
        usable = False
    if not usable:
        raise FileFormatError(f"{path}: its moments are not those of any motion. Train it again.")
    return Recognizer(info.features, bank, info.threshold, info.clips, tuple(info.sources))


def _read_info(path: Path, tree: object) -> RecognizerInfo:
    try:
        info = shaped(tree, RecognizerInfo, f"{path} (header)")
    except MotiondeckError as error:
        raise error if isinstance(error, FileFormatError) else FileFormatError(f"{path} (header): {error}") from None
    if len(info.classes) < 2 or len(set(info.classes)) < len(info.classes):
        raise FileFormatError(f"{path}: its header names fewer than two classes, or one twice")
    if not (np.isfinite(info.threshold) and abs(info.threshold) <= -LEAST_CONFIDENCE):
        raise FileFormatError(f"{path}: a threshold of {info.threshold} is impossible")
    return info
