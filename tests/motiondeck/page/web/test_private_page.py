import http.server
import os
import socket
import subprocess
import sys
import threading

import msgspec
import numpy as np
import pytest
import viser
import viser._messages
import websockets.exceptions
import websockets.sync.client

from benchmarks.deck.page import CAMERA
from motiondeck.page.web.private_page import PrivatePage
from motiondeck_base.errors import MotiondeckError
from waiting import free_port
from web_pages import coarse


def open_socket(port, **more):
    return websockets.sync.client.connect(
        f"ws://127.0.0.1:{port}", subprotocols=[f"viser-v{viser.__version__}"], open_timeout=60, **more
    )


def own_page(port):
    return {"origin": f"http://127.0.0.1:{port}"}


@pytest.fixture
def page():
    page = PrivatePage(free_port(), "test")
    yield page
    page.stop()


class Tunnels:
    """Stands in for viser's tunnel to the internet, and counts."""

    def __init__(self):
        self.opened = threading.Event()

    def __call__(self, *_):
        self.opened.set()
        raise ConnectionError("no tunnels in tests")


@pytest.fixture
def tunnels(monkeypatch):
    stand_in = Tunnels()
    monkeypatch.setattr("viser._viser.ViserTunnel", stand_in)
    return stand_in


def ask_to_share(server, port):
    """A client asks to share and then shows its camera; returns when the server has seen both."""
    arrived = threading.Event()
    server.on_client_connect(lambda _: arrived.set())
    with open_socket(port, **own_page(port)) as client:
        for message in ({"type": "ShareUrlRequest"}, CAMERA):
            client.send(msgspec.msgpack.encode(message))
        assert arrived.wait(20)


def test_a_crafted_request_cannot_publish_the_page(tunnels):
    port = free_port()
    page = PrivatePage(port, "test")
    try:
        ask_to_share(page, port)
        assert page.request_share_url() is None
        assert not tunnels.opened.is_set()
    finally:
        page.stop()


def test_the_same_request_would_publish_any_other_viser_page(tunnels):
    # Guards the test above: should viser change its message, that one would pass for the wrong reason.
    port = free_port()
    server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    try:
        ask_to_share(server, port)
        assert tunnels.opened.wait(20)
    finally:
        server.stop()


def test_pages_from_elsewhere_in_the_same_browser_are_turned_away():
    port = free_port()
    page = PrivatePage(port, "test")
    try:
        for origin in ("http://evil.example", f"http://evil.example:{port}", f"https://127.0.0.1:{port}", "null", None):
            with pytest.raises(websockets.exceptions.InvalidStatus, match="403"), open_socket(port, origin=origin):
                pass
        with open_socket(port, origin=f"http://localhost:{port}") as client:
            assert client.recv(timeout=20)
    finally:
        page.stop()


@pytest.fixture
def other_site():
    """A site of somebody else's, whose pages are what it is given."""

    class Handler(http.server.BaseHTTPRequestHandler):
        page = ""

        def do_GET(self):
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(self.page.encode())

        def log_message(self, *_):
            pass

    site = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=site.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{site.server_port}", Handler
    site.shutdown()
    site.server_close()


@pytest.mark.parametrize("ours", [True, False])
def test_another_site_cannot_frame_the_page(ours, browser, other_site):
    # The plain viser page guards the test: it is framed, so what keeps ours out is ours.
    address, handler = other_site
    port = free_port()
    page = PrivatePage(port, "test") if ours else viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    handler.page = f'<title>a game</title><iframe id="f" src="http://127.0.0.1:{port}"></iframe>'
    try:
        tab = browser.new_page()
        tab.goto(address)
        frame = tab.frames[1]
        frame.wait_for_load_state()
        shown = frame.evaluate("document.getElementById('root') !== null")
        assert shown != ours
        assert frame.url.startswith("chrome-error") == ours
        tab.close()
    finally:
        page.stop()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can act as somebody else")
