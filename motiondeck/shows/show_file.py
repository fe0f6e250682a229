"""The show file: groups of decks, and cues with times, conditions and hold points.

show = "gala"                  # the name that decks give with --show gala/DECK
if_lost = "hold"               # what a deck does without the conductor: go on, hold or stop

[groups]
chorus = ["left", "right"]

[[cues]]
at = 2.0                       # s since the show began, or since the latest hold point or condition
say = "switch walk"
in_step = true

[[cues]]
name = "bow"
hold = true                    # waits for `go`
to = ["chorus"]
say = ["switch waltz", "tempo 0.8"]
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Literal

import msgspec

from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_table import parse_command
from controller.wire.messages.commands import DeckCommand
from motiondeck.shows.membership import CONDUCTOR, check_name
from motiondeck.shows.messages import Lost
from motiondeck_base.errors import FileFormatError, MotiondeckError, UnknownNameError
from motiondeck_base.toml_file import read_toml

ALL = "all"  # the group of all decks of a show
Condition = Literal["here", "settled", "in step"]
"""Of all decks of a cue: they are connected and know the time; no switch is under way; their phases are locked."""

Seconds = Annotated[float, msgspec.Meta(ge=0, le=86400)]


class ShowCue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A cue as written."""

    say: str | list[str]
    name: str = ""
    at: Seconds | None = None  # s since the show began, or since the latest hold point or condition
    hold: bool = False
    when: Condition | None = None  # waits until this holds
    within: Seconds | None = None  # s after which a condition that does not hold becomes a hold point
    to: str | list[str] = ALL
    # Keeps loops in step from then on, at the recorded length of the motion, or at this many s a round.
    in_step: bool | Annotated[float, msgspec.Meta(ge=0.2, le=60)] = False

    @property
    def receivers(self) -> list[str]:
        """The decks and groups that it is for."""
        return [self.to] if isinstance(self.to, str) else self.to

    @property
    def commands(self) -> list[DeckCommand]:
        """The commands of the cue; raises a CommandError if it is no command, or none that a show may give."""
        lines = [self.say] if isinstance(self.say, str) else self.say
        return [show_command(line) for line in lines]

    @property
    def motions(self) -> list[str]:
        """The motions that the commands name."""
        return [name for command in self.commands for name in command.motions]


class Show(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A show."""

    show: str
    cues: list[ShowCue] = []
    decks: list[str] = []  # those that belong to it; without them every deck that is there
    groups: dict[str, list[str]] = {}
    lead: Annotated[float, msgspec.Meta(ge=0.05, le=10)] = 0.5  # how long before its time a cue is sent, s
    if_lost: Lost = "hold"  # what a deck does that has lost the conductor
    lost_after: Annotated[float, msgspec.Meta(ge=1, le=60)] = 3.0  # s without an answer until then

    def members(self, names: list[str], present: list[str]) -> list[str]:
        """The decks of some names of decks and groups, each once."""
        everybody = self.decks or present
        found = [deck for name in names for deck in (everybody if name == ALL else self.groups.get(name, [name]))]
        return list(dict.fromkeys(found))


def show_command(line: str) -> DeckCommand:
    """The command in a line of a show; raises a CommandError if it is none, or none that a show may give."""
    message = parse_command(line.split())
    message.row.check_use("cue")
    return message


def read_show(path: Path) -> Show:
    """Reads a show file; a FileFormatError has one line per problem: the file, the place, what is allowed there."""
    show = read_toml(path, Show)
    problems = [*_wrong_names(show), *_wrong_cues(show)]
    if problems:
        raise FileFormatError.listing(str(path), problems)
    return show


def wrong_motions(show: Show, decks: Mapping[str, Mapping[str, float]]) -> Iterator[str]:
    """Motions of cues that decks lack, as problems."""
    for number, cue in enumerate(show.cues, start=1):
        for name in show.members(cue.receivers, list(decks)):
            motions = decks.get(name)
            for motion in cue.motions:
                if motions is not None and motion not in motions:
                    yield f"{_place(number, cue)}: {name}: {UnknownNameError.among('motion', motion, motions)}"


def _wrong_names(show: Show) -> Iterator[str]:
    for name, what, place in (
        (show.show, "show", "show"),
        *((name, "deck", "decks") for name in show.decks),
        *((name, "group", "groups") for name in show.groups),
        *((name, "deck", f"groups.{group}") for group, decks in show.groups.items() for name in decks),
    ):
        try:
            check_name(name, what)
        except MotiondeckError as error:
            yield f"{error} in [{place}]"
        if name == CONDUCTOR and what != "show":
            yield f"the conductor cannot be a {what}: another name is needed in [{place}]"
    yield from (f"deck '{name}' is named twice in [decks]" for name, often in Counter(show.decks).items() if often > 1)
    if ALL in show.groups:
        yield f"the group '{ALL}' is always there; call yours otherwise in [groups]"
    for group, decks in show.groups.items():
        if group in show.decks:
            yield f"the group '{group}' has the name of a deck; call it otherwise in [groups]"
        if not decks:
            yield f"the group '{group}' has no decks in [groups]"
        for name in decks:
            if name in show.groups or name == ALL:
                yield f"'{name}' is a group: a group has decks, no other groups in [groups.{group}]"
            elif show.decks and name not in show.decks:
                yield f"{UnknownNameError.among('deck', name, show.decks)} in [groups.{group}]"


def _wrong_cues(show: Show) -> Iterator[str]:
    known = [*show.decks, *show.groups, ALL]
    names: set[str] = set()
    latest = 0.0
    for number, cue in enumerate(show.cues, start=1):
        place = _place(number, cue)
        if cue.name and (cue.name in names or names.add(cue.name)):
            yield f"{place}: another cue has this name"
        if cue.name.isdecimal():
            yield f"{place}: a name that is a number is taken for the number of a cue; call it otherwise"
        if not cue.say:
            yield f"{place}: say is empty; give one command or several"
        if not cue.receivers:
            yield f"{place}: to is empty; name a deck or group, or several, or leave it out for all"
        waits = [key for key, given in (("at", cue.at is not None), ("hold", cue.hold), ("when", cue.when)) if given]
        if len(waits) != 1:
            given = f"not {' and '.join(waits)}" if waits else "which say when it comes"
            yield f"{place}: give one of at, hold = true and when, {given}"
        if cue.within is not None and cue.when is None:
            yield f"{place}: within belongs to when"
        if cue.at is not None and cue.at < latest:
            yield f"{place}: at = {cue.at:g} is before the cue above, at {latest:g} s"
        latest = cue.at if cue.at is not None else 0.0
        for name in cue.receivers:
            try:
                check_name(name, "deck or group")
            except MotiondeckError as error:
                yield f"{place}: {error}"
            else:
                if show.decks and name not in known:
                    yield f"{place}: {UnknownNameError.among('deck', name, known)}"
        try:
            cue.commands  # noqa: B018 (for what it raises)
        except CommandError as error:
            yield f"{place}: {error}"


def _place(number: int, cue: ShowCue) -> str:
    return f"cue {number}" + (f" '{cue.name}'" if cue.name else "")
