"""Several people in one file: each is a take by name, and none is taken in silence."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import listed


class SeveralPeopleError(FileFormatError):
    """A file holds several people, and none of them was chosen."""

    def __init__(self, path: str | Path, people: Collection[str]) -> None:
        self.people = tuple(people)
        super().__init__(f"{path}: holds {len(people)} people ({listed(self.people)}). Choose one: --skeleton NAME.")


def chosen_person(path: str | Path, people: Collection[str], wanted: str | None) -> str:
    """The person of a file with several to read; FileFormatError if none of them is `wanted`."""
    if wanted is None:
        raise SeveralPeopleError(path, people)
    if wanted not in people:
        raise FileFormatError(f"{path}: no person in it is called '{wanted}' (there are: {listed(tuple(people))}).")
    return wanted
