import io
import os
import re
import socket
import subprocess
import sys
import threading
from pathlib import Path

import msgspec
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import expect

from controller.motion.rotations import multiply
from controller.wire.command_socket import CommandServer
from controller.wire.messages.commands import (
    EmergencyStop,
    Gaze,
    GiveBeat,
    Jump,
    Pause,
    Push,
    Reset,
    SetInput,
    SetTempo,
    Stop,
    Subscribe,
    Switch,
)
from controller.wire.messages.deck_snapshot import DeckSnapshot, LockState, TickHealth
from controller.wire.messages.replies import Accepted, Event, Refused
from controller.wire.snapshot_numbers import SnapshotNumbers
from controller.wire.telemetry import StateWriter
from motiondeck.page.scene import Follower, facing
from motiondeck.page.viewer import main
from motiondeck.page.web.page_state import PageDescription, PictureArrays, RigDescription
from motiondeck_base.shipped import find_library
from sim.models.mannequin.mannequin import build_mannequin
from simulated_bodies import human
from waiting import free_port, until
from web_pages import coarse

MOTIONS = ["walk", "jog", "waltz"]
NO_SERVOS = RigDescription([], 100.0, [])
PATIENCE = 60.0  # s: a browser without a graphics card on a busy machine


class FakeDeck:
    """Publishes a mannequin that a test has walk, and takes commands as a deck would."""

    def __init__(self, folder, **about):
        spec = build_mannequin(human())
        model = spec.compile()
        spec.to_file(str(folder / "robot.xml"))
        self.state = folder / "state"
        arrays = PictureArrays(np.zeros(model.nq))
        about = PageDescription(
            model_file=str(folder / "robot.xml"),
            motions=MOTIONS,
            robot="mannequin",
            has_phase=True,
            push_ns=16.0,
            shapes=arrays.shapes,
            **about,
        )
        self.numbers = SnapshotNumbers(MOTIONS)
        sizes = self.numbers.sizes | arrays.sizes
        self.writer = StateWriter(self.state, msgspec.to_builtins(about), sizes)
        self.server = CommandServer(0)
        self.received, self.subscribers, self.news = [], [], []
        self.stride = 0.0  # m a tick
        self.pose = lambda tick, qpos: None  # changes qpos before each tick
        self.tempo = 1.0
        self.lift = 0.0  # m, of the root above where it stands
        self.hangs = False
        self._qpos = model.qpos0.copy()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._play)
        self._thread.start()

    def _play(self):
        motion, tick, mode = 0, 0, "playing"
        # Seldom enough for a browser that draws in software to have time for the buttons between two pictures.
        while not self._over.wait(0.1):
            if self.hangs:
                continue
            tick += 1
            self._qpos[0] += self.stride
            self.pose(tick, self._qpos)
            snapshot = DeckSnapshot(
                tick=tick,
                run_s=0.1 * tick,
                late_us=float(tick % 7),
                motion=MOTIONS[motion],
                playing=MOTIONS[motion],
                mode=mode,
                phase=0.4,
                commanded_tempo=self.tempo,
                lock=LockState("beat", "locked", 3.6, 117.0),
                rate_hz=199.98,
                health=TickHealth(work_p50_us=412.0),
            )
            self.writer.values[: self.numbers.count] = self.numbers.row(snapshot)
            self.writer.publish(qpos=self._qpos + self.lift * (np.arange(len(self._qpos)) == 2))
            for message, sender in self.server.poll():
                self.received.append(message)
                if isinstance(message, Subscribe):
                    self.subscribers.append(sender)
                if isinstance(message, Switch):
                    motion = MOTIONS.index(message.to)
                if isinstance(message, EmergencyStop):
                    mode = "emergency stop"
                elif isinstance(message, Reset):
                    mode = "playing"
                refused = isinstance(message, Stop)
                reply = Refused("not while someone is watching", message.id) if refused else Accepted(message.id)
                self.server.reply(sender, reply)

            while self.news:
                event = self.news.pop(0)
                for subscriber in self.subscribers:
                    self.server.reply(subscriber, event)

    def got(self, kind):
        """Whether such a message has arrived."""
        return any(isinstance(message, kind) for message in self.received)

    @property
    def motions(self):
        """The motions that were switched to."""
        return [message.to for message in self.received if isinstance(message, Switch)]

    def end(self):
        self._over.set()
        self._thread.join()
        self.writer.close()
        self.server.close()


@pytest.fixture
def deck(tmp_path):
    fake = FakeDeck(tmp_path)
    yield fake
    fake.end()


