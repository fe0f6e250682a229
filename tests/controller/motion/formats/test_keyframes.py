"""Keyframes: joints pass through their keys, speeds never jump, and loops close."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.motion.encodings.joint_angles import angles_of
from controller.motion.formats.keyframes import EASINGS, is_keyframes, read_keyframes
from controller.motion.formats.reading import read_clip
from motiondeck_base.errors import FileFormatError

NOD = """
unit = "deg"
plays = "loop"
length = 2.0
rest = { neck = 0, jaw = 5 }

[[key]]
at = 0.5
joint = "neck"
value = 20
[[key]]
at = 1.0
pose = { neck = -10 }
easing = "ease"
"""
EASED = st.sampled_from(["smooth", *EASINGS])


def read(tmp_path, text):
    (tmp_path / "nod.toml").write_text(text)
    clip = read_clip(tmp_path / "nod.toml")
    return clip, np.degrees(angles_of(clip.rotation[:, 1:]))


def test_joints_are_at_their_keys_and_at_rest_without(tmp_path):
    clip, angles = read(tmp_path, NOD)
    assert (clip.skeleton.bones, clip.rate, len(clip), clip.plays) == (("neck", "jaw"), 100.0, 201, "loop")
    assert angles[[0, 50, 100, 200], 0] == pytest.approx([0.0, 20.0, -10.0, 0.0], abs=1e-9)
    assert angles[:, 1] == pytest.approx(5.0)


def test_a_motion_played_once_holds_what_it_has_reached(tmp_path):
    clip, angles = read(tmp_path, 'unit = "rad"\nkey = [{ at = 1, joint = "jaw", value = 0.5 }]\nlength = 2')
    assert (clip.plays, clip.duration) == ("once", 2.01)
    assert np.radians(angles) == pytest.approx(0.5)


KEYS = st.lists(st.tuples(st.integers(0, 19), st.integers(-90, 90), EASED), min_size=1, max_size=6)


def keyframes(keys, plays):
    keys = {at: (value, easing) for at, value, easing in keys}
    rows = [f'at = {at / 10}, joint = "a", value = {value}, easing = "{ease}"' for at, (value, ease) in keys.items()]
    table = ", ".join(f"{{ {row} }}" for row in rows)
    return f'unit = "deg"\nplays = "{plays}"\nlength = 2\nrate = 1000\nkey = [{table}]\n', keys


@settings(max_examples=30)
@given(keys=KEYS, plays=st.sampled_from(["loop", "once"]))
def test_keys_are_passed_and_speeds_do_not_jump(tmp_path_factory, keys, plays):
    text, keys = keyframes(keys, plays)
    _, angles = read(tmp_path_factory.getbasetemp(), text)
    course = angles[:, 0]
    for at, (value, _) in keys.items():
        assert course[100 * at] == pytest.approx(value, abs=1e-6)
    if plays == "loop":
        assert course[-1] == pytest.approx(course[0], abs=1e-9)
        course = np.concatenate([course[:-1], course])
    # With half of the frames a steady speed changes four times as much between frames, one that jumps twice.
    values = [value for value, _ in keys.values()]
    few, many = (np.abs(np.diff(part, n=2)).max() for part in (course[::2], course))
    assert many <= 0.3 * few + 1e-9
    # Never beyond the keys, but for what an overshoot goes too far.
    spread = 0.1 * (max(values) - min(values)) * any(easing == "overshoot" for _, easing in keys.values())
    assert course.max() <= max(values) + spread + 1e-9
    assert course.min() >= min(values) - spread - 1e-9


@pytest.mark.parametrize("ease", EASINGS.values(), ids=EASINGS)
def test_an_easing_begins_and_ends_at_rest(ease):
    s = np.linspace(0.0, 1.0, 10_001)
    course = ease(s)
    assert course[[0, -1]] == pytest.approx([0.0, 1.0])
    assert np.abs(np.diff(course)[[0, -1]]).max() < 1e-6


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('unit = "deg"', "", 'nod.toml: the values have no unit. Write unit = "deg" or unit = "rad" above the keys'),
        ('"deg"', '"degrees"', "'degrees' is none of deg, rad"),
        ('"ease"', '"bounce"', r"'bounce' is none of smooth, ease, early, late, overshoot in \[key.2.easing\]"),
        ("value = 20", "", r"line 7: key.1: a key needs a joint and its value, or else a pose of several"),
        ("value = 20", "valeu = 20", "Did you mean 'value'"),
        ("at = 1.0", "at = 3.0", "the key at 3 s is not before the end at 2 s. Set length"),
        ("at = 1.0", "at = 0.5", r"nod.toml: neck has two keys at 0.5 s. Leave one out"),
        ("at = 1.0", "at = 2.0", ""),
        ("neck = -10", "neck = -1000", "beyond two turns"),
        ("length = 2.0", "length = 0", "length"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, old, new, problem):
    text = NOD.replace(old, new)
    if not problem:
        assert read(tmp_path, text)[1][[0, -1], 0] == pytest.approx(-10.0)  # of a loop the end is the beginning
        return
    with pytest.raises(FileFormatError, match=problem):
        read(tmp_path, text)


def test_a_loop_that_does_not_close_is_refused(tmp_path):
    both = NOD + '[[key]]\nat = 0\njoint = "neck"\nvalue = 3\n[[key]]\nat = 2\njoint = "neck"\nvalue = 4\n'
    with pytest.raises(FileFormatError, match=r"the loop begins with neck at 3 and ends at 4. Make them equal"):
        read(tmp_path, both)


def test_a_recipe_is_not_taken_for_keyframes(tmp_path):
    (tmp_path / "recipe.toml").write_text('[[motions]]\nfile = "walk.bvh"\n')
    assert not is_keyframes(tmp_path / "recipe.toml")
    with pytest.raises(FileFormatError, match="missing key 'key'"):
        read_keyframes(tmp_path / "recipe.toml")
