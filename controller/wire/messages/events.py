"""Events of a deck, which subscribers receive."""

from typing import Literal

import msgspec

from controller.wire.messages.command_row import Natural

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
