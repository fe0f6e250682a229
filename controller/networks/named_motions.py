"""Motions that are looked up by name; a name that is not there is refused with the nearest one."""

from __future__ import annotations

from typing import Generic, TypeVar

from motiondeck_base.errors import UnknownNameError

Motion = TypeVar("Motion")


class NamedMotions(Generic[Motion]):
    """What plays motions, seen as a table of them.

    Args:
        motions: by name, at least one.

    Attributes:
        motions: their names.
    """

    def __init__(self, motions: dict[str, Motion]) -> None:
        self._of = motions
        self.motions = tuple(motions)

    def __getitem__(self, motion: str) -> Motion:
        if motion not in self._of:
            raise UnknownNameError.among("motion", motion, self.motions)
        return self._of[motion]
