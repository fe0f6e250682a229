"""Tables of numbers in text files: columns that commas, semicolons or tabs separate, at even or uneven times."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from controller.motion.clip import FARTHEST, MOST_NUMBERS, between_rows
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, read_lines

LONGEST_GAP = 0.5  # s without a frame
TIMES = ("time_s", "time", "time (s)", "time [s]", "timestamp", "seconds", "t")  # names of the first column
_LATEST = 1e300  # s
_SNIFFED = 1 << 16  # bytes read to identify a table


def is_row(text: str) -> bool:
    """Whether a line holds something other than a comment."""
    return bool(text.strip()) and not text.lstrip().startswith("#")


def separator_of(text: str) -> str:
    """The character that separates the columns of a line."""
    return max(",;\t", key=text.count)


def words_of(text: str, separator: str) -> list[str]:
    """The columns of a line without blanks and quotes."""
    return [word.strip().strip("\"'").strip() for word in text.split(separator)]


def heading(path: str | Path) -> tuple[Line, list[tuple[int, str]], str, list[str]]:
    """The first line of a table, its numbered rows, separator, and comments before it; FileFormatError without any."""
    every = [*read_lines(path)]
    texts = [(number, text) for number, text in enumerate(every, 1) if is_row(text)]
    if not texts:
        raise FileFormatError(f"{path}: there is nothing in it. Write it again.")
    number, separator = texts[0][0], separator_of(texts[0][1])
    return Line(path, number, words_of(texts[0][1], separator)), texts[1:], separator, every[: number - 1]


def first_row(path: Path) -> list[str]:
    """The columns of the first line of a file that is no comment; empty if it cannot be read."""
    try:
        with path.open("rb") as file:
            texts = file.read(_SNIFFED).decode("utf-8-sig", errors="replace").splitlines()
    except OSError:
        return []
    return next((words_of(text, separator_of(text)) for text in texts if is_row(text)), [])


def numbers(
    path: str | Path, texts: Sequence[tuple[int, str]], count: int, separator: str, largest: float = FARTHEST
) -> Array:
    """Numbers (T, C) of numbered lines, NaN if empty, <= `largest` but in column 0; FileFormatError with the line."""
    if not texts:
        raise FileFormatError(f"{path}: there are no frames in it. Write it again.")
    if len(texts) * count > MOST_NUMBERS:
        raise FileFormatError(f"{path}: {len(texts)} frames do not fit into memory. Cut the recording into pieces.")
    found = np.empty((len(texts), count))
    for frame, (number, text) in enumerate(texts):
        if separator != ",":
            text = text.replace(",", ".")
        words = words_of(text, separator) if '"' in text or "'" in text else text.split(separator)
        line = Line(path, number, words)
        if len(words) != count:
            raise line.error(f"{len(words)} values, but the first line names {count}. (Decimals have a dot.)")
        found[frame] = [*line.numbers_or_gaps(words[:1], _LATEST), *line.numbers_or_gaps(words[1:], largest)]
    return found


def even_times(time: Array, position: Array, lines: list[Line]) -> tuple[float, Array]:
    """The rate, Hz, and positions (T, ...) at even times, interpolated linearly where frames are late or missing."""
    if len(time) == 1 and np.isfinite(time[0]):
        return 120.0, position
    steps = np.diff(time, prepend=time[0] - 1.0)  # one for the first frame too, which comes after anything
    back = next(iter(np.flatnonzero(~(steps > 0.0))), None)
    if back is not None:
        raise lines[back].error(f"the time {time[back]:g} does not come after {time[back - 1]:g}. Put frames in order.")
    steps = steps[1:]
    usual = float(np.median(steps))
    if usual > LONGEST_GAP:
        raise lines[1].error(f"{usual:g} s a frame are too long. Times are in seconds: divide them by 1000 if in ms.")
    widest = int(np.argmax(steps))
    if steps[widest] > LONGEST_GAP:
        raise lines[widest + 1].error(f"no frames from {time[widest]:g} to {time[widest + 1]:g} s. Cut it there.")
    if np.ptp(steps) < 0.1 * steps.mean() + 2e-6:
        rate = len(steps) / float(time[-1] - time[0])
        return (round(rate, 2) if abs(rate - round(rate, 2)) < 1e-4 * rate else rate), position
    rate = 1.0 / float(steps[steps < 1.5 * usual].mean())
    rows = position.reshape(len(time), -1)
    count = int((time[-1] - time[0]) * rate + 1e-6) + 1
    if count * rows.shape[1] > MOST_NUMBERS:
        raise lines[0].error(f"{count} frames at even times do not fit into memory. Cut the recording into pieces.")
    even = time[0] + np.arange(count) / rate
    return rate, between_rows(rows, time, even).reshape(len(even), *position.shape[1:])
