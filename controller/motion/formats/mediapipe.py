"""Tables of MediaPipe's 33 pose landmarks (.csv), as scripts write them: one line a frame, or one a landmark.

    timestamp,left_hip_x,left_hip_y,left_hip_z,left_hip_visibility,...       or LEFT_HIP_x, x23, landmark_23_x
    frame,t_ms,lm_id,x_px,y_px,z_norm,visibility,wx_m,wy_m,wz_m              or landmark, landmark_name

Of a table that has both, the world landmarks are read: metres, the middle between the hips at the origin, y down
(MediaPipe documentation, "Pose landmark detection"). Image coordinates, which have no depth in metres, are refused.
"""

import re
from pathlib import Path
from typing import TypeAlias

import numpy as np

from controller.motion.clip import AS_FOUND, FARTHEST, MOST_NUMBERS, Format, Markers, ReadingOptions
from controller.motion.formats.joint_arrays import MEDIAPIPE
from controller.motion.formats.markers.joint_points import turned_over
from controller.motion.formats.tables import even_times, first_row, heading, words_of
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, shortened

_TIMES = ("time", "t", "timestamp", "seconds", "sec")  # besides, with an s or ms at the end
_LANDMARK = ("landmark", "lm", "landmarkid", "lmid", "landmarkname", "landmarkindex", "lmindex")
_INDEX = {re.sub("[^a-z]", "", name): index for index, name in enumerate(MEDIAPIPE)}
_COORDINATE = re.compile(r"(w?)(?:world)?([xyz])(?:m|world|3d)?", re.IGNORECASE)
_WIDE = re.compile(r"(world)?(?:landmark|lm|point|pose)?(?:(\d+|[a-z]+?)([xyz])|([xyz])(\d+))(3d|world|m)?")
_LEAST = 20  # landmarks of the 33: some scripts leave out the face
_CENTRED, _DEEP = 0.05, 0.03  # m from the origin; depth of a body over its height
Columns: TypeAlias = dict[int, list[int]]
"""The columns of x, y and z by landmark."""


def read_mediapipe(path: str | Path, options: ReadingOptions = AS_FOUND) -> Markers:
    """The landmarks as points in joints."""
    head, texts, separator, _ = heading(path)
    if not 0 < len(texts) * len(head.words) <= MOST_NUMBERS:
        raise FileFormatError(f"{path}: {len(texts)} lines are no recording. Write it again, or cut it.")
    rows = [Line(path, number, words_of(text, separator)) for number, text in texts]
    heads = [_plain(word) for word in head.words]
    clock = next((heads.index(word + end) for word in _TIMES for end in ("ms", "s", "") if word + end in heads), None)
    if clock is None:
        raise head.error("no column of times. Add one called time_s: the number of the frame over the rate.")
    if short := next((row for row in rows if len(row.words) != len(heads)), None):
        raise short.error(f"{len(short.words)} values, but the first line names {len(heads)}. Write it again.")
    time = np.array([row.number_from(row.words[clock]) for row in rows])
    if wide := _wide(heads):
        position = np.full((len(rows), len(MEDIAPIPE), 3), np.nan)
        for landmark, columns in wide.items():
            position[:, landmark] = [_numbers(row, columns) for row in rows]
    else:
        time, rows, position = _long(heads, rows, time)
    if heads[clock].endswith("ms") or (not heads[clock].endswith("s") and np.median(np.diff(time)) > 1.0):
        time = time * 0.001
    position[(position == 0.0).all(axis=(1, 2))] = np.nan  # no person was seen
    rate, position = even_times(time, position, rows)
    if np.isnan(position[:, 23:25]).all():
        raise FileFormatError(f"{path}: no hips were ever seen. Give another recording.")
    _check_world(path, position)
    names = options.renamed(MEDIAPIPE, path)
    points = Markers(names, rate, position * (options.unit or 1.0), options.up, Path(path).name)
    return points if options.up else turned_over(points)


def _plain(word: str) -> str:
    return re.sub("[^a-z0-9]", "", word.lower())


