"""Makes the pictures of the page in these docs: plays the shipped library in a browser, and takes screenshots.

.venv/bin/python docs/page_pictures.py [FOLDER]        # default: docs/pictures
"""

from __future__ import annotations

import io
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

import motiondeck

GRAPHICS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE_MS = 60_000


def main(folder: Path) -> None:
    """Writes page-NAME.webp for each of SCENES."""
    browser_path = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))))
    with (
        motiondeck.play("thesis15", "walk", robot="servo20", rig="emulated", page=True) as deck,
        sync_playwright() as tool,
    ):
        browser = tool.chromium.launch(executable_path=browser_path, args=GRAPHICS)
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        page.set_default_timeout(PATIENCE_MS)
        page.goto(str(deck.page))
        page.get_by_text("PLAYING", exact=True).wait_for()
        # The browser's own notice: it draws without a graphics card here.
        page.get_by_text("Software WebGL").locator("xpath=../..").get_by_role("button").click()
        time.sleep(3.0)
        for name, act in SCENES.items():
            act(deck, page)
            Image.open(io.BytesIO(page.screenshot())).save(folder / f"page-{name}.webp", quality=80)
            print(folder / f"page-{name}.webp")
        browser.close()


def _playing(deck: Any, page: Any) -> None:
    time.sleep(2.0)


def _network(deck: Any, page: Any) -> None:
    page.get_by_text("view", exact=True).click()
    page.get_by_text("network", exact=True).click()
    page.mouse.move(300, 600)
    time.sleep(6.0)


def _blend(deck: Any, page: Any) -> None:
    page.get_by_text("network", exact=True).click()
    page.get_by_text("view", exact=True).click()
    deck.blend("walk", "jog", 0.4).wait()
    time.sleep(1.0)


def _on_its_way(deck: Any, page: Any) -> None:
    deck.switch("crawl").wait()
    deck.switch("waltz")
    page.get_by_text("ON ITS WAY").wait_for()
    time.sleep(0.5)


def _emergency_stop(deck: Any, page: Any) -> None:
    page.keyboard.press("Escape")
    page.get_by_text("EMERGENCY STOP", exact=True).wait_for()
    time.sleep(1.0)


SCENES: dict[str, Callable[[Any, Any], None]] = {
    "playing": _playing,
    "network": _network,
    "blend": _blend,
    "on-its-way": _on_its_way,
    "emergency-stop": _emergency_stop,
}

if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "pictures")
