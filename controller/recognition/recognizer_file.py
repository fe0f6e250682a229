"""A recognizer in one file: safetensors with a JSON header, checked on load; loading executes nothing."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from controller.config import shaped
from controller.errors import FileFormatError, MotiondeckError
from controller.generators.reservoir import Reservoir
from controller.recognition.bank import ExpertBank
from controller.recognition.experts import ExpertRecipe, Moments
from controller.recognition.features import FeatureRecipe
from controller.recognition.recognizer import Recognizer
from controller.rotations import Array

VERSION = 1
KEY = "motiondeck recognizer"
LARGEST_BYTES = 2**30


class RecognizerInfo(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The header of a recognizer.

    Attributes:
        version: of the format.
        classes: the motions it knows.
        features: what it looks at.
        experts: how its experts are made.
        threshold: the margin below which a motion is called unknown.
        clips: how many clips it was trained on.
        sources: the names of their files.
        licence: terms of the recordings, if they were given.
    """

    version: int
    classes: list[str]
    features: FeatureRecipe
    experts: ExpertRecipe
    threshold: float
    clips: int
    sources: list[str]
    licence: str = ""


def save_recognizer(recognizer: Recognizer, path: Path, licence: str = "") -> None:
    """Writes a recognizer under a temporary name and renames it, so that a file is whole or not there.

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
    header = {KEY: msgspec.json.encode(info).decode()}
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be written ({error.strerror or error})") from None
    try:
        save_file({name: np.ascontiguousarray(a) for name, a in arrays.items()}, temporary, metadata=header)
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        Path(temporary).unlink(missing_ok=True)


def load_recognizer(path: Path) -> Recognizer:
    """Reads and checks a recognizer.

    Raises:
        FileFormatError: one line that names the file and what is wrong with it.
    """
    try:
        if not path.is_file():
            raise FileFormatError(f"{path}: there is no such file. Make one with `motiondeck recognize train`.")
        if path.stat().st_size > LARGEST_BYTES:
            raise FileFormatError(f"{path}: larger than {LARGEST_BYTES >> 30} GiB, which is no recognizer")
        with safe_open(path, framework="numpy") as file:
            header = file.metadata() or {}
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (SafetensorError, TypeError, ValueError, AttributeError) as error:
        raise FileFormatError(f"{path}: not a safetensors file, or a damaged one ({error})") from None
    if KEY not in header:
        raise FileFormatError(f"{path}: a safetensors file, but not a recognizer. Make one with `recognize train`.")
    info = _read_info(path, header[KEY])
    classes, neurons = len(info.classes), info.experts.neurons
    channels = _channels(path, arrays)

    def take(name: str, *shape: int) -> NDArray[Any]:
        return _checked(path, arrays, name, shape)

    reservoir = Reservoir(
        take("weights", neurons, neurons), take("input_weights", neurons, channels), take("bias", neurons),
        info.experts.leak,
    )  # fmt: skip
    xx, xy = take("xx", classes, neurons, neurons), take("xy", classes, neurons, channels)
    yy, count = take("yy", classes), take("count", classes)
    if arrays:
        raise FileFormatError(f"{path}: holds array '{next(iter(arrays))}', which nothing needs")
    if (count <= 0.0).any() or (yy < 0.0).any():
        raise FileFormatError(f"{path}: a class was trained on nothing")
    parts = tuple(Moments(xx[m], xy[m], float(yy[m]), float(count[m])) for m in range(classes))
    bank = ExpertBank(info.experts, reservoir, tuple(info.classes), parts)
    try:
        usable = bool(np.isfinite(bank.readouts).all() and np.isfinite(bank.centre).all())
    except np.linalg.LinAlgError:
        usable = False
    if not usable:
        raise FileFormatError(f"{path}: its moments are not those of any motion. Train it again.")
    return Recognizer(info.features, bank, info.threshold, info.clips, tuple(info.sources))


def _read_info(path: Path, text: str) -> RecognizerInfo:
    try:
        tree = msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError):
        raise FileFormatError(f"{path}: its header is damaged") from None
    version = tree.get("version") if isinstance(tree, dict) else None
    if version != VERSION:
        raise FileFormatError(
            f"{path}: format version {version!r}; this Motiondeck reads version {VERSION}. Train it again."
        )
    try:
        info = shaped(tree, RecognizerInfo, f"{path} (header)")
    except MotiondeckError as error:
        raise error if isinstance(error, FileFormatError) else FileFormatError(f"{path} (header): {error}") from None
    if len(info.classes) < 2 or len(set(info.classes)) < len(info.classes):
        raise FileFormatError(f"{path}: its header names fewer than two classes, or one twice")
    if not (np.isfinite(info.threshold) and info.threshold >= 0.0):
        raise FileFormatError(f"{path}: a threshold of {info.threshold} is impossible")
    return info


def _channels(path: Path, arrays: dict[str, NDArray[Any]]) -> int:
    array = arrays.get("input_weights")
    if array is None or array.ndim != 2 or array.shape[1] == 0:
        raise FileFormatError(f"{path}: array 'input_weights' is missing or empty")
    return int(array.shape[1])


def _checked(path: Path, arrays: dict[str, NDArray[Any]], name: str, shape: tuple[int, ...]) -> NDArray[Any]:
    array = arrays.pop(name, None)
    if array is None:
        raise FileFormatError(f"{path}: array '{name}' is missing")
    if array.shape != shape or array.dtype != np.float64:
        raise FileFormatError(
            f"{path}: array '{name}' is {array.dtype} of shape {array.shape}, expected float64 of shape {shape}"
        )
    if not np.isfinite(array).all():
        raise FileFormatError(f"{path}: array '{name}' holds a number that is not finite")
    return array