def test_another_user_gets_neither_the_page_nor_its_state():
    port = free_port()
    page = PrivatePage(port, "test")
    fetch = f"""
import encodings.idna, os, socket, sys
if sys.argv[1] == "other":
    os.setgid(65534); os.setuid(65534)
with socket.create_connection(("127.0.0.1", {port})) as connection:
    connection.settimeout(20.0)
    connection.sendall(b"GET / HTTP/1.1\\r\\nHost: 127.0.0.1:{port}\\r\\n\\r\\n")
    print(connection.recv(1000).split()[1].decode())
"""
    try:
        for user, status in (("own", "200"), ("other", "403")):
            done = subprocess.run([sys.executable, "-c", fetch, user], capture_output=True, text=True, check=True)
            assert done.stdout.split() == [status]
    finally:
        page.stop()


def answer(port, *headers):
    """The status of a request with these headers."""
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.settimeout(20.0)
        connection.sendall("\r\n".join(["GET / HTTP/1.1", *headers, "", ""]).encode())
        return int(connection.recv(1000).split()[1])


UPGRADE = ("Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13", f"Sec-WebSocket-Key: {'a' * 22}==")


def test_a_name_of_another_site_that_leads_here_gets_neither_the_page_nor_a_websocket(page):
    port = page.get_port()
    for own in (f"127.0.0.1:{port}", f"localhost:{port}", f"LOCALHOST:{port}", f"[::1]:{port}"):
        assert answer(port, f"Host: {own}") == 200
        assert answer(port, f"Host: {own}", f"Origin: http://127.0.0.1:{port}", *UPGRADE) == 101
    for other in (f"evil.example:{port}", "evil.example", "127.0.0.1", "127.0.0.1:1", f"127.0.0.1.evil.example:{port}"):
        assert answer(port, f"Host: {other}") == 421
        assert answer(port, f"Host: {other}", f"Origin: http://127.0.0.1:{port}", *UPGRADE) == 421
    assert answer(port) == 421
    assert answer(port, f"Host: 127.0.0.1:{port}", f"Host: evil.example:{port}") == 421


def test_a_rebound_name_shows_nothing_of_the_page_in_a_browser(page, browser):
    # Chromium takes every name below localhost for this machine, as a rebound name would be.
    tab = browser.new_page()
    tab.goto(coarse(page.address))
    tab.locator("canvas").first.wait_for()
    reply = tab.goto(f"http://rebound.localhost:{page.get_port()}/")
    assert reply.status == 421
    assert "This page is at http://127.0.0.1" in tab.content()
    tab.close()


def test_it_listens_on_loopback_only(monkeypatch):
    monkeypatch.setenv("_VISER_PORT_OVERRIDE", "1")
    port = free_port()
    page = PrivatePage(port, "test")
    try:
        assert page.address == f"http://127.0.0.1:{port}"
        assert page.get_host() == "127.0.0.1"
        with socket.socket() as other:
            # Another address of this machine; had the page taken them all, this one would be in use.
            other.bind(("127.0.0.2", port))
    finally:
        page.stop()


def test_copies_move_and_turn_in_one_message_of_which_the_latest_is_kept_for_whoever_comes():
    page = PrivatePage(free_port(), "test")
    try:
        copies = page.scene.add_batched_meshes_simple(
            "/copies", np.eye(3), np.array([[0, 1, 2]]), np.array([[1.0, 0.0, 0.0, 0.0]] * 2), np.zeros((2, 3))
        )
        for height in (1.0, 2.0):
            place, turn = np.full((2, 3), height, np.float32), np.full((2, 4), 0.5, np.float32)
            page.move_copies(copies, place, turn)
        kept = page._websock_server._broadcast_buffer.message_from_id.values()
        (moved,) = (message for message in kept if isinstance(message, viser._messages.SceneNodeUpdateMessage))
        assert moved.name == copies.name
        assert moved.updates["batched_positions"].tolist() == copies.batched_positions.tolist() == place.tolist()
        assert moved.updates["batched_wxyzs"].tolist() == copies.batched_wxyzs.tolist() == turn.tolist()
    finally:
        page.stop()


@pytest.mark.parametrize("port", ["taken", 70_000, -1])
def test_a_port_it_cannot_have_is_named(port):
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        number = holder.getsockname()[1] if port == "taken" else port
        with pytest.raises(MotiondeckError, match=f"port {number} on 127.0.0.1.*--port"):
            PrivatePage(number, "test")