def start(deck, port):
    arguments = [str(deck.state), str(port), str(deck.server.port)]
    return subprocess.Popen([sys.executable, "-m", "motiondeck.page.viewer", *arguments], stdout=subprocess.PIPE)


def open_inspect(page, port):
    """Opens the page of a port in the view with all figures, drawn coarsely, without viser's notice of software."""
    page.set_default_timeout(1000.0 * PATIENCE)
    page.goto(coarse(f"http://127.0.0.1:{port}") + "&view=inspect")
    page.locator("#state-line").wait_for()
    page.locator("#webgl-software-rendering").get_by_role("button").click()


def end(viewer, *pages):
    """Closes the pages in the browser, and ends the view."""
    for page in pages:
        page.close()
    viewer.kill()
    viewer.wait()
    viewer.stdout.close()


# The figure covers about 0.02 of the scene; a scene without it, nothing.
IN_VIEW = 0.01


def figure_share(page):
    """How much of the middle of the scene is neither sky nor floor: strongly coloured, or dark."""
    picture = page.screenshot(clip={"x": 150, "y": 40, "width": 300, "height": 420})
    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=int)
    return float(((np.ptp(pixels, axis=2) > 50) | (pixels.max(axis=2) < 90)).mean())


def in_view(page):
    """Whether the figure is seen; asked seldom, because a picture of the page keeps the browser from loading it."""
    page.wait_for_timeout(200)
    return figure_share(page) > IN_VIEW


def pushes(page, deck):
    """Whether a push has arrived, of a drag from the figure's hips to the right; what misses them turns the view."""
    page.mouse.move(300, 222)
    page.mouse.down()
    page.mouse.move(340, 223, steps=4)
    page.mouse.move(390, 224, steps=4)
    page.wait_for_timeout(300)
    page.mouse.up()
    page.wait_for_timeout(300)
    if not deck.got(Push):
        page.reload()
        until(lambda: in_view(page), "the figure")
    return deck.got(Push)


