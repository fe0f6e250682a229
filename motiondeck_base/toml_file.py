"""Reading TOML into typed structures, and writing values.

Errors name the file, the line, each wrong key and what is allowed there.
"""

import json
import math
import re
import tomllib
from bisect import bisect_left
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

import msgspec

from motiondeck_base.errors import FileFormatError
from motiondeck_base.files import what_it_is
from motiondeck_base.words import near_names

T = TypeVar("T")
Keys = tuple[str | int, ...]
"""The keys, and the indices from 0, that lead to a value."""
_LARGEST, _SMALLEST = 1e15, 1e-12  # numbers that calculations can hold
_ENDLESS = re.compile(r"[\d_]{4301}")
_ENDS = ("", "]", "]]", "]]]", "]}", "]}]", '"""', "'''")  # what may close the first lines of a TOML text
_KINDS = {"str": "text", "int": "a whole number", "float": "a number", "bool": "true or false"}
_KINDS |= {"array": "a list", "object": "a table"}
_BOUNDS = {">=": "of at least", "<=": "of at most", ">": "above", "<": "below"}


def read_toml(path: Path, shape: type[T]) -> T:
    """The contents of a TOML file as a msgspec structure that forbids unknown fields.

    A FileFormatError has one line per problem: the file, the line in it, the place, and the allowed keys or type.
    """
    text, tree = parse_toml(path)
    return shaped(tree, shape, str(path), _SMALLEST, text)


def parse_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """The text of a TOML file, and its contents as plain values; a FileFormatError says in one line what is wrong."""
    try:
        content = path.read_bytes()
        if found := what_it_is(path, content):
            raise FileFormatError(f"{path}: {found}")
        text = content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise FileFormatError(f"{path}: not a text file in UTF-8; save it as UTF-8") from None
    try:
        return text, tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileFormatError(f"{path}: not valid TOML: {error}") from None
    except ValueError:  # Python reads no whole number of more than 4300 digits
        line = next((number for number, line in enumerate(text.splitlines(), 1) if _ENDLESS.search(line)), 1)
        raise FileFormatError(f"{path} line {line}: the number is too long; numbers go up to {_LARGEST:g}") from None
    except RecursionError:
        raise FileFormatError(f"{path}: lists or tables stand too deep in each other; take brackets away") from None


def shaped(tree: object, shape: type[T], place: str, smallest: float = 0.0, text: str = "") -> T:
    """A tree of plain values as a msgspec structure; `place` is what errors call the tree.

    Numbers that are not finite, too large, or below `smallest` in size are refused. FileFormatError if the tree does
    not fit; one line per problem, with its line in `text`, the TOML text of the tree, if given.
    """
    problems = list(_impossible_numbers(tree, smallest, ()))
    try:
        if not problems:
            return msgspec.convert(tree, shape, strict=True)
    except msgspec.ValidationError:
        problems = _problems(tree, shape, ())
    lines = _Lines(text)
    raise FileFormatError("\n".join(f"{place}{lines.naming(keys)}: {problem}" for keys, problem in problems))


def _impossible_numbers(tree: object, smallest: float, place: Keys) -> Iterator[tuple[Keys, str]]:
    """The numbers of plain values that are not finite, beyond _LARGEST, or not 0 but nearer to it than `smallest`."""
    if isinstance(tree, dict):
        for key, part in tree.items():
            yield from _impossible_numbers(part, smallest, (*place, str(key)))
    elif isinstance(tree, list):
        for index, part in enumerate(tree):
            yield from _impossible_numbers(part, smallest, (*place, index))
    elif isinstance(tree, int | float) and not isinstance(tree, bool):
        size = abs(tree)
        if isinstance(size, float) and not math.isfinite(size):
            yield place, f"{_path(place)} is {tree}; it must be a finite number"
        elif size > _LARGEST:
            # Of a whole number only the length: Python writes no more than 4300 digits.
            digits = 1 + int(math.log10(2.0) * (size.bit_length() - 1)) if isinstance(size, int) else 0
            shown = f"a number of about {digits} digits" if digits else f"{tree:g}"
            yield place, f"{_path(place)} is {shown}; numbers go from {-_LARGEST:g} to {_LARGEST:g}"
        elif 0.0 < size < smallest:
            yield place, f"{_path(place)} is {tree:g}; give 0, or {smallest:g} or more"


class _Lines:
    """Where values stand in a TOML text: found in what its first lines alone say."""

    def __init__(self, text: str) -> None:
        self._lines = text.split("\n")
        self._trees: dict[int, Any] = {0: {}}

    def naming(self, keys: Keys) -> str:
        """Such as " line 3", on which a value begins, or the table that lacks it; "" where that is the whole text."""
        depth = self._depth(keys, last := len(self._lines))
        line = bisect_left(range(last + 1), depth, key=lambda count: self._depth(keys, count))
        return f" line {line}" if line else ""

    def _depth(self, keys: Keys, count: int) -> int:
        """How many of the keys the first lines have."""
        part = self._tree(count)
        for depth, key in enumerate(keys):
            try:
                part = part[key]
            except (KeyError, IndexError, TypeError):
                return depth
        return len(keys)

    def _tree(self, count: int) -> Any:
        """The contents of the first lines, with what they leave open closed; of fewer where that fails."""
        while count not in self._trees:
            for end in _ENDS:
                with suppress(tomllib.TOMLDecodeError):
                    self._trees[count] = tomllib.loads("\n".join([*self._lines[:count], end]))
                    return self._trees[count]
            count -= 1
        return self._trees[count]


