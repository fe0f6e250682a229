"""The timeline: what it keeps, and what it shows of the past."""

import numpy as np

from controller.wire.messages.deck_snapshot import DeckSnapshot
from controller.wire.messages.replies import Event
from motiondeck.page.timeline import SECONDS, Timeline
from motiondeck.page.web.page_state import Picture, PictureArrays


class Parts:
    """Stands in for the page, and keeps what is shown."""

    def add(self, kind, name, heard):
        self.heard = heard
        return self

    def show(self, state):
        self.state = state


def picture(now):
    return Picture(DeckSnapshot(motion="walk"), PictureArrays(np.array([now])))


def played(parts, seconds, step=0.5):
    """A timeline that has seen walk, then jog from half of the time on; a state holds its own time."""
    timeline = Timeline(parts)
    for now in np.arange(0.0, seconds + 0.01, step):
        timeline.keep(picture(now), "walk" if now < seconds / 2 else "jog", float(now))
    return timeline


def test_it_says_what_was_played_and_what_happened():
    parts = Parts()
    timeline = played(parts, 60.0)
    timeline.mark(Event("fault", "rig: knee is hot"))
    timeline.mark(Event("settled", "jog"))
    timeline.show()
    assert parts.state["runs"] == [[-60.0, -30.0, "walk"], [-30.0, 0.0, "jog"]]
    assert parts.state["marks"] == [[0.0, "bad", "fault: rig: knee is hot"]]


def test_looking_back_shows_the_past_while_new_states_come_in():
    parts = Parts()
    timeline = played(parts, 60.0)
    latest = picture(60.0)
    assert timeline.chosen(latest) is latest
    parts.heard({"back": 20}, None)
    timeline.keep(picture(61.0), "jog", 61.0)
    assert timeline.chosen(latest).arrays.qpos[0] == 40.0
    timeline.show()
    assert parts.state["back"] == 21.0
    parts.heard({"back": 0}, None)
    assert timeline.chosen(latest) is latest


def test_it_forgets_what_is_older_than_it_shows():
    parts = Parts()
    timeline = played(parts, 3.0 * SECONDS, step=1.0)
    timeline.show()
    assert parts.state["runs"] == [[-SECONDS, 0.0, "jog"]]
    parts.heard({"back": 10.0 * SECONDS}, None)
    assert timeline.chosen(picture(0.0)).arrays.qpos[0] == 2.0 * SECONDS


def test_what_no_part_has_sent_changes_nothing():
    parts = Parts()
    timeline, latest = played(parts, 5.0), picture(5.0)
    for said in ("back", {"back": "x"}, {"back": None}, [3]):
        parts.heard(said, None)
    assert timeline.chosen(latest) is latest
