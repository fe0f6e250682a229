import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.wire.messages.commands import EmergencyStop, SetTempo, Switch
from motiondeck.run.spec.program import Timed, parse_script, read_timeline
from motiondeck_base.errors import MotiondeckError

MOTIONS = ("walk", "jog", "stool-standup")


def test_motions_follow_each_other():
    switches = [Timed(4.0, Switch("jog")), Timed(6.5, Switch("walk"))]
    assert parse_script("walk 4, jog 2.5, walk", MOTIONS) == ("walk", switches, None)


def test_one_motion_is_a_script():
    assert parse_script(" jog ", MOTIONS) == ("jog", [], None)


def test_a_script_whose_last_part_has_seconds_has_an_end():
    assert parse_script("walk 4, jog 2.5", MOTIONS)[2] == 6.5


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("walk 4, jig 4", "part 2: unknown motion 'jig'. Did you mean jog"),
        ("walk, jog", "part 1: give its seconds"),
        ("walk four, jog", "part 1: 'four' is not a number of seconds"),
        ("walk -1", "part 1: '-1' is not"),
        ("walk nan, jog", "part 1: 'nan' is not"),
        ("walk 4,, jog", "part 2: '' is not MOTION SECONDS"),
        ("walk 4 5, jog", "part 1: 'walk 4 5' is not MOTION SECONDS"),
        ("", "part 1"),
        ("walk 4, blend walk jog 0.5", "part 2: 'blend' is no motion. Commands go into a timeline file"),
        ("show.txt", "part 1: 'show.txt' is no motion. .* whose name ends in .toml"),
    ],
)
def test_what_is_wrong_is_named_by_its_part(text, says):
    with pytest.raises(MotiondeckError, match=says):
        parse_script(text, MOTIONS)


@given(st.text(max_size=40))
def test_any_text_is_a_script_or_a_mistake(text):
    try:
        first, switches, _ = parse_script(text, MOTIONS)
    except MotiondeckError:
        return
    assert first in MOTIONS
    assert [switch.at for switch in switches] == sorted(switch.at for switch in switches)


def timeline(tmp_path, text):
    path = tmp_path / "show.toml"
    path.write_text(text)
    return path


def test_a_timeline_says_what_is_commanded_when(tmp_path):
    path = timeline(
        tmp_path,
        'motion = "walk"\n[[commands]]\nat = 6\nsay = "estop"\n[[commands]]\nat = 4.5\nsay = "jog"\n'
        '[[commands]]\nat = 5\nsay = "tempo 2 1.5"\n',
    )
    assert read_timeline(path, MOTIONS) == (
        "walk",
        [Timed(4.5, Switch("jog")), Timed(5.0, SetTempo(2.0, over=1.5)), Timed(6.0, EmergencyStop())],
    )


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('motion = "wlak"', "show.toml: unknown motion 'wlak'. Did you mean walk"),
        ("", "missing key 'motion'"),
        ('motion = "walk"\ntempo = 2', "unknown key 'tempo'"),
        ('motion = "walk"\n[[commands]]\nat = -1.0\nsay = "jog"', "command 1: at = -1.0"),
        ('motion = "walk"\n[[commands]]\nat = nan\nsay = "jog"', "commands.1.at is nan; it must be a finite number"),
        (
            'motion = "walk"\n[[commands]]\nat = 1.0\nsay = "tempo 9"',
            "command 1: tempo: TEMPO must be",
        ),
        ('motion = "walk"\n[[commands]]\nat = 1.0\nsay = "queue jig"', "command 1: unknown motion 'jig'"),
        (
            'motion = "walk"\n[[commands]]\nat = 1.0\nsay = "at 5 pause"',
            "command 1: 'at' is not for a timeline file",
        ),
        ('motion = "walk"\n[[commands]]\nat = 1.0\nsay = ""', "command 1: '' is not a command"),
    ],
)
def test_what_is_wrong_in_a_timeline_is_named_by_file_and_command(tmp_path, text, says):
    with pytest.raises(MotiondeckError, match=says) as caught:
        read_timeline(timeline(tmp_path, text), MOTIONS)
    assert "show.toml" in str(caught.value)
