"""Motions on the page: pictures, the queue, blends and the phase, in a browser; and what is found out of a library."""

from unittest.mock import Mock

import numpy as np
import pytest
from playwright.sync_api import expect

from controller.deck.routes import Routes
from controller.wire.messages.commands import Blend, Jump, Queue, Switch
from controller.wire.messages.deck_snapshot import DeckSnapshot
from motiondeck.page.motions.motion_controls import MOST, MotionControls, Partners, blends_of, pictures_of
from motiondeck.page.panel import Panel
from motiondeck.page.web.page_state import PageDescription
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage
from shipped_libraries import shipped
from waiting import free_port, tried, until

MOTIONS = ["walk", "jog", "waltz", *(f"more-{n}" for n in range(12))]


@pytest.fixture(scope="module")
def thesis15():
    return shipped()


def test_every_motion_has_a_picture_of_its_own(thesis15):
    pictures = pictures_of(thesis15)
    assert list(pictures["poses"]) == list(thesis15.network.motions)
    assert len({str(poses) for poses in pictures["poses"].values()}) == len(pictures["poses"])
    assert {(len(poses), len(poses[0])) for poses in pictures["poses"].values()} == {(3, 1 + len(pictures["parents"]))}


def test_loops_blend_with_loops_that_lie_near(thesis15):
    walk = blends_of(thesis15.network.motions, Routes.of(thesis15))["walk"]
    gap = abs(walk.others.index("slow-walk") - walk.others.index("jog"))
    assert gap in (1, len(walk.others) - 1)  # side by side on the pad, which is round
    assert walk.apart == [""] * len(walk.others)
    assert {*walk.refused} == {"crawl", "sitting"}  # they are reached by way of others
    assert "getdown lies between" in walk.refused["crawl"]


def test_a_deck_without_motions_in_between_blends_all_loops(thesis15):
    blends = blends_of(thesis15.network.motions, Routes.of(thesis15).direct)
    assert blends["walk"].refused == {}
    assert len(blends["walk"].others) == MOST
    assert "one-shot" in blends["standup"].never


def test_neighbours_on_the_pad_that_are_too_far_apart_are_known():
    motions = ("stand", "crouch", "reach", "rise")
    leaps = {name: dict.fromkeys(motions, 0.1) for name in motions}
    leaps["crouch"]["reach"] = leaps["reach"]["crouch"] = 1.0
    stand = blends_of(motions, Routes(leaps, frozenset({"rise"})))["stand"]
    assert stand.others == ["crouch", "reach"]
    assert [why.split(":")[1] for why in stand.apart] == [" rise lies between them"] * 2


PICTURES = {"parents": [-1], "poses": {name: [[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]] for name in MOTIONS}}
BLENDS = {
    "walk": Partners(["jog", "waltz"], ["", ""], {"more-1": "more-1 lies down"}),
    "waltz": Partners(["jog", "walk"], ["jog and walk are too far apart"] * 2),
    "jog": Partners(never="jog is a one-shot"),
}


