"""Mistakes in files are told in plain words: checked with what msgspec really says."""

from typing import Annotated

import msgspec
import pytest

from motiondeck_base.toml_file import in_file_words


@pytest.mark.parametrize(
    ("value", "kind", "says"),
    [
        ("12 s", float | None, "expected a number, not text"),
        (1.5, int, "expected a whole number, not a number with decimals"),
        (["left"], dict[str, list[str]], "expected a table, not a list"),
        ("left", list[str], "expected a list, not text"),
        ("yes", bool | float, "expected true or false or a number, not text"),
        (-1.0, Annotated[float, msgspec.Meta(ge=0)], "expected a number of at least 0"),
        (17, Annotated[int, msgspec.Meta(le=16)] | None, "expected a whole number of at most 16"),
        (0.0, Annotated[float, msgspec.Meta(gt=0)], "expected a number above 0"),
        ("", Annotated[str, msgspec.Meta(min_length=1)], "expected text with a length of at least 1"),
        ({}, msgspec.defstruct("Thing", [("name", str)]), "missing key 'name'"),
        ("x", Annotated[str, msgspec.Meta(pattern="y")], "Expected `str` matching regex 'y'"),
    ],
)
def test_a_value_that_does_not_fit_is_told_in_words_of_files(value, kind, says):
    with pytest.raises(msgspec.ValidationError) as caught:
        msgspec.convert(value, kind)
    assert in_file_words(str(caught.value)) == says