def _problems(tree: object, shape: Any, where: Keys) -> list[tuple[Keys, str]]:
    """Every problem of a tree below some keys; msgspec stops at the first one, so each part is converted alone."""
    try:
        msgspec.convert(tree, shape, strict=True)
    except msgspec.ValidationError as error:
        message = re.sub(r" - at `\$[^`]*`$", "", str(error))
    else:
        return []
    shape = _member(shape, tree)
    found = list(_wrong_keys(tree, shape, where))
    for key, part, part_shape in _parts(tree, shape):
        found += _problems(part, part_shape, (*where, key))
    if isinstance(tree, str | int) and (choices := list(_choices(shape))):
        return [(where, f"{tree!r} is none of {', '.join(choices)}{_at(where)}")]
    if found:
        return found
    # A problem of the whole: a wrong type, a value out of range, or what the structure itself checks.
    words = in_file_words(message)
    own = words == message and where
    return [((*where, *_meant(message)), f"{_path(where)}: {words}" if own else f"{words}{_at(where)}")]


def _meant(message: str) -> Keys:
    """The list item that a structure's own check names last, as "joint 2 (neck)", or the key that it begins with."""
    items = re.findall(r"(\w+) (\d+) \(", message)
    return (f"{items[-1][0]}s", int(items[-1][1]) - 1) if items else (message.split(" ", 1)[0],)


def _wrong_keys(tree: object, shape: Any, where: Keys) -> Iterator[tuple[Keys, str]]:
    """The unknown and the missing keys of one table; a mistyped key is not missing too."""
    if not (isinstance(tree, dict) and _is_struct(shape)):
        return
    fields = msgspec.structs.fields(shape)
    config = shape.__struct_config__
    allowed = [field.encode_name for field in fields]
    if config.tag is not None:
        allowed.append(config.tag_field)
    meant: list[str] = []
    for key in tree:
        if key not in allowed and config.forbid_unknown_fields:
            near = near_names(str(key), allowed, 1)
            meant += near
            hint = f" Did you mean '{near[0]}'?" if near else ""
            problem = f"unknown key '{key}'{_at(where)}.{hint} Allowed are: {', '.join(sorted(allowed))}."
            yield (*where, key), problem
    for field in fields:
        if field.required and field.encode_name not in (*tree, *meant):
            yield where, f"missing key '{field.encode_name}'{_at(where)}"


def _parts(tree: object, shape: Any) -> Iterable[tuple[str | int, object, Any]]:
    """The parts of a table or an array: key or index, value, and the type that it should fit."""
    if isinstance(tree, dict) and _is_struct(shape):
        fields = msgspec.structs.fields(shape)
        return [(f.encode_name, tree[f.encode_name], f.type) for f in fields if f.encode_name in tree]
    kinds = get_args(shape)
    if isinstance(tree, dict) and get_origin(shape) is dict:
        return [(str(key), part, kinds[1]) for key, part in tree.items()]
    if isinstance(tree, list) and get_origin(shape) in (list, tuple):
        each = [kinds[0]] * len(tree) if len(kinds) == 1 or kinds[-1] is Ellipsis else kinds
        return [(index, part, kind) for index, (part, kind) in enumerate(zip(tree, each, strict=False))]
    return []


def _member(shape: Any, tree: object) -> Any:
    """The type of a union that the tree's tag picks, or else its only table or array; other types without bounds."""
    if get_origin(shape) is Annotated:
        shape = get_args(shape)[0]
    if get_origin(shape) not in (Union, UnionType):
        return shape
    members = get_args(shape)
    for member in filter(_is_struct, members):
        config = member.__struct_config__
        if isinstance(tree, dict) and config.tag is not None and tree.get(config.tag_field) == config.tag:
            return member
    containers = [member for member in members if _is_struct(member) or get_origin(member) in (dict, list, tuple)]
    return containers[0] if len(containers) == 1 else shape


def _choices(shape: Any) -> Iterator[str]:
    """The words that a value may be, if it may be nothing but one of some words."""
    members = get_args(shape) if get_origin(shape) in (Union, UnionType) else (shape,)
    for member in members:
        if member is str:
            return
        if get_origin(member) is Literal:
            yield from map(str, get_args(member))


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


def _is_struct(shape: Any) -> bool:
    return isinstance(shape, type) and issubclass(shape, msgspec.Struct)


def _path(place: Keys) -> str:
    """The keys as one word, such as "joints.1.zero"; indices are counted from 1."""
    return ".".join(str(key + 1) if isinstance(key, int) else key for key in place)


def _at(where: Keys) -> str:
    return f" in [{_path(where)}]" if where else ""


def toml_value(value: object) -> str:
    """A text, number, truth value or list, a table or structure of them, as TOML writes it on one line."""
    if isinstance(value, msgspec.Struct):
        value = msgspec.structs.asdict(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{toml_key(key)} = {toml_value(part)}" for key, part in value.items()) + " }"
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")  # JSON leaves this one as it is


def toml_key(name: str) -> str:
    """A key as TOML writes it: in quotes only where that is needed."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml_value(name)