def test_the_page_shows_the_figure_and_its_buttons_command_the_deck(deck, browser):
    port = free_port()
    viewer = start(deck, port)
    page = browser.new_page(viewport={"width": 940, "height": 500})
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.set_default_timeout(1000.0 * PATIENCE)
    try:
        until(lambda: reachable(port), "the page")
        page.goto(coarse(f"http://127.0.0.1:{port}"))
        page.locator("#state-line").wait_for()
        until(lambda: in_view(page), "the figure")
        # The mouse pushes the body; on the screen to the right is 0.98 rad from x, where the camera stands at first.
        until(lambda: pushes(page, deck), "the push")
        push = next(message for message in deck.received if isinstance(message, Push))
        assert push.towards == pytest.approx(0.98, abs=0.3)
        assert 1.6 <= push.impulse <= 48.0
        deck.stride = 0.1
        # The loop's figures are in a folder that is closed at first.
        expect(page.get_by_text("200.0 Hz")).to_be_hidden()
        page.get_by_text("loop", exact=True).click()
        page.get_by_text("200.0 Hz").wait_for()
        page.get_by_text("412 µs").wait_for()
        page.get_by_text("On time: no tick was late.", exact=True).wait_for()
        page.get_by_text("locked to the beat of 117.0 a minute (+4 ms)").wait_for()

        # Button and highlight: the colour that "walk" had goes to "jog".
        walk, jog = (page.get_by_role("button", name=re.compile(f"^{name}")) for name in ("walk", "jog"))
        page.get_by_role("button", name="walk playing", exact=True).wait_for()
        colour = "button => getComputedStyle(button).backgroundColor"
        until(lambda: walk.evaluate(colour) != jog.evaluate(colour), "the highlight")
        current = walk.evaluate(colour)
        jog.click()
        page.mouse.move(20, 20)  # a button under the pointer has a colour of its own
        until(lambda: deck.motions == ["jog"], "the command")
        until(lambda: jog.evaluate(colour) == current, "the new highlight")
        until(lambda: page.locator("#state-line").inner_text().split("\n")[:2] == ["PLAYING", "jog"], "the state line")

        # Keys: the third motion, pause, and the emergency stop.
        page.keyboard.press("3")
        until(lambda: deck.motions == ["jog", "waltz"], "the key 3")
        page.keyboard.press("Space")
        until(lambda: deck.got(Pause), "the space bar")
        page.keyboard.press("Escape")
        page.get_by_text("EMERGENCY STOP", exact=True).wait_for()
        until(jog.is_disabled, "buttons that cannot be pressed now")
        # A reset is asked about first.
        page.get_by_role("button", name="Reset", exact=True).click()
        page.get_by_role("button", name="Cancel", exact=True).click()
        assert not deck.got(Reset)
        page.get_by_role("button", name="Reset", exact=True).click()
        page.get_by_role("button", name="Release", exact=True).click()
        until(lambda: deck.got(Reset), "the reset")
        until(jog.is_enabled, "buttons that can be pressed again")

        # State line and emergency stop stay in sight where the panel is longer than the window.
        page.mouse.move(850, 400)
        page.mouse.wheel(0, 3000)
        page.get_by_role("button", name="End run").click(trial=True)
        for seen in (page.locator("#state-line"), page.get_by_role("button", name="Emergency stop")):
            box = seen.bounding_box()
            assert box is not None
            assert 0.0 < box["y"] < 250.0

        # The phase is shown; tempo by keyboard, a step up, and a jump.
        phase_slider = page.get_by_role("slider", name="phase")
        tempo_slider = page.get_by_role("slider", name="tempo", exact=True)
        until(lambda: phase_slider.get_attribute("aria-valuenow") == "0.4", "the phase")
        phase_slider.focus()
        page.keyboard.press("ArrowRight")
        jumps = until(lambda: [m.phase for m in deck.received if isinstance(m, Jump)], "the jump")
        assert jumps[-1] == pytest.approx(0.41)
        tempo_slider.focus()
        page.keyboard.press("ArrowRight")
        tempo = until(lambda: [m.factor for m in deck.received if isinstance(m, SetTempo)], "the tempo")
        assert tempo[-1] == pytest.approx(1.05)

        page.get_by_text("beat", exact=True).click()
        page.get_by_role("button", name="Tap", exact=True).click()
        until(lambda: GiveBeat() in [msgspec.structs.replace(m, id=0) for m in deck.received], "the beat")

        # Events that nothing else on the page shows are notices; a switch that settles is no news.
        until(lambda: deck.subscribers, "the page's wish for events")
        deck.news += [
            Event("settled", "jog after 0.40 s", "jog", 1.0, 1),
            Event("gave up", "walk with 0.50 of jog turns over, fell back to walk", "walk", 2.0, 2),
            Event("fault", "the recorder has ended", "walk", 3.0, 3),
        ]
        page.get_by_text("walk with 0.50 of jog turns over, fell back to walk").wait_for()
        page.get_by_text("the recorder has ended").wait_for()
        expect(page.get_by_text("jog after 0.40 s")).to_have_count(0)

        # A refusal is shown in the deck's words.
        page.get_by_role("button", name="End run", exact=True).click()
        page.get_by_role("button", name="Play on", exact=True).click()
        assert not any(isinstance(message, Stop) for message in deck.received)
        page.get_by_role("button", name="End run", exact=True).click()
        page.get_by_role("button", name="End the run", exact=True).click()
        page.get_by_text("not while someone is watching").wait_for()

        # By now it has walked several metres: the view has gone along.
        until(lambda: in_view(page), "the figure that has walked on")
        expect(page.get_by_role("button", name="Share")).to_have_count(0)
        elsewhere = [url for url in asked if not url.startswith((f"http://127.0.0.1:{port}", "data:", "blob:"))]
        assert elsewhere == []

        deck.state.with_name("ended").write_text("the rig is lost: id 3")
        deck.writer.close()
        assert viewer.wait(PATIENCE) == 0
        ended = ["ENDED", "the rig is lost: id 3"]
        until(lambda: page.locator("#state-line").inner_text().split("\n")[:2] == ended, "the reason of the end")
        # Standard output belongs to the deck.
        assert viewer.stdout.read() == b""
    finally:
        end(viewer, page)


def figure_pixels(page):
    """Rows and columns of the scene, without its edges, that the figure covers, and how high that is."""
    picture = page.locator("canvas").first.screenshot()
    pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=int)[60:-60, 10:-10]
    rows, columns = np.nonzero((np.ptp(pixels, axis=2) > 50) | (pixels.max(axis=2) < 90))
    return rows, columns, len(pixels)


def height_shown(page):
    """How far up the figure is in the scene, as a share of it; None if it is not in sight."""
    rows, _, height = figure_pixels(page)
    return 1.0 - float(rows.mean()) / height if len(rows) > 200 else None


