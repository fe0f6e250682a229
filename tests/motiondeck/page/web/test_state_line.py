import numpy as np
import pytest

from controller.wire.run_recording import MODES
from controller.wire.telemetry import StateReader, StateWriter
from motiondeck.page.web.state_line import RunState, button_labels, ended_line, state_line

MOTIONS = ["walk", "jog", "crawl", "standup", "waltz"]


@pytest.mark.parametrize(
    ("state", "word", "played", "upcoming"),
    [
        ({}, "PLAYING", "walk", ""),
        ({"queue": ("jog", "waltz")}, "PLAYING", "walk", "next: jog, waltz"),
        ({"motion": "jog", "settled": False}, "ON ITS WAY", "to jog", ""),
        (
            {"playing": "crawl", "motion": "waltz", "way": ("standup", "waltz"), "settled": False},
            "ON ITS WAY",
            "crawl → standup → waltz",
            "",
        ),
        ({"way": ("jog",), "motion": "jog", "queue": ("waltz",)}, "ON ITS WAY", "walk → jog", "next: waltz"),
        ({"blend": (("jog", 0.4),)}, "BLEND", "walk + 40 % jog", ""),
        ({"blend": (("jog", 0.4), ("waltz", 0.25))}, "BLEND", "walk + 40 % jog + 25 % waltz", ""),
        ({"blend": (("jog", 0.4),), "settled": False}, "BLEND", "walk + 40 % jog", ""),
        ({"approaching": True}, "ON ITS WAY", "slowly to walk", ""),
        ({"paused": True}, "PAUSED", "walk", ""),
        ({"paused": True, "way": ("jog",)}, "PAUSED", "walk", ""),
        ({"mode": "home"}, "HOME", "at rest, or on the way there", "choose a motion to play on"),
        ({"mode": "held", "paused": True}, "HELD", "nothing moves", "choose a motion, or Home"),
        ({"mode": "emergency stop", "paused": True}, "EMERGENCY STOP", "every joint is held", "Reset releases it"),
    ],
)
def test_the_line_says_what_happens(state, word, played, upcoming):
    line = state_line(RunState(**{"motion": "walk", "playing": "walk"} | state))
    assert (line.word, line.played, line.upcoming) == (word, played, upcoming)


def test_each_mode_has_a_word_and_a_colour_of_its_own():
    lines = [state_line(RunState(mode=mode, motion="walk", playing="walk")) for mode in MODES]
    assert len({line.word for line in lines}) == len({line.colour for line in lines}) == len(MODES)


def test_the_end_keeps_its_reason_on_the_page():
    assert ended_line("the rig is lost: id 3").played == "the rig is lost: id 3"
    assert ended_line("").played == "the deck is gone"


def test_names_are_written_as_text():
    assert "&lt;b&gt;" in state_line(RunState(motion="<b>", playing="<b>")).as_html()


def test_the_shared_state_is_read():
    shared = {
        "mode": 0.0,
        "paused": 0.0,
        "motion": 4.0,
        "playing": 2.0,
        "way": [3.0, 4.0, -1.0],
        "queue": [1.0, -1.0, -1.0],
        "blend": -1.0,
        "settled": 0.0,
    }
    state = RunState.of({name: np.atleast_1d(value) for name, value in shared.items()}, MOTIONS)
    assert state == RunState("playing", False, "waltz", "crawl", ("standup", "waltz"), ("jog",), (), False)
    shared |= {"blend": [1.0, 4.0, -1.0], "blend_weight": [0.25, 0.5, 0.0], "mode": MODES.index("home")}
    state = RunState.of({name: np.atleast_1d(value) for name, value in shared.items()}, MOTIONS)
    assert state.blend == (("jog", 0.25), ("waltz", 0.5))
    assert state.shown == "crawl + jog + waltz"
    assert state.mode == "home"


def test_what_has_not_been_published_yet_is_read_as_playing():
    assert RunState.of({"motion": np.array([np.nan])}, MOTIONS) == RunState()


def test_what_the_deck_has_not_written_yet_is_not_a_motion_on_the_way(tmp_path):
    fields = {"motion": 1, "playing": 1, "way": 8, "queue": 8, "blend": 3, "blend_weight": 3}
    writer = StateWriter.create(tmp_path / "state", {}, fields)
    writer.publish(motion=1.0, playing=1.0)
    shared = StateReader.open(tmp_path / "state").read()
    assert shared is not None
    assert RunState.of(shared, MOTIONS) == RunState(motion=MOTIONS[1], playing=MOTIONS[1])


def test_buttons_say_what_part_their_motion_has():
    playing = RunState(motion="walk", playing="walk", queue=("jog", "crawl", "jog"))
    labels = ["walk · playing", "jog · queued 1", "crawl · queued 2", "standup", "waltz"]
    assert button_labels(playing, MOTIONS) == labels
    under_way = RunState(motion="waltz", playing="crawl", way=("standup", "waltz"), settled=False)
    assert button_labels(under_way, MOTIONS) == ["walk", "jog", "crawl · playing", "standup", "waltz · next"]
    blend = RunState(motion="walk", playing="walk", blend=(("jog", 0.4), ("waltz", 0.1)))
    assert button_labels(blend, MOTIONS) == ["walk · playing", "jog · 40 %", "crawl", "standup", "waltz · 10 %"]
    stopped = RunState(mode="emergency stop", motion="walk", playing="walk")
    assert button_labels(stopped, MOTIONS) == MOTIONS
