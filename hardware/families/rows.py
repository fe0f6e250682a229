"""Tables as text: the facts of models are written as rows of words."""


def rows_of(text: str) -> list[list[str]]:
    """The words of each row; # begins a comment, and rows without words are left out."""
    return [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
