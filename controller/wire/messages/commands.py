"""The commands that a deck takes: each is a message with its row.

To add one: write its class here, add it to `DeckCommand`, and carry it out in `loop/commands/commanded_run.py`.
"""

from __future__ import annotations

from typing import Annotated, Literal, get_args

import msgspec

from controller.wire.messages import arguments as arg
from controller.wire.messages.command_row import ALWAYS, CommandMessage, CommandRow
from controller.wire.messages.deck_snapshot import LOCK_SOURCES, LockSource

MOST_BYTES = 2048  # the longest command, bytes
encode = msgspec.json.Encoder().encode  # a command, a reply or an event as it is sent

_POINT = -1000.0, 1000.0  # m
_CLOCK = -1e12, 1e12  # s
_JOINT = arg.Text("JOINT", "the name of a joint")


class Switch(CommandMessage, frozen=True, tag="switch"):
    """Play a motion now, or when a one-shot has ended; direct: at once, without motions in between."""

    row = CommandRow(("timed", "cue", "script", "film"), record=1, second_reply="settled")
    to: Annotated[str, arg.MotionName()]
    direct: Annotated[bool, arg.Flag("direct")] = False


class Queue(CommandMessage, frozen=True, tag="queue"):
    """Play a motion after the present and the queued ones: a loop finishes its round, a one-shot its motion."""

    row = CommandRow(("timed", "cue", "script", "film"), record=2, second_reply="settled")
    to: Annotated[str, arg.MotionName()]


class Blend(CommandMessage, frozen=True, tag="blend"):
    """Play a blend of loops with the WEIGHT of B; of three or four motions each has its own, and A the rest."""

    row = CommandRow(("timed", "cue", "script", "film"), record=10, second_reply="settled")
    first: Annotated[str, arg.MotionName("A")]  # the motion that is switched to first, if it is not playing
    second: Annotated[str, arg.MotionName("B")]  # the motion that is blended in then
    # The blend weight of the second, from -0.3 to 1.3; "share" on the wire.
    weight: Annotated[float, arg.WEIGHT] = msgspec.field(name="share")
    # Further motions that are blended in, each with its weight; then no weight is below 0 or above 1.
    also: Annotated[
        tuple[tuple[str, float], ...], arg.WeightedMotions(arg.MotionName("C"), arg.PART, arg.MOST_BLENDED - 2)
    ] = ()

    @property
    def motions(self) -> tuple[str, ...]:
        """All its motions, the first first."""
        return self.first, self.second, *(name for name, _ in self.also)

    def check(self) -> None:
        """Raises a CommandError also where the weights or motions do not make a blend."""
        super().check()
        arg.blend_weights(self.first, self.second, self.weight, self.also)


class SetTempo(CommandMessage, frozen=True, tag="tempo"):
    """Play at -3 to 3 times the recorded tempo, reached smoothly or within SECONDS; below 0 backwards."""

    row = CommandRow(("timed", "cue", "script", "film", "replay"), record=3)
    factor: Annotated[float, arg.TEMPO]
    over: Annotated[float, arg.TEMPO_SECONDS] = 0.0


class SetInput(CommandMessage, frozen=True, tag="input"):
    """Hold joints at -1 to 1 of their range (jaw 0.4) for SECONDS (0.5), or change an input of motions (speed 1.4)."""

    row = CommandRow(("timed", "cue", "script"), record=12)
    name: Annotated[str, arg.Text("NAME", "the name of a group of joints or an input, or off")]
    value: Annotated[float, arg.Number("VALUE", -1000.0, 1000.0)] = 0.0
    seconds: Annotated[float, arg.HOLD_SECONDS] = arg.HELD  # without a further value, after which joints fall back


class Gaze(CommandMessage, frozen=True, tag="gaze"):
    """Look for SECONDS (0.5) at a point LEFT of and UP from straight ahead, at a distance of AHEAD (1), in m."""

    row = CommandRow(("timed", "cue", "script"), record=24)
    left: Annotated[float, arg.Number("LEFT", *_POINT)]
    up: Annotated[float, arg.Number("UP", *_POINT)]
    ahead: Annotated[float, arg.Number("AHEAD", 0.01, 1000.0)] = 1.0
    seconds: Annotated[float, arg.HOLD_SECONDS] = arg.HELD


class Layer(CommandMessage, frozen=True, tag="layer"):
    """Play a motion on a GROUP of joints alone, with a WEIGHT from 0 to 1 and a TEMPO; off: end it, or all layers."""

    row = CommandRow(("timed", "cue", "script"), record=23)
    group: Annotated[str, arg.Text("GROUP", "the name of a group of joints, or off")]
    to: Annotated[str, arg.Text("MOTION", "the name of a motion, or off")] = "off"
    weight: Annotated[float, arg.PART] = 1.0
    tempo: Annotated[float, arg.Number("TEMPO", 0.0, 3.0)] = 1.0  # times that of the deck


