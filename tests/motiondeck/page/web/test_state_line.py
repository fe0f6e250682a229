import pytest

from controller.wire.messages.deck_snapshot import MODES, BlendPart, DeckSnapshot
from motiondeck.page.web.state_line import button_labels, ended_line, shown_motions, state_line

MOTIONS = ["walk", "jog", "crawl", "standup", "waltz"]


@pytest.mark.parametrize(
    ("state", "word", "played", "upcoming"),
    [
        ({}, "PLAYING", "walk", ""),
        ({"queue": ("jog", "waltz")}, "PLAYING", "walk", "next: jog, waltz"),
        ({"motion": "jog", "switching": True}, "ON ITS WAY", "to jog", ""),
        (
            {"playing": "crawl", "motion": "waltz", "way": ("standup", "waltz"), "switching": True},
            "ON ITS WAY",
            "crawl → standup → waltz",
            "",
        ),
        ({"way": ("jog",), "motion": "jog", "queue": ("waltz",)}, "ON ITS WAY", "walk → jog", "next: waltz"),
        ({"blend": (BlendPart("jog", 0.4),)}, "BLEND", "walk + 40 % jog", ""),
        ({"blend": (BlendPart("jog", 0.4), BlendPart("waltz", 0.25))}, "BLEND", "walk + 40 % jog + 25 % waltz", ""),
        ({"blend": (BlendPart("jog", 0.4),), "switching": True}, "BLEND", "walk + 40 % jog", ""),
        ({"approaching": True}, "ON ITS WAY", "slowly to walk", ""),
        ({"paused": True}, "PAUSED", "walk", ""),
        ({"paused": True, "way": ("jog",)}, "PAUSED", "walk", ""),
        ({"mode": "home"}, "HOME", "at rest, or on the way there", "choose a motion to play on"),
        ({"mode": "held", "paused": True}, "HELD", "nothing moves", "choose a motion, or Home"),
        ({"mode": "emergency stop", "paused": True}, "EMERGENCY STOP", "every joint is held", "Reset releases it"),
    ],
)
def test_the_line_says_what_happens(state, word, played, upcoming):
    line = state_line(DeckSnapshot(**{"motion": "walk", "playing": "walk"} | state))
    assert (line.word, line.played, line.upcoming) == (word, played, upcoming)


def test_each_mode_has_a_word_and_a_colour_of_its_own():
    lines = [state_line(DeckSnapshot(mode=mode, motion="walk", playing="walk")) for mode in MODES]
    assert len({line.word for line in lines}) == len({line.colour for line in lines}) == len(MODES)


def test_the_end_keeps_its_reason_on_the_page():
    assert ended_line("the rig is lost: id 3").played == "the rig is lost: id 3"
    assert ended_line("").played == "the deck is gone"


def test_names_are_written_as_text():
    assert "&lt;b&gt;" in state_line(DeckSnapshot(motion="<b>", playing="<b>")).as_html()


def test_a_blend_is_shown_with_all_its_motions():
    blend = (BlendPart("jog", 0.25), BlendPart("waltz", 0.5))
    assert shown_motions(DeckSnapshot(motion="walk", playing="crawl", blend=blend)) == "crawl + jog + waltz"


def test_buttons_say_what_part_their_motion_has():
    playing = DeckSnapshot(motion="walk", playing="walk", queue=("jog", "crawl", "jog"))
    labels = ["walk · playing", "jog · queued 1", "crawl · queued 2", "standup", "waltz"]
    assert button_labels(playing, MOTIONS) == labels
    under_way = DeckSnapshot(motion="waltz", playing="crawl", way=("standup", "waltz"), switching=True)
    assert button_labels(under_way, MOTIONS) == ["walk", "jog", "crawl · playing", "standup", "waltz · next"]
    blend = DeckSnapshot(motion="walk", playing="walk", blend=(BlendPart("jog", 0.4), BlendPart("waltz", 0.1)))
    assert button_labels(blend, MOTIONS) == ["walk · playing", "jog · 40 %", "crawl", "standup", "waltz · 10 %"]
    stopped = DeckSnapshot(mode="emergency stop", motion="walk", playing="walk")
    assert button_labels(stopped, MOTIONS) == MOTIONS
