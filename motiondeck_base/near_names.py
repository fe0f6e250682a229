"""Suggests known names that are similar to a mistyped one."""

import difflib
from collections.abc import Iterable

# Of two letters changed places in a word of four a ratio of 0.75 is left; words that only share some letters have less.
ALIKE = 0.65
SHORTEST_PART = 3  # letters that count as a part of a longer name


def near_names(name: str, known: Iterable[str], most: int = 3) -> list[str]:
    """The known names most like this one, or that have it as a part, in either case; the nearest first."""
    folded = {one.lower(): one for one in known}
    typed = name.lower()
    near = difflib.get_close_matches(typed, folded, n=most, cutoff=ALIKE)
    if len(typed) >= SHORTEST_PART:
        near += [one for one in folded if typed in one]
    return [folded[one] for one in dict.fromkeys(near)][:most]


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """ " Did you mean A, B or C?", with the space before it, or nothing where no name is near."""
    *others, last = near_names(name, known) or [""]
    return f" Did you mean {', '.join(others)}{' or ' * bool(others)}{last}?" if last else ""
