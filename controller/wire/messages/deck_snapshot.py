"""The state of a run at one tick: taken from its parts, sent as a status reply, and as numbers to page and recorder.

A new value is one field of `DeckSnapshot` and its line in `SnapshotSource.take`; replies, telemetry, recordings and the
page have it then.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    NamedTuple,
    Protocol,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

import msgspec

from controller.wire.messages.blends import MOST_BLENDED
from controller.wire.messages.lock_state import LockState

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Mode = Literal["playing", "home", "held", "emergency stop"]
MODES: tuple[Mode, ...] = get_args(Mode)

_MOST_LISTED = 8  # motions of a way or a queue that are sent as numbers


@dataclass(frozen=True)
class _Names:
    """Marks a string that is sent as its place in a list of names, -1 for none of them."""

    list: Literal["motions", "recognizable", "joints"]


@dataclass(frozen=True)
class _Most:
    """Marks a sequence that is sent with at most this many items."""

    items: int


Motion = Annotated[str, _Names("motions")]
Joint = Annotated[str, _Names("joints")]


class BlendPart(NamedTuple):
    """A motion that is blended in, and its weight."""

    motion: Motion
    weight: float


class Recognized(NamedTuple):
    """The recognized motion, and the confidence in [0, 1)."""

    motion: Annotated[str, _Names("recognizable")]
    confidence: float


class TickHealth(NamedTuple):
    """Percentiles since the start, us: lateness and work of ticks; None before the first."""

    late_p50_us: float | None = None
    late_p999_us: float | None = None
    work_p50_us: float | None = None


_NO_HEALTH = TickHealth()


class DeckSnapshot(msgspec.Struct, frozen=True, kw_only=True):
    """A run at one tick. Numbers, names and tuples of both go to page and recorder; `inputs` and texts do not.

    Attributes:
        motion: the motion that is played or being switched to.
        playing: the motion that is played now, perhaps on the way to `motion`.
        way: the motions that the present switch has still to begin.
        phase: how far the motion is, from 0 to 1; None if the network runs by itself.
        inputs: the present values of the inputs that motions have besides the phase.
        lock: what the phase is locked to, if it is.
        restarts: how often the network lost its motion and was restarted.
        at: s of the deck, the clock of its events; it waits while the joints approach the motion.
        mode: whether the joints follow the motion, stand at home, are held, or are held by the emergency stop.
        approaching: whether the joints are on their slow way to the motion.
        fallen: whether the simulated robot has fallen and not stood again.
        seen: the recognized motion, if motions are recognized and one is.
        mismatch_s: for how long the joints have shown another motion than the commanded one, s.
        stuck: a joint that does not follow its targets, or "".
        kept_apart: ticks in which limbs of the robot were kept from colliding.
        run_s: s since the loop started.
        clock_s: when the tick began, by the loop's clock, s.
        late_us, work_us: lateness of the tick, and work of the tick before, us.
    """

    motion: Motion
    playing: Motion = ""
    way: Annotated[tuple[Motion, ...], _Most(_MOST_LISTED)] = ()
    queue: Annotated[list[Motion], _Most(_MOST_LISTED)] = []
    blend: Annotated[tuple[BlendPart, ...], _Most(MOST_BLENDED - 1)] = ()
    fell_back: str = ""
    tempo: float = 1.0
    commanded_tempo: float = 1.0
    phase: float | None = None
    inputs: dict[str, float] = {}
    lock: LockState | None = None
    paused: bool = False
    switching: bool = False
    restarts: int = 0
    at: float = 0.0
    mode: Mode = "playing"
    approaching: bool = False
    fallen: bool = False
    seen: Recognized | None = None
    mismatch_s: float = 0.0
    stuck: Joint = ""
    kept_apart: int = 0
    tick: int = 0
    run_s: float = 0.0
    clock_s: float = 0.0
    late_us: float = 0.0
    work_us: float = 0.0
    overruns: int = 0
    rate_hz: float = 0.0
    health: TickHealth = _NO_HEALTH


class DeckState(Protocol):
    """The state of a deck."""

    time: float

    @property
    def motions(self) -> Sequence[str]:
        """The names of its motions."""
        ...

    @property
    def motion(self) -> str:
        """The motion that is played or being switched to."""
        ...

    @property
    def playing(self) -> str:
        """The motion that is played now, perhaps on the way to `motion`."""
        ...

    @property
    def way(self) -> Sequence[str]:
        """The motions that the present switch has still to begin."""
        ...

    @property
    def queue(self) -> list[str]:
        """The motions that are played next."""
        ...

    @property
    def blend(self) -> tuple[tuple[str, float], ...]:
        """The motions that are blended in, each with its weight."""
        ...

    @property
    def fell_back(self) -> str:
        """Why the last blend was given up and what was played instead, or ""."""
        ...

    @property
    def tempo(self) -> float:
        """The present tempo."""
        ...

    @property
    def commanded_tempo(self) -> float:
        """The tempo that was commanded."""
        ...

    @property
    def phase(self) -> float | None:
        """How far the motion is, from 0 to 1; None if that is not known."""
        ...

    @property
    def inputs(self) -> dict[str, float]:
        """The present values of inputs besides the phase."""
        ...

    @property
    def lock_state(self) -> LockState | None:
        """What the phase is locked to, if it is."""
        ...

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        ...

    @property
    def paused(self) -> bool:
        """Whether it is paused."""
        ...

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        ...


class RunMode(Protocol):
    """The mode of a run; see `DeckSnapshot`."""

    @property
    def mode(self) -> Mode:
        """Of the joints."""
        ...

    @property
    def approaching(self) -> bool:
        """Whether the joints are on their slow way to the motion."""
        ...


class LoopFigures(Protocol):
    """The figures of a loop; see `controller.loop.loop.LoopState`."""

    tick: int
    seconds: float
    began_ns: int
    late_ns: int
    work_ns: int
    overruns: int

    @property
    def rate(self) -> float:
        """Ticks per second since the start."""
        ...


class RecognitionState(Protocol):
    """Recognition during a run; see `DeckSnapshot`."""

    @property
    def seen(self) -> Recognized | None:
        """The recognized motion."""
        ...

    @property
    def mismatch_s(self) -> float:
        """For how long the joints have shown another motion than the commanded one, s."""
        ...

    @property
    def stuck(self) -> str:
        """A joint that does not follow its targets, or ""."""
        ...


class FallingBody(Protocol):
    """A simulated body that can fall."""

    fallen: bool


@dataclass
class SnapshotSource:
    """The parts of a run that its snapshots are taken from; only the deck is needed."""

    deck: DeckState
    body: FallingBody | None = None
    recognition: RecognitionState | None = None
    kept_apart: Callable[[], int] | None = None  # counts the ticks in which limbs were kept from colliding
    loop: LoopFigures | None = None
    health: TickHealth = _NO_HEALTH  # the last percentiles, set from outside

    def take(self, run: RunMode | None = None) -> DeckSnapshot:
        """The present state of a run in this mode."""
        deck, loop, recognition = self.deck, self.loop, self.recognition
        return DeckSnapshot(
            motion=deck.motion,
            playing=deck.playing,
            way=tuple(deck.way),
            queue=deck.queue,
            blend=tuple(map(BlendPart._make, deck.blend)),
            fell_back=deck.fell_back,
            tempo=deck.tempo,
            commanded_tempo=deck.commanded_tempo,
            phase=deck.phase,
            inputs=deck.inputs,
            lock=deck.lock_state,
            paused=deck.paused,
            switching=not deck.settled,
            restarts=deck.restarts,
            at=deck.time,
            mode=run.mode if run is not None else "playing",
            approaching=run is not None and run.approaching,
            fallen=self.body is not None and self.body.fallen,
            seen=recognition.seen if recognition is not None else None,
            mismatch_s=recognition.mismatch_s if recognition is not None else 0.0,
            stuck=recognition.stuck if recognition is not None else "",
            kept_apart=self.kept_apart() if self.kept_apart is not None else 0,
            tick=loop.tick if loop is not None else 0,
            run_s=loop.seconds if loop is not None else 0.0,
            clock_s=1e-9 * loop.began_ns if loop is not None else 0.0,
            late_us=1e-3 * loop.late_ns if loop is not None else 0.0,
            work_us=1e-3 * loop.work_ns if loop is not None else 0.0,
            overruns=loop.overruns if loop is not None else 0,
            rate_hz=loop.rate if loop is not None else 0.0,
            health=self.health,
        )


class _Column(NamedTuple):
    """How a value is sent as numbers: the fields with their sizes, and the two directions.

    A plain number is sent as it is, without a call of `numbers`.
    """

    sizes: dict[str, int]
    numbers: Callable[[Any], list[float]]
    value: Callable[[list[float]], Any]
    plain: bool = False


class SnapshotNumbers:
    """Snapshots as numbers in fields of telemetry and recordings; the fields follow from `DeckSnapshot`.

    A name is its place in a list of names, -1 for none; None is NaN; a struct has a field for each of its fields, such
    as `lock_error_ms`.

    Attributes:
        sizes: the name of each field, and how many numbers it has.
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
        return _optional(_column(name, next(one for one in get_args(hint) if one is not NoneType), lists))
    match marks:
        case (_Names(list=which),):
            return _choice(name, lists[which])
        case (_Most(items=most),):
            return _several(_column(name, get_args(hint)[0], lists), most, get_origin(hint) or tuple)
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
        {name: 1},
        lambda value: [places.get(value, -1.0)],
        lambda numbers: names[int(numbers[0])] if numbers[0] >= 0.0 else "",
    )


def _optional(column: _Column | None) -> _Column | None:
    """None is NaN in all numbers."""
    if column is None:
        return None
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


def _several(column: _Column | None, most: int, kind: Callable[[list[Any]], Any]) -> _Column | None:
    """Up to `most` items: all first numbers, then all second ones; NaN where there is no item."""
    if column is None:
        return None
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
