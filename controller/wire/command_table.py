"""The commands of a deck in one table: word, arguments with their ranges, one line of help, and when it is allowed.

The prompt, `motiondeck send`, timelines, the page, the gamepad and the socket all read this table.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, get_args

import msgspec

from controller.wire.messages import (
    LOCK_SOURCES,
    MOST_BYTES,
    SIDES,
    AlignTicks,
    AtTime,
    Blend,
    CommandError,
    EmergencyStop,
    GetPhase,
    GetStatus,
    GiveBeat,
    Heartbeat,
    Home,
    Jump,
    LoadLibrary,
    LockPhase,
    Message,
    Mode,
    Pause,
    Push,
    Queue,
    ReadRegisters,
    Reset,
    RestartServo,
    Resume,
    ScanPorts,
    ServoTorque,
    SetInput,
    SetTempo,
    StepOn,
    Stop,
    Subscribe,
    Switch,
    Timeable,
    Unlock,
    WriteRegister,
)
from motiondeck_base.near_names import did_you_mean

LONGEST_NAME = 100
MOST_BLENDED = 4
"""No blend has more motions."""
LONGEST_PATH = 1500


@dataclass(frozen=True)
class MotionName:
    """An argument that names a motion; `field` is its field in the message, `name` its name in the help."""

    field: str
    name: str = "MOTION"
    optional: bool = False
    kind: str = "motion"

    def parse(self, word: str) -> str:
        """The name itself."""
        return word

    def check(self, value: str) -> None:
        """Raises a CommandError where a name is empty or too long to be a motion's."""
        if not 0 < len(value) <= LONGEST_NAME:
            raise CommandError(f"the name of a {self.kind} has 1 to {LONGEST_NAME} characters")
        _check_text(f"the name of a {self.kind}", value)


@dataclass(frozen=True)
class FilePath:
    """An argument that is a file."""

    field: str
    name: str
    optional: bool = False

    def parse(self, word: str) -> str:
        """The path itself."""
        return word

    def check(self, value: str) -> None:
        """Raises a CommandError where a path is empty or too long for a message."""
        if not 0 < len(value) <= LONGEST_PATH:
            raise CommandError(f"a path has 1 to {LONGEST_PATH} characters here")
        _check_text("a path", value)


def _check_text(what: str, value: str) -> None:
    """Raises a CommandError for bytes of a command line that are no text: they cannot be sent."""
    try:
        value.encode()
    except UnicodeEncodeError:
        raise CommandError(f"{what} is text in UTF-8, not {value!a}") from None


@dataclass(frozen=True)
class Number:
    """An argument that is a number from `lowest` to `highest`; with `whole` it has no fraction."""

    field: str
    name: str
    lowest: float
    highest: float
    optional: bool = False
    whole: bool = False

    def parse(self, word: str) -> float:
        """The number; raises a CommandError where the word is none."""
        try:
            return int(word) if self.whole else float(word)
        except ValueError:
            raise CommandError(self._range(f"'{word}'")) from None

    def check(self, value: float) -> None:
        """Raises a CommandError where a number is outside the range or not finite."""
        if not (math.isfinite(value) and self.lowest <= value <= self.highest):
            raise CommandError(self._range(f"{value:g}"))

    def _range(self, given: str) -> str:
        kind = "a whole number" if self.whole else "a number"
        return f"{self.name} must be {kind} from {self.lowest:g} to {self.highest:g}, not {given}"


@dataclass(frozen=True)
class Flag:
    """An argument that is either its own name or left out."""

    field: str
    name: str
    optional: bool = True

    def parse(self, word: str) -> bool:
        """True; raises a CommandError for any other word."""
        if word != self.name:
            raise CommandError(f"'{word}' is not understood here; leave it out or give: {self.name}")
        return True

    def check(self, value: bool) -> None:
        """Accepts either value."""


@dataclass(frozen=True)
class Choice:
    """An argument that is one of a few words."""

    field: str
    name: str
    words: tuple[str, ...]
    optional: bool = False

    def parse(self, word: str) -> str:
        """The word itself, if it is one of them; raises a CommandError for any other."""
        self.check(word)
        return word

    def check(self, value: str) -> None:
        """Raises a CommandError where a word is none of them."""
        if value not in self.words:
            raise CommandError(f"{self.name} must be one of {', '.join(self.words)}, not '{value}'")


