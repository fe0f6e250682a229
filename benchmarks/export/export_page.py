"""Pictures a second of exported pages in headless Chromium, and their cost.

`motiondeck export LIBRARY --robot ROBOT --for web --out FOLDER` makes a page. WebGL is drawn by SwiftShader, the rest
as Chromium does without a graphics card. Pages are shown in turns. Milliseconds are processor time of all of Chromium's
processes a picture, `of pixels` the share in each direction that the page has come to, and the load that of one minute.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from benchmarks.command import run
from benchmarks.deck.page import cpu_seconds

SETTLES = 15.0  # s, after which a page has chosen its pixels
BY_SOFTWARE = ("--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader")
WINDOW_TOO = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SHARE = "(({ canvas }) => canvas.width / canvas.clientWidth)(motiondeck.page.scene)"


def used(process: int) -> float:
    """Processor time of a process and of all below it, s."""
    below = [int(child) for task in Path(f"/proc/{process}/task").iterdir() for child in children(task)]
    return cpu_seconds(process) + sum(used(child) for child in below)


def children(task: Path) -> list[str]:
    """The processes that a thread has begun."""
    return (task / "children").read_text().split()


def shown(browser: Any, folder: Path, seconds: float, size: tuple[int, int]) -> tuple[float, float, float, float]:
    """Pictures a second, ms of processor time a picture, share of pixels, and the machine's load."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.goto((folder / "index.html").resolve().as_uri())
    page.wait_for_function("motiondeck.page?.frames > 1", timeout=60_000)
    time.sleep(SETTLES)
    began, before, first = time.monotonic(), used(os.getpid()), page.evaluate("motiondeck.page.frames")
    time.sleep(seconds)
    pictures = page.evaluate("motiondeck.page.frames") - first
    spent, passed = used(os.getpid()) - before, time.monotonic() - began
    share = page.evaluate(SHARE)
    page.close()
    return pictures / passed, 1e3 * spent / max(pictures, 1), share, os.getloadavg()[0]


def main(
    folders: Annotated[list[Path], typer.Argument(help="Folders of pages, the first one to compare with.")],
    seconds: Annotated[float, typer.Option(help="How long a page is measured each time.")] = 20.0,
    runs: Annotated[int, typer.Option(help="How often each page is shown.")] = 3,
    width: Annotated[int, typer.Option(help="Of the window.")] = 1280,
    height: Annotated[int, typer.Option(help="Of the window.")] = 760,
    whole_window: Annotated[bool, typer.Option(help="Have SwiftShader put the whole window together, too.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Pictures a second and processor time a picture: each run, and medians."""
    from playwright.sync_api import sync_playwright

    program = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    rows = [(folder, []) for folder in folders]
    with sync_playwright() as tool:
        browser = tool.chromium.launch(executable_path=program, args=[*(WINDOW_TOO if whole_window else BY_SOFTWARE)])
        for _ in range(runs):
            for folder, measured in rows:
                measured.append(shown(browser, folder, seconds, (width, height)))
        browser.close()
    if as_json:
        print(json.dumps({str(folder): measured for folder, measured in rows}))
        return
    print(f"{'':>24} {'pictures/s':>10} {'ms each':>8} {'of pixels':>9} {'load':>5}")
    for folder, measured in rows:
        for name, row in (*enumerate(measured, 1), ("median", [*map(statistics.median, zip(*measured, strict=True))])):
            text = f"{folder.name[-17:]} {name}"
            print(f"{text:>24} {row[0]:>10.1f} {row[1]:>8.1f} {row[2]:>9.2f} {row[3]:>5.1f}")


if __name__ == "__main__":
    run("export_page", main, __doc__)
