"""Messages: the commands that a deck takes and the replies that it gives; typed, and JSON on the wire.

Every command carries a number that its replies repeat. It is answered at once by Accepted, Refused or State; a Switch,
Queue or Blend that was accepted is answered once more when it has settled, a look at servos when they have answered.
Who subscribes gets Events, until it leaves.
`command_table` has what a person types for each command, the ranges of its arguments and when it is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal, get_args

import msgspec

from motiondeck_base.errors import MotiondeckError

MOST_BYTES = 2048
"""No command is longer than this."""

Number = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]

Mode = Literal["playing", "home", "held", "emergency stop"]


class CommandError(MotiondeckError):
    """A command that cannot be read, or an argument out of its range; the message names what is allowed."""


class Switch(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="switch"):
    """Play another motion now, or when a one-shot has ended; the queue is cleared.

    Attributes:
        to: the motion.
        direct: whether to go there at once and straight, however far it is.
    """

    to: str
    id: Number = 0
    direct: bool = False


class Queue(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="queue"):
    """Play a motion after the present and the queued ones: a loop goes round to its end, a one-shot is finished."""

    to: str
    id: Number = 0


class Blend(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="blend"):
    """Play a blend of loops.

    Attributes:
        first: the motion that is switched to first, if it is not playing.
        second: the motion that is blended in then.
        weight: the blend weight of the second, from -0.3 to 1.3; "share" on the wire.
        also: further motions that are blended in, each with its weight; then no weight is below 0 or above 1.
    """

    first: str
    second: str
    weight: float = msgspec.field(name="share")
    id: Number = 0
    also: tuple[tuple[str, float], ...] = ()

    @property
    def motions(self) -> tuple[str, ...]:
        """All its motions, the first first."""
        return self.first, self.second, *(name for name, _ in self.also)


def described(first: str, blend: Sequence[tuple[str, float]]) -> str:
    """A motion and what is blended into it, for a person: "walk with 0.30 of jog and 0.20 of waltz"."""
    parts = [f"{weight:.2f} of {name}" for name, weight in blend]
    return f"{first} with {' and '.join(parts)}" if parts else first


class SetTempo(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="tempo"):
    """Play at another tempo.

    Attributes:
        factor: 1 is as fast as recorded, 0 stands still, negative plays backwards.
        over: how many seconds the change takes; 0 for as quickly as is smooth.
    """

    factor: float
    id: Number = 0
    over: float = 0.0


class Jump(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="jump"):
    """Go to a phase of the motion that is played, through a join.

    Attributes:
        phase: from 0 to 1.
    """

    phase: float
    id: Number = 0


class SetInput(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="input"):
    """Give an input of the motions another value.

    Attributes:
        name: of the input, such as "speed".
        value: in its own unit.
    """

    name: str
    value: float
    id: Number = 0


class GiveBeat(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="beat"):
    """A beat of what the motion is to be locked to; the first one locks it, if it is not locked to beats yet.

    Attributes:
        ago: how many seconds ago it was; negative for one that is still to come.
    """

    id: Number = 0
    ago: float = 0.0


LockSource = Literal["beat", "deck", "body"]
LockStage = Literal["searching", "locked", "waiting"]
LOCK_SOURCES: tuple[LockSource, ...] = get_args(LockSource)
LOCK_STAGES: tuple[LockStage, ...] = get_args(LockStage)


class LockPhase(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="lock"):
    """Lock the phase of the motion to beats, to another deck, or to the measured joints.

    Attributes:
        source: which of them.
        phase: the phase that falls on a beat, or how far to be ahead of the other deck.
        steps: how many beats a round of the motion has; 0 for what keeps the tempo nearest to 1.
    """

    source: LockSource
    id: Number = 0
    phase: float = 0.0
    steps: int = 0


class Unlock(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="unlock"):
    """Play at the commanded tempo again."""

    id: Number = 0


class Pause(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="pause"):
    """Come to a standstill."""

    id: Number = 0


class StepOn(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="step"):
    """Go on in a pause, and stand still again.

    Attributes:
        seconds: of the motion; 0 for one tick.
    """

    id: Number = 0
    seconds: float = 0.0


class Resume(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="resume"):
    """Go on after a pause, from home, or after the emergency stop was reset."""

    id: Number = 0


class Home(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="home"):
    """Go slowly to the rest pose and stay there."""

    id: Number = 0


class EmergencyStop(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="estop"):
    """Brake every joint at once, as hard as its limits allow, and hold it until Reset."""

    id: Number = 0


class Reset(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="reset"):
    """Release the emergency stop; nothing moves before Resume, Switch or Home.

    Attributes:
        code: from another machine, what the refusal of a reset without one says; it belongs to one emergency stop.
    """

    id: Number = 0
    code: float = 0.0


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="stop"):
    """Bring the joints to rest and end the run."""

    id: Number = 0


class Heartbeat(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="heartbeat"):
    """Pause when the sender is not heard from any more, whatever it sends.

    Attributes:
        within: s in which it will be heard from again; 0 ends this.
    """

    within: float
    id: Number = 0


class AlignTicks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="align"):
    """Move the ticks of the loop onto the multiples of their period on another clock.

    Attributes:
        here: a time of this machine's steady clock, s.
        there: the time of the other clock then, s.
    """

    here: float
    there: float
    id: Number = 0


class Subscribe(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="subscribe"):
    """Ask for Events from now on; over a network again within a minute."""

    id: Number = 0


class GetStatus(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="status"):
    """Ask for the State."""

    id: Number = 0


class GetPhase(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="phase"):
    """Ask for the PhaseNow."""

    id: Number = 0


class ServoTorque(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="torque"):
    """Take the torque off a servo of the rig, or set it up again and switch it on where it stands.

    Attributes:
        joint: its name in the rig file.
        to: on or off.
    """

    joint: str
    to: Literal["on", "off"]
    id: Number = 0


class RestartServo(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="restart"):
    """Restart a servo of the rig, and set it up again; the others hold meanwhile."""

    joint: str
    id: Number = 0


class ReadRegisters(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="registers"):
    """Read all registers of a servo of the rig; answered once more by Registers."""

    joint: str
    id: Number = 0


class WriteRegister(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="write"):
    """Write a register of a servo whose torque was switched off; answered once more by Registers.

    Attributes:
        joint: its name in the rig file.
        register: its name in the control table.
        count: the new value, in the register's own counts.
    """

    joint: str
    register: str
    count: int
    id: Number = 0


class ScanPorts(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="scan"):
    """Ask who is on the ports of the rig, while all servos hold; answered once more by OnPorts."""

    id: Number = 0


Side = Literal["front", "back", "left", "right"]
SIDES: tuple[Side, ...] = get_args(Side)


class Push(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="push"):
    """Push the simulated body.

    Attributes:
        side: of the body, where the push meets it.
        impulse: N s; 0 for one that a person would have to step against.
        towards: where it drives the body, rad from the world's x to its y axis; None for straight away from that side.
    """

    side: Side
    impulse: float = 0.0
    id: Number = 0
    towards: float | None = None


class LoadLibrary(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="load"):
    """Come to rest, and start again with another library.

    Attributes:
        library: its file, seen from the folder in which the deck was started.
        to: the motion that is played first.
    """

    library: str
    to: str
    id: Number = 0


class Accepted(msgspec.Struct, frozen=True, tag="accepted"):
    """The command is being carried out.

    Attributes:
        id: that of the command.
        after: the one-shot that is finished first, or "".
        via: the motions on the way.
    """

    id: Number
    after: str = ""
    via: list[str] = []  # msgspec copies an empty default


class Refused(msgspec.Struct, frozen=True, tag="refused"):
    """The command was not carried out, and why; id is 0 where it could not be read."""

    reason: str
    id: Number = 0


class Settled(msgspec.Struct, frozen=True, tag="settled"):
    """The switch is complete, so many seconds after it was commanded."""

    to: str
    seconds: float
    id: Number


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
    id: Number = 0


class ServoOnPort(msgspec.Struct, frozen=True, array_like=True):
    """A servo that has answered; `joint` is "" for one that is not in the rig file."""

    joint: str
    servo: int
    model: str
    firmware: int


class OnPorts(msgspec.Struct, frozen=True, tag="ports"):
    """Who is on the ports of the rig at its baud rate.

    Attributes:
        servos: that have answered.
        missing: the joints whose servo has not.
    """

    servos: list[ServoOnPort]
    missing: list[str]
    id: Number = 0


class PhaseNow(msgspec.Struct, frozen=True, tag="phase"):
    """How far the motion is, and how fast it turns.

    Attributes:
        motion: the motion that is played.
        phase: from 0 to 1; None if the network runs by itself.
        rate: rounds a second, negative backwards; None for a one-shot, or without a phase.
        at: when the phase was this, by the machine's steady clock, s; None if the deck does not play in real time.
    """

    motion: str
    phase: float | None
    rate: float | None
    id: Number
    at: float | None = None


class LockState(msgspec.Struct, frozen=True):
    """What the phase is locked to.

    Attributes:
        source: beats, another deck, or the measured joints.
        state: "searching" before it is in step, "locked" when it is, "waiting" while the body is held.
        error_ms: how far the motion is behind, ms; of a body how far the body is; None if that is not known.
        per_minute: beats a minute, where there are beats.
    """

    source: LockSource
    state: LockStage
    error_ms: float | None = None
    per_minute: float | None = None

    def __str__(self) -> str:
        """In a few words, as in "locked to the beat of 120.0 a minute (+4 ms)"."""
        to = {"beat": "the beat", "deck": "another deck", "body": "the body"}[self.source]
        beat = f" of {self.per_minute:.1f} a minute" if self.per_minute is not None else ""
        off = f" ({self.error_ms:+.0f} ms)" if self.error_ms is not None else ""
        state = {"searching": "searching for", "locked": "locked to", "waiting": "waiting for"}[self.state]
        return f"{state} {to}{beat}{off}"


def lock_numbers(lock: LockState | None) -> dict[str, float]:
    """A lock as fields of telemetry and recordings: indices of LOCK_SOURCES and LOCK_STAGES, -1 for none, and ms."""
    if lock is None:
        return {"lock_source": -1.0, "lock_stage": -1.0, "lock_error_ms": math.nan}
    error = lock.error_ms if lock.error_ms is not None else math.nan
    return {
        "lock_source": float(LOCK_SOURCES.index(lock.source)),
        "lock_stage": float(LOCK_STAGES.index(lock.state)),
        "lock_error_ms": error,
    }


class State(msgspec.Struct, frozen=True, tag="state"):
    """What is played, and what can be.

    Attributes:
        motion: the motion that is played or being switched to.
        motions: all motions of the library.
        tempo: the present tempo; negative backwards.
        phase: how far the motion is, from 0 to 1; None if the network runs by itself.
        lock: what the phase is locked to, if it is.
        paused: whether it is paused.
        switching: whether a switch is under way.
        id: that of the command.
        queue: the motions that are played next.
        mode: whether the joints follow the motion, stand at home, are held, or are held by the emergency stop.
        blend: the motions that are blended in, each with its weight.
        fell_back: why the last blend was given up and what was played instead.
        seen: the motion that is recognized, and the confidence, while that is switched on.
        inputs: the present values of the inputs that motions have besides the phase.
        at: s of the deck, the clock of its events; it waits while the joints approach the motion.
        fallen: whether the simulated robot has fallen and not stood again.
        approaching: whether the joints are on their slow way to the motion.
    """

    motion: str
    motions: list[str]
    tempo: float
    paused: bool
    switching: bool
    id: Number
    queue: list[str] = []
    mode: Mode = "playing"
    blend: tuple[tuple[str, float], ...] = ()
    fell_back: str = ""
    seen: tuple[str, float] | None = None
    phase: float | None = None
    inputs: dict[str, float] = {}
    lock: LockState | None = None
    at: float = 0.0
    fallen: bool = False
    approaching: bool = False


EventKind = Literal[
    "motion",
    "via",
    "settled",
    "overtaken",
    "gave up",
    "paused",
    "resumed",
    "mode",
    "recognized",
    "fault",
    "servo",
    "push",
    "fell",
    "stands",
    "overrun",
    "replayed",
    "lost",
    "ended",
]


class Event(msgspec.Struct, frozen=True, tag="event"):
    """Something that happened on a deck.

    Attributes:
        kind: "motion": another motion, or a blend, is commanded; "via": one on the way to it begins; "settled": nothing
            is left of the one before; "overtaken": another command came first; "gave up": a blend was given up;
            "paused", "resumed"; "mode": the joints go home, are held, are stopped in an emergency, or play again;
            "recognized": it looks like another motion than before; "fault": of an output or the deck; "servo":
            something was done with a servo, or one is back; "push", "fell", "stands": the simulated robot was pushed,
            has fallen, stands again; "overrun":
            ticks came more than a period late; "replayed": a recorded datagram was refused; "lost": a heartbeat is
            missing, and the deck was paused; "ended": the run is over.
        text: the same for a person.
        motion: the motion that it is about, or "".
        at: s since the deck's start.
        number: rises by 1 from event to event of a deck; a gap tells of events that were lost on the way.
        id: always 0, as no command's.
    """

    kind: EventKind
    text: str
    motion: str = ""
    at: float = 0.0
    number: Number = 0
    id: Number = 0


Timeable = (
    Switch | Queue | Blend | SetTempo | SetInput | Jump | LockPhase | Unlock | Pause | Resume | Home | Push | Stop
)
"""Commands that can be given ahead of their time."""


class AtTime(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag="at"):
    """Carry out a command in the tick that is due at a time; in the next one if that has passed.

    It is accepted at once, and refused later where it cannot be carried out; a switch is answered once more when it
    has settled. An emergency stop ends it, and so does its sender by leaving.

    Attributes:
        when: by this machine's steady clock, s.
        say: the command.
    """

    when: float
    say: Timeable
    id: Number = 0


Message = (
    Switch
    | Queue
    | Blend
    | SetTempo
    | SetInput
    | Jump
    | GiveBeat
    | LockPhase
    | Unlock
    | Pause
    | StepOn
    | Resume
    | Home
    | EmergencyStop
    | Reset
    | Stop
    | Heartbeat
    | AlignTicks
    | AtTime
    | Subscribe
    | GetStatus
    | GetPhase
    | ServoTorque
    | RestartServo
    | ReadRegisters
    | WriteRegister
    | ScanPorts
    | Push
    | LoadLibrary
)
Reply = Accepted | Refused | Settled | Registers | OnPorts | State | PhaseNow | Event
Last = Settled | Refused | Registers | OnPorts
"""Second replies."""

encode = msgspec.json.Encoder().encode
_replies = msgspec.json.Decoder(Reply)


def read_reply(data: bytes) -> Reply:
    """The reply in a datagram.

    Raises:
        CommandError: if it is not one.
    """
    try:
        return _replies.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise CommandError(f"the deck's reply cannot be read ({error})") from error
