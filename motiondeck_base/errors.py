"""What a user can do wrong, said in one line that names the place and the remedy."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class MotiondeckError(Exception):
    """A mistake that the user can mend; the command line prints it without a traceback."""


class FileFormatError(MotiondeckError):
    """A file that does not say what its format demands; the message names the file and the place."""


class UnknownNameError(MotiondeckError):
    """A name that nothing here bears; the message offers the nearest ones."""

    @classmethod
    def among(cls, kind: str, name: str, known: Iterable[str]) -> UnknownNameError:
        """The error for `name`, which is no known `kind`, with the nearest names or else all of them."""
        names = list(known)
        near = difflib.get_close_matches(name.lower(), names, n=3, cutoff=0.5)
        if near:
            return cls(f"unknown {kind} '{name}'. Did you mean {' or '.join(near)}?")
        return cls(f"unknown {kind} '{name}'. There are: {', '.join(names)}.")