@dataclass(frozen=True)
class WholeCommand:
    """An argument that is a command, as one word."""

    field: str
    name: str
    optional: bool = False

    def parse(self, word: str) -> Timeable:
        """The command; raises a CommandError where it is none, or none for another time."""
        message = parse_command(word.split())
        if not isinstance(message, Timeable):
            raise CommandError(f"{self.name} can be given only for now: {word}")
        return message

    def check(self, value: Timeable) -> None:
        """Raises a CommandError where an argument of it is out of its range."""
        checked(value)


@dataclass(frozen=True)
class FurtherParts:
    """Arguments that are names of motions and numbers in turn, as many as there are; they come last."""

    field: str
    part: MotionName
    weight: Number
    most: int
    optional: bool = True

    @property
    def name(self) -> str:
        """As in the help."""
        return f"{self.part.name} {self.weight.name} ..."

    def parse(self, words: Sequence[str]) -> tuple[tuple[str, float], ...]:
        """The names with their numbers; raises a CommandError where one has no number, or they are too many."""
        if len(words) % 2 or len(words) > 2 * self.most:
            raise CommandError(f"give each motion with its {self.weight.name}, at most {self.most} more of them")
        return tuple((self.part.parse(a), self.weight.parse(b)) for a, b in zip(words[::2], words[1::2], strict=True))

    def check(self, value: Sequence[tuple[str, float]]) -> None:
        """Raises a CommandError where one of them is not allowed."""
        if len(value) > self.most:
            raise CommandError(f"there are {len(value)} more motions; {self.most} more are the most")
        for name, number in value:
            self.part.check(name)
            self.weight.check(number)


Argument = MotionName | FilePath | Number | Flag | Choice | WholeCommand | FurtherParts

TEMPO = Number("factor", "TEMPO", -3.0, 3.0)
TEMPO_SECONDS = Number("over", "SECONDS", 0.0, 60.0, optional=True)
STEP_SECONDS = Number("seconds", "SECONDS", 0.0, 1.0, optional=True)
PHASE = Number("phase", "PHASE", 0.0, 1.0)
WEIGHT = Number("weight", "WEIGHT", -0.3, 1.3)
PART = Number("weight", "WEIGHT", 0.0, 1.0)
CODE = Number("code", "CODE", 0.0, 999999.0, optional=True)
WITHIN = Number("within", "SECONDS", 0.0, 60.0)
_CLOCK = -1e12, 1e12  # s
AGO = Number("ago", "AGO", -2.0, 2.0, optional=True)
STEPS = Number("steps", "STEPS", 0, 16, optional=True, whole=True)
COUNT = Number("count", "COUNT", -32768, 65535, whole=True)
LOCK_PHASE = Number("phase", "PHASE", 0.0, 1.0, optional=True)

ALWAYS: frozenset[Mode] = frozenset(get_args(Mode))
RELEASED: frozenset[Mode] = ALWAYS - {"emergency stop"}


