"""Makes the pictures of the page in these docs: plays the shipped library in a browser, and takes screenshots.

Each scene is shown in three windows: page-NAME.webp (1366 x 768), page-NAME-large.webp (1920 x 1080) and
page-NAME-phone.webp (390 x 844); the operate view also in page-NAME-tablet.webp (1024 x 768). A phone shows the operate
view, where the scene is not of the inspect view alone.

.venv/bin/python docs/page_pictures.py [FOLDER [NAME...]]        # default: all, into docs/pictures
"""

from __future__ import annotations

import base64
import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from controller.library.motion_library import load_library
from controller.wire.command_socket import CommandClient
from controller.wire.messages.commands import Blend, EmergencyStop, Queue, Reset, Resume, SetTempo, Stop, Switch
from motiondeck.run.sampled_motions import as_clip
from motiondeck_base.shipped import find_library, find_rig

GRAPHICS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
PATIENCE_MS = 180_000
COMMAND_PORT = 47899
COMMAND = [sys.executable, "-P", "-m", "motiondeck"]
WINDOWS = {"": (1366, 768), "-large": (1920, 1080), "-phone": (390, 844), "-tablet": (1024, 768)}
THREE = ("", "-large", "-phone")
Shots = Iterator[tuple[str, Any]]


def main(folder: Path, names: Sequence[str]) -> None:
    """Writes the pictures of these of SCENES."""
    browser_path = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
    with tempfile.TemporaryDirectory() as work, sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=behind(browser_path, Path(work)), args=GRAPHICS)
        with deck_on_emulated_servos(Path(work)) as (address, hands):
            setting = Setting(browser, address, hands, Path(work))
            for name in (name for name in SCENES if name in names):
                for window, page in SCENES[name](setting):
                    file = folder / f"page-{name}{window}.webp"
                    picture = page.screenshot(timeout=PATIENCE_MS)
                    Image.open(io.BytesIO(picture)).save(file, quality=80 if not window else 70)
                    print(file, flush=True)
        browser.close()


def behind(program: str | None, work: Path) -> Path:
    """A program that runs another at a low priority: a browser that draws without a graphics card takes every core.

    Raises:
        SystemExit: if there is none.
    """
    if program is None:
        sys.exit("no Chromium or Google Chrome was found; install one of them")
    script = work / "browser"
    script.write_text(f'#!/bin/sh\nexec nice -n 5 {program} "$@"\n')
    script.chmod(0o700)
    return script


@dataclass(frozen=True)
class Setting:
    """Where a scene is played.

    Attributes:
        browser: of Playwright.
        address: of the page.
        hands: told what to do to the emulated servos.
        work: the folder in which the deck was started.
    """

    browser: Any
    address: str
    hands: Callable[[str], None]
    work: Path

    def open(self, window: str, view: str = "inspect", scheme: str = "light") -> Any:
        """The page in a browser window of a size and in a view, when it shows what happens."""
        width, height = WINDOWS[window]
        page = self.browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
        page.set_default_timeout(PATIENCE_MS)
        page.goto(f"{self.address}/?view={view}")
        if view == "operate":
            page.locator(".operate .motion svg").first.wait_for(state="attached")
            return page
        page.locator("#state-line").wait_for()
        # The browser's own notice: it draws without a graphics card here.
        page.get_by_text("Software WebGL").locator("xpath=../..").get_by_role("button").click()
        page.get_by_role("button", name=re.compile("^walk")).locator("svg").first.wait_for(state="attached")
        return page

    def shots(
        self, arrange: Callable[[Any], None] = lambda page: None, seconds: float = 3.0, on_phone: str = "operate"
    ) -> Shots:
        """The page in each window, one after the other, arranged if in inspect, then left alone for some seconds."""
        for window in THREE:
            view = on_phone if window == "-phone" else "inspect"
            page = self.open(window, view)
            if view == "inspect":
                arrange(page)
            time.sleep(seconds)
            if view == "inspect":
                page.wait_for_function("!document.querySelector('.mantine-Notification-root')")
            yield window, page
            page.close()


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
        yield next(line for line in deck.stderr if line.startswith("page:")).split()[1], tell
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


