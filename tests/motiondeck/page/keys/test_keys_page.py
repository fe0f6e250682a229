"""The page of keyframes in a browser: posed, keyed, moved, saved, learned and played with emulated servos."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from controller.motion.formats.keyframes import Keyframes
from motiondeck_base.toml_file import read_toml
from web_pages import open_early, printed_address

ARM = Path(__file__).parents[4] / "examples" / "arm" / "arm.toml"


@pytest.fixture
def written(tmp_path):
    """The address of the page of a new motion of the arm, and the folder that it will be in."""
    shutil.copy(ARM, tmp_path / "arm.toml")
    words = ["rig", "teach", str(tmp_path / "arm.toml"), "--out", str(tmp_path / "wave.toml")]
    page = subprocess.Popen([sys.executable, "-m", "motiondeck.cli.main", *words], stdout=subprocess.PIPE, text=True)
    assert page.stdout is not None
    try:
        yield printed_address(page.stdout), tmp_path
    finally:
        page.terminate()
        page.wait(timeout=30)


@pytest.mark.thorough
def test_a_motion_is_posed_keyed_moved_saved_learned_and_played(browser, written):
    address, folder = written
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.set_default_timeout(60_000)
    open_early(page, address)
    draft = page.locator("#draft")
    draft.get_by_text("4 s, once · 1 key · not saved").wait_for()

    def fill(label, value):
        field = page.locator(f"xpath=//label[normalize-space()='{label}']/ancestor::div[.//input][1]//input").last
        field.fill(str(value))
        field.press("Enter")

    def press(name):
        page.get_by_role("button", name=name, exact=True).click()

    for at, elbow in ((1, 60), (2, 0), (3, 60)):
        fill("time, s", at)
        page.get_by_role("button", name=f"Set key at {at} s").wait_for()
        fill("elbow", elbow)
        draft.get_by_text("This pose is no key yet").wait_for()
        press(f"Set key at {at} s")
        page.get_by_role("button", name=f"Change key at {at} s").wait_for()
    fill("length, s", 2)
    draft.get_by_text("the key at 3 s is not before the end at 2 s").wait_for()
    page.locator(".key-strip .key[data-at='3']").press("ArrowLeft")
    page.locator(".key-strip .key[data-at='2.95']").press("Delete")
    draft.get_by_text("3 keys").wait_for()
    press("Undo")
    draft.get_by_text("4 keys").wait_for()
    page.locator(".key-strip .key[data-at='1']").click()
    page.get_by_role("button", name="Change key at 1 s").wait_for()
    page.locator(
        "xpath=//label[normalize-space()='easing']/ancestor::div[.//input][1]//input[not(@type='hidden')]"
    ).click()
    page.get_by_role("option", name="late").click()
    page.locator(".key-strip .key[title^='1 s, late']").wait_for()
    press("Play")
    press("Pause")
    press("Save")
    draft.get_by_text("saved as").wait_for()
    keys = read_toml(folder / "wave.toml", Keyframes).key
    assert [(key.at, key.pose["elbow"]) for key in keys] == [(0.0, 0.0), (1.0, 60.0), (2.0, 0.0), (2.95, 60.0)]
    assert [key.easing for key in keys] == ["smooth", "late", "smooth", "smooth"]

    press("emulated")
    page.locator("#rehearsal").get_by_text("wave.safetensors plays").wait_for()
    run = browser.new_page(viewport={"width": 800, "height": 600})
    open_early(run, page.locator("#rehearsal a").get_attribute("href"))
    run.get_by_text("PLAYING", exact=True).wait_for(timeout=60_000)
    run.close()
    press("Stop playing")
    page.locator("#rehearsal").get_by_text("the run has ended").wait_for()
    assert len(read_toml(folder / "wave.toml", Keyframes).key) == 4  # the recipe has another name
    page.close()
