"""What tests of pages share: a scene that is drawn fast, and files that are dropped."""

import base64
import re

from playwright.sync_api import Error


def coarse(address):
    """The address of a page whose scene is drawn with a hundredth of its pixels: in software they take long."""
    return f"{address.rstrip('/')}/?fixedDpr=0.1"


def printed_address(lines):
    """The address that a program prints for its page, after what is permitted, and known of the robot's motions."""
    first = lines.readline()
    while first.startswith(("granted: ", "not permitted: ", "which motions ")):
        first = lines.readline()
    found = re.fullmatch(r"page: (http://127\.0\.0\.1:\d+)\n", first)
    assert found, first
    return found[1]


def open_early(page, address):
    """Opens an address, drawn coarsely, as soon as a server answers there."""
    for _ in range(600):
        try:
            page.goto(coarse(address))
            break
        except Error:
            page.wait_for_timeout(100)


def drop(page, *files):
    """Drops files on a page, as from a file manager."""
    given = [(file.name, base64.b64encode(file.read_bytes()).decode()) for file in files]
    page.evaluate(
        """(files) => {
            const carried = new DataTransfer();
            for (const [name, text] of files)
              carried.items.add(new File([Uint8Array.from(atob(text), (c) => c.charCodeAt(0))], name));
            const event = new DragEvent("drop", { dataTransfer: carried, bubbles: true, cancelable: true });
            document.body.dispatchEvent(event);
        }""",
        given,
    )
