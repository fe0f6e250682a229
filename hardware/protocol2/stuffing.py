"""Byte stuffing: keeps the header FF FF FD out of a frame's body, so that a header always means a new frame.

    stuff:    FF FF FD     ->  FF FF FD FD
    unstuff:  FF FF FD FD  ->  FF FF FD

The pattern cannot overlap itself, and a stuffed FD follows an FD, so it never completes another pattern: one pass from
left to right is the same as scanning the output, and the two functions are exact inverses for any bytes.
"""

from __future__ import annotations

_PATTERN = b"\xff\xff\xfd"
_STUFFED = b"\xff\xff\xfd\xfd"


def stuff(body: bytes) -> bytes:
    """The body as it goes onto the wire; it holds no FF FF FD without an FD behind it."""
    return body.replace(_PATTERN, _STUFFED)


def unstuff(body: bytes) -> bytes:
    """The body as it was before `stuff`."""
    return body.replace(_STUFFED, _PATTERN)