@dataclass(frozen=True)
class DeckCommand:
    """One command.

    Attributes:
        word: what is typed; also the tag on the wire.
        message: the type of its message.
        arguments: in the order in which they are typed.
        help: one line.
        modes: the modes of a run in which it is carried out; in others it is refused.
        aliases: other words for it.
    """

    word: str
    message: type[Message]
    arguments: tuple[Argument, ...]
    help: str
    modes: frozenset[Mode] = RELEASED
    aliases: tuple[str, ...] = ()

    @property
    def usage(self) -> str:
        """The command with its arguments, as in "tempo TEMPO [SECONDS]"."""
        names = [f"[{a.name}]" if a.optional else a.name for a in self.arguments]
        return " ".join([self.word, *names])

    def parse(self, words: Sequence[str]) -> Message:
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
    DeckCommand(
        "switch",
        Switch,
        (MotionName("to"), Flag("direct", "direct")),
        "play a motion now, or when a one-shot has ended; direct: at once, without motions in between",
    ),
    DeckCommand(
        "queue", Queue, (MotionName("to"),), "play a motion when the present one has ended or finished its round"
    ),
    DeckCommand(
        "blend",
        Blend,
        (
            MotionName("first", "A"),
            MotionName("second", "B"),
            WEIGHT,
            FurtherParts("also", MotionName("", "C"), PART, MOST_BLENDED - 2),
        ),
        "play a blend of loops; WEIGHT (-0.3 to 1.3) is that of B; of three or four, each has its own, and A the rest",
    ),
    DeckCommand(
        "tempo",
        SetTempo,
        (TEMPO, TEMPO_SECONDS),
        "play at -3 to 3 times the recorded tempo, reached smoothly or within 0 to 60 s; below 0 backwards",
    ),
    DeckCommand(
        "input",
        SetInput,
        (MotionName("name", "INPUT", kind="input"), Number("value", "VALUE", -1000.0, 1000.0)),
        "change an input that motions were learned with, such as speed 1.4 (m/s); it is reached smoothly",
    ),
    DeckCommand("jump", Jump, (PHASE,), "go to a phase (0 to 1) of the present motion, by a transition"),
    DeckCommand(
        "beat",
        GiveBeat,
        (AGO,),
        "a beat, now or AGO seconds ago (-2 to 2): locks the motion to the beats",
        aliases=("tap",),
    ),
    DeckCommand(
        "lock",
        LockPhase,
        (Choice("source", "SOURCE", LOCK_SOURCES), LOCK_PHASE, STEPS),
        "lock the phase to: beat (PHASE falls on it, STEPS beats a round, 0: automatic), deck (PHASE ahead), body",
    ),
    DeckCommand("unlock", Unlock, (), "end a lock and play at the commanded tempo"),
    DeckCommand("pause", Pause, (), "stand still"),
    DeckCommand("step", StepOn, (STEP_SECONDS,), "in a pause: go on for one tick, or for SECONDS (up to 1)"),
    DeckCommand("resume", Resume, (), "play on after a pause, from home, or after a reset"),
    DeckCommand("home", Home, (), "go slowly to the rest pose and stay there"),
    DeckCommand("estop", EmergencyStop, (), "emergency stop: brake every joint at once and hold", ALWAYS),
    DeckCommand(
        "reset",
        Reset,
        (CODE,),
        "release the emergency stop; nothing moves before resume, home or a motion",
        frozenset({"emergency stop"}),
    ),
    DeckCommand(
        "heartbeat",
        Heartbeat,
        (WITHIN,),
        "pause when the sender has been silent for this long (up to 60 s); 0 ends that",
        ALWAYS,
    ),
    DeckCommand(
        "align",
        AlignTicks,
        (Number("here", "HERE", *_CLOCK), Number("there", "THERE", *_CLOCK)),
        "move ticks onto those of a clock that shows THERE when this machine's shows HERE, s (for programs)",
        ALWAYS,
    ),
    DeckCommand(
        "at",
        AtTime,
        (Number("when", "WHEN", *_CLOCK), WholeCommand("say", "'COMMAND'")),
        "carry out a command in the tick due at WHEN by this machine's clock, s (for programs)",
    ),
    DeckCommand("subscribe", Subscribe, (), "receive the events of the deck", ALWAYS),
    DeckCommand("status", GetStatus, (), "show what is played, and all motions", ALWAYS),
    DeckCommand("phase", GetPhase, (), "show the phase of the motion and its rounds per second", ALWAYS),
    DeckCommand(
        "torque",
        ServoTorque,
        (MotionName("joint", "JOINT", kind="joint"), Choice("to", "on|off", ("on", "off"))),
        "switch a servo's torque off (it goes limp), or on again where it stands",
        ALWAYS,
    ),
    DeckCommand(
        "restart",
        RestartServo,
        (MotionName("joint", "JOINT", kind="joint"),),
        "restart a servo of the rig and set it up again; the others hold meanwhile",
    ),
    DeckCommand(
        "registers",
        ReadRegisters,
        (MotionName("joint", "JOINT", kind="joint"),),
        "show all registers of a servo",
        ALWAYS,
    ),
    DeckCommand(
        "write",
        WriteRegister,
        (
            MotionName("joint", "JOINT", kind="joint"),
            MotionName("register", "REGISTER", kind="register"),
            COUNT,
        ),
        "write a register of a servo whose torque is off; only what the rig does not rely on",
        ALWAYS,
    ),
    DeckCommand("scan", ScanPorts, (), "list who is on the rig's ports; all servos hold meanwhile"),
    DeckCommand(
        "push",
        Push,
        (Choice("side", "SIDE", SIDES), Number("impulse", "IMPULSE", 0.0, 1000.0, optional=True)),
        "push the simulated body from its front, back, left or right with IMPULSE N s (default: forces a step)",
        ALWAYS,
    ),
    DeckCommand(
        "load",
        LoadLibrary,
        (FilePath("library", "LIBRARY"), MotionName("to")),
        "come to rest, and start again with another library file (path from the deck's folder)",
    ),
    DeckCommand("stop", Stop, (), "bring the joints to rest and end the run", ALWAYS, ("quit",)),
)

