"""The figures of Deliallisi 2017, and the two noise channels without which some of them cannot be reproduced.

Two of the 61 channels (5 and 17, counted from 1) are zero by construction; the files hold rounding errors there, which
min-max normalisation amplifies to noise between -1 and 1. The thesis silenced them in the input of its conceptor
networks but kept them as targets of the readout: its NRMSE(W_out) and MABS(W_out) can only be reproduced that way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from controller.learning.preparation.training_motion import TrainingMotion
from controller.motion.encodings.bone_directions import FIRST_BONE
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.formats.jaeger_patterns import read_mat
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError

NOISE_CHANNELS = (4, 16)


@dataclass(frozen=True)
class ThesisFigures:
    """The figures of one network of the thesis.

    Attributes:
        accuracy: training errors by the names of `trainers.trainer.TrainingError`.
        robustness, stability: failure rates by motion, as shares.
        tables: the numbers of the tables of robustness and of stability.
    """

    accuracy: dict[str, float]
    robustness: dict[str, float] = field(default_factory=dict)
    stability: dict[str, float] = field(default_factory=dict)
    tables: tuple[str, str] = ("", "")


def _rates(*percent: int) -> dict[str, float]:
    motions = ("jog", "cartwheel", "waltz", "box3", "getseated")
    return {motion: rate / 100 for motion, rate in zip(motions, percent, strict=False)}


THESIS: dict[str, ThesisFigures] = {
    "esn-4.1": ThesisFigures(
        {"mabs_readout": 0.0016, "nrmse_readout": 0.0275},
        _rates(0, 16, 35, 84, 87),
        _rates(0, 19, 65, 0),
        ("4.2", "4.7"),
    ),
    "esn-4.3": ThesisFigures(
        {"mabs_readout": 0.0015, "nrmse_readout": 0.0328},
        _rates(9, 32, 23, 23, 74),
        _rates(0, 45, 3, 3),
        ("4.4", "4.8"),
    ),
    "esn-4.5": ThesisFigures(
        {"mabs_readout": 0.0013, "nrmse_readout": 0.0156},
        _rates(0, 0, 27, 12, 74),
        _rates(0, 0, 8, 0),
        ("4.6", "4.9"),
    ),
    "conceptor-4.1": ThesisFigures(
        {"mabs_readout": 0.0066, "nrmse_readout": 0.0435, "mabs_weights": 0.0312, "nrmse_weights": 0.0057},
        _rates(0, 1, 30, 31, 57),
        _rates(0, 0, 22, 0),
        ("4.2", "4.7"),
    ),
    "conceptor-4.3": ThesisFigures(
        {"mabs_readout": 0.0065, "nrmse_readout": 0.0454, "mabs_weights": 0.0328, "nrmse_weights": 0.0072},
        _rates(0, 3, 27, 12, 60),
        _rates(0, 0, 13, 0),
        ("4.4", "4.8"),
    ),
}


def noisy_targets(lessons: Sequence[TrainingMotion], files: Sequence[Path]) -> list[Array]:
    """The lessons' frames with the recordings' rounding noise in the two channels that are zero otherwise.

    Args:
        lessons: the plain recordings without their first frames, as in the thesis.
        files: the recording of each, in Jaeger's format.

    Raises:
        FileFormatError: if a file is not one of Jaeger's.
    """
    noise = [_noise(file) for file in files]
    normalisation = Normalisation.fit(noise)
    out = []
    for lesson, channels in zip(lessons, noise, strict=True):
        target = lesson.frames.copy()
        target[:, NOISE_CHANNELS] = normalisation.apply(channels)[-len(target) :]
        out.append(target)
    return out


def _noise(file: Path) -> Array:
    for name, variable in read_mat(file).items():
        if name.startswith("nnRawData") and variable.values is not None and variable.values.shape[1] > FIRST_BONE + 12:
            return variable.values[:, NOISE_CHANNELS]
    raise FileFormatError(
        f"{file}: the thesis's readout targets need Jaeger's recordings; this file has no field nnRawData..."
    )
