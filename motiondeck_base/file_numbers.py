"""Numbers of files that calculations cannot hold: too large, too small, or not finite."""

import math
from collections.abc import Iterator
from typing import NamedTuple

LARGEST = 1e15
SMALLEST = 1e-12


class ImpossibleNumber(NamedTuple):
    """A number that is refused: the keys and the indices (from 0) that lead to it, and the problem: "is inf; ..."."""

    place: tuple[str | int, ...]
    problem: str


def impossible_numbers(
    tree: object, smallest: float = 0.0, place: tuple[str | int, ...] = ()
) -> Iterator[ImpossibleNumber]:
    """The numbers of plain values that are not finite, beyond `LARGEST`, or not 0 but nearer to it than `smallest`."""
    if isinstance(tree, dict):
        for key, part in tree.items():
            yield from impossible_numbers(part, smallest, (*place, str(key)))
    elif isinstance(tree, list):
        for index, part in enumerate(tree):
            yield from impossible_numbers(part, smallest, (*place, index))
    elif isinstance(tree, int | float) and not isinstance(tree, bool):
        size = abs(tree)
        if isinstance(size, float) and not math.isfinite(size):
            yield ImpossibleNumber(place, f"is {tree}; it must be a finite number")
        elif size > LARGEST:
            # Of a whole number only the length: Python writes no more than 4300 digits.
            digits = 1 + int(math.log10(2.0) * (size.bit_length() - 1)) if isinstance(size, int) else 0
            shown = f"a number of about {digits} digits" if digits else f"{tree:g}"
            yield ImpossibleNumber(place, f"is {shown}; numbers go from {-LARGEST:g} to {LARGEST:g}")
        elif 0.0 < size < smallest:
            yield ImpossibleNumber(place, f"is {tree:g}; give 0, or {smallest:g} or more")


def key_path(place: tuple[str | int, ...]) -> str:
    """The keys as one word, such as "joints.1.zero"; indices are counted from 1."""
    return ".".join(str(key + 1) if isinstance(key, int) else key for key in place)
