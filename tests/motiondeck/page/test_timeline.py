"""The timeline: what it keeps, and what it shows of the past."""

import re
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
import viser
import websockets.sync.client
from hypothesis import given, settings
from hypothesis import strategies as st

from controller.wire.messages.deck_snapshot import DeckSnapshot
from controller.wire.messages.replies import Event
from motiondeck.page.bodies import Bodies as DrawnBodies
from motiondeck.page.bodies import View
from motiondeck.page.past import Past, Timeline
from motiondeck.page.plots import SECONDS
from motiondeck.page.scene import DARK, Scene
from motiondeck.page.web.page_state import Picture, PictureArrays
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human
from waiting import free_port, until

VIEW = View("off", target=False, network=False, steps=False, forces=False, follows=False)


class Parts:
    """Stands in for the page, and keeps what is shown."""

    page = SimpleNamespace(on_client_disconnect=lambda leave: None)

    def add(self, kind, name, heard=None):
        self.heard = heard
        return self

    def show(self, state):
        self.state = state


@contextmanager
def connected(page):
    """A browser that draws nothing, as its page knows it."""
    camera = {
        "wxyz": (1.0, 0.0, 0.0, 0.0),
        "position": (1.0, 0.0, 0.0),
        "look_at": (0.0,) * 3,
        "up_direction": (0.0, 0.0, 1.0),
    }
    camera |= {
        "type": "ViewerCameraMessage",
        "fov": 1.0,
        "near": 0.1,
        "far": 10.0,
        "image_height": 768,
        "image_width": 1366,
    }
    link = websockets.sync.client.connect(
        page.address.replace("http", "ws"),
        subprotocols=[websockets.Subprotocol(f"viser-v{viser.__version__}")],
        origin=websockets.Origin(page.address),
        max_size=None,
        compression=None,
    )
    with link:
        link.send(msgspec.msgpack.encode(camera))
        until(page.get_clients, "the browser")
        yield next(iter(page.get_clients().values()))


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


def test_a_dark_browser_that_looks_back_sees_the_past_as_dark():
    page = PrivatePage(free_port(), "test")
    try:
        body = Scene(page, build_mannequin(human()).compile())
        past = Past(PageParts(page), DrawnBodies(body, None, None, None))
        with connected(page) as client:
            body.suit(client, (True, False))
            nodes = client.scene._handle_from_node_name
            shown = Picture(DeckSnapshot(motion="walk"), PictureArrays(body.data.qpos))
            past.timeline.keep(shown, "walk", 1.0)
            past.look(client.client_id, 1.0)
            past.show({client.client_id: client}, VIEW, np.zeros(2), 1.0)
            assert past.moment(client.client_id) == 1.0
            assert [nodes[f"/floor/{parity}"].color for parity in range(2)] == [*DARK[1]]
            assert not any(nodes[f"/shadow{whose}"].visible for whose in ("", " follower", " human"))
            assert all(node.visible for name, node in nodes.items() if name.startswith("/robot/"))
    finally:
        page.stop()