def _landmarks(words: list[str]) -> list[int]:
    """The landmarks by their names, or numbers from 0 or from 1; -1 for any other word."""
    numbers = [int(word) if word.isdecimal() and len(word) < 3 else -1 for word in words]
    first = 1 if 0 not in numbers and len(MEDIAPIPE) in numbers else 0
    plain = [re.sub("[^a-z]", "", word) for word in words]
    found = [n - first if n >= first else _INDEX.get(name, -1) for n, name in zip(numbers, plain, strict=True)]
    return [landmark if landmark < len(MEDIAPIPE) else -1 for landmark in found]


def _wide(heads: list[str]) -> Columns:
    """The columns of each landmark in a table with one line a frame; empty for another table."""
    parts = [(column, part) for column, head in enumerate(heads) if (part := _WIDE.fullmatch(head))]
    landmarks = _landmarks([part[2] or part[5] for _, part in parts])
    found: dict[tuple[bool, int], dict[str, int]] = {}
    for (column, part), landmark in zip(parts, landmarks, strict=True):
        if landmark >= 0:
            found.setdefault((bool(part[1] or part[6]), landmark), {})[part[3] or part[4]] = column
    for world in (True, False):
        whole = {of: [axes[a] for a in "xyz"] for (kind, of), axes in found.items() if (kind, len(axes)) == (world, 3)}
        if len(whole) >= _LEAST:
            return whole
    return {}


def _long(heads: list[str], rows: list[Line], time: Array) -> tuple[Array, list[Line], Array]:
    """Times, the first line of each, and positions (T, 33, 3) from a table with one line a landmark."""
    which = next((heads.index(word) for word in _LANDMARK if word in heads), None)
    axes: dict[tuple[bool, str], int] = {}
    for column, head in enumerate(heads):
        if part := _COORDINATE.fullmatch(head):
            axes[bool(part[1]) or "world" in head, part[2]] = column
    columns = next(([axes[w, a] for a in "xyz"] for w in (True, False) if all((w, a) in axes for a in "xyz")), None)
    if which is None or columns is None:
        raise Line(rows[0].path, 1, []).error("expected x, y and z of MediaPipe's 33 landmarks. Write it so.")
    times, frame = np.unique(time, return_inverse=True)
    position = np.full((len(times), len(MEDIAPIPE), 3), np.nan)
    for row, at, landmark in zip(rows, frame, _landmarks([_plain(row.words[which]) for row in rows]), strict=True):
        if landmark < 0:
            raise row.error(f"'{shortened(row.words[which])}' is none of MediaPipe's 33 landmarks. Write it again.")
        if not np.isnan(position[at, landmark]).all():
            raise row.error(f"'{shortened(row.words[which])}' comes twice in this frame. Write each person alone.")
        position[at, landmark] = _numbers(row, columns)
    return times, [rows[index] for index in np.unique(frame, return_index=True)[1]], position


def _numbers(row: Line, columns: list[int]) -> list[float]:
    return row.numbers_or_gaps((row.words[column] for column in columns), FARTHEST)


def _check_world(path: str | Path, position: Array) -> None:
    """FileFormatError for image coordinates: pixels, or shares of the image's width and height."""
    seen = position[~np.isnan(position).any(axis=(1, 2))]
    hips = position[:, 23:25].mean(axis=1)
    if len(seen) == 0 or np.nanmedian(np.abs(hips)) < _CENTRED:
        return
    low, high = np.quantile(seen[..., :2], [0.02, 0.98])
    height, depth = np.median(np.ptp(seen, axis=1), axis=0)[1:]
    if (low >= 0.0 and high <= 1.0) or depth < _DEEP * height:
        raise FileFormatError(
            f"{path}: image coordinates, without a depth in metres. Write pose_world_landmarks, not pose_landmarks."
        )


def _is_mediapipe(path: Path) -> bool:
    heads = [_plain(word) for word in first_row(path)]
    return bool(_wide(heads)) or (any(word in heads for word in _LANDMARK) and any(map(_COORDINATE.fullmatch, heads)))


FORMAT = Format(suffixes=(".csv",), read=read_mediapipe, matches=_is_mediapipe)
