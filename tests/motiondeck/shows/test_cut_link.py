"""A link that is cut keeps no other from being heard: members that stand still, over TLS on this machine."""

import itertools
import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, closing

import numpy as np
import pytest

from motiondeck.shows import link
from motiondeck.shows.link import Link
from motiondeck.shows.membership import with_certificates
from waiting import free_ports, tried, until

pytest.importorskip("zenoh")
make_certificates = pytest.importorskip("motiondeck.shows.certificates").make_certificates

SILENT = [f"silent-{number}" for number in range(8)]
LEASE = 0.4
UNREAD = 20 * [bytes(60_000)]  # more than a receiver that stands still has room for, less than a sender has
SITTING = f"""
import sys, time
from pathlib import Path
from motiondeck.shows import link
from motiondeck.shows.membership import with_certificates
link.LEASE = {LEASE}
links = [link.Link(with_certificates(Path(folder))) for folder in sys.argv[1:]]
for each in links:
    each.subscribe("cue", lambda *_: None)
    each.announce("deck/here")
time.sleep(60)
"""


def test_lost_links_do_not_silence_the_one_that_is_left(tmp_path, monkeypatch):
    monkeypatch.setattr(link, "LEASE", LEASE)
    attempts = itertools.count()
    tried(lambda: check(tmp_path / str(next(attempts))))


def check(folder):
    """What one of two members says is heard each second while the links to all others are lost."""
    names = ["conductor", "talker", *SILENT]
    ports = free_ports(len(names))
    make_certificates(folder, "gala", {name: f"127.0.0.1:{port}" for name, port in zip(names, ports, strict=True)})
    folders = [str(folder / name) for name in SILENT]
    heard, here = [], []
    with ExitStack() as opened:
        conductor = opened.enter_context(closing(Link(with_certificates(folder / "conductor"))))
        conductor.subscribe("health/*", lambda *_: heard.append(time.monotonic()))
        conductor.watch("deck/*", lambda *seen: here.append(seen))
        talker = opened.enter_context(closing(Link(with_certificates(folder / "talker"))))
        silent = subprocess.Popen([sys.executable, "-c", SITTING, *folders])
        opened.callback(silent.wait)
        opened.callback(silent.kill)
        until(lambda: conductor.neighbours == talker.neighbours == len(names) - 1 and here, "all links")
        time.sleep(0.2)  # what the last one wants to hear is known too
        os.kill(silent.pid, signal.SIGSTOP)
        for data in UNREAD:
            conductor.publish("cue", data)
            time.sleep(0.005)  # too much at once is dropped
        end = time.monotonic() + LEASE + 1.5
        while time.monotonic() < end:
            talker.publish("health/talker", b"well")
            time.sleep(0.02)
        until(lambda: conductor.neighbours <= 1, "the loss of the others")
        assert max(np.diff([*heard, end])) < 1.0