def _playing(setting: Setting) -> Shots:
    time.sleep(6.0)
    yield from setting.shots()


def _operate(setting: Setting, scheme: str = "light") -> Shots:
    send(Switch("walk"), Queue("jog"), Queue("waltz"), SetTempo(0.05))  # the queue stays as it is for long
    for window in ("-phone", "-tablet", "-large"):
        page = setting.open(window, "operate", scheme)
        time.sleep(6.0)
        yield window, page
        page.close()
    send(Switch("walk"), SetTempo(1.0))


def _operate_dark(setting: Setting) -> Shots:
    yield from _operate(setting, "dark")


def _locked(setting: Setting) -> Shots:
    page = setting.open("-phone", "operate")
    page.get_by_role("button", name="Lock").click()
    time.sleep(4.0)
    yield "-phone", page
    page.close()


def _past(setting: Setting) -> Shots:
    send(Switch("waltz"))
    time.sleep(10.0)
    send(Switch("walk"))
    page = setting.open("")
    time.sleep(8.0)
    bar = page.locator(".timeline-strip .bar").bounding_box()
    page.mouse.click(bar["x"] + (1.0 - 12.0 / 180.0) * bar["width"], bar["y"] + 0.5 * bar["height"])
    page.get_by_role("button", name="back to now").wait_for()
    page.wait_for_function("!document.querySelector('.mantine-Notification-root')")
    yield "", page
    page.close()


def _knee(page: Any) -> None:
    page.get_by_role("button", name="l knee").click()
    page.locator('.servo-card.warn[aria-label*="hot"]').scroll_into_view_if_needed()


def _hot_servo(setting: Setting) -> Shots:
    with warmed(setting.hands, "l_knee", 75):
        time.sleep(6.0)
        yield from setting.shots(_knee)


@contextmanager
def warmed(hands: Callable[[str], None], joint: str, degrees: int) -> Iterator[None]:
    """Keeps a servo hot."""
    over = Event()

    def warm() -> None:
        while not over.wait(1.0):
            hands(f"warm {joint} {degrees}")

    thread = Thread(target=warm)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _registers(setting: Setting) -> Shots:
    page = setting.open("")
    page.get_by_role("button", name="l knee").click()
    page.get_by_role("button", name="Registers").click()
    page.get_by_role("row", name="operating_mode").wait_for()
    time.sleep(1.0)
    yield "", page
    page.get_by_role("button", name="Close").click()
    page.close()


def _look_inside(page: Any) -> None:
    page.get_by_text("view", exact=True).click()
    box = page.get_by_role("checkbox", name="network")
    if not box.is_checked():
        box.click()
    page.mouse.move(700, 600)


def _network(setting: Setting) -> Shots:
    yield from setting.shots(_look_inside, 5.0, on_phone="inspect")
    page = setting.open("")
    page.get_by_text("view", exact=True).click()
    page.get_by_role("checkbox", name="network").click()
    page.close()


def _plots(setting: Setting) -> Shots:
    page = setting.open("")
    page.get_by_role("tab", name="Plots").click()
    for curve in ("angle/l_knee", "angle/r_knee", "current/l_knee", "loop/lateness", "loop/bus load"):
        page.get_by_label("add a curve").select_option(curve)
    page.get_by_role("button", name="10 s", exact=True).click()
    page.get_by_role("button", name="Larger").click()
    time.sleep(12.0)
    yield "", page
    page.close()


def _networks(setting: Setting) -> Shots:
    page = setting.open("")
    page.get_by_role("tab", name="Networks").click()
    page.get_by_label("motion beside").select_option("jog")
    page.locator(".side-by-side b").get_by_text("jog", exact=True).wait_for()
    time.sleep(2.0)
    yield "", page
    page.close()


def _blend(setting: Setting) -> Shots:
    send(Blend("walk", "slow-walk", 0.25, also=(("jog", 0.4),)))
    time.sleep(4.0)
    yield from setting.shots()


def _on_its_way(setting: Setting) -> Shots:
    send(Switch("crawl"))
    time.sleep(8.0)
    send(SetTempo(0.03), Switch("waltz"))
    yield from setting.shots(lambda page: page.locator("#state-line").get_by_text("ON ITS WAY").wait_for(), 1.0)
    send(SetTempo(1.0))
    time.sleep(6.0)


