"""Motions on the page: pictures, the queue, blends and the phase, in a browser; and what is found out of a library."""

import numpy as np
import pytest

from controller.library.motion_library import load_library
from controller.wire.messages import Blend, Jump, Queue, Switch
from motiondeck_base.shipped import find_library
from sim.view.motions.library_glance import MOST, blends_of, pictures_of
from sim.view.motions.motion_controls import MotionControls
from sim.view.web.parts import PageParts
from sim.view.web.private_page import PrivatePage
from sim.view.web.state_line import RunState
from web_pages import free_port, until

MOTIONS = ["walk", "jog", "waltz", *(f"more-{n}" for n in range(12))]


@pytest.fixture(scope="module")
def thesis15():
    return load_library(find_library("thesis15"))


def test_every_motion_has_a_picture_of_its_own(thesis15):
    pictures = pictures_of(thesis15)
    assert list(pictures) == list(thesis15.network.motions)
    assert len(set(pictures.values())) == len(pictures)
    assert max(map(len, pictures.values())) < 3000


def test_loops_blend_with_loops_that_lie_near(thesis15):
    blends = blends_of(thesis15)
    assert "jog" in blends["walk"]
    assert "crawl" not in blends["walk"]  # it is reached by way of others
    assert all(len(others) <= MOST and name not in others for name, others in blends.items())


class Known:
    """What is known of a library, at once."""

    pictures = {name: f'<svg id="picture-{name}"></svg>' for name in MOTIONS}  # noqa: RUF012
    blends = {"walk": ["jog", "waltz"]}  # noqa: RUF012


def test_grid_queue_ring_and_pad_send_commands(browser):
    page, sent = PrivatePage(free_port(), "test"), []
    controls = MotionControls(PageParts(page), MOTIONS, None, has_phase=True, send=sent.append)
    controls._glance = Known()
    playing = RunState(motion="walk", playing="walk", queue=("jog", "waltz"))
    controls.show(playing, {"phase": np.array([0.4])})
    tab = browser.new_page(viewport={"width": 500, "height": 900})
    tab.set_default_timeout(60_000)

    def sends(act, *messages):
        sent.clear()
        act()
        until(lambda: len(sent) >= len(messages), f"{messages}, not {sent}")
        assert sent == [*messages]

    try:
        tab.goto(page.address)
        tab.locator("#picture-walk").wait_for()
        assert tab.get_by_role("button", name="walk · playing", exact=True).is_enabled()
        sends(lambda: tab.get_by_role("button", name="jog · queued 1", exact=True).click(), Switch("jog"))
        sends(lambda: tab.get_by_role("button", name="queue: more-3", exact=True).click(), Queue("more-3"))
        again = [Switch("walk"), Queue("waltz"), Queue("jog")]
        sends(lambda: tab.get_by_role("button", name="sooner: waltz").click(), *again)
        sends(lambda: tab.get_by_role("button", name="take out: jog").click(), Switch("walk"), Queue("waltz"))

        tab.get_by_placeholder("search a motion").fill("wal")
        assert [name for name in MOTIONS if tab.locator(f'.motion[data-key="{name}"]').is_visible()] == [
            "walk",
            "waltz",
        ]

        ring = tab.get_by_role("slider", name="phase")
        assert ring.get_attribute("aria-valuenow") == "0.4"
        sends(lambda: (ring.focus(), tab.keyboard.press("ArrowRight")), Jump(0.41))
        # Up is the first of the two, jog; half of the way out is about half of it.
        pad = tab.locator(".pad").bounding_box()
        sent.clear()
        tab.mouse.click(pad["x"] + 0.5 * pad["width"], pad["y"] + 0.2 * pad["height"])
        (blend,) = until(lambda: sent, "the blend")
        assert isinstance(blend, Blend)
        assert (blend.first, blend.second) == ("walk", "jog")
        assert 0.3 < blend.weight < 0.7
    finally:
        tab.close()
        page.stop()
