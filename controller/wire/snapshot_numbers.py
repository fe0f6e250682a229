"""Snapshots of a run as numbers, for shared memory and recordings; the fields follow from `DeckSnapshot`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from controller.wire.messages.deck_snapshot import DeckSnapshot, Most, Names

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class _Column(NamedTuple):
    """How a value is sent: fields with their sizes, and the two directions; a plain number goes without `numbers`."""

    sizes: dict[str, int]
    numbers: Callable[[Any], list[float]]
    value: Callable[[list[float]], Any]
    plain: bool = False


class SnapshotNumbers:
    """Snapshots as numbers in fields of telemetry and recordings; the fields follow from `DeckSnapshot`.

    A name is its place in a list of names, -1 for none; None is NaN; a struct has its fields, such as `lock_error_ms`.
    """

    def __init__(self, motions: Sequence[str], *, recognizable: Sequence[str] = (), joints: Sequence[str] = ()) -> None:
        lists = {"motions": motions, "recognizable": recognizable, "joints": joints}
        hints = get_type_hints(DeckSnapshot, include_extras=True).items()
        columns = {name: column for name, hint in hints if (column := _column(name, hint, lists)) is not None}
        plain = {name: column for name, column in columns.items() if column.plain}
        others = {name: column for name, column in columns.items() if not column.plain}
        self._columns = plain | others
        self._plain = attrgetter(*plain)
        self._others = [(attrgetter(name), column.numbers) for name, column in others.items()]
        # The name of each field, and how many numbers it has.
        self.sizes = {field: size for column in self._columns.values() for field, size in column.sizes.items()}
        self.count = sum(self.sizes.values())

    def row(self, snapshot: DeckSnapshot) -> list[float]:
        """The numbers of a snapshot in the order of the fields."""
        row: list[float] = [*self._plain(snapshot)]
        for value_of, numbers in self._others:
            row += numbers(value_of(snapshot))
        return row

    def read(self, fields: Mapping[str, NDArray[np.float64]]) -> DeckSnapshot:
        """The snapshot in the fields of one state."""
        read: dict[str, Any] = {}
        for name, column in self._columns.items():
            numbers: list[float] = []
            for field in column.sizes:
                numbers += fields[field].tolist()
            read[name] = column.value(numbers)
        return DeckSnapshot(**read)


def _column(name: str, hint: Any, lists: Mapping[str, Sequence[str]]) -> _Column | None:
    """How a field of this type is sent; None for one that is not, such as a text."""
    marks: tuple[object, ...] = ()
    if get_origin(hint) is Annotated:
        hint, *marked = get_args(hint)
        marks = tuple(marked)
    if get_origin(hint) in (UnionType, Union):
        inner = _column(name, next(one for one in get_args(hint) if one is not NoneType), lists)
        return inner and _optional(inner)
    match marks:
        case (Names(list=which),):
            return _choice(name, lists[which])
        case (Most(items=most),):
            inner = _column(name, get_args(hint)[0], lists)
            return inner and _several(inner, most, get_origin(hint) or tuple)
    if get_origin(hint) is Literal:
        return _choice(name, get_args(hint))
    if hint in (float, int, bool):
        return _Column({name: 1}, lambda value: [float(value)], lambda numbers: hint(numbers[0]), plain=True)
    if isinstance(hint, type) and hasattr(hint, "__annotations__"):
        parts = get_type_hints(hint, include_extras=True).items()
        return _record(hint, {part: _column(f"{name}_{part}", kind, lists) for part, kind in parts})
    return None


def _choice(name: str, names: Sequence[str]) -> _Column:
    places = {one: float(place) for place, one in enumerate(names)}
    return _Column(
        {name: 1}, lambda v: [places.get(v, -1.0)], lambda numbers: names[int(numbers[0])] if numbers[0] >= 0.0 else ""
    )


def _optional(column: _Column) -> _Column:
    """None is NaN in all numbers."""
    none = [math.nan] * sum(column.sizes.values())
    return _Column(
        column.sizes,
        lambda value: none if value is None else column.numbers(value),
        lambda numbers: None if math.isnan(numbers[0]) else column.value(numbers),
    )


def _record(kind: type, columns: Mapping[str, _Column | None]) -> _Column:
    """A struct or named tuple: the numbers of its fields one after the other."""
    known = {part: column for part, column in columns.items() if column is not None}

    def numbers(value: object) -> list[float]:
        return [number for part, column in known.items() for number in column.numbers(getattr(value, part))]

    def value(numbers: list[float]) -> object:
        read, first = {}, 0
        for part, column in known.items():
            size = sum(column.sizes.values())
            read[part] = column.value(numbers[first : first + size])
            first += size
        return kind(**read)

    sizes = {field: size for column in known.values() for field, size in column.sizes.items()}
    return _Column(sizes, numbers, value)


def _several(column: _Column, most: int, kind: Callable[[list[Any]], Any]) -> _Column:
    """Up to `most` items: all first numbers, then all second ones; NaN where there is no item."""
    width = sum(column.sizes.values())
    none = [math.nan] * (most * width)

    def numbers(value: Sequence[object]) -> list[float]:
        if not value:
            return none
        rows = [column.numbers(item) for item in value[:most]]
        rows += [[math.nan] * width] * (most - len(rows))
        return [row[place] for place in range(width) for row in rows]

    def value(numbers: list[float]) -> object:
        rows = [numbers[item::most] for item in range(most) if not math.isnan(numbers[item])]
        return kind([column.value(row) for row in rows])

    return _Column(dict.fromkeys(column.sizes, most), numbers, value)
