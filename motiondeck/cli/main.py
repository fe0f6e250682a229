"""The `motiondeck` command: its subcommands, and its error messages."""

import errno
import io
import os
import re
import signal
import sys
import termios
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any

from motiondeck_base.early_end import outside_imports, take_signals
from motiondeck_base.whole_lines import print_whole_lines

# During imports Ctrl-C ends the program silently.
signal.signal(signal.SIGINT, signal.SIG_DFL)
take_signals()

# Two BLAS threads cost a loop 8 ms at p99; set before numpy is imported.
for _library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

warnings.filterwarnings("ignore", ".*(operate in serial mode|have been cancelled)")  # `jobs.spread` says the first

import typer  # noqa: E402
import typer.core  # noqa: E402

from motiondeck.cli.common.help_text import set_help_texts  # noqa: E402
from motiondeck_base.errors import MotiondeckError  # noqa: E402
from motiondeck_base.words import printable  # noqa: E402

_WELCOME = """Plays learned human motions live on simulated humanoids and servo rigs, and switches them on command.

Three things to try:

  motiondeck play                a humanoid, with a button for each motion
  motiondeck learn walk.bvh      learn a recording of your own, to play it
  motiondeck play --robot servo20 --rig emulated
                                 the same on twenty emulated servos

`motiondeck COMMAND --help` explains a command and has examples.
"""

# Typer vendors Click or imports it; this is the base class of usage errors in both.
_UsageError: type[Exception] = typer.BadParameter.__bases__[0]

# The panels of the help, and the module of each command; a group of commands is an app.
_PANELS = {
    "Play": {"play": "play", "send": "remote.send", "events": "remote.send", "replay": "replay", "plot": "plot"},
    "Learn": {
        "examples": "examples",
        "learn": "learn",
        "clip": "clip.commands",
        "library": "library",
        "evaluate": "evaluate",
        "recognize": "recognize",
        "segment": "segment",
    },
    "Robot": {"robot": "robot.commands", "preflight": "preflight", "retarget": "robot.retarget"},
    "Servo rig": {"rig": "rig.commands"},
    "Export": {"export": "export"},
    "Show": {"gamepad": "remote.gamepad", "stage": "remote.stage", "conduct": "show.conduct", "fleet": "show.fleet"},
}


class _Commands(typer.core.TyperGroup):
    """The commands in the order of their panels."""

    def list_commands(self, ctx: Any) -> list[str]:
        """The names of the commands that were imported."""
        return [name for modules in _PANELS.values() for name in modules if name in self.commands]


def command_line(words: Sequence[str] = ()) -> typer.Typer:
    """The command line; if `words` begin with a subcommand, only that one is imported, which saves time."""
    app = typer.Typer(
        name="motiondeck",
        cls=_Commands,
        help=_WELCOME,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        rich_markup_mode="rich",
        pretty_exceptions_enable=False,
    )
    app.callback()(options)
    rows = [(panel, name, module) for panel, modules in _PANELS.items() for name, module in modules.items()]
    first = next((word for word in words if word != "--debug"), "")
    for panel, name, path in [row for row in rows if row[1] == first] or rows:
        module = import_module(f"motiondeck.cli.{path}")
        if hasattr(module, "app"):
            app.add_typer(module.app, name=name, rich_help_panel=panel)
        else:
            # A negative number is not an option: `send tempo -1`.
            settings = {"ignore_unknown_options": True} if name == "send" else None
            app.command(name, context_settings=settings, rich_help_panel=panel)(getattr(module, name))
    set_help_texts(app)
    return app


def _print_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version  # slow to import

        print(f"motiondeck {version('motiondeck')}")
        raise typer.Exit


def options(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Options of every subcommand."""
    if debug:
        os.environ["MOTIONDECK_DEBUG"] = "1"


def _refuse(error: Any) -> None:
    """Ends the program after a usage error, with one line and exit code 2."""
    problem = printable(error.format_message()).replace("Value error, ", "")
    problem = problem.replace("a valid float", "a number").replace("a valid int", "a whole number")
    if problem:  # else the help has been printed
        command = error.ctx.command_path if error.ctx is not None else "motiondeck"
        end = "" if problem.endswith(("?", ".")) else "."
        if error.ctx is not None and problem.startswith("Missing"):
            text = re.sub(r" \\\n *", " ", error.ctx.command.help)
            end += f" Example: {re.findall(rf'{command} .*?(?=  |$)', text, re.M)[0]}."
        print(f"motiondeck: {problem}{end} `{command} --help` explains.", file=sys.stderr)
    sys.exit(error.exit_code)


def _terminal_is_closed() -> bool:
    """Whether standard output is a terminal whose window was closed."""
    try:
        termios.tcgetattr(1)
    except termios.error as error:
        return error.args[0] == errno.EIO
    return False


def _run() -> Any:
    """Runs the command and flushes its output, so that write errors are raised here."""
    try:
        return command_line(sys.argv[1:])(standalone_mode=False)
    finally:
        if sys.stdout is not None:
            sys.stdout.flush()


def main() -> None:
    """Runs the command line; a user's mistake prints one line, with exit code 1."""
    signal.signal(signal.SIGINT, outside_imports(signal.default_int_handler))
    print_whole_lines()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # letters that the terminal lacks become question marks
    try:
        sys.exit(_run())
    except (KeyboardInterrupt, typer.Abort):
        sys.exit(130)
    except BrokenPipeError:
        # The reader of the output has ended (`| head`).
        sys.stdout = None
        sys.exit(141)
    except OSError as error:
        if _terminal_is_closed():
            sys.stdout = None
            sys.exit(128 + signal.SIGHUP)
        if "MOTIONDECK_DEBUG" in os.environ or error.errno != errno.ENOSPC:
            raise
        print("motiondeck: no space is left on the device of the output", file=sys.stderr)
        sys.stdout = None
        sys.exit(1)
    except _UsageError as error:
        _refuse(error)
    except Exception as error:
        if "MOTIONDECK_DEBUG" in os.environ or not isinstance(error, MotiondeckError):
            raise
        print(f"motiondeck: {printable(str(error))}", file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
