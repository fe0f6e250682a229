import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motiondeck_base.errors import FileFormatError
from motiondeck_base.toml_file import read_toml, shaped


class Part(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    size: int
    colour: str = "red"


class Round(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, tag="round"):
    radius: float


class Square(msgspec.Struct, forbid_unknown_fields=True, kw_only=True, tag="square"):
    side: float


class Thing(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    name: str
    shape: Round | Square | None = None
    parts: list[Part] = []


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
        ('nmae = "a"', "unknown key 'nmae'.*Did you mean 'name'.*name, parts, shape"),
        ('name = "a"\n[[parts]]\nsize = 1\ncolor = "x"', r"unknown key 'color' in \[parts.*\].*'colour'.*colour, size"),
        ('name = "a"\nshape = {type = "round", side = 1.0}', "unknown key 'side'.*radius, type"),
        ('name = "a"\nshape = {type = "oval"}', "oval"),
        ("name = 3", "expected `str`, got `int`.*name"),
        ("", "missing required field `name`"),
        ("name = ", "not valid TOML.*Invalid value"),
    ],
)
def test_what_is_wrong_is_said_with_file_place_and_remedy(tmp_path, text, says):
    with pytest.raises(FileFormatError, match=says) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "thing.toml"))


def test_a_missing_file_a_folder_and_junk_are_named(tmp_path):
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_toml(tmp_path / "none.toml", Thing)
    with pytest.raises(FileFormatError, match="cannot be read"):
        read_toml(tmp_path, Thing)
    junk = tmp_path / "junk.toml"
    junk.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="not a text file"):
        read_toml(junk, Thing)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.recursive(
        st.none() | st.booleans() | st.integers(-5, 5) | st.text("abc", max_size=3),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(st.sampled_from(["name", "shape", "parts", "size", "type", "x"]), inner, max_size=4)
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
