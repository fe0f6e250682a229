"""A commanded switch and its progress."""

from __future__ import annotations

from dataclasses import dataclass

from controller.wire.messages.blends import described


@dataclass(slots=True)
class CommandedSwitch:
    """A commanded switch; times are s since the deck's start, None while still to come.

    Attributes:
        to: the motion.
        commanded_s: when it was commanded.
        first_change_s: the first tick whose targets it changed.
        settled_s: when it was complete.
        after: the one-shot that is finished first, or "".
        via: the motions on the way.
        overtaken: whether another command came before it had settled.
        blend: the motions that are blended in once `to` is playing, each with its weight.
        fell_back: why the blend was given up and what is played instead, or "".
    """

    to: str
    commanded_s: float
    first_change_s: float | None = None
    settled_s: float | None = None
    after: str = ""
    via: tuple[str, ...] = ()
    overtaken: bool = False
    blend: tuple[tuple[str, float], ...] = ()
    fell_back: str = ""

    @property
    def destination(self) -> str:
        """What is played when it has settled, for a person."""
        return described(self.to, self.blend)
