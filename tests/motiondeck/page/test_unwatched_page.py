"""The page while nobody looks: it keeps the past and computes nothing else; who connects sees the present."""

from contextlib import closing

import numpy as np
import pytest
import viser
import websockets.sync.client

from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages.deck_snapshot import DeckSnapshot
from motiondeck.page.deck_view import DeckView
from motiondeck.page.web.page_state import PageDescription, Picture, PictureArrays
from motiondeck.page.web.parts import Part
from motiondeck.page.web.private_page import PrivatePage
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human
from waiting import free_port, until


def connected(page):
    """A browser that has drawn nothing yet."""
    version = websockets.Subprotocol(f"viser-v{viser.__version__}")
    address = f"ws://127.0.0.1:{page.get_port()}"
    return websockets.sync.client.connect(
        address, subprotocols=[version], origin=websockets.Origin(page.address), max_size=None
    )


@pytest.fixture
def view(tmp_path):
    spec = build_mannequin(human())
    model, file = spec.compile(), tmp_path / "robot.xml"
    spec.to_file(str(file))
    page = PrivatePage(free_port(), "test")
    with closing(CommandServer(0)) as server, closing(CommandClient(server.port)) as client:
        arrays = PictureArrays(model.qpos0)
        about = PageDescription(model_file=str(file), motions=["walk"], robot="mannequin", shapes=arrays.shapes)
        shown = DeckView(page, about, client, tmp_path)
        yield page, lambda at, mode: shown.show(Picture(DeckSnapshot(motion="walk", mode=mode), arrays), at)
        page.stop()


def test_nothing_but_the_past_is_computed_until_a_browser_connects_and_that_sees_the_present(view, monkeypatch):
    page, show = view
    shown, as_usual = [], Part.show
    monkeypatch.setattr(Part, "show", lambda part, state: (shown.append(state), as_usual(part, state)))
    times = iter(np.arange(1000) * 0.04 + 100.0)
    for _ in range(100):
        show(next(times), "playing")
    assert shown == []
    with connected(page):
        until(lambda: page.is_watched, "the browser")
        show(next(times), "emergency stop")
        assert any("EMERGENCY STOP" in str(state) for state in shown)
        count = len(shown)
        for _ in range(25):
            show(next(times), "playing")
        assert len(shown) > count
    until(lambda: not page.is_watched, "the end of the browser")
    count = len(shown)
    for _ in range(25):
        show(next(times), "playing")
    assert len(shown) == count
