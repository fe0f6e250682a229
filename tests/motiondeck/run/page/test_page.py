"""The page of a running deck, pressed by a real browser."""

import io
import os
import re
import subprocess
import sys
from contextlib import closing, suppress

import msgspec
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from bodies import waving
from controller.motion.formats.writing import bvh_text
from controller.wire.command_socket import CommandClient
from controller.wire.messages.commands import GetStatus, Subscribe
from controller.wire.messages.replies import Accepted, Event
from motiondeck_base.shipped import find_rig
from waiting import PATIENCE, free_port, tried
from web_pages import drop, open_early, printed_address

pytestmark = pytest.mark.thorough


COMMAND_PORT = str(free_port())
COMMAND = [sys.executable, "-m", "motiondeck.cli.main"]


@pytest.fixture(scope="module")
def emulator(tmp_path_factory):
    """Emulated servos that obey hands, and the rig file for them."""
    servos = subprocess.Popen(
        [*COMMAND, "rig", "emulate", "servo20"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with suppress(OSError):  # servos answer in time on a busy machine too, where that is permitted
        os.sched_setscheduler(servos.pid, os.SCHED_FIFO, os.sched_param(40))
    assert servos.stdout is not None
    rig = tmp_path_factory.mktemp("rig") / "servo20.toml"
    text = find_rig("servo20").read_text().replace("/dev/ttyUSB0", servos.stdout.readline().strip())
    text = re.sub(r"^rate_hz = .*$", "rate_hz = 25", text, flags=re.M)
    # Servos whose process gets no core for a while must not end the deck.
    rig.write_text(f'on_loss = "go on"\nreconnect_s = 600\n{text}')
    yield servos, rig
    servos.kill()
    servos.communicate()


@pytest.fixture(scope="module")
def address(emulator):
    """A deck that plays walk on a robot with servos, and its page; it ticks rarely, as nobody looks at the motion."""
    _, rig = emulator
    robot = ["--robot", "servo20", "--rig", str(rig), "--rate", "50"]
    decks = []

    def start():
        decks.append(
            subprocess.Popen(
                [*COMMAND, "play", "walk", *robot, "--port", "0", "--command-port", COMMAND_PORT],
                cwd=rig.parent,
                stdin=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
        )
        return printed_address(decks[-1].stderr)

    try:
        yield tried(start)  # a servo whose process gets no core does not answer
    finally:
        for deck in decks:
            deck.terminate()
            deck.communicate(timeout=60)


@pytest.fixture(scope="module")
def page(browser, address):
    page = browser.new_page(viewport={"width": 1130, "height": 600})
    open_early(page, address)
    page.get_by_role("button", name=re.compile("^jog")).wait_for()
    return page


def picture(page):
    """What the page shows left of the panel, as grey values."""
    png = page.screenshot(clip={"x": 430, "y": 50, "width": 350, "height": 500})
    return np.asarray(Image.open(io.BytesIO(png)).convert("L"), dtype=float)


def state():
    """What the deck says of itself."""
    with closing(CommandClient(int(COMMAND_PORT))) as client:
        return msgspec.to_builtins(client.request(GetStatus(), timeout_s=30.0))


def until(page, condition):
    for _ in range(500):
        if condition():
            return True
        page.wait_for_timeout(100)
    return False


def test_a_body_is_in_view_and_moves(page):
    assert until(page, lambda: picture(page).std() > 10.0)
    first = picture(page)
    assert until(page, lambda: np.abs(picture(page) - first).mean() > 1.0)


def switch(page, motion):
    """Presses the button of a motion, and waits until it plays alone."""
    page.get_by_role("button", name=re.compile(f"^{motion}\\b(?!-)")).click()
    assert until(page, lambda: state()["motion"] == motion and not state()["switching"])


def test_a_button_switches_the_motion(page):
    switch(page, "walk")
    before = picture(page)
    switch(page, "crawl")
    # Who crawls leaves the upper half of the picture.
    upper = slice(0, 180)
    assert until(page, lambda: picture(page)[upper].std() < 0.8 * before[upper].std())


def test_there_is_a_button_for_each_motion_and_one_to_pause(page):
    for motion in state()["motions"]:
        expect(page.get_by_role("button", name=re.compile(f"^{motion}\\b(?!-)"))).to_have_count(1)
    if not state()["paused"]:
        page.get_by_role("button", name="Pause").click()
    assert until(page, lambda: state()["paused"])


def test_the_page_says_how_the_loop_is_doing(page):
    if not page.get_by_text("p50").locator("visible=true").count():
        page.get_by_text("loop", exact=True).click()
    for word in ("Hz", "p50", "p99.9", "tick"):
        page.get_by_text(word).locator("visible=true").first.wait_for()


def test_nobody_can_publish_the_page(page):
    expect(page.get_by_role("button", name="Share")).to_have_count(0)


def test_a_dropped_recording_is_learned_and_played(page, emulator):
    """The deck starts again with its rig and on its ports; the page comes back by itself."""
    _, rig = emulator
    swing = rig.parent / "swing.bvh"
    swing.write_text(bvh_text(waving(30.0, 4.0, still=1.0)))
    drop(page, swing)  # its tab opens by itself
    page.get_by_role("button", name="Learn it").click()
    page.get_by_role("button", name="Play it").click()
    page.get_by_role("button", name="Start again with it").click()
    page.locator("#state-line").get_by_text("swing", exact=True).wait_for()
    assert state()["motion"] == "swing"
    assert len(state()["motions"]) == 16
    page.get_by_role("tab", name="Rig").click()


def test_a_servo_that_is_pulled_is_told_and_red(page, emulator):
    servos, _ = emulator
    card = page.get_by_role("button", name=re.compile("^l knee"))
    card.wait_for()
    expect(card).not_to_have_class(re.compile(r"\bbad\b"))
    with closing(CommandClient(int(COMMAND_PORT))) as client:
        assert isinstance(client.request(Subscribe(), timeout_s=30.0), Accepted)
        servos.stdin.write("pull l_knee\n")
        servos.stdin.flush()
        while not (isinstance(event := client.receive(PATIENCE), Event) and "l_knee" in event.text):
            assert event is not None
    page.locator('.servo-card.bad[aria-label^="l knee"]').wait_for()
