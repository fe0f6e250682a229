"""What tests of pages share: a free port, and waiting for something that a browser does."""

import base64
import socket
import time


def free_port():
    """A port of 127.0.0.1 that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def until(condition, what, seconds=60.0):
    """What the condition gives when it holds; a browser without a graphics card on a busy machine takes its time."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        time.sleep(0.02)
    return found


def coarse(address):
    """The address of a page whose scene is drawn with a hundredth of its pixels: in software they take long."""
    return f"{address.rstrip('/')}/?fixedDpr=0.1"


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
