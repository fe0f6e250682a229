"""The 15 patterns of H. Jaeger's conceptor demo, on which Deliallisi 2017 trained: MATLAB files of CMU motions.

The file of pattern X holds `nnRawDataX`, 61 channels a frame at 120 Hz (those of `bone_directions`, in mm and per
frame), and `segLengthsX`, the lengths of the 19 bones in mm. Channels 5 and 17, counted from 1, are zero by
construction; the files have rounding errors there.
"""

from pathlib import Path

import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions, walked_clip
from controller.motion.encodings.bone_directions import FIRST_BONE, FORWARD, HEIGHT, LEFT, TURN_RATE, BoneDirections
from controller.motion.formats.mat5 import read_mat
from controller.motion.rotations import Array
from controller.motion.skeleton import JAEGER_BONES, thesis_skeleton
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed

RATE = 120.0  # Hz, from the scripts that made the patterns; not in the files
MILLIMETRE = 0.001  # m


def read_pattern(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The motion in one of Jaeger's pattern files, on a skeleton with that file's bone lengths.

    All frames of the file are kept: nnRawWaltz.mat holds its 450 twice. Encoding the clip with BoneDirections gives the
    file's channels in m, rad and s, except for the velocities of the first frame.
    """
    options.refuse(path)
    pattern, data, lengths = _fields(path)
    if not (np.isfinite(data).all() and np.isfinite(lengths).all()):
        raise FileFormatError(f"{path}: holds a number that is not finite. Fetch the file again.")
    if not np.all((lengths > 0.0) & (lengths < 1e6)):
        raise FileFormatError(
            f"{path}: segLengths{pattern} holds a length that no bone in mm can have. Fetch it again."
        )
    if np.any(np.abs(data[:, :FIRST_BONE]) > 1e6):
        raise FileFormatError(f"{path}: nnRawData{pattern} moves further than 1 km. Fetch the file again.")
    encoding = BoneDirections(thesis_skeleton(lengths * MILLIMETRE, pattern))
    channels = data.copy()
    channels[:, encoding.silent] = 0.0
    norms = np.linalg.norm(channels[:, FIRST_BONE:].reshape(len(channels), -1, 3), axis=-1)
    if np.any(np.abs(norms - 1.0) > 1e-6):
        frame, bone = np.argwhere(np.abs(norms - 1.0) > 1e-6)[0]
        raise FileFormatError(
            f"{path}: nnRawData{pattern}, frame {frame + 1}: the direction of bone '{JAEGER_BONES[bone]}' is no unit "
            f"vector across the heading (its length is {norms[frame, bone]:.6g}). "
            "Give the raw pattern, not a normalised one."
        )
    channels[:, HEIGHT] *= MILLIMETRE
    channels[:, TURN_RATE] *= RATE
    channels[:, FORWARD : LEFT + 1] *= MILLIMETRE * RATE
    return walked_clip(pattern, encoding.skeleton, encoding.decode(channels), RATE, Path(path).name)


def _fields(path: str | Path) -> tuple[str, Array, Array]:
    """The pattern's name, its data (T, 61) and its bone lengths (19,), in the units of the file."""
    there = read_mat(path)
    data_fields = (name for name in there if name.startswith("nnRawData") and name.isascii() and name.isidentifier())
    pattern = next(data_fields, "").removeprefix("nnRawData")
    found: list[Array] = []
    for name, columns in (
        (f"nnRawData{pattern}", FIRST_BONE + 3 * len(JAEGER_BONES)),
        (f"segLengths{pattern}", len(JAEGER_BONES)),
    ):
        if name not in there:
            raise FileFormatError(
                f"{path}: there is no field '{name}' (there are: {listed(there) or 'none'}). "
                "Give one of Jaeger's nnRaw files, with fields nnRawData<name> and segLengths<name>."
            )
        field = there[name]
        rows = "frames" if name.startswith("nnRawData") else "1"
        fits = len(field.shape) == 2 and field.shape[1] == columns and (field.shape[0] == 1 or rows == "frames")
        if field.values is None or not fits or field.values.size == 0:
            shape = " x ".join(map(str, field.shape))
            raise FileFormatError(
                f"{path}: field '{name}' is {shape} of {field.kind}; expected {rows} x {columns} of double. "
                "Give one of Jaeger's nnRaw files."
            )
        found.append(field.values)
    data, lengths = found
    return pattern, data, lengths[0]


FORMAT = Format(suffixes=(".mat",), read=read_pattern, magic=b"MATLAB 5.0 MAT-file")
