"""Networks looked into: how far a motion is from its recording, and two networks side by side."""

from types import SimpleNamespace

import numpy as np
import pytest

from bodies import waving
from controller.deck.motion_generator import MotionGenerator
from controller.learning.learn import learn
from controller.library.motion_library import load_library, save_library
from controller.motion.formats.writing import bvh_text
from controller.motion.rotations import from_rotation_vector, multiply
from controller.motion.skeleton import walk_path
from motiondeck.page.against_recording import NAMES, AgainstRecordings
from motiondeck.page.network.side_by_side import POINTS, add_side_by_side, course
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage
from motiondeck_base.shipped import find_library
from shipped_libraries import shipped
from waiting import free_port, until
from web_pages import coarse


def looked(history, library, skeleton):
    """The mean and the largest distance, mm, of every picture of a history."""
    AgainstRecordings(history, library, skeleton.info())
    at = np.arange(len(history.motions))
    return [history.derived[name](at) for name in NAMES]


@pytest.mark.thorough
def test_a_bent_elbow_is_as_far_from_the_recording_as_its_hand_has_moved(tmp_path):
    (tmp_path / "swing.bvh").write_text(bvh_text(waving(60.0, 4.0)))
    library = learn([tmp_path], "two", seeds=[0]).library
    save_library(library, tmp_path / "two.safetensors")
    (info,), rate, skeleton = library.info.motions, library.info.rate, library.skeleton
    seconds = info.against_recording.to_s - info.against_recording.from_s
    frames = MotionGenerator(library, info.name).frames(seconds, rate)
    pose = walk_path(library.encoding.decode(frames), 1.0 / rate)
    rotation, count = pose.rotation.copy(), len(frames)
    bent = rotation.copy()
    for bone in ("rwri", "rhan"):  # they begin at the elbow and at the wrist
        turn = from_rotation_vector(np.array([0.0, 0.3, 0.0]))
        bent[:, 1 + skeleton.index(bone)] = multiply(turn, bent[:, 1 + skeleton.index(bone)])
    phase = (np.arange(count) / rate / seconds) % 1.0

    def history(turns):
        blocks = {"human_root": pose.root_position, "human_rotation": turns.reshape(count, -1)}
        names = [info.name] * count
        block = lambda kept, at: blocks[kept][at]  # noqa: E731
        return SimpleNamespace(motions=names, derived={}, column=lambda name, at: phase[at], block=block)

    near, far = (looked(history(turns), tmp_path / "two.safetensors", skeleton) for turns in (rotation, bent))
    assert np.median(near[0]) < info.against_recording.mm.p95
    moved = skeleton.joints(pose.root_position, bent) - skeleton.joints(pose.root_position, rotation)
    expected = 1000.0 * np.linalg.norm(moved, axis=-1).max(axis=1)
    inner = (phase > 0.1) & (phase < 0.9)  # at its seam a recording does not meet itself
    np.testing.assert_allclose(far[1][inner], expected[inner], atol=3.0 * np.max(near[1][inner]) + 1.0)
    assert expected[inner].max() > 5.0 * np.max(near[1][inner])
    (tmp_path / "swing.bvh").unlink()  # nothing is said where the recording has gone
    assert np.isnan(looked(history(bent), tmp_path / "two.safetensors", skeleton)).all()


def played(library, motion):
    """The outputs of a motion at POINTS phases, shape (POINTS, C)."""
    network = library.network.twin()
    frames, out = {one.name: one.frames for one in library.info.motions}[motion], np.zeros(network.channels)
    network.cue(motion, 0)
    rows = []
    for _ in range(frames):
        network.advance(out)
        rows.append(out.copy())
    return np.array(rows)[np.round(np.linspace(0, frames - 1, POINTS)).astype(int)]


def test_a_course_is_what_the_network_plays():
    found = course(shipped(), "walk")
    assert (found["motion"], found["motions"]) == ("walk", list(shipped().network.motions))
    np.testing.assert_allclose(np.transpose(found["outputs"]), played(shipped(), "walk"), atol=6e-4)
    assert {len(values) for values in found["neurons"].values()} == {POINTS}


def test_nothing_is_said_of_a_motion_that_a_replaced_library_does_not_have():
    one = SimpleNamespace(motions=["gone"], derived={}, column=None, block=None)
    assert np.isnan(looked(one, find_library("thesis15"), shipped().skeleton)).all()


@pytest.mark.thorough
def test_of_a_library_that_was_learned_anew_the_new_motions_are_drawn(tmp_path):
    said, shown = {}, SimpleNamespace(content="")

    def add(kind, name, fixed=None, heard=None):
        said[name] = heard
        return SimpleNamespace(show=lambda state: None)

    file = tmp_path / "some.safetensors"
    client = SimpleNamespace(client_id=1, gui=SimpleNamespace(add_html=lambda content: shown))
    parts = SimpleNamespace(add=add, page=SimpleNamespace(on_client_disconnect=lambda leave: None))
    add_side_by_side(parts, file, tmp_path)
    for name in ("thesis15", "cmu86"):
        file.write_bytes(find_library(name).read_bytes())
        said["side-by-side"](["left", "", ""], SimpleNamespace(client=client))
        for motion in load_library(file).network.motions:
            assert f"&quot;{motion}&quot;" in shown.content
    file.unlink()
    said["side-by-side"](["left", "", ""], SimpleNamespace(client=client))
    assert "reason" in shown.content


@pytest.mark.thorough
def test_two_motions_are_drawn_side_by_side_and_say_how_far_they_are_apart(browser):
    page = PrivatePage(free_port(), "test")
    thesis15 = find_library("thesis15")
    add_side_by_side(PageParts(page), thesis15, thesis15.parent)
    tab = browser.new_page(viewport={"width": 900, "height": 700})
    tab.set_default_timeout(60_000)
    try:
        tab.goto(coarse(page.address) + "&view=inspect")
        first = next(iter(shipped().network.motions))
        tab.locator(".side-by-side figure").first.wait_for(state="attached")
        tab.get_by_label("motion beside").select_option("walk")
        apart = np.sqrt(np.square(played(shipped(), first) - played(shipped(), "walk")).mean(axis=1)).mean()
        said = tab.locator(".side-by-side figcaption").get_by_text("apart")
        until(
            lambda: said.count() and float(said.inner_text().split()[2]) == pytest.approx(apart, rel=0.02), "the figure"
        )
        tab.get_by_label("library beside").select_option("cmu86")
        tab.locator(".side-by-side").get_by_text("of cmu86").wait_for()
    finally:
        tab.close()
        page.stop()
