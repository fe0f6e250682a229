"""Messages: what a deck can be told, and what it answers; typed, and JSON on the wire.

Every command carries a number that its answers repeat. It is answered at once by Accepted, Refused or State; a Switch
that was accepted is answered once more when it has settled.
"""

from __future__ import annotations

import math
from typing import Annotated

import msgspec

from controller.errors import MotiondeckError

SLOWEST, FASTEST = 0.1, 3.0
LONGEST_NAME = 100
MOST_BYTES = 2048
"""No message is longer than this."""


Number = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]


class CommandError(MotiondeckError):
    """A command that cannot be understood or carried out; the message says what can be."""


class Switch(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="switch"):
    """Play another motion."""

    to: str
    id: Number = 0


class SetSpeed(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="speed"):
    """Play at another tempo: 1 is as fast as recorded."""

    factor: float
    id: Number = 0


class Pause(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="pause"):
    """Come to a standstill."""

    id: Number = 0


class Resume(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="resume"):
    """Go on after a pause."""

    id: Number = 0


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="stop"):
    """Bring the joints to rest and end the run."""

    id: Number = 0


class Status(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="status"):
    """Say what is played, and what could be."""

    id: Number = 0


class Accepted(msgspec.Struct, frozen=True, tag="accepted"):
    """The command is being carried out."""

    id: Number


class Refused(msgspec.Struct, frozen=True, tag="refused"):
    """Nothing was done, and why; id is 0 where the command could not be read."""

    reason: str
    id: Number = 0


class Settled(msgspec.Struct, frozen=True, tag="settled"):
    """Nothing is left of the motion before; seconds since the switch was commanded."""

    to: str
    seconds: float
    id: Number


class State(msgspec.Struct, frozen=True, tag="state"):
    """What is played: the motion, its tempo, whether a switch is under way; and all motions there are."""

    motion: str
    motions: list[str]
    speed: float
    paused: bool
    switching: bool
    id: Number


Message = Switch | SetSpeed | Pause | Resume | Stop | Status
Reply = Accepted | Refused | Settled | State

COMMANDS = "switch MOTION, speed FACTOR, pause, resume, status, stop"

encode = msgspec.json.Encoder().encode
_messages = msgspec.json.Decoder(Message)
_replies = msgspec.json.Decoder(Reply)


def read_message(data: bytes) -> Message:
    """The command in a datagram.

    Raises:
        CommandError: if it is none, or asks for what cannot be; it says what can.
    """
    if len(data) > MOST_BYTES:
        raise CommandError(f"this message is too long; {MOST_BYTES} bytes are the most")
    try:
        return checked(_messages.decode(data))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise CommandError(f"this is no command ({error}). There are: {COMMANDS}.") from error


def read_reply(data: bytes) -> Reply:
    """The reply in a datagram.

    Raises:
        CommandError: if it is none.
    """
    try:
        return _replies.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise CommandError(f"the deck's answer is not understood ({error})") from error


def checked(message: Message) -> Message:
    """The command itself, if its values make sense whatever the deck plays.

    Raises:
        CommandError: if they do not; it says what is allowed.
    """
    match message:
        case Switch(to=name) if not 0 < len(name) <= LONGEST_NAME:
            raise CommandError(f"a motion's name has 1 to {LONGEST_NAME} characters")
        case SetSpeed(factor=factor) if not (math.isfinite(factor) and SLOWEST <= factor <= FASTEST):
            raise CommandError(f"speed {factor:g} is not allowed; give a factor from {SLOWEST:g} to {FASTEST:g}")
    return message
