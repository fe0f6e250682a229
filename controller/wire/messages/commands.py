"""The commands that a deck takes.

`command_table` has what a person types for each of them, the ranges of its arguments and when it is allowed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, Union, get_args

import msgspec

from controller.wire.messages.lock_state import LockSource
from motiondeck_base.errors import MotiondeckError

MOST_BYTES = 2048
"""No command is longer than this."""

encode = msgspec.json.Encoder().encode
"""A command, a reply or an event as it is sent."""

Natural = Annotated[int, msgspec.Meta(ge=0, lt=2**53)]
"""A whole number from 0 on that JSON carries exactly."""


class CommandError(MotiondeckError):
    """A command that cannot be read, or an argument out of its range; the message names what is allowed."""


class DeckCommand(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A command to a deck; its replies repeat its number, `id`."""

    id: Natural = 0


class Switch(DeckCommand, frozen=True, tag="switch"):
    """Play another motion now, or when a one-shot has ended; the queue is cleared.

    Attributes:
        to: the motion.
        direct: whether to go there at once and straight, however far it is.
    """

    to: str
    direct: bool = False


class Queue(DeckCommand, frozen=True, tag="queue"):
    """Play a motion after the present and the queued ones: a loop goes round to its end, a one-shot is finished."""

    to: str


class Blend(DeckCommand, frozen=True, tag="blend"):
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
    also: tuple[tuple[str, float], ...] = ()

    @property
    def motions(self) -> tuple[str, ...]:
        """All its motions, the first first."""
        return self.first, self.second, *(name for name, _ in self.also)


class SetTempo(DeckCommand, frozen=True, tag="tempo"):
    """Play at another tempo.

    Attributes:
        factor: 1 is as fast as recorded, 0 stands still, negative plays backwards.
        over: how many seconds the change takes; 0 for as quickly as is smooth.
    """

    factor: float
    over: float = 0.0


class Jump(DeckCommand, frozen=True, tag="jump"):
    """Go to a phase of the motion that is played, through a join.

    Attributes:
        phase: from 0 to 1.
    """

    phase: float


class SetInput(DeckCommand, frozen=True, tag="input"):
    """Give an input of the motions another value.

    Attributes:
        name: of the input, such as "speed".
        value: in its own unit.
    """

    name: str
    value: float


class GiveBeat(DeckCommand, frozen=True, tag="beat"):
    """A beat of what the motion is to be locked to; the first one locks it, if it is not locked to beats yet.

    Attributes:
        ago: how many seconds ago it was; negative for one that is still to come.
    """

    ago: float = 0.0


class LockPhase(DeckCommand, frozen=True, tag="lock"):
    """Lock the phase of the motion to beats, to another deck, or to the measured joints.

    Attributes:
        source: which of them.
        phase: the phase that falls on a beat, or how far to be ahead of the other deck.
        steps: how many beats a round of the motion has; 0 for what keeps the tempo nearest to 1.
    """

    source: LockSource
    phase: float = 0.0
    steps: int = 0


class Unlock(DeckCommand, frozen=True, tag="unlock"):
    """Play at the commanded tempo again."""


class Pause(DeckCommand, frozen=True, tag="pause"):
    """Come to a standstill."""


class StepOn(DeckCommand, frozen=True, tag="step"):
    """Go on in a pause, and stand still again.

    Attributes:
        seconds: of the motion; 0 for one tick.
    """

    seconds: float = 0.0


class Resume(DeckCommand, frozen=True, tag="resume"):
    """Go on after a pause, from home, or after the emergency stop was reset."""


class Home(DeckCommand, frozen=True, tag="home"):
    """Go slowly to the rest pose and stay there."""


class EmergencyStop(DeckCommand, frozen=True, tag="estop"):
    """Brake every joint at once, as hard as its limits allow, and hold it until Reset."""


class Reset(DeckCommand, frozen=True, tag="reset"):
    """Release the emergency stop; nothing moves before Resume, Switch or Home.

    Attributes:
        code: from another machine, what the refusal of a reset without one says; it belongs to one emergency stop.
    """

    code: float = 0.0


class Stop(DeckCommand, frozen=True, tag="stop"):
    """Bring the joints to rest and end the run."""


class Heartbeat(DeckCommand, frozen=True, tag="heartbeat"):
    """Pause when the sender is not heard from any more, whatever it sends.

    Attributes:
        within: s in which it will be heard from again; 0 ends this.
    """

    within: float


class AlignTicks(DeckCommand, frozen=True, tag="align"):
    """Move the ticks of the loop onto the multiples of their period on another clock.

    Attributes:
        here: a time of this machine's steady clock, s.
        there: the time of the other clock then, s.
    """

    here: float
    there: float


class Subscribe(DeckCommand, frozen=True, tag="subscribe"):
    """Ask for Events from now on; over a network again within a minute."""


class GetStatus(DeckCommand, frozen=True, tag="status"):
    """Ask for the State."""


class GetPhase(DeckCommand, frozen=True, tag="phase"):
    """Ask for the PhaseNow."""


class ServoTorque(DeckCommand, frozen=True, tag="torque"):
    """Take the torque off a servo of the rig, or set it up again and switch it on where it stands.

    Attributes:
        joint: its name in the rig file.
        to: on or off.
    """

    joint: str
    to: Literal["on", "off"]


class RestartServo(DeckCommand, frozen=True, tag="restart"):
    """Restart a servo of the rig, and set it up again; the others hold meanwhile."""

    joint: str


class ReadRegisters(DeckCommand, frozen=True, tag="registers"):
    """Read all registers of a servo of the rig; answered once more by Registers."""

    joint: str


class WriteRegister(DeckCommand, frozen=True, tag="write"):
    """Write a register of a servo whose torque was switched off; answered once more by Registers.

    Attributes:
        joint: its name in the rig file.
        register: its name in the control table.
        count: the new value, in the register's own counts.
    """

    joint: str
    register: str
    count: int


class ScanPorts(DeckCommand, frozen=True, tag="scan"):
    """Ask who is on the ports of the rig, while all servos hold; answered once more by OnPorts."""


Side = Literal["front", "back", "left", "right"]
SIDES: tuple[Side, ...] = get_args(Side)


class Push(DeckCommand, frozen=True, tag="push"):
    """Push the simulated body.

    Attributes:
        side: of the body, where the push meets it.
        impulse: N s; 0 for one that a person would have to step against.
        towards: where it drives the body, rad from the world's x to its y axis; None for straight away from that side.
    """

    side: Side
    impulse: float = 0.0
    towards: float | None = None


class LoadLibrary(DeckCommand, frozen=True, tag="load"):
    """Come to rest, and start again with another library.

    Attributes:
        library: its file, seen from the folder in which the deck was started.
        to: the motion that is played first.
    """

    library: str
    to: str


Timeable = (
    Switch | Queue | Blend | SetTempo | SetInput | Jump | LockPhase | Unlock | Pause | Resume | Home | Push | Stop
)
"""Commands that can be given ahead of their time."""


class AtTime(DeckCommand, frozen=True, tag="at"):
    """Carry out a command in the tick that is due at a time; in the next one if that has passed.

    It is accepted at once, and refused later where it cannot be carried out; a switch is answered once more when it
    has settled. An emergency stop ends it, and so does its sender by leaving.

    Attributes:
        when: by this machine's steady clock, s.
        say: the command.
    """

    when: float
    say: Timeable


if TYPE_CHECKING:
    AnyCommand = DeckCommand
else:
    AnyCommand = Union[tuple(DeckCommand.__subclasses__())]  # noqa: UP007  (as msgspec reads it, by its tag)
