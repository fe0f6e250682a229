import tomllib
from typing import Literal

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motiondeck_base.errors import FileFormatError
from motiondeck_base.toml_file import read_toml, shaped, toml_key, toml_value


class Part(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    size: int
    colour: str = "red"


class Round(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, tag="round"):
    radius: float


class Square(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, tag="square"):
    side: float


class Cue(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    when: Literal["here", "settled"] | None = None


def test_a_word_that_is_none_of_the_choices_is_told_them(tmp_path):
    path = tmp_path / "cue.toml"
    path.write_text('when = "heer"\n')
    with pytest.raises(FileFormatError, match=r"'heer' is none of here, settled in \[when\]"):
        read_toml(path, Cue)


class Thing(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    name: str
    shape: Round | Square | None = None
    parts: list[Part] = []
    named: dict[str, Part] = {}
    span: tuple[int, int] | None = None


def read(tmp_path, text):
    path = tmp_path / "thing.toml"
    path.write_text(text)
    return read_toml(path, Thing)


def test_a_good_file_is_read(tmp_path):
    thing = read(tmp_path, 'name = "a"\nshape = {type = "square", side = 2.0}\n[[parts]]\nsize = 3\n')
    assert thing == Thing(name="a", shape=Square(side=2.0), parts=[Part(size=3)])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('nmae = "a"', "unknown key 'nmae'.*Did you mean 'name'.*name, named, parts, shape, span"),
        ('name = "a"\n[[parts]]\nsize = 1\ncolor = "x"', r"unknown key 'color' in \[parts.*\].*'colour'.*colour, size"),
        ('name = "a"\nshape = {type = "round", side = 1.0}', "unknown key 'side'.*radius, type"),
        ('name = "a"\nshape = {type = "oval"}', "oval"),
        ("name = 3", "expected text, not a whole number.*name"),
        ("", "missing key 'name'"),
        ("name = ", "not valid TOML.*Invalid value"),
    ],
)
def test_what_is_wrong_is_said_with_file_place_and_remedy(tmp_path, text, says):
    with pytest.raises(FileFormatError, match=says) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "thing.toml"))


def test_all_problems_of_a_file_are_reported_a_line_each(tmp_path):
    text = """
nmae = "a"
shape = {type = "square", side = "long", radius = 1.0}
span = [1, "two"]
parts = [{size = 1}, {size = "big"}, {color = "x"}]
named = {left = {size = 1.5}}
"""
    with pytest.raises(FileFormatError) as caught:
        read(tmp_path, text)
    place = f"{tmp_path / 'thing.toml'} line "
    lines = str(caught.value).split("\n")
    assert all(line.startswith(place) for line in lines)
    assert [line.removeprefix(place).split(" Did")[0].split(" Allowed")[0] for line in lines] == [
        "2: unknown key 'nmae'.",  # and no other line on the name that it should have been
        "3: unknown key 'radius' in [shape].",
        "3: expected a number, not text in [shape.side]",
        "5: expected a whole number, not text in [parts.2.size]",
        "5: unknown key 'color' in [parts.3].",
        "5: missing key 'size' in [parts.3]",
        "6: expected a whole number, not a number with decimals in [named.left.size]",
        "4: expected a whole number, not text in [span.2]",
    ]


@given(st.sets(st.integers(0, 9), min_size=1), st.sets(st.integers(0, 9)))
def test_each_wrong_part_has_a_line_of_its_own(wrong, unknown):
    parts = [{"size": "x" if i in wrong else 1} | ({"seize": 1} if i in unknown else {}) for i in range(10)]
    with pytest.raises(FileFormatError) as caught:
        shaped({"name": "a", "parts": parts}, Thing, "here")
    lines = str(caught.value).split("\n")
    assert {i for i in range(10) for line in lines if line.endswith(f"in [parts.{i + 1}.size]")} == wrong
    assert {i for i in range(10) for line in lines if f"'seize' in [parts.{i + 1}]" in line} == unknown
    assert len(lines) == len(wrong) + len(unknown)


words = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
plain = words | st.integers(-9, 9) | st.floats(allow_nan=False, allow_infinity=False) | st.booleans()


@given(words, st.recursive(plain, lambda part: st.lists(part, max_size=3), max_leaves=5), st.dictionaries(words, plain))
def test_what_is_written_is_read_again(key, value, table):
    text = f"{toml_key(key)} = {toml_value(value)}\n{toml_key(key + 'a')} = {toml_value(table)}"
    assert tomllib.loads(text) == {key: value, key + "a": table}


LINES = """# span = [
span = [  # of lines
  1, 2,
]
name = \'\'\'
[[parts]]
size = 3 \'\'\'
shape = { type = "square", side = 2.0 }

[[parts]]
size = 1
[[parts]]
colour = "red"
size = 2
[named.left]
size = 4
[named]
right.size = 5
"""


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (("1, 2", '1, "two"'), 3),
        (("  1, 2,", "  1,\n  2,\n  3,"), 2),
        (("span", "spam"), 2),
        (("side = 2.0", "side = []"), 8),
        (("size = 1", "size = 1\nseize = 2"), 12),
        (("size = 2", ""), 12),
        (("size = 2", "size = 2.5"), 14),
        (("size = 4", 'size = "4"'), 16),
        (("right.size = 5", "right.size = inf"), 18),
    ],
)
def test_the_line_of_a_mistake_is_named(tmp_path, change, line):
    assert read(tmp_path, LINES).parts[1].size == 2
    with pytest.raises(FileFormatError, match=rf"thing\.toml line {line}: [^\n]*$"):
        read(tmp_path, LINES.replace(*change))


def test_a_missing_file_a_folder_and_junk_are_named(tmp_path):
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_toml(tmp_path / "none.toml", Thing)
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_toml(tmp_path, Thing)
    junk = tmp_path / "junk.toml"
    junk.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="not a text file in UTF-8"):
        read_toml(junk, Thing)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-5, 5) | st.text("abc", max_size=3),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(["name", "shape", "parts", "named", "span", "size", "type", "x"]), inner, max_size=4
            )
        ),
        max_leaves=8,
    )
)
def test_whatever_the_tree_the_error_is_ours(tree):
    said = "here: "
    try:
        shaped(tree, Thing, "here")
    except FileFormatError as error:
        said = str(error)
    assert said.startswith("here: ")
