"""The timeline: what it keeps, and what it shows of the past."""

import re
from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.wire.messages.deck_snapshot import DeckSnapshot
from controller.wire.messages.replies import Event
from motiondeck.page.bodies import View
from motiondeck.page.past import Past
from motiondeck.page.timeline import SECONDS, Timeline
from motiondeck.page.web.page_state import Picture, PictureArrays

VIEW = View("off", target=False, network=False, steps=False, forces=False, follows=False)


class Parts:
    """Stands in for the page, and keeps what is shown."""

    def add(self, kind, name, heard=None):
        self.heard = heard
        return self

    def show(self, state):
        self.state = state


def picture(now):
    return Picture(DeckSnapshot(motion="walk"), PictureArrays(np.array([now])))


def played(parts, seconds, step=0.5, timeline=None):
    """A timeline that has seen walk, then jog from half of the time on; a state holds its own time."""
    timeline = timeline or Timeline(parts, None)
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


def test_it_forgets_what_is_older_than_it_shows():
    parts = Parts()
    timeline = played(parts, 3.0 * SECONDS, step=1.0)
    timeline.show()
    assert parts.state["runs"] == [[-SECONDS, 0.0, "jog"]]
    assert timeline.at(10.0 * SECONDS)[1].arrays.qpos[0] == 2.0 * SECONDS
    assert timeline.at(20.0)[1].arrays.qpos[0] == 3.0 * SECONDS - 20.0


class Bodies:
    """Stands in for what is drawn, for all browsers or for one."""

    def __init__(self, client=None):
        self.client, self.drawn = client, []
        self.scene = SimpleNamespace(suit=lambda client: None)

    def twin(self, client):
        client.twins.append(Bodies(client))
        return client.twins[-1]

    def show(self, arrays, view, centre):
        self.drawn.append(float(arrays.qpos[0]))


class Client:
    """Stands in for a browser; it counts what is drawn for it alone."""

    def __init__(self, number):
        self.client_id, self.scene, self.gui = number, self, self
        self.twins, self.alone, self.content = [], set(), ""

    def atomic(self):
        return nullcontext()

    def add_html(self, content):
        return self

    def add_frame(self, name, **how):
        self.alone.add(name)

    def remove_by_name(self, name):
        self.alone.discard(name)

    @property
    def past(self):
        """How many seconds ago its frame says that it sees; 0 for now."""
        return int(re.search(r"back&quot;:(\d+)", self.content)[1]) if self.content else 0


ASKED = st.one_of(
    st.tuples(st.just("ask"), st.integers(0, 2), st.floats(0.1, 300.0)),
    st.tuples(st.sampled_from(["return", "leave"]), st.integers(0, 2), st.none()),
    st.tuples(st.just("call back"), st.none(), st.none()),
    st.tuples(st.just("say"), st.integers(0, 2), st.sampled_from(["back", {"back": "x"}, {"back": None}, [3]])),
)


@settings(max_examples=30)
@given(st.lists(ASKED, max_size=12))
def test_a_browser_sees_the_past_that_it_asked_for_alone_until_it_is_called_back(deeds):
    parts, now = Parts(), 60.0
    kept = [*np.arange(0.0, now + 0.01, 0.5)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("time.monotonic", lambda: now)
        past = Past(parts, Bodies())
        timeline = played(parts, now, timeline=past.timeline)
        clients, moments = {number: Client(number) for number in range(3)}, {}
        for deed, number, back in deeds:
            now += 1.0
            timeline.keep(picture(now), "jog", now)
            kept.append(now)
            if deed == "ask" and number in clients:
                parts.heard({"back": back}, SimpleNamespace(client_id=number))
                moments[number] = min(at for at in kept if at >= now - back)
            elif deed == "say" and number in clients:  # what no part of ours has sent
                parts.heard(back, SimpleNamespace(client_id=number))
            elif deed == "return" and number in clients:
                parts.heard({"back": 0}, SimpleNamespace(client_id=number))
                moments.pop(number, None)
            elif deed == "leave" and clients.pop(number, None):
                moments.pop(number, None)
            elif deed == "call back":
                past.call_back()
                moments.clear()
                for other in clients:  # a hand that drags still sends what it asked for
                    parts.heard({"back": 9.0}, SimpleNamespace(client_id=other))
            past.show(clients, VIEW, np.zeros(2), now)
            for other, client in clients.items():
                assert client.past == (max(round(now - moments[other]), 1) if other in moments else 0)
                assert bool(client.alone) == (other in moments)
                if other in moments:
                    assert client.twins[-1].drawn[-1] == moments[other]
