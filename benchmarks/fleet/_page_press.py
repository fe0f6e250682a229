"""Presses the emergency stop of a show's page as a browser does."""

from __future__ import annotations

import sys
import time
from typing import Any

import msgspec
import viser
import zstandard
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

_LENGTHS = 16  # bytes before the compressed messages
_CAMERA = {  # a browser is there for viser once it has sent its camera
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 0.0, 0.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 10.0,
    "image_height": 100,
    "image_width": 100,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


def main() -> None:
    """Waits for the button in what the page at a port sends, and presses it."""
    port = int(sys.argv[1])
    protocol = Subprotocol(f"viser-v{viser.__version__}")
    with connect(
        f"ws://127.0.0.1:{port}", origin=Origin(f"http://127.0.0.1:{port}"), subprotocols=[protocol], max_size=None
    ) as page:
        page.send(msgspec.msgpack.encode(_CAMERA))
        while (button := _stop_button(page.recv(3.0))) is None:
            pass
        time.sleep(0.1)
        page.send(msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": button, "updates": {"value": True}}))
        time.sleep(0.1)  # the page carries it out while the browser is there


def _stop_button(data: Any) -> str | None:
    size = int.from_bytes(data[8:_LENGTHS], "little")
    messages = msgspec.msgpack.decode(zstandard.decompress(data[_LENGTHS : _LENGTHS + size]))["messages"]
    for message in messages:
        if message["type"] == "GuiButtonMessage" and message["props"]["label"] == "Emergency stop":
            return message["uuid"]
    return None