BY_WORD = {word: command for command in COMMANDS for word in (command.word, *command.aliases)}
_BY_MESSAGE: dict[type[Message], DeckCommand] = {command.message: command for command in COMMANDS}
USAGES = ", ".join(command.usage for command in COMMANDS)

_messages = msgspec.json.Decoder(Message)


def command_of(message: Message) -> DeckCommand:
    """The row of a message."""
    return _BY_MESSAGE[type(message)]


def checked(message: Message) -> Message:
    """The message itself, if its arguments are in their ranges.

    Raises:
        CommandError: if one is not; it names the argument and its range.
    """
    for argument in command_of(message).arguments:
        argument.check(getattr(message, argument.field))
    if isinstance(message, Blend):
        blend_weights(message.first, message.second, message.weight, message.also)
    return message


def blend_weights(first: str, second: str, weight: float, also: Sequence[tuple[str, float]] = ()) -> dict[str, float]:
    """The weights of the motions of a blend, the first with what the others leave.

    Raises:
        CommandError: if a motion is named twice, there are too many, or a weight is not allowed; it says what is.
    """
    parts = [(second, weight), *also]
    names = [first, *(name for name, _ in parts)]
    for name in names:
        if names.count(name) > 1:
            raise CommandError(f"a blend takes two motions or more, not {name} twice")
    if len(names) > MOST_BLENDED:
        raise CommandError(f"a blend takes at most {MOST_BLENDED} motions, not {len(names)}")
    for _, part in parts:
        (PART if also else WEIGHT).check(part)
    rest = 1.0 - sum(part for _, part in parts)
    if also and rest < -1e-9:
        raise CommandError(f"the weights of a blend sum to at most 1, not to {1.0 - rest:g}; {first} has what is left")
    return {first: rest if abs(rest) > 1e-9 else 0.0} | dict(parts)


def read_message(data: bytes) -> Message:
    """The command in a datagram.

    Raises:
        CommandError: if it is no command, or an argument is out of range; it names what is allowed.
    """
    if len(data) > MOST_BYTES:
        raise CommandError(f"this message is too long; {MOST_BYTES} bytes are the most")
    try:
        return checked(_messages.decode(data))
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise CommandError(f"this is not a command ({error}). Commands: {USAGES}.") from error


def parse_command(words: Sequence[str]) -> Message:
    """The message of typed words: a command and its arguments, or a motion's name alone, which switches to it.

    Raises:
        CommandError: if they are no command; it names the commands.
    """
    command = BY_WORD.get(words[0]) if words else None
    if command is not None:
        try:
            return command.parse(words[1:])
        except CommandError as error:
            raise CommandError(f"{words[0]}: {error}") from None
    if len(words) == 1:
        return checked(Switch(words[0]))
    hint = did_you_mean(words[0], BY_WORD) if words else ""
    raise CommandError(f"'{' '.join(words)}' is not a command.{hint} `motiondeck send help` lists the commands.")
