"""The commands of a deck in one table: word, arguments with their ranges, one line of help, and when it is allowed.

The prompt, `motiondeck send`, timelines, the page, the gamepad and the socket all read this table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

import msgspec

from controller.wire.messages import commands
from controller.wire.messages.arguments import (
    AGO,
    CODE,
    COUNT,
    LOCK_PHASE,
    PART,
    PHASE,
    STEP_SECONDS,
    STEPS,
    TEMPO,
    TEMPO_SECONDS,
    WEIGHT,
    WITHIN,
    Choice,
    Flag,
    FurtherParts,
    Number,
    Text,
    motion_name,
)
from controller.wire.messages.blends import MOST_BLENDED, blend_weights
from controller.wire.messages.commands import MOST_BYTES, SIDES, AnyCommand, CommandError, DeckCommand, Timeable
from controller.wire.messages.deck_snapshot import Mode
from controller.wire.messages.lock_state import LOCK_SOURCES
from motiondeck_base.near_names import did_you_mean

ALWAYS: frozenset[Mode] = frozenset(get_args(Mode))
RELEASED: frozenset[Mode] = ALWAYS - {"emergency stop"}


@dataclass(frozen=True)
class WholeCommand:
    """An argument that is a command, as one word."""

    field: str
    name: str
    optional = False

    def parse(self, word: str) -> Timeable:
        """The command; raises a CommandError where it is none, or none for another time."""
        message = parse_command(word.split())
        if not isinstance(message, Timeable):
            raise CommandError(f"{self.name} can be given only for now: {word}")
        return message

    def check(self, value: Timeable) -> None:
        """Raises a CommandError where an argument of it is out of its range."""
        checked(value)


Argument = Text | Number | Flag | Choice | WholeCommand | FurtherParts

_JOINT = Text("joint", "JOINT", "the name of a joint")
_CLOCK = -1e12, 1e12  # s


@dataclass(frozen=True)
class CommandRow:
    """A row of the table: one command.

    Attributes:
        word: what is typed; also the tag on the wire.
        message: the type of its message.
        arguments: in the order in which they are typed.
        help: one line.
        modes: the modes of a run in which it is carried out; in others it is refused.
        aliases: other words for it.
    """

    word: str
    message: type[DeckCommand]
    arguments: tuple[Argument, ...]
    help: str
    modes: frozenset[Mode] = RELEASED
    aliases: tuple[str, ...] = ()

    @property
    def usage(self) -> str:
        """The command with its arguments, as in "tempo TEMPO [SECONDS]"."""
        names = [f"[{a.name}]" if a.optional else a.name for a in self.arguments]
        return " ".join([self.word, *names])

    def parse(self, words: Sequence[str]) -> DeckCommand:
        """The message of the typed arguments.

        Raises:
            CommandError: if there are too few or too many, or one is not allowed.
        """
        required = sum(not argument.optional for argument in self.arguments)
        further = self.arguments[-1] if self.arguments and isinstance(self.arguments[-1], FurtherParts) else None
        single = [argument for argument in self.arguments if not isinstance(argument, FurtherParts)]
        if len(words) < required or (further is None and len(words) > len(single)):
            raise CommandError(f"give it as: {self.usage}")
        values: dict[str, Any] = {one.field: one.parse(word) for one, word in zip(single, words, strict=False)}
        if further is not None:
            values[further.field] = further.parse(words[len(single) :])
        return checked(self.message(**values))


COMMANDS = (
    CommandRow(
        "switch",
        commands.Switch,
        (motion_name("to"), Flag("direct", "direct")),
        "play a motion now, or when a one-shot has ended; direct: at once, without motions in between",
    ),
    CommandRow(
        "queue",
        commands.Queue,
        (motion_name("to"),),
        "play a motion when the present one has ended or finished its round",
    ),
    CommandRow(
        "blend",
        commands.Blend,
        (
            motion_name("first", "A"),
            motion_name("second", "B"),
            WEIGHT,
            FurtherParts("also", motion_name("", "C"), PART, MOST_BLENDED - 2),
        ),
        "play a blend of loops; WEIGHT (-0.3 to 1.3) is that of B; of three or four, each has its own, and A the rest",
    ),
    CommandRow(
        "tempo",
        commands.SetTempo,
        (TEMPO, TEMPO_SECONDS),
        "play at -3 to 3 times the recorded tempo, reached smoothly or within 0 to 60 s; below 0 backwards",
    ),
    CommandRow(
        "input",
        commands.SetInput,
        (Text("name", "INPUT", "the name of an input"), Number("value", "VALUE", -1000.0, 1000.0)),
        "change an input that motions were learned with, such as speed 1.4 (m/s); it is reached smoothly",
    ),
    CommandRow("jump", commands.Jump, (PHASE,), "go to a phase (0 to 1) of the present motion, by a transition"),
    CommandRow(
        "beat",
        commands.GiveBeat,
        (AGO,),
        "a beat, now or AGO seconds ago (-2 to 2): locks the motion to the beats",
        aliases=("tap",),
    ),
    CommandRow(
        "lock",
        commands.LockPhase,
        (Choice("source", "SOURCE", LOCK_SOURCES), LOCK_PHASE, STEPS),
        "lock the phase to: beat (PHASE falls on it, STEPS beats a round, 0: automatic), deck (PHASE ahead), body",
    ),
    CommandRow("unlock", commands.Unlock, (), "end a lock and play at the commanded tempo"),
    CommandRow("pause", commands.Pause, (), "stand still"),
    CommandRow("step", commands.StepOn, (STEP_SECONDS,), "in a pause: go on for one tick, or for SECONDS (up to 1)"),
    CommandRow("resume", commands.Resume, (), "play on after a pause, from home, or after a reset"),
    CommandRow("home", commands.Home, (), "go slowly to the rest pose and stay there"),
    CommandRow("estop", commands.EmergencyStop, (), "emergency stop: brake every joint at once and hold", ALWAYS),
    CommandRow(
        "reset",
        commands.Reset,
        (CODE,),
        "release the emergency stop; nothing moves before resume, home or a motion",
        frozenset({"emergency stop"}),
    ),
    CommandRow(
        "heartbeat",
        commands.Heartbeat,
        (WITHIN,),
        "pause when the sender has been silent for this long (up to 60 s); 0 ends that",
        ALWAYS,
    ),
    CommandRow(
        "align",
        commands.AlignTicks,
        (Number("here", "HERE", *_CLOCK), Number("there", "THERE", *_CLOCK)),
        "move ticks onto those of a clock that shows THERE when this machine's shows HERE, s (for programs)",
        ALWAYS,
    ),
    CommandRow(
        "at",
        commands.AtTime,
        (Number("when", "WHEN", *_CLOCK), WholeCommand("say", "'COMMAND'")),
        "carry out a command in the tick due at WHEN by this machine's clock, s (for programs)",
    ),
    CommandRow("subscribe", commands.Subscribe, (), "receive the events of the deck", ALWAYS),
    CommandRow("status", commands.GetStatus, (), "show what is played, and all motions", ALWAYS),
    CommandRow("phase", commands.GetPhase, (), "show the phase of the motion and its rounds per second", ALWAYS),
    CommandRow(
        "torque",
        commands.ServoTorque,
        (_JOINT, Choice("to", "on|off", ("on", "off"))),
        "switch a servo's torque off (it goes limp), or on again where it stands",
        ALWAYS,
    ),
    CommandRow(
        "restart",
        commands.RestartServo,
        (_JOINT,),
        "restart a servo of the rig and set it up again; the others hold meanwhile",
    ),
    CommandRow(
        "registers",
        commands.ReadRegisters,
        (_JOINT,),
        "show all registers of a servo",
        ALWAYS,
    ),
    CommandRow(
        "write",
        commands.WriteRegister,
        (
            _JOINT,
            Text("register", "REGISTER", "the name of a register"),
            COUNT,
        ),
        "write a register of a servo whose torque is off; only what the rig does not rely on",
        ALWAYS,
    ),
    CommandRow("scan", commands.ScanPorts, (), "list who is on the rig's ports; all servos hold meanwhile"),
    CommandRow(
        "push",
        commands.Push,
        (Choice("side", "SIDE", SIDES), Number("impulse", "IMPULSE", 0.0, 1000.0, optional=True)),
        "push the simulated body from its front, back, left or right with IMPULSE N s (default: forces a step)",
        ALWAYS,
    ),
    CommandRow(
        "load",
        commands.LoadLibrary,
        (Text("library", "LIBRARY", "a path", longest=1500), motion_name("to")),
        "come to rest, and start again with another library file (path from the deck's folder)",
    ),
    CommandRow("stop", commands.Stop, (), "bring the joints to rest and end the run", ALWAYS, ("quit",)),
)

BY_WORD = {word: command for command in COMMANDS for word in (command.word, *command.aliases)}
_ROWS: dict[type[DeckCommand], CommandRow] = {row.message: row for row in COMMANDS}
USAGES = ", ".join(command.usage for command in COMMANDS)

_commands = msgspec.json.Decoder(AnyCommand)


def row_of(message: DeckCommand) -> CommandRow:
    """The row of a message."""
    return _ROWS[type(message)]


def checked(message: DeckCommand) -> DeckCommand:
    """The message itself, if its arguments are in their ranges.

    Raises:
        CommandError: if one is not; it names the argument and its range.
    """
    for argument in row_of(message).arguments:
        argument.check(getattr(message, argument.field))
    if isinstance(message, commands.Blend):
        blend_weights(message.first, message.second, message.weight, message.also)
    return message


def read_command(data: bytes) -> DeckCommand:
    """The command in a datagram.

    Raises:
        CommandError: if it is no command, or an argument is out of range; it names what is allowed.
    """
    if len(data) > MOST_BYTES:
        raise CommandError(f"this message is too long; {MOST_BYTES} bytes are the most")
    try:
        return checked(_commands.decode(data))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise CommandError(f"this is not a command ({error}). Commands: {USAGES}.") from error


def parse_command(words: Sequence[str]) -> DeckCommand:
    """The message of typed words: a command and its arguments, or a motion's name alone, which switches to it.

    A single word may be a whole command, such as "switch jog".

    Raises:
        CommandError: if they are no command; it names the commands.
    """
    if len(words) == 1 and words[0].split()[:1] and words[0].split()[0] in BY_WORD:
        words = words[0].split()
    command = BY_WORD.get(words[0]) if words else None
    if command is not None:
        try:
            return command.parse(words[1:])
        except CommandError as error:
            raise CommandError(f"{words[0]}: {error}") from None
    if len(words) == 1:
        return checked(commands.Switch(words[0]))
    hint = did_you_mean(words[0], BY_WORD) if words else ""
    raise CommandError(f"'{' '.join(words)}' is not a command.{hint} `motiondeck send help` lists the commands.")
