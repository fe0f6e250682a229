"""Tables as text: the facts of models are files of rows of words, beside the module that reads them."""

from pathlib import Path


def file_beside(module: str, name: str) -> str:
    """The text of a file in the folder of a module, which is given by its `__file__`."""
    return Path(module).with_name(name).read_text(encoding="utf-8")


def rows_of(text: str) -> list[list[str]]:
    """The words of each row; # begins a comment, and rows without words are left out."""
    return [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