class Jump(CommandMessage, frozen=True, tag="jump"):
    """Go to a phase (0 to 1) of the present motion, by a transition."""

    row = CommandRow(("timed", "cue", "script", "film"), record=11)
    phase: Annotated[float, arg.PHASE]


class GiveBeat(CommandMessage, frozen=True, tag="beat"):
    """A beat, now or AGO seconds ago (-2 to 2); the first one locks the motion to the beats."""

    row = CommandRow(("script",), aliases=("tap",), record=13)
    ago: Annotated[float, arg.AGO] = 0.0


class LockPhase(CommandMessage, frozen=True, tag="lock"):
    """Lock the phase to: beat (PHASE falls on it, STEPS a round, 0: automatic), deck (PHASE ahead), body, person."""

    row = CommandRow(("timed", "script"), record=14)
    source: Annotated[LockSource, arg.Choice("SOURCE", LOCK_SOURCES)]
    phase: Annotated[float, arg.PHASE] = 0.0
    steps: Annotated[int, arg.STEPS] = 0  # beats in a round of the motion; 0 for what keeps the tempo nearest to 1


class FollowPerson(CommandMessage, frozen=True, tag="follow"):
    """Say that a person was at PHASE of a motion AGO seconds ago, at a TEMPO, to a deck locked to them."""

    row = CommandRow(("script",), record=25)
    to: Annotated[str, arg.MotionName()]
    phase: Annotated[float, arg.PHASE]
    tempo: Annotated[float, arg.TEMPO] = 1.0
    ago: Annotated[float, arg.AGO] = 0.0
    body: tuple[float, ...] = ()  # as of `Deck.follow`


class Unlock(CommandMessage, frozen=True, tag="unlock"):
    """End a lock and play at the commanded tempo."""

    row = CommandRow(("timed", "cue", "script"), record=15)


class Pause(CommandMessage, frozen=True, tag="pause"):
    """Come to a standstill."""

    row = CommandRow(("timed", "cue", "script", "film", "replay"), record=4)


class StepOn(CommandMessage, frozen=True, tag="step"):
    """In a pause: go on for one tick, or for SECONDS (up to 1), and stand still again."""

    row = CommandRow(("script", "replay"), record=22)
    seconds: Annotated[float, arg.STEP_SECONDS] = 0.0


class Resume(CommandMessage, frozen=True, tag="resume"):
    """Play on after a pause, from home, or after a reset."""

    row = CommandRow(("timed", "cue", "script", "film", "replay"), record=5)


class Home(CommandMessage, frozen=True, tag="home"):
    """Go slowly to the rest pose and stay there until resume or a motion."""

    row = CommandRow(("timed", "cue", "script", "replay"), record=6)


class EmergencyStop(CommandMessage, frozen=True, tag="estop"):
    """Emergency stop: brake every joint at once, as hard as its limits allow, and hold until reset."""

    row = CommandRow(("script", "replay"), ALWAYS, record=7)


class Reset(CommandMessage, frozen=True, tag="reset"):
    """Release the emergency stop; nothing moves before resume, home or a motion."""

    row = CommandRow(("script", "replay"), frozenset({"emergency stop"}), record=8)
    # Needed from another machine; the refusal of a reset without one names it, anew for each emergency stop.
    code: Annotated[float, arg.Number("CODE", 0.0, 999999.0)] = 0.0


class Stop(CommandMessage, frozen=True, tag="stop"):
    """Bring the joints to rest, go to the rest pose, and end the run."""

    row = CommandRow(("timed", "cue", "script", "replay"), ALWAYS, aliases=("quit",), record=9)


class Heartbeat(CommandMessage, frozen=True, tag="heartbeat"):
    """Pause when the sender ends or sends nothing for SECONDS (up to 60); 0 ends that."""

    row = CommandRow(("script", "replay"), ALWAYS)
    within: Annotated[float, arg.Number("SECONDS", 0.0, 60.0)]


class AlignTicks(CommandMessage, frozen=True, tag="align"):
    """Move ticks onto those of a clock that shows THERE when this machine's shows HERE, s (for programs)."""

    row = CommandRow(("script", "replay"), ALWAYS)
    here: Annotated[float, arg.Number("HERE", *_CLOCK)]  # a time of this machine's steady clock, s
    # The time of the other clock then, s; the ticks become multiples of their period on that clock.
    there: Annotated[float, arg.Number("THERE", *_CLOCK)]


