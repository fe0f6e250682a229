"""`motiondeck send` and `motiondeck events`: a running deck commanded and followed from elsewhere."""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from typer import Argument, Option

from controller.wire.authentication import read_token
from controller.wire.command_socket import DEFAULT_PORT, CommandClient
from controller.wire.messages.command_table import COMMANDS, checked, parse_command
from controller.wire.messages.commands import Blend, EmergencyStop, GetStatus, Heartbeat, Subscribe
from controller.wire.messages.replies import Accepted, Event, Refused, Settled, State
from motiondeck.run.terminal import STARTING, describe, help_on
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import as_float

_LONGEST_WAIT = 120.0  # s for --wait: a switch by way of other motions takes that long
_STOPPED_WITHIN = 0.5  # s after which a line says that an emergency stop is not acknowledged
_AGAIN = 15.0  # s after which a subscription is renewed

_UNSTOPPED = "the emergency stop is not acknowledged yet; it is sent on. If the robot moves, cut its power"

CommandPort = Annotated[int, Option(metavar="PORT", help="The deck's command port.")]
Host = Annotated[str | None, Option(metavar="ADDRESS", help="A deck on another machine; needs --token-file.")]
TokenFile = Annotated[Path | None, Option(metavar="FILE", help="The token that deck was started with.")]


def send(
    words: Annotated[
        list[str],
        Argument(
            metavar="COMMAND",
            help=f"One of: {', '.join(command.word for command in COMMANDS)}; `motiondeck send help` explains them.",
        ),
    ],
    wait: Annotated[bool, Option("--wait", help="Wait until a switch, queued motion or blend has settled.")] = False,
    command_port: CommandPort = DEFAULT_PORT,
    host: Host = None,
    token_file: TokenFile = None,
    as_json: Annotated[bool, Option("--json", help="Print the deck's reply as one JSON object.")] = False,
) -> None:
    """Send a command to the running deck and print its reply.

    The exit code is 1 if the deck refuses. The commands are those of the prompt of `play`. MOTION alone switches to it,
    and `status` lists the motions.

    [bold]Examples[/]

      motiondeck send switch waltz
      motiondeck send tempo 0.5
      motiondeck send status --json
    """
    for word in words:
        if word.startswith("-") and as_float(word) is None:
            raise typer.BadParameter(f"there is no option {word}")
    if words[0] == "help":
        print(help_on(words[1:]))
        return
    request = parse_command(words)
    client = client_of(command_port, host, token_file)
    overdue = threading.Timer(_STOPPED_WITHIN, print, [_UNSTOPPED], {"file": sys.stderr, "flush": True})
    if isinstance(request, EmergencyStop) and host is not None:
        overdue.start()
    try:
        answer = client.request(request, STARTING)
        if wait and request.row.second_reply == "settled" and isinstance(answer, Accepted):
            if answer.after or answer.via:
                print(describe(answer), file=sys.stderr)
            answer = client.wait_settled(answer.id, _LONGEST_WAIT)
            if answer is None:
                raise MotiondeckError(f"it has not settled after {_LONGEST_WAIT:g} s; is the deck paused?")
        elif request.row.second_reply == "servos" and isinstance(answer, Accepted):
            answer = client.wait_settled(answer.id, _LONGEST_WAIT)
            if answer is None:
                raise MotiondeckError("the rig does not answer. Is it connected? See: motiondeck send status")
    finally:
        overdue.cancel()
        client.close()
    if as_json:
        print(json.dumps(msgspec.to_builtins(answer)))
    else:
        print(describe(answer))
        if isinstance(request, Blend) and isinstance(answer, Settled):
            print("the blend is checked as it plays: motiondeck events tells if it is given up", file=sys.stderr)
    if isinstance(answer, Refused):
        raise typer.Exit(1)


def events(
    command_port: CommandPort = DEFAULT_PORT,
    host: Host = None,
    token_file: TokenFile = None,
    heartbeat: Annotated[
        float | None, Option(metavar="SECONDS", help="Pause the deck after so long without a sign of this program, s.")
    ] = None,
    as_json: Annotated[bool, Option("--json", help="One JSON object a line.")] = False,
) -> None:
    """Print the events of the running deck until it ends or Ctrl-C.

    With --heartbeat the deck comes to a standstill when this program ends or the network between them fails.

    [bold]Examples[/]

      motiondeck events
      motiondeck events --json
      motiondeck events --heartbeat 1 --host robot ...
    """
    every = min(_AGAIN, heartbeat / 4.0) if heartbeat else _AGAIN
    client = client_of(command_port, host, token_file)
    try:
        if isinstance(refused := client.request(Subscribe(), STARTING), Refused):
            raise MotiondeckError(f"the deck refuses the subscription: {refused.reason}")
        if heartbeat is not None:
            client.post(checked(Heartbeat(heartbeat)))
        last, due = 0, time.monotonic() + every
        heard = due
        while True:
            reply = client.receive(due - time.monotonic())
            if reply is not None:
                heard = time.monotonic()
            elif time.monotonic() > heard + 2.0 * every + 1.0:
                raise MotiondeckError("the deck replies no more. Is it still running? See: motiondeck send status")
            if isinstance(reply, Event):
                if last and reply.number > last + 1:
                    print(f"{reply.number - last - 1} events were lost on the way", file=sys.stderr)
                last = reply.number
                line = json.dumps(msgspec.to_builtins(reply)) if as_json else f"{reply.at:.2f} {describe(reply)}"
                print(line, flush=True)
                if reply.kind == "ended":
                    return
            if time.monotonic() >= due:
                due += every
                client.post(Subscribe())
    finally:
        client.close()


def state_of(client: CommandClient) -> State:
    """What a deck plays, which may be starting still; MotiondeckError if it does not say so."""
    state = client.request(GetStatus(), STARTING)
    if not isinstance(state, State):
        raise MotiondeckError(f"the deck did not report what it plays: {describe(state)}")
    return state


def client_of(command_port: int, host: str | None, token_file: Path | None) -> CommandClient:
    """A client of the deck that the options name."""
    if (host is None) != (token_file is None):
        raise MotiondeckError("a deck on another machine needs both --host ADDRESS and --token-file FILE")
    token = read_token(token_file) if token_file is not None else None
    return CommandClient(command_port, host, token)
