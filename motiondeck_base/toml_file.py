"""Reading TOML into typed structures, with errors that name the file, the key and what would have been right."""

from __future__ import annotations

import difflib
import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from motiondeck_base.errors import FileFormatError

T = TypeVar("T")


def read_toml(path: Path, shape: type[T]) -> T:
    """The contents of a TOML file as a msgspec structure that forbids unknown fields.

    Raises:
        FileFormatError: one line with the file, the place, and the allowed keys or the expected type.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise FileFormatError(f"{path}: is not a text file") from None
    try:
        tree = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileFormatError(f"{path}: not valid TOML: {error}") from None
    return shaped(tree, shape, str(path))


def shaped(tree: object, shape: type[T], place: str) -> T:
    """A tree of plain values as a msgspec structure; `place` is what errors call it.

    Raises:
        FileFormatError: if the tree does not fit.
    """
    try:
        return msgspec.convert(tree, shape, strict=True)
    except msgspec.ValidationError as error:
        raise FileFormatError(f"{place}: {_explain(str(error), shape, tree)}") from None


def _explain(message: str, shape: Any, tree: Any) -> str:
    """msgspec's message with the allowed keys added where a key is unknown."""
    where = re.search(r" - at `\$(?P<path>[^`]*)`$", message)
    path = where["path"] if where else ""
    said = message[: where.start()] if where else message
    at = f" in [{path.lstrip('.')}]" if path else ""
    unknown = re.search(r"unknown field `(?P<key>[^`]*)`", said)
    if unknown is None:
        return said[:1].lower() + said[1:] + at
    key, allowed = unknown["key"], _allowed(shape, path, tree)
    near = difflib.get_close_matches(key, allowed, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return f"unknown key '{key}'{at}.{hint} Allowed are: {', '.join(sorted(allowed))}."


def _allowed(shape: Any, path: str, tree: Any) -> list[str]:
    """The keys that the structure at a msgspec path takes."""
    kind: Any = msgspec.inspect.type_info(shape)
    for step in re.findall(r"\.(\w+)|\[(\d+|\.\.\.)\]", path):
        name = step[0]
        kind = _struct_of(kind, tree)
        if name:
            field = next((f for f in getattr(kind, "fields", ()) if f.encode_name == name), None)
            if field is None:
                return []
            kind = field.type
            tree = tree.get(name) if isinstance(tree, dict) else None
        else:
            kind = getattr(kind, "item_type", None) or getattr(kind, "value_type", kind)
            tree = tree[int(step[1])] if step[1].isdigit() and isinstance(tree, list) else None
    kind = _struct_of(kind, tree)
    names = [field.encode_name for field in getattr(kind, "fields", ())]
    return [*names, kind.tag_field] if getattr(kind, "tag_field", None) else names


def _struct_of(kind: Any, tree: Any) -> Any:
    """Of a union the member that the tree's tag picks, else the type itself."""
    members = [m for m in getattr(kind, "types", ()) if isinstance(m, msgspec.inspect.StructType)]
    for member in members:
        if isinstance(tree, dict) and member.tag_field and tree.get(member.tag_field) == member.tag:
            return member
    return members[0] if members else kind