class Subscribe(CommandMessage, frozen=True, tag="subscribe"):
    """Receive the events of the deck; over a network again within a minute."""

    row = CommandRow(("script", "replay"), ALWAYS)


class GetStatus(CommandMessage, frozen=True, tag="status"):
    """Show what is played, and all motions."""

    row = CommandRow(("script", "replay"), ALWAYS)


class GetPhase(CommandMessage, frozen=True, tag="phase"):
    """Show the phase of the motion and its rounds per second."""

    row = CommandRow(("script", "replay"), ALWAYS)


class ServoTorque(CommandMessage, frozen=True, tag="torque"):
    """Switch a servo's torque off (it goes limp), or check the servo and switch it on where it stands."""

    row = CommandRow(("script", "replay"), ALWAYS, record=16)
    joint: Annotated[str, _JOINT]
    to: Annotated[Literal["on", "off"], arg.Choice("on|off", ("on", "off"))]


class RestartServo(CommandMessage, frozen=True, tag="restart"):
    """Restart a servo and set it up again; the others hold meanwhile."""

    row = CommandRow(("script", "replay"), record=17)
    joint: Annotated[str, _JOINT]


class ReadRegisters(CommandMessage, frozen=True, tag="registers"):
    """Show all registers of a servo; they are read between the positions."""

    row = CommandRow(("script", "replay"), ALWAYS, second_reply="servos")
    joint: Annotated[str, _JOINT]


class WriteRegister(CommandMessage, frozen=True, tag="write"):
    """Write a register of a servo whose torque is off; only what the rig does not rely on."""

    row = CommandRow(("script", "replay"), record=20, second_reply="servos")
    joint: Annotated[str, _JOINT]
    register: Annotated[str, arg.Text("REGISTER", "the name of a register")]
    count: Annotated[int, arg.Number("COUNT", -32768, 65535, whole=True)]  # the new value, in the register's own counts


class ScanPorts(CommandMessage, frozen=True, tag="scan"):
    """List the servos on the rig's ports; all servos hold meanwhile."""

    row = CommandRow(("script", "replay"), record=21, second_reply="servos")


Side = Literal["front", "back", "left", "right"]
SIDES: tuple[Side, ...] = get_args(Side)


class Push(CommandMessage, frozen=True, tag="push"):
    """Push the simulated body from its front, back, left or right with IMPULSE N s (default: forces a step)."""

    row = CommandRow(("timed", "cue", "script", "replay"), ALWAYS, record=19)
    side: Annotated[Side, arg.Choice("SIDE", SIDES)]
    impulse: Annotated[float, arg.Number("IMPULSE", 0.0, 1000.0)] = 0.0  # N s; 0 for one that forces a step
    # Direction of the push, rad from the world's x to its y axis; None for straight away from that side.
    towards: float | None = None


class LoadLibrary(CommandMessage, frozen=True, tag="load"):
    """Come to rest, and start again with another library file (path from the deck's folder)."""

    row = CommandRow(("script", "replay"), record=18)
    library: Annotated[str, arg.Text("LIBRARY", "a path", longest=1500)]
    to: Annotated[str, arg.Text("MOTION", "the name of a motion")]


class AtTime(CommandMessage, frozen=True, tag="at"):
    """Carry out a command in the tick due at WHEN by this machine's clock, s (for programs).

    It is accepted at once, and refused later where it cannot be carried out; a switch is answered once more when it
    has settled. An emergency stop cancels it, and so does its sender by leaving. A time that has passed means now.
    """

    row = CommandRow(("replay",))
    when: Annotated[float, arg.Number("WHEN", *_CLOCK)]  # by this machine's steady clock, s
    say: Annotated[DeckCommand, arg.WholeCommand("'COMMAND'")]

    def check(self) -> None:
        """Raises a CommandError also where the command is invalid or not for a later time."""
        super().check()
        self.say.row.check_use("timed")
        self.say.check()


_OfMotions = (
    Switch | Queue | Blend | SetTempo | SetInput | Gaze | Layer | Jump | GiveBeat | LockPhase | FollowPerson | Unlock
)
_OfTheRun = Pause | StepOn | Resume | Home | EmergencyStop | Reset | Heartbeat | AlignTicks | AtTime
_Questions = Subscribe | GetStatus | GetPhase
_OfServos = ServoTorque | RestartServo | ReadRegisters | WriteRegister | ScanPorts
DeckCommand = _OfMotions | _OfTheRun | _Questions | _OfServos | Push | LoadLibrary | Stop
"""All commands, in the order of the help."""
