"""Motions on the page: pictures, the queue, blends and the phase, in a browser; and what is found out of a library."""

import time

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
from waiting import free_port, until

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
        # Up is the first of the two, jog, whose name stands where its weight is 1; pulled down, through the middle, it
        # is less than none, and not waltz, which lies there.
        pad = tab.get_by_role("slider", name="blend weight")
        box = pad.bounding_box()

        def at(share):
            return box["x"] + 0.5 * box["width"], box["y"] + share * box["height"]

        def blended():
            (blend,) = until(lambda: sent[-1:], "the blend")
            assert isinstance(blend, Blend)
            assert (blend.first, blend.second) == ("walk", "jog")
            return blend.weight

        sent.clear()
        tab.mouse.move(*at(0.33))
        tab.mouse.down()
        assert 0.4 < blended() < 0.6
        for share, weight in ((0.04, 1.3), (0.9, -0.3)):
            time.sleep(0.15)
            tab.mouse.move(*at(share))
            until(lambda wanted=weight: blended() == wanted, f"a weight of {weight}")
        tab.mouse.up()
        assert pad.get_attribute("aria-valuenow") == "-0.3"
        sends(lambda: (pad.focus(), tab.keyboard.press("ArrowUp")), Blend("walk", "jog", -0.25))
    finally:
        tab.close()
        page.stop()
