import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.cli.script import Cue, parse_script
from controller.errors import MotiondeckError

MOTIONS = ("walk", "jog", "stool-standup")


def test_motions_follow_each_other():
    assert parse_script("walk 4, jog 2.5, walk", MOTIONS) == [Cue(0.0, "walk"), Cue(4.0, "jog"), Cue(6.5, "walk")]


def test_one_motion_is_a_script():
    assert parse_script(" jog ", MOTIONS) == [Cue(0.0, "jog")]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("walk 4, jig 4", "part 2: unknown motion 'jig'. Did you mean jog"),
        ("walk, jog", "part 1: say for how long"),
        ("walk four, jog", "part 1: 'four' is not a number of seconds"),
        ("walk -1", "part 1: '-1' is not"),
        ("walk nan, jog", "part 1: 'nan' is not"),
        ("walk 4,, jog", "part 2: '' is not a motion"),
        ("walk 4 5, jog", "part 1: 'walk 4 5' is not a motion and its seconds"),
        ("", "part 1"),
    ],
)
def test_what_is_wrong_is_named_by_its_part(text, says):
    with pytest.raises(MotiondeckError, match=says):
        parse_script(text, MOTIONS)


@given(st.text(max_size=40))
def test_any_text_is_a_script_or_a_mistake(text):
    try:
        cues = parse_script(text, MOTIONS)
    except MotiondeckError:
        return
    assert cues[0].at == 0.0
    assert [cue.at for cue in cues] == sorted(cue.at for cue in cues)
