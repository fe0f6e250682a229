"""Makes the pictures of the page in these docs: plays the shipped library in a browser, and takes screenshots.

.venv/bin/python docs/page_pictures.py [FOLDER [NAME...]]        # default: all, into docs/pictures
"""

from __future__ import annotations

import base64
import io
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from controller.library.motion_library import load_library
from controller.wire.command_socket import CommandClient
from controller.wire.messages import Blend, Reset, Resume, Switch
from motiondeck_base.shipped import find_library, find_rig
from sim.physics.played_motions import as_clip

GRAPHICS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE_MS = 180_000
COMMAND_PORT = 47899
COMMAND = [sys.executable, "-P", "-m", "motiondeck"]


def main(folder: Path, names: Sequence[str]) -> None:
    """Writes page-NAME.webp for these of SCENES."""
    browser_path = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))))
    with tempfile.TemporaryDirectory() as work, sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=browser_path, args=GRAPHICS)
        with deck_on_emulated_servos(Path(work)) as (address, hands):
            page = browser.new_page(viewport={"width": 1366, "height": 768})
            page.set_default_timeout(PATIENCE_MS)
            page.goto(address)
            _begin(page)
            for name, act in ((name, act) for name, act in SCENES.items() if name in names):
                size = SIZES.get(name, (1366, 768))
                page.set_viewport_size({"width": size[0], "height": size[1]})
                act(page, hands, Path(work))
                file = folder / f"page-{name}.webp"
                Image.open(io.BytesIO(page.screenshot(timeout=PATIENCE_MS))).save(file, quality=80)
                print(file, flush=True)
        browser.close()


@contextmanager
def deck_on_emulated_servos(work: Path) -> Iterator[tuple[str, Callable[[str], None]]]:
    """A deck on emulated servos: the address of its page, and how hands are told what to do to the servos."""
    servos = subprocess.Popen(
        [*COMMAND, "rig", "emulate", "servo20"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert servos.stdin is not None
    assert servos.stdout is not None
    rig = work / "servo20.toml"
    port = servos.stdout.readline().strip()
    rig.write_text('on_loss = "go on"\n' + find_rig("servo20").read_text().replace("/dev/ttyUSB0", port))
    options = ["--robot", "servo20", "--rig", str(rig), "--port", "0", "--command-port", str(COMMAND_PORT)]
    deck = subprocess.Popen(
        [*COMMAND, "play", "walk", *options], cwd=work, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    assert deck.stderr is not None

    def tell(words: str) -> None:
        print(words, file=servos.stdin, flush=True)

    try:
        yield deck.stderr.readline().split()[1], tell
    finally:
        deck.terminate()
        deck.communicate()
        servos.kill()
        servos.communicate()


def send(*messages: Any) -> None:
    """Sends commands to the deck."""
    with closing(CommandClient(COMMAND_PORT)) as client:
        for message in messages:
            client.request(message, timeout_s=30.0)


def drop(page: Any, file: Path) -> None:
    """Drops a file on the page."""
    page.evaluate(
        """([name, text]) => {
            const carried = new DataTransfer();
            carried.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
            const event = new DragEvent("drop", { dataTransfer: carried, bubbles: true, cancelable: true });
            document.body.dispatchEvent(event);
        }""",
        [file.name, base64.b64encode(file.read_bytes()).decode()],
    )


def _begin(page: Any) -> None:
    page.get_by_text("PLAYING", exact=True).wait_for()
    # The browser's own notice: it draws without a graphics card here.
    page.get_by_text("Software WebGL").locator("xpath=../..").get_by_role("button").click()
    time.sleep(3.0)


def _playing(page: Any, hands: Callable[[str], None], work: Path) -> None:
    time.sleep(6.0)


def _phone(page: Any, hands: Callable[[str], None], work: Path) -> None:
    page.reload()  # a camera keeps the place that it got where the window was larger
    _begin(page)


def _rig(page: Any, hands: Callable[[str], None], work: Path) -> None:
    page.get_by_role("tab", name="Rig").click()
    time.sleep(6.0)


def _hot_servo(page: Any, hands: Callable[[str], None], work: Path) -> None:
    page.get_by_role("button", name="l_knee").click()
    for _ in range(5):
        hands("warm l_knee 75")
        time.sleep(1.0)
    page.locator('.servo-card.warn[aria-label*="hot"]').wait_for()


def _registers(page: Any, hands: Callable[[str], None], work: Path) -> None:
    page.get_by_role("button", name="Registers").click()
    page.get_by_role("row", name="operating_mode").wait_for()
    time.sleep(1.0)


def _network(page: Any, hands: Callable[[str], None], work: Path) -> None:
    page.get_by_role("button", name="Close").click()
    page.get_by_text("view", exact=True).click()
    page.get_by_text("network", exact=True).click()
    page.mouse.move(700, 600)
    time.sleep(6.0)


def _blend(page: Any, hands: Callable[[str], None], work: Path) -> None:
    page.get_by_text("network", exact=True).click()
    page.get_by_text("view", exact=True).click()
    send(Blend("walk", "jog", 0.4))
    page.get_by_text("BLEND", exact=True).wait_for()
    time.sleep(3.0)


def _on_its_way(page: Any, hands: Callable[[str], None], work: Path) -> None:
    send(Switch("crawl"))
    time.sleep(6.0)
    send(Switch("waltz"))
    page.get_by_text("ON ITS WAY").wait_for()
    time.sleep(0.5)


def _emergency_stop(page: Any, hands: Callable[[str], None], work: Path) -> None:
    page.keyboard.press("Escape")
    page.get_by_text("EMERGENCY STOP", exact=True).wait_for()
    time.sleep(1.0)


def _learning(page: Any, hands: Callable[[str], None], work: Path) -> None:
    if page.get_by_text("EMERGENCY STOP", exact=True).is_visible():
        send(Reset(), Resume())
    page.get_by_role("tab", name="Learn").click()
    from controller.mocap.formats.writing import bvh_text

    recording = work / "my-waltz.bvh"
    recording.write_text(bvh_text(as_clip(load_library(find_library("thesis15")), "waltz", 6.0, 60.0)))
    drop(page, recording)
    page.get_by_role("button", name="Learn it").wait_for()
    page.get_by_role("button", name="Learn it").click()
    page.get_by_role("button", name="Play it").wait_for()


SCENES: dict[str, Callable[[Any, Callable[[str], None], Path], None]] = {
    "playing": _playing,
    "hot-servo": _hot_servo,
    "registers": _registers,
    "network": _network,
    "blend": _blend,
    "on-its-way": _on_its_way,
    "emergency-stop": _emergency_stop,
    "learning": _learning,
    "large": _rig,
    "phone": _phone,
}
SIZES = {"large": (1920, 1080), "phone": (390, 844)}

if __name__ == "__main__":
    os.environ.setdefault("MUJOCO_GL", "disable")
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "pictures", sys.argv[2:] or [*SCENES])
