"""Uploads of a page, by a browser that keeps to nothing: too large ones are refused and not kept."""

import threading
from types import SimpleNamespace

import msgspec
import pytest
import viser
import websockets.sync.client

from benchmarks.deck.page import CAMERA
from motiondeck.page.learning.learn_panel import limit_uploads
from motiondeck.page.web.private_page import PrivatePage
from waiting import free_port, until

MOST = 1000


@pytest.fixture
def uploads():
    port = free_port()
    page, refused, taken, there = PrivatePage(port, "test"), [], [], threading.Event()
    button = page.gui.add_upload_button("a file")
    button.on_upload(lambda event: taken.append((event.target.value.name, len(event.target.value.content))))
    limit_uploads(page, MOST, lambda name, size: refused.append((name, size)))
    page.on_client_connect(lambda _: there.set())
    own = {"origin": f"http://127.0.0.1:{port}", "subprotocols": [f"viser-v{viser.__version__}"], "open_timeout": 60}
    with websockets.sync.client.connect(f"ws://127.0.0.1:{port}", **own) as client:
        send(client, **CAMERA)
        assert there.wait(20)
        kept = page.gui._current_file_upload_states
        yield SimpleNamespace(client=client, source=button._impl.uuid, refused=refused, taken=taken, kept=kept)
    page.stop()


def send(client, **message):
    client.send(msgspec.msgpack.encode(message))


def announce(uploads, name, size, parts=1):
    about = {"filename": name, "mime_type": "", "part_count": parts, "size_bytes": size}
    about |= {"source_component_uuid": uploads.source, "transfer_uuid": name}
    send(uploads.client, type="FileTransferStartUpload", **about)


def give(uploads, name, content, part=0):
    about = {"source_component_uuid": uploads.source, "transfer_uuid": name, "part_index": part, "content": content}
    send(uploads.client, type="FileTransferPart", **about)


def test_a_file_of_the_largest_size_is_taken_and_a_larger_one_is_refused_and_not_kept(uploads):
    announce(uploads, "large.bvh", MOST + 1)
    give(uploads, "large.bvh", bytes(MOST + 1))
    announce(uploads, "fits.bvh", MOST)
    give(uploads, "fits.bvh", bytes(MOST))
    until(lambda: uploads.taken, "the file that fits")
    assert uploads.taken == [("fits.bvh", MOST)]
    assert uploads.refused == [("large.bvh", MOST + 1)]
    assert not uploads.kept


def test_many_files_at_once_are_no_way_around_it(uploads):
    for number in range(4):
        announce(uploads, f"{number}.bvh", 400, parts=2)
        give(uploads, f"{number}.bvh", bytes(200))
    until(lambda: len(uploads.refused) == 2, "the refusals")
    assert sum(one["transferred_bytes"] for one in uploads.kept.values()) <= MOST
    for number in range(2):
        give(uploads, f"{number}.bvh", bytes(200), part=1)
    until(lambda: len(uploads.taken) == 2, "both files that fit")


def test_a_file_that_is_larger_than_announced_is_refused(uploads):
    announce(uploads, "liar.bvh", 10, parts=3)
    for part in range(3):
        give(uploads, "liar.bvh", bytes(MOST), part)
    announce(uploads, "fits.bvh", 1)
    give(uploads, "fits.bvh", bytes(1))
    until(lambda: uploads.taken, "the file that fits")
    assert uploads.refused == [("liar.bvh", MOST)]
    assert not uploads.kept


@pytest.mark.parametrize(("size", "parts"), [(-1, 0), (5, 10**9), (2**70, 1)])
def test_impossible_announcements_are_refused(uploads, size, parts):
    announce(uploads, "odd.bvh", min(size, 2**63), parts)
    until(lambda: uploads.refused, "the refusal")
    assert not uploads.kept
