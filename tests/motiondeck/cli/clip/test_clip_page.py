"""The page of a recording, pressed by a real browser."""

import re
import subprocess
import sys

import pytest
from playwright.sync_api import expect

from recordings import BVH
from waiting import soon
from web_pages import open_early, printed_address


@pytest.fixture
def address(tmp_path):
    """The page of a bow of a second, once up and down."""
    head, _, rows = BVH.partition("Frames: 2\n")
    time, first, second, _ = rows.split("\n", 3)
    frames = "\n".join([first, second] * 60)
    (tmp_path / "bow.bvh").write_text(f"{head}Frames: 120\n{time}\n{frames}\n")
    command = [sys.executable, "-m", "motiondeck.cli.main", "clip", "view", str(tmp_path / "bow.bvh"), "--port", "0"]
    view = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert view.stdout is not None
    try:
        yield printed_address(view.stdout)
    finally:
        view.terminate()
        view.wait(timeout=60)


@pytest.mark.thorough
def test_the_bar_the_steps_and_the_button(browser, address):
    page = browser.new_page(viewport={"width": 800, "height": 600})
    open_early(page, address)

    def frame():
        found = re.match(r"frame (\d+) of 120", page.locator("#where").inner_text())
        assert found is not None
        return int(found.group(1))

    pause, play = (page.get_by_role("button", name=name, exact=True) for name in ("Pause", "Play"))
    pause.wait_for()

    def pauses():
        """While a page is being laid out, a click may fall beside the button."""
        if pause.is_visible():
            pause.click()
        expect(play).to_be_visible(timeout=5000)

    soon(pauses)
    page.wait_for_timeout(500)
    here = frame()
    page.wait_for_timeout(500)
    assert frame() == here
    step, after = ("+1", here + 1) if here < 120 else ("-1", here - 1)
    page.get_by_role("button", name=step, exact=True).click()
    page.get_by_text(f"frame {after} of 120").wait_for()
    bar = page.get_by_role("textbox").first

    def goes_to_the_middle():
        """What the step has set may still be on its way, and takes the place of what is typed."""
        bar.fill("0.5")
        bar.press("Enter")
        expect(page.get_by_text("frame 61 of 120")).to_be_visible(timeout=5000)

    soon(goes_to_the_middle)
    play.click()
    pause.wait_for()
    decided = page.locator("#decided").inner_text()
    assert "unit: cm" in decided
    assert "otherwise: --ground none" in decided
    page.close()