def _emergency_stop(setting: Setting) -> Shots:
    send(EmergencyStop())
    time.sleep(2.0)
    yield from setting.shots()
    send(Reset(), Resume())


def _learning(setting: Setting) -> Shots:
    from controller.motion.formats.writing import bvh_text

    recording = setting.work / "my-waltz.bvh"
    recording.write_text(bvh_text(as_clip(load_library(find_library("thesis15")), "waltz", 6.0, 60.0)))
    page = setting.open("")
    page.get_by_role("tab", name="Learn").click()
    drop(page, recording)
    page.get_by_role("button", name="Learn it").click()
    page.get_by_role("button", name="Play it").wait_for()
    page.close()
    yield from setting.shots(_learned, on_phone="inspect")


def _learned(page: Any) -> None:
    page.get_by_role("tab", name="Learn").click()
    page.get_by_role("button", name="Play it").scroll_into_view_if_needed()


def _keys(setting: Setting) -> Shots:
    arm = setting.work / "arm"
    shutil.copytree(Path(__file__).parents[1] / "examples" / "arm", arm)
    words = [*COMMAND, "rig", "teach", str(arm / "arm.toml"), "--out", str(arm / "pick.toml")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        page = setting.browser.new_page(viewport={"width": 1366, "height": 768})
        page.set_default_timeout(PATIENCE_MS)
        address = program.stdout.readline().split()[1]
        time.sleep(5.0)  # the address is printed before it answers
        page.goto(address)
        page.get_by_text("Software WebGL").locator("xpath=../..").get_by_role("button").click()
        page.locator(".key[data-at='4.7']").click()
        page.get_by_role("button", name="Change key at 4.7 s").wait_for()
        time.sleep(3.0)
        yield "", page
        page.close()
        program.terminate()


def _show(setting: Setting) -> Shots:
    text = (Path(__file__).parent / "shows.md").read_text(encoding="utf-8")
    show = setting.work / "gala.toml"
    show.write_text(re.findall(r"^```toml\n(.*?)^```", text, flags=re.M | re.S)[0])
    deck = [
        *COMMAND,
        "play",
        "walk",
        "--kinematic",
        "--rate",
        "50",
        "--headless",
        "--command-port",
        "0",
        "--seconds",
        "60",
    ]
    programs = [
        subprocess.Popen([*deck, "--show", f"gala/{name}"], stdin=subprocess.DEVNULL) for name in ("left", "right")
    ]
    conductor = [*COMMAND, "conduct", str(show), "--port", "8051"]
    programs.append(subprocess.Popen(conductor, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL))
    time.sleep(10.0)
    page = setting.browser.new_page(viewport={"width": 1000, "height": 620})
    page.set_default_timeout(PATIENCE_MS)
    page.goto("http://127.0.0.1:8051")
    page.get_by_text("Software WebGL").locator("xpath=../..").get_by_role("button").click()
    page.get_by_text("HELD", exact=True).wait_for()
    time.sleep(3.0)
    yield "", page
    page.close()
    for program in programs:
        program.terminate()
        program.wait()


def _ended(setting: Setting) -> Shots:
    pages = {window: setting.open(window, "operate" if window == "-phone" else "inspect") for window in THREE}
    send(Stop())
    for window, page in pages.items():
        page.locator(".operate .word" if window == "-phone" else "#state-line").get_by_text("ENDED").wait_for()
    yield from pages.items()


SCENES: dict[str, Callable[[Setting], Shots]] = {
    "playing": _playing,
    "operate": _operate,
    "operate-dark": _operate_dark,
    "locked": _locked,
    "past": _past,
    "network": _network,
    "plots": _plots,
    "networks": _networks,
    "hot-servo": _hot_servo,
    "registers": _registers,
    "blend": _blend,
    "on-its-way": _on_its_way,
    "emergency-stop": _emergency_stop,
    "learning": _learning,
    "keys": _keys,
    "show": _show,
    "ended": _ended,
}

if __name__ == "__main__":
    os.environ.setdefault("MUJOCO_GL", "disable")
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "pictures", sys.argv[2:] or [*SCENES])
