"""The events of a deck, which subscribers receive, and its replies.

A command is answered at once by Accepted, Refused or State; a Switch, Queue or Blend that was accepted is answered once
more when it has settled, a request to servos when they have replied.
"""

from collections.abc import Sequence
from typing import Literal, Self

import msgspec

from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_row import Natural
from controller.wire.messages.deck_snapshot import DeckSnapshot

EventKind = Literal[
    "motion",  # another motion, or a blend, is commanded
    "via",  # a motion on the way to it begins
    "settled",  # nothing is left of the motion before
    "overtaken",  # another command came first
    "gave up",  # a blend was given up
    "paused",
    "resumed",
    "mode",  # the joints go home, are held, are stopped in an emergency, or play again
    "recognized",  # it looks like another motion than before
    "fault",  # of an output or the deck
    "servo",  # something was done with a servo, or one is back
    "layer",  # layers were commanded
    "push",  # the simulated robot was pushed
    "fell",
    "stands",  # it stands again
    "overrun",  # ticks came more than a period late
    "replayed",  # a recorded datagram was refused
    "lost",  # a heartbeat is missing, and the deck was paused
    "ended",  # the run is over
]


class Event(msgspec.Struct, frozen=True, tag="event"):
    """Something that happened on a deck."""

    kind: EventKind
    text: str
    motion: str = ""  # the motion that it is about, or ""
    at: float = 0.0  # s since the deck's start
    number: Natural = 0  # rises by 1 from event to event of a deck; a gap means lost events
    id: Natural = 0  # always 0, as no command's
    presses: Natural = 0  # of a mode: how often the emergency stop was pressed so far, by any source


class Accepted(msgspec.Struct, frozen=True, tag="accepted"):
    """The command is being carried out."""

    id: Natural
    after: str = ""  # the one-shot that is finished first, or ""
    via: list[str] = []  # the motions on the way; msgspec copies an empty default


class Refused(msgspec.Struct, frozen=True, tag="refused"):
    """The command was not carried out, for this reason; id is 0 where it could not be read."""

    reason: str
    id: Natural = 0


class Settled(msgspec.Struct, frozen=True, tag="settled"):
    """The switch is complete; `seconds` counts from the command."""

    to: str
    seconds: float
    id: Natural


class ServoRegister(msgspec.Struct, frozen=True, array_like=True):
    """One register: its name, address and count, what that means (or ""), and whether it can be written."""

    name: str
    address: int
    count: int
    meaning: str
    writable: bool


class Registers(msgspec.Struct, frozen=True, tag="registers"):
    """What the registers of a servo hold."""

    joint: str
    model: str
    registers: list[ServoRegister]
    id: Natural = 0


class ServoOnPort(msgspec.Struct, frozen=True, array_like=True):
    """A servo that has answered; `joint` is "" for one that is not in the rig file."""

    joint: str
    servo: int
    model: str
    firmware: int


class OnPorts(msgspec.Struct, frozen=True, tag="ports"):
    """The servos on the ports of the rig at its baud rate."""

    servos: list[ServoOnPort]
    missing: list[str]  # the joints whose servo did not reply
    id: Natural = 0


class PhaseNow(msgspec.Struct, frozen=True, tag="phase"):
    """The phase of the motion and its rate."""

    motion: str
    phase: float | None  # from 0 to 1; None if the network runs by itself
    rate: float | None  # rounds a second, negative backwards; None for a one-shot, or without a phase
    id: Natural
    # When the phase was this, by the machine's steady clock, s; None if the deck does not play in real time.
    at: float | None = None


class State(DeckSnapshot, frozen=True, kw_only=True, tag="state"):
    """The status of a deck: its snapshot, and all motions of the library."""

    motions: list[str]
    id: Natural

    @classmethod
    def of(cls, snapshot: DeckSnapshot, motions: Sequence[str], id: int) -> Self:
        """The reply to the command `id`."""
        fields = {name: getattr(snapshot, name) for name in DeckSnapshot.__struct_fields__}
        return cls(motions=list(motions), id=id, **fields)


Reply = Accepted | Refused | Settled | Registers | OnPorts | State | PhaseNow | Event
SecondReply = Settled | Refused | Registers | OnPorts

_replies = msgspec.json.Decoder(Reply)


def read_reply(data: bytes) -> Reply:
    """The reply in a datagram; raises a CommandError if it is not one."""
    try:
        return _replies.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise CommandError(f"the deck's reply cannot be read ({error})") from error
