"""`motiondeck send`: one command for a running deck, from another terminal or a script."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from controller.wire.command_socket import DEFAULT_PORT
from controller.wire.command_table import COMMANDS

_LONGEST_WAIT = 120.0  # s for --wait: a switch by way of other motions takes that long


def send(
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="COMMAND",
            help=" | ".join(command.usage for command in COMMANDS),
        ),
    ],
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait until a switch, a queued motion or a blend has settled.")
    ] = False,
    command_port: Annotated[int, typer.Option("--command-port", help="The deck's command port.")] = DEFAULT_PORT,
    host: Annotated[
        str | None,
        typer.Option("--host", metavar="ADDRESS", help="A deck on another machine; needs --token-file."),
    ] = None,
    token_file: Annotated[
        Path | None, typer.Option("--token-file", metavar="FILE", help="The token that deck was started with.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the deck's reply as one JSON object.")] = False,
) -> None:
    """Send a command to the running deck and print its reply; the exit code is 1 if it was refused.

    Examples:  motiondeck send switch waltz      motiondeck send tempo 0.5      motiondeck send status --json
    """
    import msgspec

    from controller.cli.session.terminal import describe
    from controller.wire.authentication import read_token
    from controller.wire.command_socket import CommandClient
    from controller.wire.command_table import parse_command
    from controller.wire.messages import Accepted, Blend, Queue, Refused, Switch
    from motiondeck_base.errors import MotiondeckError

    request = parse_command(words)
    if (host is None) != (token_file is None):
        raise MotiondeckError("a deck on another machine needs both --host ADDRESS and --token-file FILE")
    if host is not None and token_file is not None:
        client = CommandClient(command_port, host, read_token(token_file))
    else:
        client = CommandClient(command_port)
    try:
        answer = client.request(request)
        if wait and isinstance(request, Switch | Queue | Blend) and isinstance(answer, Accepted):
            if answer.after or answer.via:
                print(describe(answer), file=sys.stderr)
            answer = client.wait_settled(answer.id, _LONGEST_WAIT) or answer
    finally:
        client.close()
    if as_json:
        print(json.dumps(msgspec.to_builtins(answer)))
    else:
        print(describe(answer))
    if isinstance(answer, Refused):
        raise typer.Exit(1)