def figure_box(page):
    """Where the figure is on the page, as the browser has the boxes of elements; None if it is not in sight."""
    page.wait_for_timeout(200)
    rows, columns, _ = figure_pixels(page)
    panel = page.locator("#state-line").bounding_box()
    if panel["x"] < 50:  # on a phone it lies over the lower half, with its title above the line
        above = rows + 60 < panel["y"] - 70
        rows, columns = rows[above], columns[above]
    if len(rows) < 200:
        return None
    (left, right), (top, bottom) = np.quantile(columns, (0.005, 0.995)), np.quantile(rows, (0.005, 0.995))
    scene = page.locator("canvas").first.bounding_box()
    place = {"x": scene["x"] + left + 10, "y": scene["y"] + top + 60}
    return {**place, "width": right - left, "height": bottom - top}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("rig", "held"),
    [(None, "a stop acts once it goes on"), (NO_SERVOS, "the rig is held; a stop still reaches it")],
)
def test_a_deck_that_hangs_is_not_shown_as_playing_and_tells_of_a_rig_only_where_one_is(rig, held, tmp_path, browser):
    deck, port = FakeDeck(tmp_path, rig=rig), free_port()
    viewer = start(deck, port)
    page = browser.new_page(viewport={"width": 940, "height": 500})
    try:
        until(lambda: reachable(port), "the page")
        page.goto(coarse(f"http://127.0.0.1:{port}"))
        line = page.locator("#state-line")
        line.get_by_text("PLAYING").wait_for()
        deck.hangs = True
        line.get_by_text(re.compile(r"of the deck for \d+ s")).wait_for()
        line.get_by_text("NO ANSWER").wait_for()
        line.get_by_text(held, exact=True).wait_for()
        page.get_by_role("button", name="Emergency stop", exact=True).click()
        deck.hangs = False
        line.get_by_text("EMERGENCY STOP").wait_for()
    finally:
        end(viewer, page)
        deck.end()


@pytest.mark.thorough
def test_each_browser_looks_back_alone_and_is_called_back_by_what_happens(deck, browser):
    port = free_port()
    viewer = start(deck, port)
    pages = []

    def open_page():
        page = browser.new_page(viewport={"width": 940, "height": 500})
        page.set_default_timeout(1000.0 * PATIENCE)
        page.goto(coarse(f"http://127.0.0.1:{port}"))
        page.locator("#state-line").wait_for()
        page.locator(".timeline-strip .run").first.wait_for()
        page.add_style_tag(content=".notices { display: none !important; }")  # as dark as the figure
        pages.append(page)
        return page

    def looks_back(page):
        bar = page.locator(".timeline-strip .bar").bounding_box()
        page.mouse.click(bar["x"] + 0.04 * bar["width"], bar["y"] + 0.5 * bar["height"])  # before the first picture
        page.locator(".past-frame").wait_for()

    def is_high(page):
        page.wait_for_timeout(200)
        height = height_shown(page)
        return height is not None and height > 0.55

    def is_low(page):
        page.wait_for_timeout(200)
        height = height_shown(page)
        return height is not None and height < 0.5

    try:
        until(lambda: reachable(port), "the page")
        one, other = open_page(), open_page()
        for page in (one, other):
            until(lambda page=page: is_low(page), "the figure on the floor")
        until(lambda: deck.subscribers, "the page's wish for events")
        deck.lift = 0.35
        for page in (one, other):
            until(lambda page=page: is_high(page), "the figure that was lifted")
        called_back = (
            lambda: deck.news.append(Event("fault", "rig: knee is hot", "walk", 3.0, 1)),
            lambda: deck.news.append(Event("mode", "emergency stop", "walk", 4.0, 2)),
            lambda: setattr(deck, "tempo", 1.2),  # from a terminal: there is no event of it
            lambda: other.keyboard.press("2"),
            lambda: one.get_by_role("button", name="back to now").click(),
        )
        for call in called_back:
            one.wait_for_timeout(1000)
            looks_back(one)
            until(lambda: is_low(one), "the past")
            assert is_high(other)
            expect(other.locator(".past-frame")).to_be_hidden()
            if call is called_back[0]:  # who comes later sees what happens now
                until(lambda: is_high(open_page()), "the present")
                pages.pop().close()
                assert is_low(one)
            call()
            one.locator(".past-frame").wait_for(state="hidden")
            until(lambda: is_high(one), "the present")
    finally:
        end(viewer, *pages)


