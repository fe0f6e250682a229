"""Help and messages point to nothing that a wheel lacks: to no folder of the source, and to pages by title."""

import ast
import re
import tomllib
from pathlib import Path

import pytest
import typer

from motiondeck.cli.main import command_line

ROOT = Path(__file__).parents[3]
ROOMS = ("controller", "sim", "hardware", "motiondeck", "motiondeck_base")
OF_THE_SOURCE = re.compile(
    r"(?<![\w/.])(docs|configs|examples|benchmarks|tests)/[\w*{]|python -m benchmarks|\b[\w-]+\.md\b"
)
TITLES = [file.read_text("utf-8").partition("\n")[0].removeprefix("# ") for file in (ROOT / "docs").glob("*.md")]


def helps(command, name="motiondeck"):
    """The help of a command, of its options and of all commands below it."""
    yield name, command.help or ""
    for parameter in command.params:
        yield f"{name} {parameter.name}", getattr(parameter, "help", None) or ""
    for word, one in getattr(command, "commands", {}).items():
        yield from helps(one, f"{name} {word}")


def said():
    """Every text in the source that is no docstring, and every text of a table, by file."""
    for room in ROOMS:
        for file in sorted((ROOT / room).rglob("*.py")):
            tree = ast.parse(file.read_text("utf-8"))
            bodies = [
                node.body for node in ast.walk(tree) if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
            ]
            docstrings = {id(body[0].value) for body in bodies if body and isinstance(body[0], ast.Expr)}
            for node in ast.walk(tree):
                if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
                    yield file.name, node.value
        for file in sorted((ROOT / room).rglob("*.toml")):
            yield file.name, str(tomllib.loads(file.read_text("utf-8")))


def problems(text):
    """Places that a wheel lacks, unless the text says how to copy them, and titles that no page has."""
    copied = re.search(r"motiondeck examples|wrote examples/", text)
    lacking = [
        found[0] for found in OF_THE_SOURCE.finditer(text) if not (copied and found[1] in ("configs", "examples"))
    ]
    titles = re.findall(r"""\bpage ['"]([^'"]+)['"]""", text)
    return lacking + [title for title in titles if not any(one.startswith(title) for one in TITLES)]


@pytest.mark.parametrize("texts", [helps(typer.main.get_command(command_line())), said()], ids=["help", "messages"])
def test_no_text_names_a_place_that_a_wheel_lacks(texts):
    wrong = [(where, problems(text)) for where, text in texts]
    assert [(where, found) for where, found in wrong if found] == []
