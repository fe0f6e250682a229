"""The state of a run at one tick: a status reply, and numbers for page and recorder.

A new value is one field of `DeckSnapshot` and its line in `SnapshotSource.take`
(`controller/loop/commands/snapshots.py`); replies, telemetry, recordings and the page have it then
(`controller/wire/snapshot_numbers.py`).
"""

from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple, get_args

import msgspec

from controller.wire.messages.arguments import MOST_BLENDED

Mode = Literal["playing", "home", "held", "emergency stop"]
MODES: tuple[Mode, ...] = get_args(Mode)
LockSource = Literal["beat", "deck", "body", "person"]
LockStage = Literal["searching", "locked", "waiting"]
LOCK_SOURCES: tuple[LockSource, ...] = get_args(LockSource)

_MOST_LISTED = 8  # motions of a way or a queue that are sent as numbers


@dataclass(frozen=True)
class Names:
    """Marks a string that is sent as its place in a list of names, -1 for none of them."""

    list: Literal["motions", "recognizable", "joints"]


@dataclass(frozen=True)
class Most:
    """Marks a sequence that is sent with at most this many items."""

    items: int


Motion = Annotated[str, Names("motions")]
Joint = Annotated[str, Names("joints")]


class BlendPart(NamedTuple):
    """A motion that is blended in, and its weight."""

    motion: Motion
    weight: float


class Recognized(NamedTuple):
    """The recognized motion, and the confidence in [0, 1)."""

    motion: Annotated[str, Names("recognizable")]
    confidence: float


class LockState(msgspec.Struct, frozen=True):
    """What the phase is locked to."""

    source: LockSource
    state: LockStage  # "searching" before it is in step, "locked" when it is, "waiting" while the body is held
    # How far the motion is behind, ms; of a body how far the body is; None if that is not known.
    error_ms: float | None = None
    per_minute: float | None = None

    def __str__(self) -> str:
        """In a few words, as in "locked to the beat of 120.0 a minute (+4 ms)"."""
        to = {"beat": "the beat", "deck": "another deck", "body": "the body", "person": "a person"}[self.source]
        beat = f" of {self.per_minute:.1f} a minute" if self.per_minute is not None else ""
        off = f" ({self.error_ms:+.0f} ms)" if self.error_ms is not None else ""
        state = {"searching": "searching for", "locked": "locked to", "waiting": "waiting for"}[self.state]
        return f"{state} {to}{beat}{off}"


class TickHealth(NamedTuple):
    """Percentiles since the start, us: lateness and work of ticks; None before the first."""

    late_p50_us: float | None = None
    late_p999_us: float | None = None
    work_p50_us: float | None = None


NO_HEALTH = TickHealth()


class DeckSnapshot(msgspec.Struct, frozen=True, kw_only=True):
    """A run at one tick. Numbers, names and tuples of both go to page and recorder; other fields do not."""

    motion: Motion  # the motion that is played or being switched to
    playing: Motion = ""  # the motion that is played now, perhaps on the way to `motion`
    # The motions that the present switch has still to begin.
    way: Annotated[tuple[Motion, ...], Most(_MOST_LISTED)] = ()
    queue: Annotated[list[Motion], Most(_MOST_LISTED)] = []
    blend: Annotated[tuple[BlendPart, ...], Most(MOST_BLENDED - 1)] = ()
    fell_back: str = ""
    tempo: float = 1.0
    commanded_tempo: float = 1.0
    phase: float | None = None  # how far the motion is, from 0 to 1; None if the network runs by itself
    inputs: dict[str, float] = {}  # the present values of the inputs that motions have besides the phase
    layers: dict[str, str] = {}  # the motion of each group of joints that has a layer
    lock: LockState | None = None  # what the phase is locked to, if it is
    paused: bool = False
    switching: bool = False
    restarts: int = 0  # how often the network lost its motion and was restarted
    at: float = 0.0  # s of the deck, the clock of its events; it waits while the joints approach the motion
    # Whether the joints follow the motion, stand at home, are held, or are held by the emergency stop.
    mode: Mode = "playing"
    approaching: bool = False  # whether the joints are on their slow way to the motion
    fallen: bool = False  # whether the simulated robot has fallen and not stood again
    seen: Recognized | None = None  # the recognized motion, if motions are recognized and one is
    mismatch_s: float = 0.0  # for how long the joints have shown another motion than the commanded one, s
    stuck: Joint = ""  # a joint that does not follow its targets, or ""
    kept_apart: int = 0  # ticks in which limbs of the robot were kept from colliding
    tick: int = 0
    run_s: float = 0.0  # s since the loop started
    clock_s: float = 0.0  # when the tick began, by the loop's clock, s
    late_us: float = 0.0  # lateness of the tick, us
    work_us: float = 0.0  # work of the tick before, us
    overruns: int = 0
    rate_hz: float = 0.0
    health: TickHealth = NO_HEALTH