@pytest.mark.thorough
def test_joints_and_gaze_follow_a_hand_until_it_lets_go(tmp_path, browser):
    live = {"library_file": str(find_library("thesis15")), "groups": ["arms"], "live": ["arms", "jaw"], "gazes": True}
    deck, port = FakeDeck(tmp_path, **live), free_port()
    viewer = start(deck, port)
    page = browser.new_page(viewport={"width": 940, "height": 900})
    page.set_default_timeout(1000.0 * PATIENCE)

    def values(kind):
        return [message for message in deck.received if isinstance(message, kind)]

    def holds(part, to, kind):
        """Whether values come from a part that is pressed in the middle and dragged to a share of its width and height.

        A press on a panel that still moves misses it.
        """
        part.scroll_into_view_if_needed()
        box = part.bounding_box()
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        page.mouse.down()
        page.mouse.move(box["x"] + to[0] * box["width"], box["y"] + to[1] * box["height"], steps=3)
        page.wait_for_timeout(700)  # it is said again and again while the hand rests
        if len(values(kind)) < 3:
            page.mouse.up()
        return len(values(kind)) >= 3

    def quiet(kind):
        before = len(values(kind))
        page.wait_for_timeout(700)
        return len(values(kind)) == before

    def let_go(kind):
        page.mouse.up()
        until(lambda: quiet(kind), "the end of the values")

    try:
        until(lambda: reachable(port), "the page")
        page.goto(coarse(f"http://127.0.0.1:{port}"))
        page.locator("#state-line").wait_for()
        page.get_by_text("live values", exact=True).click()
        slider = page.get_by_title("input jaw, while it is held")
        until(lambda: holds(slider, (0.9, 0.5), SetInput), "the values of the slider")
        assert values(SetInput)[-1].name == "jaw"
        assert values(SetInput)[-1].value == pytest.approx(0.85, abs=0.1)
        let_go(SetInput)
        expect(slider).to_have_value("0")
        until(lambda: holds(page.get_by_label("gaze"), (0.75, 0.2), Gaze), "the points of the pad")
        assert (values(Gaze)[-1].left, values(Gaze)[-1].up) == pytest.approx((0.5, 0.6), abs=0.05)
        let_go(Gaze)
    finally:
        end(viewer, page)
        deck.end()


def reachable(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def test_the_view_ends_with_the_process_that_started_it(deck, tmp_path):
    port = free_port()
    arguments = [str(deck.state), str(port), str(deck.server.port)]
    starter = "import subprocess, sys; "
    starter += f"print(subprocess.Popen([sys.executable, '-m', 'motiondeck.page.viewer', *{arguments!r}]).pid)"
    starter += "; sys.stdout.flush(); sys.stdin.read()"
    parent = subprocess.Popen([sys.executable, "-c", starter], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    viewer = int(parent.stdout.readline())
    try:
        until(lambda: reachable(port), "the page")
        parent.communicate()
        until(lambda: not reachable(port), "the end of the view")
    finally:
        if Path(f"/proc/{viewer}").exists() and reachable(port):
            os.kill(viewer, 9)


def test_without_a_deck_there_is_one_clear_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("motiondeck.page.viewer.LONGEST_WAIT", 0.1)
    assert main(str(tmp_path / "none"), str(free_port()), "1") == 1
    said = capsys.readouterr().err
    assert said.startswith("motiondeck: ")
    assert "none" in said
    assert said.count("\n") == 1


def test_a_taken_port_is_one_clear_line(deck, capsys):
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        assert main(str(deck.state), str(port), "1") == 1
    assert f"port {port}" in capsys.readouterr().err


def test_the_view_goes_along_with_a_walk_and_leaves_out_its_sway():
    follower = Follower()
    behind, sideways = [], []
    for step in range(600):
        t = 0.02 * step
        centre = follower.follow(np.array([1.5 * t, 0.1 * np.sin(7.0 * t)]), 0.02)
        behind.append(1.5 * t - centre[0])
        sideways.append(centre[1])
    assert max(np.abs(behind[300:])) < 0.02
    assert max(np.abs(sideways[300:])) < 0.09
    jump = np.array([50.0, 0.0])
    assert np.array_equal(follower.follow(jump, 0.02), jump)


@pytest.mark.parametrize(
    ("axis", "angle", "heading"),
    [((0, 0, 1), 0.0, 0.0), ((0, 0, 1), 2.0, 2.0), ((0, 1, 0), np.pi / 2, 0.0), ((0, 1, 0), 0.5, 0.0)],
)
def test_the_camera_knows_where_a_body_faces(axis, angle, heading):
    turned = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * np.array(axis))])
    rest = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])  # of a model that stands along y
    assert facing(multiply(turned, rest), rest) == pytest.approx(heading, abs=1e-9)
