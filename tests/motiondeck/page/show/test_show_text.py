"""What the page of a show says of given states of the show, without a browser."""

import html
import re

import msgspec
import pytest

from motiondeck.page.show.show_text import cue_table, deck_cards, show_line
from motiondeck.shows.messages import ClockHealth, DeckHealth
from motiondeck.shows.show_file import ShowCue
from motiondeck.shows.show_state import DeckRow, ShowState

CUES = [
    ShowCue(say="switch walk", name="opening", when="here", in_step=True),
    ShowCue(say=["switch jog", "tempo 0.8"], at=12.0, to=["sides"]),
    ShowCue(say="home", name="bow", hold=True),
]
HEALTH = DeckHealth("run", 1, "walk", "playing", 0.25, False, False, "locked to another deck (+3 ms)", None)


def show(**given):
    return ShowState("gala", CUES, **given)


def deck(here=True, heard_ago=0.1, losses=0, silent=False, stop="", **health):
    known = None if silent else msgspec.structs.replace(HEALTH, **health)
    return DeckRow("left", "servo20", "cmu", "stage2", here, losses, heard_ago, known, stop)


def words(page):
    return re.sub(r"\s+", " ", html.unescape(re.sub("<[^>]*>", " ", page)))


@pytest.mark.parametrize(
    ("state", "said"),
    [
        (show(upcoming=0), ("READY", 'first "opening"', "as soon as all are connected")),
        (show(present=0, upcoming=1, seconds=11.6), ("PLAYING", '"opening"', "next cue 2 in 12 s")),
        (show(present=1, upcoming=2, waits=True), ("HELD", 'before "bow"', "Go brings it")),
        (show(present=2), ("PLAYING", '"bow"', "that was the last cue")),
        (
            show(present=1, upcoming=2, stopped_by="right", decks=[deck(mode="emergency stop", stop="holds")]),
            ("EMERGENCY STOP", "by right", "reset at each deck: left"),
        ),
        (
            show(upcoming=2, stopped_by="right", decks=[deck(stop="reset"), deck(here=False, stop="not reached")]),
            ("EMERGENCY STOP", "by right", "all decks are reset: Go"),
        ),
        (
            show(upcoming=2, stopped_by="right", decks=[deck(stop="not reached")]),
            ("EMERGENCY STOP", "by right", "has not reached: left"),
        ),
        (ShowState("gala", []), ("NO CUES", "the decks do what is typed", "")),
    ],
)
def test_the_line_says_what_is_and_what_comes(state, said):
    line = show_line(state)
    assert (line.word, line.played, line.upcoming) == said


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        (
            deck(),
            [
                "plays walk",
                "servo20 · cmu · stage2",
                "in step (+3 ms) · phase 0.25",
                "clock unknown",
                "heard 0.1 s ago",
            ],
        ),
        (deck(clock=ClockHealth(0.4, -12.0, 0.00125)), ["clock +1.25 ms ± 0.40 ms, drift -12 ppm"]),
        (deck(clock=ClockHealth(0.4, 3.0, -4711.5)), ["clock -4711.500 s ± 0.40 ms"]),
        (deck(lock="searching for another deck"), ["not in step"]),
        (deck(lock="", phase=None), ["not locked · no phase"]),
        (deck(paused=True), ["paused in walk"]),
        (deck(switching=True, motion="jog"), ["to jog"]),
        (deck(mode="emergency stop"), ["EMERGENCY STOP"]),
        (deck(stop="not reached"), ["STOP NOT REACHED"]),
        (deck(stop="not reached", mode="emergency stop"), ["EMERGENCY STOP"]),
        (deck(heard_ago=3.2), ["SILENT for 3 s"]),
        (deck(here=False, silent=True), ["not here yet"]),
        (deck(here=False, silent=True, losses=2), ["GONE", "gone so far: 2"]),
        (deck(problem="cue 3 came <late>"), ["last problem: cue 3 came <late>"]),
    ],
)
def test_a_card_says_how_a_deck_is(seen, said):
    page = deck_cards(show(decks=[seen]))
    for part in ["left", *said]:
        assert part in words(page)
    assert "<late>" not in page


def test_the_cue_list_marks_the_present_cue_and_the_next():
    rows = [words(row).strip() for row in cue_table(show(present=0, upcoming=1)).split("</tr>")]
    assert rows[0] == "now 1 opening when all are connected all switch walk, in step"
    assert rows[1] == "next 2 12 s sides switch jog; tempo 0.8"
    assert rows[2] == "3 bow at Go all home"
