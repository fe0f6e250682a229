"""Mistakes in a rig file in its own terms: the message of msgspec with line, place and allowed keys."""

import re
from collections.abc import Sequence
from pathlib import Path

from motiondeck_base.file_words import in_file_words
from motiondeck_base.near_names import did_you_mean

_QUOTED = re.compile(r'"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'')


def explain(path: str | Path, text: str, message: str, keys: Sequence[str]) -> str:
    """msgspec's message with the line and place in the file, and the allowed keys where one is unknown."""
    what, _, where = message.partition(" - at `$")
    place = re.sub(r"\[(\d+)\]", lambda found: f" {int(found[1]) + 1}", where.rstrip("`").lstrip("."))
    place = place.replace("joints ", "joint ", 1)
    unknown = re.search(r"unknown field `(.*)`", what)
    if unknown:
        hint = did_you_mean(unknown[1], keys, 1)
        what = f"unknown key '{unknown[1]}'.{hint} The keys here are {', '.join(keys)}"
    elif what.startswith("Invalid enum value"):
        allowed = {"on_exit": "'off' and 'hold'", "on_loss": "'stop' and 'go on'"}.get(place, "-1 and 1")
        what = f"{what.removeprefix('Invalid enum value ')} is not allowed; {allowed} are"
    key = unknown[1] if unknown else where.rpartition(".")[2].rstrip("`")
    line = _line(text, where, key, what)
    what = in_file_words(what)
    end = "" if what.endswith("?") else "."
    return f"{path}{f' line {line}' if line else ''}: {f'{place}: ' if place else ''}{what}{end}"


def _line(text: str, where: str, key: str, what: str) -> int | None:
    """The line of the mistake: that of the key, of the joint, or of what the message names first or last."""
    joint = re.search(r"joints\[(\d+)\]", where)
    if joint:
        return _line_of(text, key if not key.startswith("joints[") else what.split(" ", 1)[0], int(joint[1]) + 1)
    named = re.findall(r"joint (\d+) \(", what)
    if named:
        return _line_of(text, "", int(named[-1]))
    return _line_of(text, key or what.split(" ", 1)[0])


def _line_of(text: str, key: str, joint: int | None = None) -> int | None:
    """The line, counted from 1, of a key of the file or of its joint number `joint` (from 1); None if it is not found.

    Where the joint lacks that key, the line on which the joint begins.
    """
    lines = [_QUOTED.sub('""', line).partition("#")[0] for line in text.splitlines()]
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
    headed = [(row, 0) for row, line in enumerate(lines) if re.match(r"\s*\[\[\s*joints\s*\]\]", line)]
    if headed:
        return headed
    first = next((row for row, line in enumerate(lines) if re.match(r"\s*joints\s*=", line)), len(lines))
    found: list[tuple[int, int]] = []
    depth = 0
    for row in range(first, len(lines)):
        for brace in re.finditer("[{}]", lines[row]):
            if brace[0] == "{" and depth == 0:
                found.append((row, brace.start()))
            depth += 1 if brace[0] == "{" else -1
    return found


def _find(lines: list[str], key: str, start: int, end: int) -> int | None:
    given = re.compile(rf"(?:^|[\s{{,]){re.escape(key)}\s*=")
    return next((row + 1 for row in range(start, end) if given.search(lines[row])), None)