def test_grid_queue_ring_and_pad_send_commands(browser):
    page, sent = PrivatePage(free_port(), "test"), []
    about = PageDescription(model_file="", robot="test", motions=MOTIONS, has_phase=True)
    controls = MotionControls(PageParts(page), about, sent.append)
    controls.pictures, controls.blends = PICTURES, BLENDS
    playing = DeckSnapshot(motion="walk", playing="walk", queue=["jog", "waltz"], phase=0.4)
    controls.show(playing)
    tab = browser.new_page(viewport={"width": 500, "height": 900})
    tab.set_default_timeout(60_000)

    def sends(act, *messages):
        sent.clear()
        act()
        until(lambda: len(sent) >= len(messages), f"{messages}, not {sent}")
        assert sent == [*messages]

    try:
        tab.goto(page.address)
        tab.locator('[data-key="walk"] .picture svg path').first.wait_for(state="attached")
        expect(tab.get_by_role("button", name="walk playing", exact=True)).to_be_enabled()
        sends(lambda: tab.get_by_role("button", name="jog queued 1", exact=True).click(), Switch("jog"))
        sends(lambda: tab.get_by_role("button", name="queue: more-3", exact=True).click(), Queue("more-3"))
        again = [Switch("walk"), Queue("waltz"), Queue("jog")]
        sends(lambda: tab.get_by_role("button", name="sooner: waltz").click(), *again)
        sends(lambda: tab.get_by_role("button", name="take out: jog").click(), Switch("walk"), Queue("waltz"))

        tab.get_by_placeholder("search a motion").fill("wal")
        for name in MOTIONS:
            expect(tab.locator(f'.motion[data-key="{name}"]')).to_be_visible(visible=name in ("walk", "waltz"))
        expect(tab.get_by_text("no motion is named like this", exact=True)).to_be_hidden()
        tab.get_by_placeholder("search a motion").fill("zzz")
        tab.get_by_text("no motion is named like this", exact=True).wait_for()
        tab.get_by_placeholder("search a motion").fill("wal")
        keys = tab.locator(".motion").evaluate_all("all => all.map((one) => [one.dataset.key, one.dataset.keyNumber])")
        assert dict(keys) == dict(zip(MOTIONS, [*"123456789", *[None] * 6], strict=True))

        ring = tab.get_by_role("slider", name="phase")
        expect(ring).to_have_attribute("aria-valuenow", "0.4")
        sends(lambda: (ring.focus(), tab.keyboard.press("ArrowRight")), Jump(0.41))
        # Up is the first of the two, jog, whose name stands where its weight is 1; waltz stands at 120 degrees from it.
        pad = tab.get_by_role("slider", name="blend weight")

        def at(jog, waltz):
            """Where jog and waltz have these weights."""
            box = pad.bounding_box()
            one = box["width"] * 52 / 148
            right, up = np.sin(2 * np.pi / 3) * waltz, jog + np.cos(2 * np.pi / 3) * waltz
            return box["x"] + 0.5 * box["width"] + one * right, box["y"] + 0.5 * box["height"] - one * up

        def pulled(*stations):
            tab.mouse.move(*at(*stations[0]))
            tab.mouse.down()
            for station in stations[1:]:
                tab.mouse.move(*at(*station))
            tab.mouse.up()

        def pulling(stations, *messages):
            """What is above the pad may still move it while the mouse goes there."""
            tried(lambda: sends(lambda: pulled(*stations), *messages))

        pulling([(0.5, 0.0)], Blend("walk", "jog", 0.5))
        # However far it goes, a pull is one command: that of where it is let go.
        pulling([(0.5, 0.0), (0.2, 0.7), (0.3, 0.4)], Blend("walk", "jog", 0.3, also=(("waltz", 0.4),)))
        expect(pad).to_have_attribute("aria-valuetext", "jog 30 %, waltz 40 %")
        pulling([(0.9, 0.9)], Blend("walk", "jog", 0.5, also=(("waltz", 0.5),)))  # without walk
        pulling([(1.0, 0.0), (1.4, 0.0)], Blend("walk", "jog", 1.3))
        pulling([(0.0, 1.2)], Blend("walk", "waltz", 1.2))
        pulling([(-0.45, -0.5)], Blend("walk", "jog", 0.0))  # nothing stands there
        refused = tab.get_by_text("no blend with more-1")
        expect(refused.locator("..")).to_have_attribute("title", "more-1 lies down")
        refused.click()
        tab.get_by_text("more-1 lies down").wait_for()
        tab.keyboard.down("Shift")
        pulling([(0.5, 0.0), (-0.5, 0.0)], Blend("walk", "jog", -0.3))
        tab.keyboard.up("Shift")
        controls._touched = 0.0
        blend = (("jog", 0.4), ("waltz", 0.3))
        controls.show(DeckSnapshot(motion="walk", playing="walk", blend=blend, phase=0.4))
        tab.locator("#motion-dial").get_by_text("waltz 30 %").wait_for()
        sends(lambda: (pad.focus(), tab.keyboard.press("ArrowUp")), Blend("walk", "jog", 0.45, also=(("waltz", 0.3),)))

        # Where three at once would be refused, the point stays on the line of the nearer name.
        controls._touched = 0.0
        controls.show(DeckSnapshot(motion="waltz", playing="waltz", phase=0.4))
        expect(tab.locator(".apart")).to_have_text("jog and walk are too far apart")
        pulling([(0.5, 0.4)], Blend("waltz", "jog", 0.3))
        controls._touched = 0.0
        controls.show(DeckSnapshot(motion="jog", playing="jog", phase=0.4))
        tab.get_by_role("group").get_by_text("jog is a one-shot").first.wait_for()
    finally:
        tab.close()
        page.stop()


@pytest.mark.thorough
def test_a_long_list_of_what_cannot_be_blended_makes_the_panel_no_wider(browser):
    """It had the emergency stop half out of sight."""
    page = PrivatePage(free_port(), "test")
    about = PageDescription(model_file="", robot="test", motions=MOTIONS, has_phase=True)
    panel = Panel(page, about, Mock(), look_from=Mock())
    panel.motion_controls.pictures = PICTURES
    panel.motion_controls.blends = {
        "walk": Partners(["jog"], [""], {name: f"{name} lies down" for name in MOTIONS[2:]})
    }
    panel.show(DeckSnapshot(motion="walk", playing="walk", phase=0.4))
    tab = browser.new_page(viewport={"width": 1000, "height": 700})
    tab.set_default_timeout(60_000)
    stop = tab.get_by_role("button", name="Emergency stop")
    try:
        tab.goto(page.address)
        tab.get_by_text("no blend with waltz").wait_for()
        until(lambda: (box := stop.bounding_box()) and box["x"] + box["width"] <= 1000, "the panel within the window")
    finally:
        tab.close()
        page.stop()
