"""Translates msgspec errors into the terms of TOML and JSON files."""

import re

_KINDS = {
    "str": "text",
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
}
_BOUNDS = {">=": "of at least", "<=": "of at most", ">": "above", "<": "below"}


def in_file_words(message: str) -> str:
    """Such as "expected a number of at least 0" for "Expected `float` >= 0.0"; other messages as they are."""
    if missing := re.fullmatch(r"Object missing required field `(.*)`", message):
        return f"missing key '{missing[1]}'"
    parts = re.fullmatch(r"Expected `([^`]*)`(?:, got `([^`]*)`| of length (\S+) (\S+)| (\S+) (\S+))", message)
    if parts is None:
        return message
    wanted, got, length, longest, bound, limit = parts.groups()
    kinds = " or ".join(_KINDS.get(kind, kind) for kind in wanted.split(" | ") if kind != "null")
    if got is not None:
        return f"expected {kinds}, not {'a number with decimals' if got == 'float' else _KINDS.get(got, got)}"
    if length is not None:
        return f"expected {kinds} with a length {_BOUNDS.get(length, length)} {longest}"
    return f"expected {kinds} {_BOUNDS.get(bound, bound)} {limit.removesuffix('.0')}"
