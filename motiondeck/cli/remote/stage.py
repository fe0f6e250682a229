"""`motiondeck stage`: commands a running deck by OSC, MIDI and trackers."""

from __future__ import annotations

import logging
import sys
import time
from contextlib import ExitStack, closing
from functools import partial
from typing import TYPE_CHECKING, Annotated

from typer import Argument

from controller.wire.command_socket import DEFAULT_PORT
from controller.wire.messages.commands import DeckCommand, FollowPerson, Gaze, GiveBeat, Pause, SetInput, SetTempo
from controller.wire.messages.replies import Refused, Reply
from motiondeck.cli.remote.send import CommandPort, Host, TokenFile, client_of, state_of
from motiondeck.run.terminal import describe
from motiondeck_base.errors import FileFormatError, MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_library, find_stage
from motiondeck_base.words import counted, printable

if TYPE_CHECKING:
    from motiondeck.stage.bridge import Input
    from motiondeck.stage.stage_file import StageMap


class Sparing:
    """Says a text on standard error, but the same one at most once a second."""

    def __init__(self) -> None:
        self._said, self._at = "", 0.0

    def __call__(self, text: str) -> None:
        """Says a text."""
        now = time.monotonic()
        if text != self._said or now > self._at + 1.0:
            self._said, self._at = text, now
            print(printable(text), file=sys.stderr, flush=True)


def stage(
    file: Annotated[str, Argument(metavar="FILE", help="The stage file, or the name of a shipped one: osc, midi.")],
    command_port: CommandPort = DEFAULT_PORT,
    host: Host = None,
    token_file: TokenFile = None,
) -> None:
    """Command the running deck by OSC, MIDI and trackers of a person.

    A stage file maps them to commands; the deck's end or Ctrl-C ends it. OSC and trackers are taken from programs of
    this user on this machine only. For a deck on another machine run this beside them, with --host and --token-file.
    Needs the extra `stage`: pip install "motiondeck\\[stage]".

    Examples:  motiondeck stage osc      motiondeck stage show.toml
    """
    from controller.deck.person_follower import PersonFollower
    from controller.learning.reservoirs.completion_training import learn_completion
    from controller.library.motion_library import load_library
    from motiondeck.stage.bridge import Bridge
    from motiondeck.stage.midi import MidiGoneError, MidiInput, open_midi_port
    from motiondeck.stage.osc import OscInput, OscOutput
    from motiondeck.stage.stage_file import read_stage
    from motiondeck.stage.tracker import TrackerInput

    path = find_stage(file)
    mapped = read_stage(path)
    client = client_of(command_port, host, token_file)
    logging.disable(logging.WARNING)  # python-osc logs what it cannot read, and so do we, but not as often
    tell = Sparing()
    with ExitStack() as opened:
        opened.callback(logging.disable, logging.NOTSET)
        opened.enter_context(closing(client))
        try:
            motions = state_of(client).motions
            named = {motion: pattern for pattern in mapped.patterns for motion in pattern.motions}
            problems = [
                f"'{pattern.text}': {UnknownNameError.among('motion', motion, motions)}"
                for motion, pattern in named.items()
                if motion not in motions
            ]
            if problems:
                raise FileFormatError.listing(str(path), problems)
            inputs: list[Input] = []
            if mapped.osc.port is not None:
                inputs.append(opened.enter_context(closing(OscInput(mapped.osc.port, mapped.osc.commands, tell))))
            if mapped.midi is not None:
                port = open_midi_port(mapped.midi.input)
                inputs.append(opened.enter_context(closing(MidiInput(port, mapped.midi))))
            if (tracker := mapped.tracker) is not None:
                library = load_library(find_library(tracker.library))
                if unknown := ", ".join(motion for motion in library.network.motions if motion not in motions):
                    raise FileFormatError(f"{path}: library in [tracker] has motions that the deck lacks: {unknown}.")
                follower = PersonFollower(library, tracker.points, tracker.height, learn_completion)
                heard = TrackerInput(tracker.listen, follower, tracker.names, tell)
                inputs.append(opened.enter_context(closing(heard)))
            target = mapped.osc.target
            output = opened.enter_context(closing(OscOutput(*target))) if target is not None else None
            print(f"{path.name}: {_summary(mapped)}", flush=True)
            Bridge(client, inputs, output, partial(_print_reply, tell), tell).run()
        except MidiGoneError as error:
            client.request(Pause())
            raise MotiondeckError(f"{error}, so the deck was paused") from None
        except KeyboardInterrupt:
            sys.exit(130)


def _summary(mapped: StageMap) -> str:
    osc, midi = mapped.osc, mapped.midi
    parts: list[str] = []
    if osc.port is not None:
        parts.append(f"OSC on port {osc.port} of loopback ({counted(len(osc.commands), 'address')})")
    if osc.target is not None:
        parts.append(f"OSC to {osc.target[0]}:{osc.target[1]}")
    if midi is not None:
        clock = ", clock" if midi.clock else ""
        parts.append(
            f"MIDI from {midi.input} ({counted(len(midi.notes), 'note')}, {counted(len(midi.cues), 'cue')}{clock})"
        )
    if (tracker := mapped.tracker) is not None:
        parts.append(f"trackers on port {tracker.listen} of loopback ({counted(len(tracker.points), 'point')})")
    return ", ".join(parts)


def _print_reply(tell: Sparing, source: str, command: DeckCommand, reply: Reply) -> None:
    """Prints a command and its reply; of those that come again and again only what is refused."""
    if isinstance(reply, Refused) or not isinstance(command, FollowPerson | Gaze | GiveBeat | SetTempo | SetInput):
        line = f"{source}: {command.row.word}: {describe(reply)}"
        if isinstance(command, FollowPerson):  # refused 30 times a second while the deck is stopped
            tell(line)
        else:
            print(printable(line).replace("\n", r"\n"), flush=True)
