"""`motiondeck send`: a command for the deck that is running, from another terminal or a script."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from controller.realtime.commands import DEFAULT_PORT


def send(
    words: Annotated[
        list[str],
        typer.Argument(metavar="COMMAND", help="switch MOTION | speed FACTOR | pause | resume | status | stop"),
    ],
    wait: Annotated[bool, typer.Option("--wait", help="Wait until a switch has settled.")] = False,
    command_port: Annotated[int, typer.Option("--command-port", help="The deck's command port.")] = DEFAULT_PORT,
    as_json: Annotated[bool, typer.Option("--json", help="Print the deck's answer as one JSON object.")] = False,
) -> None:
    """Send a command to the deck that is running and print its answer; the exit code is 1 if it was refused.

    Examples:  motiondeck send switch waltz      motiondeck send speed 0.5      motiondeck send status --json
    """
    import msgspec

    from controller.cli.terminal import parse_command
    from controller.realtime.commands import CommandClient
    from controller.realtime.messages import Accepted, Refused, Settled, State, Switch

    request = parse_command(words)
    client = CommandClient(command_port)
    try:
        answer = client.request(request)
        if wait and isinstance(request, Switch) and isinstance(answer, Accepted):
            answer = client.wait_settled(answer.id) or answer
    finally:
        client.close()
    if as_json:
        print(json.dumps(msgspec.to_builtins(answer)))
    else:
        match answer:
            case Refused(reason=reason):
                print(f"refused: {reason}")
            case Settled(to=motion, seconds=seconds):
                print(f"settled on {motion} after {seconds:.2f} s")
            case State() as state:
                print(f"{state.motion} at {state.speed:g} times{', paused' if state.paused else ''}")
                print(f"motions: {', '.join(state.motions)}")
            case _:
                print("accepted")
    if isinstance(answer, Refused):
        raise typer.Exit(1)
