"""A number with the word that it counts: 1 frame, 2 frames."""

from __future__ import annotations


def counted(number: int, one: str) -> str:
    """The number and the word, which takes an s unless the number is 1."""
    return f"{number} {one}" if number == 1 else f"{number} {one}s"
