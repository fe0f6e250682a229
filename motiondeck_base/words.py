"""Words of messages: names like a mistyped one, a number with what it counts, and text that is safe to print."""

import difflib
import re
from collections.abc import Iterable

# Of two letters changed places in a word of four a ratio of 0.75 is left; words that only share some letters have less.
ALIKE = 0.65
SHORTEST_PART = 3  # letters that count as a part of a longer name
_CONTROLS = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")  # all but tab and newline


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


def counted(number: int, one: str) -> str:
    """The number and the word, which takes an s, or es behind ch, sh and s, unless the number is 1."""
    ending = "es" if one.endswith(("ch", "sh", "s")) else "s"
    return f"{number} {one}" if number == 1 else f"{number} {one}{ending}"


def printable(text: str) -> str:
    r"""Text of a file or socket, each control character and change of writing direction spelled out, as \x1b."""
    return _CONTROLS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)
