"""The `motiondeck` command: its subcommands, and how errors reach the user."""

from __future__ import annotations

import errno
import os
import signal
import sys
from typing import Annotated

# While modules are still being imported Ctrl-C ends the program silently.
signal.signal(signal.SIGINT, signal.SIG_DFL)

# Two BLAS threads cost a loop eight milliseconds at p99; this must be set before numpy is imported.
for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

import typer  # noqa: E402

from controller.cli import (  # noqa: E402
    evaluate,
    fit,
    gamepad,
    learn,
    play,
    plot,
    preflight,
    recognize,
    replay,
    segment,
    send,
)
from controller.cli.clip import fill  # noqa: E402
from controller.cli.library import motions  # noqa: E402
from controller.cli.rig import commands as rig  # noqa: E402
from controller.cli.robot import commands as robot  # noqa: E402
from controller.cli.robot import retarget  # noqa: E402
from motiondeck_base.errors import MotiondeckError  # noqa: E402
from motiondeck_base.printable import printable  # noqa: E402

app = typer.Typer(
    name="motiondeck",
    help="Plays learned human motions live on simulated humanoids and servo rigs, and switches them on command.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
)
app.command("play")(play.play)
app.command("send")(send.send)
app.command("events")(send.events)
app.command("gamepad")(gamepad.gamepad)
app.command("replay")(replay.replay)
app.command("plot")(plot.plot)
app.command("learn")(learn.learn)
app.command("fit")(fit.fit)
app.command("evaluate")(evaluate.evaluate)
app.command("preflight")(preflight.preflight)
app.command("retarget")(retarget.retarget)
app.add_typer(motions.app, name="library")
app.add_typer(fill.app, name="clip")
app.add_typer(rig.app, name="rig")
app.add_typer(robot.app, name="robot")
app.add_typer(recognize.app, name="recognize")
app.command("segment")(segment.segment)


@app.callback()
def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    """Sets what holds for every subcommand."""
    if debug:
        os.environ["MOTIONDECK_DEBUG"] = "1"


def main() -> None:
    """Runs the command line; a user's mistake ends in one clear line and exit code 1."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader of our output has gone (`| head`).
        sys.stdout = None
        sys.exit(141)
    except OSError as error:
        if "MOTIONDECK_DEBUG" in os.environ or error.errno != errno.ENOSPC:
            raise
        print("motiondeck: no space is left where the output goes", file=sys.stderr)
        sys.stdout = None
        sys.exit(1)
    except Exception as error:
        if "MOTIONDECK_DEBUG" in os.environ or not isinstance(error, MotiondeckError):
            raise
        print(f"motiondeck: {printable(str(error))}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
