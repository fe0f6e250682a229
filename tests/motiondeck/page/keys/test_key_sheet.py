"""Keys that are set, moved and deleted in any order come back from their file as they are."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.keyframes import EASINGS, Keyframes, read_keyframes
from motiondeck.page.keys.draft import KeySheet
from motiondeck_base.errors import FileFormatError
from motiondeck_base.toml_file import read_toml

TIMES = st.integers(0, 40).map(lambda at: at / 10)
POSES = st.dictionaries(st.sampled_from(["a", "b-2", 'c "d" é']), st.integers(-900, 900).map(lambda deg: deg / 10))
CHANGES = st.lists(
    st.one_of(
        st.tuples(st.just("set"), TIMES, POSES, st.sampled_from(["smooth", *EASINGS])),
        st.tuples(st.just("delete"), TIMES),
        st.tuples(st.just("move"), TIMES, TIMES),
    ),
    max_size=12,
)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("keys") / "motion.toml"


@settings(max_examples=30)
@given(st.sampled_from(["loop", "once"]), CHANGES)
def test_any_keys_are_the_same_when_read_again(file, plays, changes):
    sheet, known = KeySheet(plays, 4.0), {}  # `known` is the same as a plain dictionary of values
    for name, at, *more in changes:
        getattr(sheet, name)(at, *more)
        to = more[0] if name == "move" else at
        to = 0.0 if plays == "loop" and to == 4.0 else to
        if name == "set" and more[0]:
            known[to] = known.get(to, {}) | more[0]
        elif name != "set" and at in known:
            key = known.pop(at)
            known |= {to: known.get(to, {}) | key} if name == "move" else {}
    assert {at: {joint: value for joint, (value, _) in key.items()} for at, key in sheet.keys.items()} == known
    file.write_text(sheet.text, encoding="utf-8")
    assert KeySheet.of(read_toml(file, Keyframes)) == sheet
    if known:
        read, own = read_keyframes(file), sheet.clip("motion")
        assert angles_of(read.rotation) == pytest.approx(angles_of(own.rotation), abs=1e-9)


def test_rest_is_a_key_at_the_beginning_and_radians_become_degrees(file):
    file.write_text('unit = "rad"\nlength = 2\nrest = { a = 0.5, b = 0.1 }\nkey = [{ at = 0, joint = "a", value = 1 }]')
    sheet = KeySheet.of(read_toml(file, Keyframes))
    assert sheet.keys == {0.0: {"a": (57.2958, "smooth"), "b": (5.7296, "smooth")}}


def test_the_end_of_a_loop_is_its_beginning_and_a_key_behind_the_end_is_refused():
    sheet = KeySheet("loop", 2.0)
    assert (sheet.set(2.0, {"a": 5.0}), sheet.set(1.0, {"a": 9.0})) == (0.0, 1.0)
    sheet.length = 0.5
    with pytest.raises(FileFormatError, match=r"the key at 1 s is not before the end at 0.5 s"):
        sheet.clip("motion")
