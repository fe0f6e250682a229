"""Marker files of OpenSim and Motion Analysis (.trc): a table, one line a frame.

    PathFileType  4  (X/Y/Z)  walk.trc
    DataRate  CameraRate  NumFrames  NumMarkers  Units  OrigDataRate  ...
    100       100         2          2           mm     100
    Frame#  Time  LKNE          RKNE
                  X1  Y1  Z1    X2  Y2  Z2
    1       0.00  12  480  3    ...

Columns are separated by tabs; those of an unseen marker are empty (OpenSim documentation, "Marker (.trc) Files"). Older
exporters put spaces into line 1 and several tabs between the values of line 3.
"""

from array import array
from itertools import islice
from pathlib import Path

import numpy as np

from controller.motion.clip import AS_FOUND, FARTHEST, MOST_NUMBERS, UNITS, Format, Markers, ReadingOptions
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, as_float, listed, read_lines, shortened


def read_trc(path: str | Path, options: ReadingOptions = AS_FOUND) -> Markers:
    """The markers in a TRC file."""
    texts = ((number, text) for number, text in enumerate(read_lines(path), 1) if text.strip())
    rows = (Line(path, number, text.split("\t")) for number, text in texts)
    lines = [*islice(rows, 5)]
    if len(lines) < 5 or not lines[0].words[0].strip().lower().startswith("pathfiletype"):
        raise FileFormatError(f"{path}: this is no .trc file, or it is cut short. Is it the right one?")
    heads, values = (" ".join(line.words).split() for line in lines[1:3])
    if len(heads) != len(values):  # some are empty
        heads, values = lines[1].words, lines[2].words
    fields = {head.strip().lower(): value.strip() for head, value in zip(heads, values, strict=False)}
    rate = lines[2].number_from(fields.get("datarate", ""))
    if not 0.1 <= rate <= 1e5:
        raise lines[2].error(f"a rate of {rate:g} frames per second is not possible.")
    unit = options.unit or UNITS.get(fields.get("units", "").lower())
    if unit is None:
        raise lines[2].error(f"the unit '{shortened(fields.get('units', ''))}' is unknown. Give it with --unit.")
    names = tuple(word.strip() for word in lines[3].words[2:] if word.strip())
    if not names or len(set(names)) < len(names):
        raise lines[3].error("expected the names of markers, no two alike.")
    axes = [word.strip().lower()[:1] for word in lines[4].words if word.strip()]
    if axes[:3] != ["x", "y", "z"]:
        raise lines[4].error("expected X1, Y1, Z1 and so on under the names of the markers.")
    values, words = array("d"), [0]  # numbers, and how many words the lines of the first and of the last frame have
    for row in rows:
        words[len(values) > 0 :] = [len(row.words)]
        values.extend(_row(row, 3 * len(names)))
        if len(values) > MOST_NUMBERS:
            raise FileFormatError(f"{path}: more than {MOST_NUMBERS} numbers do not fit into memory. Cut it.")
    position = np.frombuffer(values).reshape(-1, len(names), 3)
    position *= unit
    position[~(np.maximum(position.max(axis=-1), -position.min(axis=-1)) < FARTHEST)] = np.nan
    announced = as_float(fields.get("numframes", "")) or 0.0
    # A cropped recording keeps the number in line 3; a broken transfer ends within a line.
    if len(position) == 0 or (len(position) < announced and words[-1] < words[0]):
        raise FileFormatError(
            f"{path}: {announced:g} frames are announced, but {len(position)} follow, and the last line is cut short. "
            "Fetch it again."
        )
    if np.isnan(position).all():
        raise FileFormatError(f"{path}: no marker was ever seen ({listed(names)}). Give another recording.")
    return Markers(options.renamed(names, path), rate, position, options.up, Path(path).name)


def _row(line: Line, count: int) -> list[float]:
    """The numbers of a frame after its number and time, NaN for empty ones; lines may end before the last gaps."""
    words = "\t".join(line.words[2:]).rstrip().split("\t")
    if len(words) > count:
        raise line.error(f"{len(words)} numbers, but the markers have {count}.")
    return line.numbers_or_gaps([*words, *[""] * (count - len(words))])


FORMAT = Format(suffixes=(".trc",), read=read_trc, magic=b"PathFileType")
