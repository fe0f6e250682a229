"""Checks the page with axe-core: both views, light and dark, on a phone and a laptop, playing and stopped.

axe-core comes from npm, into a temporary folder. Exit code 1 if there is a serious or critical finding.

.venv/bin/python docs/page_axe.py
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from page_pictures import PATIENCE_MS, behind, deck_on_emulated_servos, send
from playwright.sync_api import sync_playwright

from controller.wire.messages.commands import EmergencyStop, Reset, Resume

WINDOWS = {"phone": (390, 844), "laptop": (1366, 768)}
GRAPHICS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]
GRAVE = ("serious", "critical")


def findings(page: Any, axe: str) -> list[str]:
    """What axe finds on a page: impact, rule, and the first elements."""
    page.evaluate(axe)
    found = page.evaluate("axe.run(document, { resultTypes: ['violations'] })")["violations"]
    return [
        f"{one['impact']} {one['id']}: {one['help']}: " + "; ".join(str(node["target"][0]) for node in one["nodes"][:3])
        for one in found
    ]


def main() -> int:
    """Prints every finding; returns the exit code."""
    grave = 0
    with tempfile.TemporaryDirectory() as work, sync_playwright() as tool:
        subprocess.run(["npm", "install", "--prefix", work, "axe-core"], check=True, stdout=subprocess.DEVNULL)
        axe = (Path(work) / "node_modules/axe-core/axe.min.js").read_text(encoding="utf-8")
        program = next(filter(None, map(shutil.which, ("chromium", "google-chrome"))), None)
        browser = tool.chromium.launch(executable_path=behind(program, Path(work)), args=GRAPHICS)
        with deck_on_emulated_servos(Path(work)) as (address, _):
            for stopped in (False, True):
                send(*([EmergencyStop()] if stopped else []))
                for view in ("operate", "inspect"):
                    for scheme in ("light", "dark"):
                        for window, (width, height) in WINDOWS.items():
                            page = browser.new_page(
                                viewport={"width": width, "height": height}, color_scheme=scheme, bypass_csp=True
                            )
                            page.set_default_timeout(PATIENCE_MS)
                            page.goto(f"{address}/?view={view}&fixedDpr=0.1")
                            page.locator(".motion svg").first.wait_for(state="attached")
                            page.locator(f"[data-mantine-color-scheme={scheme}]").wait_for()
                            if stopped:
                                page.get_by_text("EMERGENCY STOP", exact=True).first.wait_for(state="attached")
                            found = findings(page, axe)
                            grave += sum(one.startswith(GRAVE) for one in found)
                            print(f"{view}, {scheme}, {window}, {'stopped' if stopped else 'playing'}:", flush=True)
                            print("".join(f"  {one}\n" for one in found) or "  nothing\n", end="", flush=True)
                            page.close()
            send(Reset(), Resume())
        browser.close()
    return 1 if grave else 0


if __name__ == "__main__":
    sys.exit(main())
