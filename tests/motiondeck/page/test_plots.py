"""Curves of the last minutes: what is saved is what the loop has written, and only the browser that chose it has it."""

import csv
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect
from test_viewer import FakeDeck, end, open_inspect, reachable, start

from controller.wire.messages.deck_snapshot import DeckSnapshot
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.plots import MOST_POINTS, PICTURES, History
from motiondeck.page.web.page_state import PageDescription, Picture, PictureArrays, RigDescription, ServoDescription
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human
from waiting import free_port, until

RIG = RigDescription(["well"], 25.0, [ServoDescription(name, 1, "XM430-W350", -3.14, 3.14, 80.0) for name in "ab"])
EMPTY = mujoco.MjModel.from_xml_string("<mujoco/>")


def kept(pictures, every=0.04):
    """A history of two servos with so many pictures; servo a is as many degrees off as the picture's number."""
    arrays = PictureArrays(np.zeros(7), bus=np.zeros(1), servos=np.zeros((8, 2)))
    about = PageDescription(model_file="", robot="rig", motions=["walk"], rig=RIG, shapes=arrays.shapes)
    history = History(about, EMPTY)
    for number in range(pictures):
        states = ServoStates(*arrays.servos)
        states.goals[:], states.positions[:] = 0.0, np.radians([-(number % 90), 1.0])
        states.temperatures[:] = 30.0, np.nan
        arrays.bus[0] = 0.25 * every * number
        state = DeckSnapshot(motion="walk", run_s=every * number, late_us=float(number))
        history.keep(Picture(state, arrays), 100.0 + every * number)
    return history


def test_columns_are_what_was_kept():
    history = kept(100)
    at = history.places(101.0, 102.0)
    numbers = np.arange(25, 51)
    np.testing.assert_allclose(history.run_s[at], 0.04 * numbers)
    np.testing.assert_allclose(history.column("late_us", at), numbers)
    np.testing.assert_allclose(history.column("a measured", at), np.radians(-numbers), atol=1e-6)
    np.testing.assert_allclose(history.column("a goal", at), 0.0)
    np.testing.assert_allclose(history.column("b temperature", at), np.nan)
    np.testing.assert_allclose(history.column("busy 1", at), 0.01 * numbers, atol=1e-6)


def test_of_many_pictures_the_same_ones_are_drawn_each_time():
    history = kept(PICTURES + 500)
    at = history.run_s[history.places(0.0, 1e9)]
    assert MOST_POINTS / 2 < len(at) <= MOST_POINTS
    assert at[0] >= 0.04 * 500
    assert (np.diff(at) > 0.0).all()
    some = history.run_s[history.places(150.0, 250.0)]
    assert {*np.round(some, 2)} & {*np.round(at, 2)}


WRITTEN = """() => {
  const { prototype } = CanvasRenderingContext2D;
  const { fillText } = prototype;
  window.written = new Set();
  prototype.fillText = function (words, ...at) { written.add(words); fillText.call(this, words, ...at); };
}"""  # the words that are drawn from now on


@pytest.mark.thorough
def test_the_table_of_a_plot_is_what_the_loop_wrote_and_no_other_browser_gets_it(tmp_path, browser):
    deck, port = FakeDeck(tmp_path), free_port()
    place = int(build_mannequin(human()).compile().joint("rkne").qposadr[0])

    def bend(tick, qpos):
        """Turns the right knee about y by 0.5 sin(t), rad, at t = tick / 7."""
        half = 0.25 * math.sin(tick / 7.0)
        qpos[place : place + 4] = math.cos(half), 0.0, math.sin(half), 0.0

    deck.pose = bend
    viewer = start(deck, port)
    page, other = (browser.new_page(viewport={"width": 1280, "height": 800}) for _ in range(2))
    try:
        until(lambda: reachable(port), "the page")
        for one in (page, other):
            open_inspect(one, port)
            one.get_by_text("Plots", exact=True).click()
        curves = page.get_by_label("add a curve")
        for name in ("angle/rkne.y", "loop/lateness"):
            curves.select_option(name)
        page.get_by_role("button", name="10 s", exact=True).click()
        page.get_by_role("img", name="rkne.y measured").wait_for()
        state = "JSON.parse(document.querySelector('[data-state-of=plot-curves]').dataset.state)"
        page.wait_for_function(f"{state}.run.length > 20 && Object.keys({state}.curves).length === 2")
        with page.expect_download() as table:
            page.get_by_role("button", name="CSV").click()
        with page.expect_download() as picture:
            page.get_by_role("button", name="PNG").click()
        head, *rows = csv.reader(Path(table.value.path()).read_text(encoding="utf-8").splitlines())
        assert head == ["run_s", "rkne.y measured (°)", "lateness (µs)"]
        assert len(rows) > 20
        for run_s, angle, late in rows:
            tick = round(10.0 * float(run_s))
            assert float(run_s) == pytest.approx(0.1 * tick, abs=1e-3)
            assert float(angle) == pytest.approx(math.degrees(0.5 * math.sin(tick / 7.0)), abs=2e-3)
            assert float(late) == tick % 7
        with Image.open(picture.value.path()) as drawn:
            assert len(np.unique(np.asarray(drawn.convert("L")))) > 20
        expect(other.locator("[data-state-of=plot-curves]")).to_have_count(0)

        # The picture names each of several joints.
        page.evaluate(WRITTEN)
        more = ("lkne.y", "rank.y")
        for name in more:
            curves.select_option(f"angle/{name}")
        page.wait_for_function(
            "names => names.every((name) => [...written].some((words) => words.startsWith(name)))",
            arg=["rkne.y", *more],
        )
        for name in more:
            page.get_by_role("button", name=f"remove angle/{name}").click()

        # A hand in the strip leads the plot of this browser to that moment; a tab that is not in sight gets no more.
        bar = page.locator(".timeline-strip .bar").bounding_box()
        page.mouse.click(bar["x"] + (1.0 - 2.0 / 180.0) * bar["width"], bar["y"] + 0.5 * bar["height"])
        page.wait_for_function(f"{state}.hand !== null")
        page.get_by_role("button", name="back to now").click()
        page.wait_for_function(f"{state}.hand === null")
        page.get_by_role("button", name="remove angle/rkne.y").click()
        page.wait_for_function(f"Object.keys({state}.curves).length === 1")
    finally:
        end(viewer, page, other)
        deck.end()
