"""Line numbers in a rig file, for error messages: the line of a key."""

from __future__ import annotations

import re

_STRING = re.compile(r'"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'')


def line_of(text: str, key: str, joint: int | None = None) -> int | None:
    """The line, counted from 1, of a key of the file or of its joint number `joint` (from 1); None if it is not found.

    Where the joint lacks that key, the line on which the joint begins.
    """
    lines = [_STRING.sub('""', line).partition("#")[0] for line in text.splitlines()]
    starts = _joint_starts(lines)
    if joint is None:
        return _find(lines, key, 0, starts[0][0] if starts else len(lines)) or _find(lines, key, 0, len(lines))
    if joint > len(starts):
        return None
    row, column = starts[joint - 1]
    end_row, end_column = starts[joint] if joint < len(starts) else (len(lines) - 1, None)
    part = [*lines[: end_row + 1]]
    part[end_row] = part[end_row][:end_column]
    part[row] = " " * column + part[row][column:]
    return (_find(part, key, row, end_row + 1) if key else None) or row + 1


def _joint_starts(lines: list[str]) -> list[tuple[int, int]]:
    """Row and column, from 0, at which each joint begins."""
    headed = [(row, 0) for row, line in enumerate(lines) if re.match(r"\s*\[\[\s*joints\s*\]\]", line)]
    if headed:
        return headed
    first = next((row for row, line in enumerate(lines) if re.match(r"\s*joints\s*=", line)), len(lines))
    return [(row, brace.start()) for row in range(first, len(lines)) for brace in re.finditer("{", lines[row])]


def _find(lines: list[str], key: str, start: int, end: int) -> int | None:
    """The line from 1 in rows start to end - 1 in which a key is given a value."""
    given = re.compile(rf"(?:^|[\s{{,]){re.escape(key)}\s*=")
    return next((row + 1 for row in range(start, end) if given.search(lines[row])), None)
