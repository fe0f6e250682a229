"""The messages of a show: typed, and JSON on the wire.

deck/DECK           token of a deck, and its About as an answer
conductor           token of the conductor
clock               the conductor's Time as an answer
cue                 TimedCue, from the conductor
health/DECK         a deck's DeckHealth, four times a second
stop                EmergencyStopAll, from any member, and again and again from each whose deck still holds it
"""

from typing import Literal, TypeVar

import msgspec

from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.deck_snapshot import Mode

Lost = Literal["go on", "hold", "stop"]
"""What a deck does that has lost the conductor: nothing, a pause, or an emergency stop."""

StopAt = Literal["", "not reached", "holds", "reset"]
"""How far a deck is with the emergency stop that stands; "" while there is none."""

T = TypeVar("T")


class About(msgspec.Struct, frozen=True):
    """A deck."""

    robot: str
    library: str
    rate: float  # ticks of its loop a second
    rounds: dict[str, float]  # of each motion that is a loop, how long a round takes at tempo 1, s; 0 for a one-shot
    host: str = ""


class EmergencyStopAll(msgspec.Struct, frozen=True):
    """Emergency stop of all decks."""

    by: str
    id: str  # of this stop: a deck that was reset after it is not stopped by it again
    over: bool = False  # whether the conductor has gone on since


class Time(msgspec.Struct, frozen=True):
    """The time of a conductor."""

    run: str  # of the conductor; another run is another clock
    seconds: float  # the time, s
    lost: Lost  # what a deck does when the conductor does not answer any more
    after: float  # s without an answer after which that happens
    stops: list[EmergencyStopAll] = []  # the latest ones of the show


class CommonRound(msgspec.Struct, frozen=True):
    """What loops keep step with."""

    began: float  # when phase 0 was, in the conductor's time, s
    seconds: float

    def phase(self, time: float) -> float:
        """The phase at a conductor's time, [0, 1)."""
        return ((time - self.began) / self.seconds) % 1.0


class TimedCue(msgspec.Struct, frozen=True):
    """Commands at a time."""

    run: str
    number: int  # rises from cue to cue of a run
    name: str
    at: float  # when, in the conductor's time, s
    decks: list[str]
    say: list[DeckCommand]
    step: CommonRound | None = None  # what loops keep step with from then on; None for nothing


class ClockHealth(msgspec.Struct, frozen=True):
    """How well a deck knows the conductor's time: uncertainty, ms, and drift, ppm.

    The conductor's clock is ahead of the deck's by the offset, s; both count from any moment, such as a start.
    """

    uncertainty_ms: float
    drift_ppm: float
    offset_s: float = 0.0


class DeckHealth(msgspec.Struct, frozen=True):
    """The state of a deck."""

    run: str  # the conductor of the last cue that was carried out; "" for none
    cue: int  # its number; 0 for none
    motion: str  # this and the next ones as in `State`
    mode: Mode
    phase: float | None
    paused: bool
    switching: bool
    lock: str  # "" without one
    clock: ClockHealth | None  # how well the conductor's time is known; None if not at all
    problem: str = ""  # the latest refusal or cue that came too late, or ""
    problems: int = 0
    # The latest emergency stops that the deck has carried out; it was reset since unless `mode` says so.
    stops: list[EmergencyStopAll] = []


encode = msgspec.json.Encoder().encode


def read(data: bytes, kind: type[T]) -> T | None:
    """A message of a kind, or None where it is something else."""
    try:
        return msgspec.json.decode(data, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
