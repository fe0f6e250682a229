"""Learning a recording on the page, in a browser; the process that learns is the real one."""

import re
import sys
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from bodies import waving
from controller.library.motion_library import load_library
from controller.motion.formats.writing import bvh_text
from controller.wire.messages.commands import LoadLibrary, Pause, ServoTorque
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.learning.hand_recorder import HandRecorder
from motiondeck.page.learning.learn_panel import MOST_BYTES, LearnPanel
from motiondeck.page.learning.learning_process import LearnRequest, NotLearned, work
from motiondeck.page.web.page_state import RigDescription, ServoDescription
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage
from motiondeck_base.shipped import find_library
from waiting import free_port, until
from web_pages import coarse, drop

pytestmark = pytest.mark.thorough

LEARNS = [sys.executable, "-P", "-m", "motiondeck.run.page.learning"]


RIG = RigDescription(
    ["well", "is off on command"],
    100.0,
    [ServoDescription(name, 1, "", -3.14, 3.14, 80.0) for name in ("neck", "l_elbow", "l_wrist")],
)


@dataclass
class Learning:
    """A page where one can learn: its tab in a browser, what was asked for and sent, its folder, and its recorder."""

    tab: Page
    folder: Path
    hands: HandRecorder
    asked: list
    sent: list


@pytest.fixture(scope="module")
def learning(tmp_path_factory, browser):
    folder = tmp_path_factory.mktemp("learning")
    page, asked, sent = PrivatePage(free_port(), "test"), [], []
    parts = PageParts(page)

    def ask(event, title, text, yes, then):
        asked.append(then)

    with chdir(folder):
        panel = LearnPanel(parts, LEARNS, find_library("thesis15"), folder / "dropped", ask)
        hands = HandRecorder(parts, RIG, folder / "dropped", ask, sent.append, panel.look_at)
        hands.show(rig([0, 0, 0], [0.0, 0.0, 0.0]))
        tab = browser.new_page(viewport={"width": 900, "height": 600})
        tab.set_default_timeout(60_000)
        tab.goto(coarse(page.address))
        tab.get_by_text("Drop a recording").wait_for()
        yield Learning(tab, folder, hands, asked, sent)
        tab.close()
        page.stop()


def test_a_dropped_recording_is_trimmed_named_learned_and_played(learning):
    tab, asked, folder = learning.tab, learning.asked, learning.folder
    (folder / "broken.bvh").write_text("HIERARCHY\n")
    (folder / "swing.bvh").write_text(bvh_text(waving(30.0, 4.0, still=1.0)))

    drop(tab, folder / "broken.bvh")
    tab.locator("#learning").get_by_text("no MOTION section").wait_for()
    expect(tab.locator("#learning")).to_have_text(re.compile("^broken.bvh"))
    expect(tab.get_by_text("uploaded successfully")).to_be_hidden()
    expect(tab.get_by_role("button", name="Learn it")).to_be_hidden()

    drop(tab, folder / "swing.bvh")
    tab.get_by_role("button", name="Learn it").wait_for()
    expect(tab.locator(".film-strip svg")).to_have_count(8)
    tab.get_by_text("6.0 s").wait_for()
    tab.get_by_role("button", name="Learn it").click()
    tab.get_by_role("button", name="Play it").click()
    until(lambda: asked, "the command")
    written = folder / "thesis15-swing.safetensors"
    assert asked.pop() == LoadLibrary(str(written), "swing")
    assert written.is_file()


def rig(loose, angles):
    """The states of the rig's servos."""
    states = ServoStates(*np.zeros((8, 3)))
    return states._replace(conditions=np.array(loose, dtype=float), positions=np.array(angles))


def test_the_rig_is_recorded_by_hand_and_the_part_that_was_chosen_is_played(learning):
    tab, hands, asked = learning.tab, learning.hands, learning.asked
    tab.get_by_role("button", name="Record the rig by hand").click()
    until(lambda: asked, "the question")
    asked.pop()()
    assert learning.sent == [Pause(), *(ServoTorque(servo.joint, "off") for servo in RIG.servos)]
    hands.show(rig([0, 1, 1], [0.1, 0.0, 0.0]))
    tab.get_by_text("2 of 3 joints are loose").wait_for()
    tab.get_by_role("button", name="Start recording").click()
    until(lambda: hands.recording, "the recording")
    for frame in range(8 * 30):
        swing = np.sin(np.pi * frame / 30.0) * (frame > 60)  # rounds of 2 s, after 2 s of rest
        hands.record(10.0 + frame / 30.0, rig([0, 1, 1], [0.1, 0.5 * swing, 0.8 * swing]))
    hands.show(rig([0, 1, 1], [0.1, 0.0, 0.0]))
    tab.get_by_role("button", name="Stop recording").click()
    tab.get_by_text("by-hand-1: 8.0 s").wait_for()
    name = tab.locator('input[value="by-hand-1"]').element_handle()
    name.fill("wave")
    name.press("Enter")
    tab.get_by_role("button", name="Learn it").click()
    tab.get_by_text("It is in a new library").wait_for()
    tab.get_by_role("button", name="Play it").click()
    until(lambda: asked, "the command")
    load = asked.pop()
    assert (Path(load.library).name, load.to) == ("wave.safetensors", "wave")
    library = load_library(Path(load.library))
    assert library.skeleton.bones == ("l_elbow", "l_wrist")
    (motion,) = library.info.motions
    rounds = motion.frames / library.info.rate / 2.0
    assert (motion.plays, rounds) == ("loop", pytest.approx(round(rounds), abs=0.05))
    played = library.network.twin()
    played.cue("wave", 0)
    angles = np.empty((motion.frames, 2))
    for frame in angles:
        played.advance(frame)
    assert np.ptp(angles, axis=0) == pytest.approx([1.0, 1.6], rel=0.15)


def test_a_recording_without_its_skeleton_says_what_to_drop(learning):
    tab, folder = learning.tab, learning.folder
    (folder / "walk.amc").write_text(":FULLY-SPECIFIED\n")
    drop(tab, folder / "walk.amc")
    tab.get_by_text("drop the .asf too").wait_for()


def test_a_recording_that_is_too_large_is_refused_in_one_line_and_not_written(learning):
    tab, folder = learning.tab, learning.folder
    (folder / "long.bvh").write_bytes(bytes(MOST_BYTES + 1))
    tab.locator("input[type=file]").set_input_files(folder / "long.bvh")
    said = tab.locator("#learning").get_by_text("long.bvh has")
    said.wait_for()
    expect(said).to_have_text(
        "long.bvh has 67,108,865 bytes; the page takes at most 67,108,864 bytes. Give it to: motiondeck learn"
    )
    assert not [*(folder / "dropped").glob("long*")]
    expect(tab.get_by_text("Uploading")).to_have_count(0)
    expect(tab.get_by_role("button", name="Choose a recording")).to_be_enabled()


def test_a_learning_process_that_dies_is_told():
    (said,) = work([sys.executable, "-c", "raise SystemExit(3)"], LearnRequest(str(Path("no.bvh"))))
    assert isinstance(said, NotLearned)
    assert "ended without an answer" in said.reason
