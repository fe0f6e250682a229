"""The words of the product's sources: little dialect, and no name of a file or module that does not exist."""

import io
import re
import tokenize
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("motiondeck", "motiondeck_base", "controller", "sim", "hardware")
PRODUCT = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
SOURCES = [*PRODUCT, *(path for folder in ("benchmarks", "examples") for path in sorted((ROOT / folder).rglob("*.py")))]

# A person in place of the thing, or a clause in place of the field's term.
DIALECT = re.compile(r"\b(?:who|whoever|told|nobody|so many|of its own|in turns|one's)\b", re.IGNORECASE)
MOST = 10  # some are right; lower it with what is rewritten

FILE = re.compile(r"(?<![\w./*<-])((?:\w+/)*\w+\.(?:py|md))\b")
MODULE = re.compile(rf"`((?:{'|'.join(PACKAGES)})(?:\.\w+)+)`")


def test_the_product_speaks_plain_english():
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in PRODUCT
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        for _ in DIALECT.findall(line)
    ]
    assert len(found) <= MOST, "\n".join(found)


def prose(path):
    """The strings and comments of a source."""
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
    return "\n".join(token.string for token in tokens if token.type in (tokenize.STRING, tokenize.COMMENT))


def existing_files():
    """Every file of the project, with a slash before each part of its path."""
    skipped = {".git", ".venv", "build", "dist"}
    top = [path for path in ROOT.iterdir() if path.name not in skipped]
    paths = [path for one in top for path in ([one] if one.is_file() else one.rglob("*"))]
    return ["/" + path.relative_to(ROOT).as_posix() for path in paths]


def exists_as_module(name):
    """Whether a dotted name is a module, or something in one."""
    parts = name.split(".")
    for length in range(len(parts), 0, -1):
        path = ROOT.joinpath(*parts[:length])
        source = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if source.is_file():
            return length == len(parts) or re.search(rf"\b{parts[length]}\b", source.read_text()) is not None
    return False


@pytest.fixture(scope="module")
def texts():
    return {path.relative_to(ROOT).as_posix(): prose(path) for path in SOURCES}


def test_sources_name_files_that_exist(texts):
    ends = {end for path in existing_files() for end in (path[i:] for i, sign in enumerate(path) if sign == "/")}
    gone = {path: {name for name in FILE.findall(text) if f"/{name}" not in ends} for path, text in texts.items()}
    assert {path: names for path, names in gone.items() if names} == {}


def test_sources_name_modules_that_exist(texts):
    gone = {path: {n for n in MODULE.findall(text) if not exists_as_module(n)} for path, text in texts.items()}
    assert {path: names for path, names in gone.items() if names} == {}
