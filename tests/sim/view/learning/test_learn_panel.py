"""Learning a recording on the page, in a browser; the process that learns is the real one."""

import sys
from pathlib import Path

import pytest

from bodies import waving
from controller.mocap.formats.writing import bvh_text
from controller.wire.messages import LoadLibrary
from motiondeck_base.shipped import find_library
from sim.view.learning.learn_panel import LearnPanel
from sim.view.learning.learning_process import LearnRequest, NotLearned, work
from sim.view.web.parts import PageParts
from sim.view.web.private_page import PrivatePage
from web_pages import drop, free_port, until

LEARNS = [sys.executable, "-P", "-m", "controller.cli.session.page_learning"]


@pytest.fixture
def learning(tmp_path, monkeypatch, browser):
    """A page where one can learn, its tab in a browser, and what was asked for."""
    monkeypatch.chdir(tmp_path)
    page, asked = PrivatePage(free_port(), "test"), []
    LearnPanel(
        page,
        PageParts(page),
        LEARNS,
        find_library("thesis15"),
        tmp_path / "dropped",
        lambda event, title, text, yes, message: asked.append(message),
    )
    tab = browser.new_page(viewport={"width": 900, "height": 600})
    tab.set_default_timeout(60_000)
    tab.goto(page.address)
    tab.get_by_text("Drop a recording").wait_for()
    yield tab, asked, tmp_path
    tab.close()
    page.stop()


def test_a_dropped_recording_is_trimmed_named_learned_and_played(learning):
    tab, asked, folder = learning
    (folder / "broken.bvh").write_text("HIERARCHY\n")
    (folder / "swing.bvh").write_text(bvh_text(waving(30.0, 4.0, still=1.0)))

    drop(tab, folder / "broken.bvh")
    tab.locator("#learning").get_by_text("no MOTION section").wait_for()
    assert not tab.get_by_role("button", name="Learn it").is_visible()

    drop(tab, folder / "swing.bvh")
    tab.get_by_role("button", name="Learn it").wait_for()
    assert tab.locator(".film-strip svg").count() == 8
    tab.get_by_text("6.0 s").wait_for()
    tab.get_by_role("button", name="Learn it").click()
    tab.get_by_role("button", name="Play it").click()
    until(lambda: asked, "the command")
    written = folder / "thesis15-swing.safetensors"
    assert asked == [LoadLibrary(str(written), "swing")]
    assert written.is_file()


def test_a_recording_without_its_skeleton_says_what_to_drop(learning):
    tab, _, folder = learning
    (folder / "walk.amc").write_text(":FULLY-SPECIFIED\n")
    drop(tab, folder / "walk.amc")
    tab.get_by_text("drop the .asf too").wait_for()


def test_a_learning_process_that_dies_is_told():
    (said,) = work([sys.executable, "-c", "raise SystemExit(3)"], LearnRequest(str(Path("no.bvh"))))
    assert isinstance(said, NotLearned)
    assert "ended without an answer" in said.reason
