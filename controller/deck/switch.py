"""A switch: one motion that was commanded, and what has become of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(slots=True)
class CommandedSwitch:
    """A switch that was commanded; times in s since the deck's start, None while still to come.

    Attributes:
        to: the motion.
        commanded_s: when the command came.
        first_change_s: the first tick whose targets it changed.
        settled_s: when nothing was left of the motion before.
        after: the motion whose end is awaited first, or "".
        via: the motions on the way.
        overtaken: whether another command came before it had settled.
        blend: what is mixed in as soon as the motion is played, and its share.
        fell_back: why the blend was given up and what is played instead, or "".
    """

    to: str
    commanded_s: float
    first_change_s: float | None = None
    settled_s: float | None = None
    after: str = ""
    via: tuple[str, ...] = ()
    overtaken: bool = False
    blend: tuple[str, float] | None = None
    fell_back: str = ""
