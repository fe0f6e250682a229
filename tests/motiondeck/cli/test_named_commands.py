"""Commands, options and benchmarks that texts name exist: in configs, pages, docstrings, help and error messages."""

import re
from pathlib import Path

import pytest
import typer

from benchmarks.__main__ import find_benchmarks
from motiondeck.cli.main import command_line

ROOT = Path(__file__).parents[3]
PRODUCT = [
    path
    for room in ("motiondeck", "motiondeck_base", "controller", "sim", "hardware", "examples")
    for path in sorted((ROOT / room).rglob("*.py"))
]
CONFIGS = sorted((ROOT / "configs").rglob("*.toml"))
# The change log names what is gone.
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
OPTION = re.compile(r"(?<![\w(-])--[a-z][a-z-]*[a-z]\b(?!:)")  # not var(--x) and --x: of a style sheet
# Of pip, dask and servers.
FOREIGN = {"--require-hashes", "--no-deps", "--dashboard-address", "--nthreads", "--nworkers"}


def declared():
    """Options of benchmarks, examples and child processes: as text, or as a parameter from which typer makes one."""
    texts = [path.read_text() for path in (ROOT / "benchmarks").rglob("*.py")]
    names = {name.replace("_", "-") for text in texts for name in re.findall(r"^    (\w+): ", text, flags=re.M)}
    written = {option for text in texts for option in OPTION.findall(text)}
    by_argparse = {
        option for path in PRODUCT for option in re.findall(r"add_argument\(\s*\"(--[a-z-]+)", path.read_text())
    }
    return written | by_argparse | {f"--{no}{name}" for name in names for no in ("", "no-")}


@pytest.fixture(scope="module")
def program():
    return typer.main.get_command(command_line())


@pytest.fixture(scope="module")
def elsewhere():
    return declared() | FOREIGN


def options_of(command):
    """The options of a command and of the commands below it."""
    own = {option for one in command.params for option in (*one.opts, *one.secondary_opts) if option.startswith("--")}
    return own.union(*(options_of(below) for below in getattr(command, "commands", {}).values()), {"--help"})


def mentions(program, text):
    """Where a text calls a command, as lists of words: after `motiondeck`, or between backticks."""
    names = "|".join(program.commands)
    called = rf"(?:\bmotiondeck |`)((?:{names})(?: [^`\n]*?)?)(?=`|\n|$|  | \||[;&#])"
    return [match.split() for match in re.findall(called, text)]


def wrong(program, words):
    """What a call names that is not there, or nothing."""
    command, rest = program, words
    while hasattr(command, "commands") and rest and re.fullmatch(r"[a-z-]+", rest[0]):
        if rest[0] not in command.commands:
            return f"{' '.join(words)}: there is no command {rest[0]}"
        command, rest = command.commands[rest[0]], rest[1:]
    unknown = set(OPTION.findall(" ".join(rest))) - options_of(command) - {"--debug"}
    return f"{' '.join(words)}: no option {', '.join(sorted(unknown))}" if unknown else ""


def leaves(command):
    """The commands below a command that are no groups."""
    for below in getattr(command, "commands", {}).values():
        yield from leaves(below) if hasattr(below, "commands") else [below]


def test_every_command_has_an_example_and_begins_with_a_sentence_of_one_line(program):
    for command in leaves(program):
        sentence = command.help.partition("\n\n")[0]
        assert "Example" in command.help, command.name
        assert len(sentence) <= 66, sentence
        assert [one.name for one in command.params if not one.help] == []


def test_the_command_line_stays_small(program):
    commands = list(leaves(program))
    options = [one for command in commands for one in command.params if one.param_type_name == "option"]
    assert len(commands) <= 47
    assert len([one for one in options if one.name != "help"]) <= 246


@pytest.mark.parametrize("path", [*CONFIGS, *PAGES, *PRODUCT], ids=lambda path: path.relative_to(ROOT).as_posix())
def test_what_a_text_names_exists(program, elsewhere, path):
    text = path.read_text(encoding="utf-8")
    assert [problem for words in mentions(program, text) if (problem := wrong(program, words))] == []
    named = set(re.findall(r"(?:`|^ +|: +)motiondeck ([a-z]+)\b", text, flags=re.M))
    assert named - set(program.commands) == set()
    benchmarks = set(re.findall(r"python -m benchmarks ([a-z_0-9]+)", text))
    assert benchmarks - set(find_benchmarks()) == set()
    assert set(OPTION.findall(text)) - options_of(program) - elsewhere == set()
