"""Messages: what a deck can be told, and what it answers; typed, and JSON on the wire.

Every command carries a number that its answers repeat. It is answered at once by Accepted, Refused or State; a Switch,
Queue or Blend that was accepted is answered once more when it has settled.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import msgspec

from motiondeck_base.errors import MotiondeckError

SLOWEST, FASTEST = 0.1, 3.0
LONGEST_RAMP = 60.0
LONGEST_NAME = 100
MOST_BYTES = 2048
"""No message is longer than this."""


Number = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]


Mode = Literal["playing", "home", "held", "emergency stop"]


class CommandError(MotiondeckError):
    """A command that cannot be understood or carried out; the message says what can be."""


class Switch(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="switch"):
    """Play another motion now, or after a motion that happens once; what was queued is forgotten.

    Attributes:
        to: the motion.
        direct: whether to go there at once and straight, however far it is.
    """

    to: str
    id: Number = 0
    direct: bool = False


class Queue(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="queue"):
    """Play a motion after what is played and queued: a loop goes round to its end, what happens once is finished."""

    to: str
    id: Number = 0


class Blend(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="blend"):
    """Play a mixture of two motions that go on for ever.

    Attributes:
        first: is switched to, if it is not played.
        second: is mixed in then.
        share: of the second, from 0 to 1.
    """

    first: str
    second: str
    share: float
    id: Number = 0


class SetSpeed(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="speed"):
    """Play at another tempo.

    Attributes:
        factor: 1 is as fast as recorded.
        over: how many seconds the change takes; 0 for as quickly as is smooth.
    """

    factor: float
    id: Number = 0
    over: float = 0.0


class Pause(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="pause"):
    """Come to a standstill."""

    id: Number = 0


class Resume(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="resume"):
    """Go on after a pause, from home, or after the emergency stop was reset."""

    id: Number = 0


class Home(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="home"):
    """Go slowly to the rest pose and stay there."""

    id: Number = 0


class EmergencyStop(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="estop"):
    """Brake every joint as hard as its limits allow, at once, and stay there until Reset."""

    id: Number = 0


class Reset(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="reset"):
    """Release the emergency stop; nothing moves before Resume, Switch or Home."""

    id: Number = 0


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="stop"):
    """Bring the joints to rest and end the run."""

    id: Number = 0


class GetStatus(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="status"):
    """Say what is played, and what could be."""

    id: Number = 0


class Accepted(msgspec.Struct, frozen=True, tag="accepted"):
    """The command is being carried out.

    Attributes:
        id: of the command.
        after: the motion whose end is awaited first, or "".
        via: the motions on the way.
    """

    id: Number
    after: str = ""
    via: list[str] = []  # msgspec copies an empty default


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
    """What is played, and what could be.

    Attributes:
        motion: what is played, or being switched to.
        motions: all there are.
        speed: the tempo.
        paused: whether it stands still on command.
        switching: whether a switch is under way.
        id: of the command.
        queue: what is played next.
        mode: whether the joints follow the motion, stand at home, are held, or are held by the emergency stop.
        blend: what is mixed into the motion, and its share.
        fell_back: why the last blend was given up and what was played instead.
        seen: which motion the measured joints look like and how surely, if that is watched and they move.
    """

    motion: str
    motions: list[str]
    speed: float
    paused: bool
    switching: bool
    id: Number
    queue: list[str] = []
    mode: Mode = "playing"
    blend: tuple[str, float] | None = None
    fell_back: str = ""
    seen: tuple[str, float] | None = None


Message = Switch | Queue | Blend | SetSpeed | Pause | Resume | Home | EmergencyStop | Reset | Stop | GetStatus
Reply = Accepted | Refused | Settled | State

COMMANDS = "switch MOTION, queue MOTION, blend A B SHARE, speed FACTOR, pause, resume, home, estop, reset, status, stop"

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
        case Switch(to=name) | Queue(to=name) if not 0 < len(name) <= LONGEST_NAME:
            raise CommandError(f"a motion's name has 1 to {LONGEST_NAME} characters")
        case Blend(first=first, second=second) if not (
            0 < len(first) <= LONGEST_NAME and 0 < len(second) <= LONGEST_NAME
        ):
            raise CommandError(f"a motion's name has 1 to {LONGEST_NAME} characters")
        case Blend(share=share) if not 0.0 <= share <= 1.0:
            raise CommandError(f"a share of {share:g} is not allowed; give one from 0 to 1")
        case SetSpeed(factor=factor) if not (math.isfinite(factor) and SLOWEST <= factor <= FASTEST):
            raise CommandError(f"speed {factor:g} is not allowed; give a factor from {SLOWEST:g} to {FASTEST:g}")
        case SetSpeed(over=over) if not 0.0 <= over <= LONGEST_RAMP:
            raise CommandError(f"a change of speed may take 0 to {LONGEST_RAMP:g} s, not {over:g}")
    return message
