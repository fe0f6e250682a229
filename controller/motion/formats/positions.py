"""CSV tables of positions: time in s, then x, y, z of joints or of markers, m, as `writing` writes them.

    time_s,root.x,root.y,root.z,lhipjoint.x, ...
    0.000000,0.1,0.2,0.9, ...

Also tables of other programs: with semicolons or tabs (then decimals may have a comma), quotes, comment lines with #,
`time` or `t` for `time_s`, `root_x`, `root x` or `rootX` for `root.x`, and a body in cm or mm.

A table that begins with `root` is a body: each column is the end of a bone. The bones are found from the distances:
the parent of a joint is the earlier joint at the most constant distance, and of equally constant ones the nearest.
Bones called "A-B" and "A-C" start in one joint, as `joint_tree` names them. Twists are chosen by `orientation`. But if
the points called hips or thighs lie in the hips, near the root, all are points in joints, as in tables without a root.

Our tables have z up. In others the body tells the vertical axis, which of a camera points down.
"""

import re
from pathlib import Path

import numpy as np

from controller.motion.clip import AS_FOUND, Clip, Format, Markers, ReadingOptions, unit_of_size
from controller.motion.formats.markers.joint_points import joint_points, turned_over
from controller.motion.formats.tables import TIMES, even_times, first_row, heading, numbers
from controller.motion.orientation import orient
from controller.motion.rest_pose import RecordedBody, rest_skeleton
from controller.motion.rotations import Array, continuous, normalise
from controller.motion.skeleton import Skeleton
from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import Line

MOST_COLUMNS = 3000
COMPARED = 400  # frames in which distances are compared
WRITTEN = 1e-5  # m: files have six digits, so a distance that varies by less is constant
NO_LENGTH = 1e-5  # m
IN_HIP = 0.5  # thighs: a point this near to the root is no knee
_COLUMN = re.compile(r"(.+?)[._ :]?([xyz])", re.IGNORECASE)


def read_positions(path: str | Path, options: ReadingOptions = AS_FOUND) -> Clip | Markers:
    """The body or the markers of a CSV table."""
    columns, rate, position, ours = _table(path)
    is_body = columns[0].lower() == "root"
    position *= options.unit or (unit_of_size(position) if len(columns) > 1 else 1.0)
    names = options.renamed(columns, path)
    up = options.up or ("z" if ours else None)
    points = Markers(names, rate, position, up, Path(path).name)
    if not is_body or _in_joints(points):
        return points if up else turned_over(points)
    if len(names) < 2 or np.isnan(position).any():
        raise FileFormatError(f"{path}: a body needs its root and all other joints in every frame. Fill the gaps.")
    name = Path(path).stem
    body = _body(names[1:], _parents(names, position), position)
    skeleton, root, rotation, *_ = rest_skeleton(name, body, 1.0, up)
    return Clip(name, skeleton, rate, root, continuous(rotation), Path(path).name)


def _in_joints(points: Markers) -> bool:
    """Whether the points of a table with a root lie in the joints of their names, not at the ends of bones."""
    joints, root = joint_points(points), points.position[:, 0]

    def apart(one: Array, other: Array) -> float:
        return float(np.nanmedian(np.linalg.norm(one - other, axis=-1)))

    return bool(joints) and all(
        apart(joints[side + "hip"], root) < IN_HIP * apart(joints[side + "hip"], joints[side + "kne"]) for side in "lr"
    )


def is_table(path: Path) -> bool:
    """Whether a .csv is a table of positions, by its first line."""
    columns = first_row(path)
    return len(columns) > 1 and columns[0].lower() in TIMES and _COLUMN.fullmatch(columns[1]) is not None


def _table(path: str | Path) -> tuple[tuple[str, ...], float, Array, bool]:
    """Names, rate, Hz, positions (T, N, 3), NaN where a cell is empty, and whether `writing` names columns so."""
    head, rows, separator, _ = heading(path)
    columns = head.words
    if columns[0].lower() not in TIMES or len(columns) < 4 or len(columns) % 3 != 1 or len(columns) > MOST_COLUMNS:
        raise head.error(
            "expected 'time_s' and then x, y and z of each joint, such as 'root.x,root.y,root.z'. Write it so, or "
            "export the recording as .bvh, .c3d or .trc."
        )
    found = [_COLUMN.fullmatch(column) for column in columns[1:]]
    named = [(column[1], column[2].lower()) for column in found if column is not None]
    names = tuple(name for name, _ in named[::3])
    if named != [(name, axis) for name in names for axis in "xyz"] or len(set(names)) * 3 < len(found):
        raise head.error("expected x, y and z of each joint side by side, no two joints alike.")
    table = numbers(path, rows, len(columns), separator)
    time, position = table[:, 0], table[:, 1:].reshape(len(rows), -1, 3)
    rate, position = even_times(time, position, [Line(path, number, []) for number, _ in rows])
    position[np.isnan(position).any(axis=-1)] = np.nan
    ours = columns[0] == "time_s" and columns[1::3] == [f"{name}.x" for name in names]
    return names, rate, position, ours


def _parents(names: tuple[str, ...], position: Array) -> list[int]:
    seen = position[:: max(1, len(position) // COMPARED)]
    start = [name.partition("-")[0] if "-" in name else name for name in names]
    parent: dict[int, int] = {}
    for joint in range(1, len(names)):
        if joint in parent:
            continue
        together = [other for other in range(joint, len(names)) if start[other] == start[joint]]
        apart = np.sqrt(np.square(seen[:, None, :joint] - seen[:, together, None]).sum(-1))
        varies = apart.std(axis=0).max(axis=0)
        keeps = varies <= max(WRITTEN, 1.01 * float(varies.min()))
        nearest = int(np.argmin(np.where(keeps, apart.mean(axis=(0, 1)), np.inf)))
        parent |= dict.fromkeys(together, nearest)
    return [parent[joint] for joint in range(1, len(names))]


def _body(names: tuple[str, ...], parent: list[int], position: Array) -> RecordedBody:
    """Bones between joints (T, 1 + B, 3) with these parents; the zero pose is the first frame."""
    line = position[:, 1:] - position[:, parent]
    length = np.median(np.sqrt(np.square(line).sum(-1)), axis=0)
    direction = normalise(line)
    for bone, above in enumerate(parent):
        if length[bone] < NO_LENGTH:  # has no direction: moves with its parent
            length[bone] = 0.0
            direction[:, bone] = direction[:, above - 1] if above > 0 else np.array([0.0, 0.0, 1.0])
    skeleton = Skeleton("", names, np.array(parent) - 1, direction[0], length)
    vector = direction[0] * length[:, None]
    return RecordedBody(names, skeleton.parent, vector, position[:, 0], orient(skeleton, direction))


FORMAT = Format(suffixes=(".csv",), read=read_positions, general=True, matches=is_table)
