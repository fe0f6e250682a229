"""A viser page that stays on this machine and its user's: on loopback, used only by its own page, never shared.

viser can publish a page on the internet through a tunnel, and does so whenever a client asks; it also takes commands
from any web page that happens to be open in the same browser, and lets itself be framed by one, so that a click meant
for that page is a command. And every account on the machine can connect to a port of it. None of this may
happen to the panel of a robot.
"""

import contextlib
import io
import logging
import os
import socket
import time
from collections.abc import Callable, Iterator
from http import HTTPStatus
from typing import Any

import numpy as np
import viser
import viser._messages
import websockets.asyncio.server
from numpy.typing import NDArray
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from motiondeck.page.web.page_style import CURRENT
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.socket_owners import owner_of_connection

LOOPBACK = "127.0.0.1"
LAST_WORD = 1.2  # s for a browser to get the end
THEME: dict[str, Any] = {"show_share_button": False, "show_logo": False, "brand_color": CURRENT}
_HTTP = 80  # the port that browsers leave out


class PrivatePage(viser.ViserServer):
    """A viser server on 127.0.0.1 alone, which is never shared; MotiondeckError if the port is taken or not allowed."""

    def __init__(self, port: int, label: str) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((LOOPBACK, port))
            except (OSError, OverflowError) as error:
                raise MotiondeckError(_taken(port)) from error
        os.environ.pop("_VISER_PORT_OVERRIDE", None)
        # A client that connects and leaves again is not worth a traceback in the deck's terminal.
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
        with _own_pages_only(port):
            super().__init__(host=LOOPBACK, port=port, label=label, verbose=False)
        if self.get_port() != port:
            # viser moves on to the next free port when it loses a race for this one.
            self.stop()
            raise MotiondeckError(_taken(port))
        self.gui.configure_theme(**THEME)
        self.suit: Callable[[viser.ClientHandle, tuple[bool, bool]], None] = lambda *_: None  # see `Scene.suit`
        # Sharing is off three times: no button, no handler for a crafted message, no method to call.
        for request in (viser._messages.ShareUrlRequest, viser._messages.ShareUrlDisconnect):
            self._websock_server.unregister_handler(request)

    def request_share_url(self, verbose: bool = True) -> None:
        """Refuses: the panel of a robot is not published."""

    def move_copies(
        self, copies: viser.BatchedMeshHandle, position: NDArray[np.float32], turn: NDArray[np.float32]
    ) -> None:
        """Moves and turns copies of a mesh, shapes (N, 3), m, and (N, 4); nothing may change these arrays any more."""
        # Set one by one, these properties would be two messages, each of which costs again for every browser.
        places = {"batched_positions": position, "batched_wxyzs": turn}
        vars(copies._impl.props).update(places)
        copies._impl.api._queue_scene_message(viser._messages.SceneNodeUpdateMessage(copies.name, places))

    @property
    def is_watched(self) -> bool:
        """Whether a browser is connected, perhaps one that has not drawn its scene yet: `get_clients` lacks that."""
        return bool(self._websock_server._client_state_from_id)

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{LOOPBACK}:{self.get_port()}"


@contextlib.contextmanager
def served(port: int, label: str) -> Iterator[PrivatePage]:
    """A page in the block; the browsers then get what it shows last. MotiondeckError as of `PrivatePage`."""
    # viser announces itself on standard output, which is kept for results.
    with contextlib.redirect_stdout(io.StringIO()):
        page = PrivatePage(port, label)
        try:
            yield page
            page.flush()
            time.sleep(LAST_WORD if page.get_clients() else 0.0)
        finally:
            page.stop()


def _taken(port: int) -> str:
    return f"port {port} on {LOOPBACK} is in use or not allowed. Choose another with --port."


@contextlib.contextmanager
def _own_pages_only(port: int) -> Iterator[None]:
    """Makes a server started within refuse websockets that its own page has not opened, and frames around that page."""
    # A browser lets any page open a websocket to any address, but says truthfully which page it was. And it takes a
    # page for one of a site whose name has been made to lead here (DNS rebinding), but says truthfully which.
    serve = websockets.asyncio.server.serve
    hosts = [f"{host}:{port}" if port != _HTTP else host for host in (LOOPBACK, "localhost", "[::1]")]
    pages = [f"http://{host}" for host in hosts]

    def guarded(*arguments: Any, process_request: Callable[[ServerConnection, Request], Any], **more: Any) -> Any:
        def check(connection: ServerConnection, request: Request) -> Any:
            if not _is_same_user(connection):
                return connection.respond(HTTPStatus.FORBIDDEN, "This page belongs to another user.\n")
            if [host.lower() for host in request.headers.get_all("Host")] not in [[host] for host in hosts]:
                return connection.respond(HTTPStatus.MISDIRECTED_REQUEST, f"This page is at {pages[0]} only.\n")
            return process_request(connection, request)

        return serve(*arguments, origins=pages, process_request=check, process_response=_forbid_frames, **more)  # pyright: ignore

    websockets.asyncio.server.serve = guarded  # pyright: ignore
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve  # pyright: ignore


def _is_same_user(connection: ServerConnection) -> bool:
    """Whether a program of our own user, or root, is at the other end; the system's table of connections says whose."""
    near, far = connection.local_address, connection.remote_address
    return owner_of_connection(far[:2], near[:2]) in (0, os.geteuid())


def _forbid_frames(connection: ServerConnection, request: Request, response: Response) -> None:
    """Has the browser show the page in no frame, whatever page that stands in."""
    response.headers["Content-Security-Policy"] = "frame-ancestors 'none'"
    response.headers["X-Frame-Options"] = "DENY"
