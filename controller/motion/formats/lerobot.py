"""Episodes of LeRobot's datasets, versions 2 and 3 (.parquet): a robot's joints, as they were measured.

    meta/info.json                     frames a second, and the names of what is in a column
    data/chunk-000/file-000.parquet    a row a frame, of one or several episodes (version 2: episode_000000.parquet)

Read is `observation.state`, or `action` where that has no names; where names end in .pos, only those. The options say
the unit, which the dataset does not.
"""

from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, ReadingOptions
from controller.motion.formats.tables import even_times
from controller.motion.formats.taught_clip import taught_clip
from controller.motion.joint_tree import SeveralPeopleError, chosen_person
from controller.motion.rotations import Array
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line, read_bytes

_COLUMNS = ("observation.state", "action")


def read_episode(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip:
    """The take of an episode; of several the options name one, by its number, as a person."""
    if options.up is not None:
        raise FileFormatError(f"{path}: joint angles have no axis that is up: omit the option.")
    content, (column, names, rate) = read_bytes(path), _described(Path(path))
    values, frame, episode = _columns(path, content, column)
    if values.shape != (len(frame), len(names)) or not values.size:
        raise FileFormatError(f"{path}: {values.shape} numbers in '{column}' for {len(names)} names. Fetch it again.")
    if options.unit is None:
        raise FileFormatError(f"{path}: LeRobot does not say the unit of joints: give --unit deg or --unit rad.")
    name, several = Path(path).stem, [f"{number:.0f}" for number in dict.fromkeys(episode.tolist())]
    if len(several) > 1:
        if options.person is None:
            raise SeveralPeopleError(path, several, "episodes")
        chosen = episode == float(chosen_person(path, several, options.person))
        name, frame, values = f"{name}-{options.person}", frame[chosen], values[chosen]
    joints = [place for place, one in enumerate(names) if one.endswith(".pos")] or [*range(len(names))]
    labels = options.renamed(tuple(names[place].removesuffix(".pos") for place in joints), path)
    lines = [Line(path, row, []) for row in range(1, len(frame) + 1)]
    _, angles = even_times(frame / rate, options.unit * values[:, joints], lines)
    with FileFormatError.placed(path, ". Is the unit right?"):
        return taught_clip(name, labels, rate, angles, Path(path).name)


def _described(path: Path) -> tuple[str, list[str], float]:
    """The column that is read, its names, and the frames a second."""
    file = path.resolve().parent.parent.parent / "meta" / "info.json"
    if not file.is_file():
        raise FileFormatError(f"{path}: it is no dataset of LeRobot without meta/info.json, two folders above.")
    try:
        info: Any = msgspec.json.decode(read_bytes(file))
        for column in _COLUMNS:
            names = info["features"].get(column, {}).get("names")
            names = msgspec.convert([*chain(*names.values())] if isinstance(names, dict) else names, list[str] | None)
            if names and 1.0 <= info["fps"] <= 10_000.0:
                return column, names, float(info["fps"])
    except (msgspec.MsgspecError, UnicodeDecodeError, KeyError, TypeError, AttributeError) as error:
        raise FileFormatError(f"{file}: not as LeRobot writes it ({error}). Fetch it again.") from None
    raise FileFormatError(f"{file}: no possible fps, or no names in {' or '.join(_COLUMNS)}. Write them into it.")


def _columns(path: str | Path, content: bytes, column: str) -> list[Array]:
    """The values of each row, and the numbers of its frame and its episode."""
    try:
        arrow, parquet = import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError:
        raise FileFormatError(f"{path}: Parquet needs pyarrow: pip install 'motiondeck[lerobot]'") from None
    names = [column, "frame_index", "episode_index"]
    try:
        table = parquet.read_table(arrow.BufferReader(content), columns=names)
        found = [np.array(table.column(name).to_pylist(), dtype=np.float64) for name in names]
        if all(np.isfinite(one).all() for one in found):
            return found
        raise ValueError("a number is missing")
    except (arrow.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise FileFormatError(f"{path}: cannot be read as an episode of LeRobot ({reason}). Fetch it again.") from None


FORMAT = Format(
    suffixes=(".parquet",), read=read_episode, magic=b"PAR1", matches=lambda path: path.parent.parent.name == "data"
)
