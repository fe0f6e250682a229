"""The operate view: what it offers in each state, targets and letters in light and dark, the lock of one browser."""

import threading
from contextlib import closing, contextmanager

import msgspec
import pytest
from playwright.sync_api import expect
from test_alarms import apart
from test_panel import SITUATIONS, state
from test_panel_for_hands import CONTRAST, LEAST, LETTERS, MEASURE, MOTIONS, SIZES, VERDICTS

from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages.command_table import parse_command
from controller.wire.messages.commands import EmergencyStop, Layer, Queue, Reset, SetTempo, Switch
from controller.wire.messages.replies import Accepted, Event
from motiondeck.page.operate import deck_buttons, deck_cues
from motiondeck.page.panel import Panel
from motiondeck.page.web.page_state import PageDescription
from motiondeck.page.web.private_page import PrivatePage
from waiting import PATIENCE, free_port, soon, until

KNEE = "l_knee (id 18) does not answer; the rig goes on without it. Check its plug and cable."
SILENT = "rig: the port /dev/ttyUSB0 was silent. Check adapter, cable and supply. Servos: l_hip, l_knee, r_hip, r_knee"

# The longest of the causes that servo20 can have, as a rig tells it.
CUT = "rig: 17 of 20 servos of /dev/ttyUSB0 stopped answering. Check the cable after r_shoulder_pitch (id 3)."


@contextmanager
def shown_panel():
    """A panel whose commands are all accepted, with those that have come."""
    page, heard, over = PrivatePage(free_port(), "test"), [], threading.Event()
    with closing(CommandServer(0)) as server, closing(CommandClient(server.port)) as client:

        def answer():
            while not over.wait(0.01):
                for message, sender in server.poll():
                    heard.append(msgspec.structs.replace(message, id=0))
                    server.reply(sender, Accepted(message.id))

        deck = threading.Thread(target=answer)
        deck.start()
        about = PageDescription(
            model_file="",
            motions=MOTIONS,
            robot="",
            has_phase=True,
            verdicts=VERDICTS,
            groups=["arms"],
            library_file="-",
        )
        panel = Panel(page, about, client, look_from=lambda *_: None)
        panel.show(state())
        try:
            yield page, panel, heard
        finally:
            over.set()
            deck.join()
            page.stop()


def commands(now, label):
    return [parse_command(words) for words in {one.label: one.commands for one in deck_buttons(now)}[label]]


def agree(box, other):
    assert box == pytest.approx(other, abs=1.0)


def test_a_button_has_the_commands_of_the_state_and_a_state_without_one_has_none():
    queued = state(queue=["jog", "waltz"])
    assert commands(queued, "Next") == [Switch("jog"), Queue("waltz")]
    assert [(row.mark, row.name) for row in deck_cues(queued)] == [("now", "walk"), ("next", "jog"), ("", "waltz")]
    assert [parse_command(words) for words in deck_cues(queued)[1].take_out] == [Switch("walk"), Queue("waltz")]
    assert commands(state(), "Next") == commands(state(), "Reset") == []
    under_way = deck_cues(state(motion="jog", switching=True, queue=["waltz"]))
    assert [(row.mark, row.take_out) for row in under_way] == [("now", ()), ("next", ()), ("", ())]
    fading = state(playing="jog", motion="jog", switching=True, queue=["waltz"])
    assert [(row.mark, row.name) for row in deck_cues(fading)] == [("now", "jog"), ("next", "waltz")]
    stopped = state(mode="emergency stop", queue=["jog"])
    assert commands(stopped, "Reset") == [Reset()]
    assert commands(stopped, "Next") == commands(stopped, "Pause") == commands(stopped, "Home") == []
    assert commands(state(mode="held"), "Resume") == [parse_command(["resume"])]


@pytest.mark.thorough
@pytest.mark.parametrize(("width", "height"), [(390, 844), (360, 740)])
def test_a_phone_shows_an_alarm_with_all_of_its_remedy_and_has_room_for_motions(browser, width, height):
    with shown_panel() as (page, panel, _):
        tab = browser.new_page(viewport={"width": width, "height": height}, has_touch=True)
        tab.set_default_timeout(1000.0 * PATIENCE)
        try:
            tab.goto(f"{page.address}/?view=operate")
            tab.locator(".operate .motion").last.wait_for()
            for number, text in enumerate((f"rig: {KNEE}", CUT, CUT)):
                panel.show_event(Event("fault", f"{text} Servos: l_hip, l_knee", "walk", 1.0, number))
            tab.locator(".operate .alarm").get_by_text("Fault × 2").wait_for()
            tab.get_by_role("button", name="Acknowledge (1 more)").wait_for()

            def seen_whole():
                box, cause = (tab.locator(f".operate .alarm {part}").bounding_box() for part in ("> div", "span"))
                scene, desk = (tab.locator(f".operate .{part}").bounding_box() for part in ("robot", "desk"))
                assert desk["height"] > 0.3 * height
                assert min(scene["width"], scene["height"]) > 0.3 * width
                assert apart(scene, tab.locator(".operate .notices").bounding_box())
                # A box of letters is a little higher than their line.
                assert cause["y"] >= box["y"] - 2.0
                assert cause["y"] + cause["height"] <= box["y"] + box["height"] + 2.0

            soon(seen_whole)
        finally:
            tab.close()


@pytest.mark.thorough
@pytest.mark.parametrize(("size", "scheme"), [(size, scheme) for size in SIZES for scheme in ("light", "dark")])
def test_hands_hit_and_eyes_read_the_operate_view_and_nothing_moves(browser, size, scheme):
    width, height = SIZES[size]
    with shown_panel() as (page, panel, _):
        tab = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)
        try:
            tab.goto(f"{page.address}/?view=operate")
            view = tab.locator(".operate")
            view.locator(".motion").last.wait_for()
            tab.locator(f"[data-scheme={scheme}]").wait_for()
            first = {}

            def fits():
                found = tab.evaluate(MEASURE)
                assert [text for text in found["read"] if text[1] < LETTERS or text[2] < CONTRAST] == []
                assert [target for target in found["targets"] if min(target[1][2:]) < LEAST] == []
                assert [name for name, whole in found["names"] if not whole] == []
                # What is in the cue list, and the alarm's button, comes and goes in a place of its own.
                stays = {
                    name: box
                    for name, box in found["targets"]
                    if not any(word in name for word in ("take out", "Acknowledge", "Pause", "Resume"))
                    and not name.startswith(tuple(MOTIONS))
                }
                before = first or stays
                assert stays.keys() == before.keys()
                assert {name: box for name, box in stays.items() if box != pytest.approx(before[name], abs=1.0)} == {}
                return stays, found["read"]

            for number, (now, (word, *_)) in enumerate(SITUATIONS):
                panel.show(now)
                if number == 2:
                    panel.show_event(Event("fault", SILENT, "walk", 1.0, 1))
                    pressed = view.get_by_role("button", name="Acknowledge")
                    expect(pressed).to_have_text("Acknowledge")
                    one = pressed.bounding_box()
                    panel.show_event(Event("fault", f"rig: {KNEE}", "walk", 2.0, 2))
                    expect(pressed).to_have_text("Acknowledge (1 more)")
                    soon(lambda one=one, pressed=pressed: agree(pressed.bounding_box(), one))
                view.locator(".word").get_by_text(word, exact=True).wait_for()
                if number == 5:
                    view.get_by_role("button", name="Acknowledge (1 more)").click()
                    view.get_by_role("button", name="Acknowledge", exact=True).click()
                    view.locator(".alarm").wait_for(state="hidden")
                tab.wait_for_function(
                    "queue => document.querySelectorAll('.operate li b').length > queue", arg=len(now.queue)
                )
                stays, read = soon(fits)
                first = first or stays
            letters = {text: size for text, size, _ in read}
            assert letters["Motions"] == 16 if width <= 1024 else letters["Motions"] > 20
            panel.show(SITUATIONS[0][0])
            view.locator(".word").get_by_text(SITUATIONS[0][1][0], exact=True).wait_for()
            view.locator(".lock").click()
            tab.locator("html[data-locked=true]").wait_for()

            def reads_locked():
                found = tab.evaluate(MEASURE)
                assert {"Home", "jog", "Locked: hold"} <= {text for text, *_ in found["read"]}
                assert [text for text in found["read"] if text[1] < LETTERS or text[2] < CONTRAST] == []
                boxes = [(box, first.get(name, box)) for name, box in found["targets"]]
                assert [both for both in boxes if both[0] != pytest.approx(both[1], abs=1.0)] == []

            soon(reads_locked)
            panel.end("stopped on command")
            view.locator(".word").get_by_text("ENDED").wait_for()
            expect(view.get_by_role("button", name="EMERGENCY STOP")).to_be_disabled()
        finally:
            tab.close()


@pytest.mark.thorough
def test_a_locked_browser_takes_no_hand_but_on_the_stop_and_no_other_browser_is_locked(browser):
    with shown_panel() as (page, _, heard):
        window = {"width": 390, "height": 844}
        tabs = [browser.new_page(viewport=window, color_scheme=scheme) for scheme in ("dark", "light")]
        try:
            for tab in tabs:
                tab.set_default_timeout(1000.0 * PATIENCE)
                tab.goto(page.address)  # a phone opens in operate
                tab.locator(".operate .motion").last.wait_for()
            ours, theirs = (tab.locator(".operate") for tab in tabs)
            lock = ours.locator(".lock")
            lock.click()
            lock.get_by_text("Locked").wait_for()
            expect(theirs.locator(".lock")).to_have_text("Lock")
            jog = ours.get_by_role("button", name="jog", exact=True, include_hidden=True)
            box = jog.bounding_box()
            tabs[0].mouse.click(box["x"] + 9, box["y"] + 9)
            for key in ("Space", "1", "s"):
                tabs[0].keyboard.press(key)
            lock.click()  # a tap is no hold
            ours.get_by_role("button", name="EMERGENCY STOP").click()
            until(lambda: heard, "the stop of a locked browser")
            assert [type(one) for one in heard] == [EmergencyStop]
            tabs[0].reload()
            lock.get_by_text("Locked").wait_for()
            lock.focus()
            tabs[0].keyboard.down("Enter")
            lock.get_by_text("Lock", exact=True).wait_for()
            tabs[0].keyboard.up("Enter")
            lock.get_by_text("Lock", exact=True).wait_for()
            theirs.get_by_role("button", name="slower").click()
            until(lambda: SetTempo(0.9) in heard, "the tempo")
            theirs.get_by_role("button", name="Layer on").click()
            until(lambda: Layer("arms", MOTIONS[0]) in heard, "the layer")
            ours.get_by_role("button", name="Inspect").click()
            ours.wait_for(state="detached")
            tabs[0].get_by_role("button", name="Emergency stop").wait_for()
            expect(theirs).to_be_visible()
            for tab, scheme in zip(tabs, ("dark", "light"), strict=True):
                expect(tab.locator("html")).to_have_attribute("data-mantine-color-scheme", scheme)
        finally:
            for tab in tabs:
                tab.close()


@pytest.mark.thorough
def test_keys_alone_open_a_folder_of_inspect_and_show_where_they_are(browser):
    window = {"width": 1280, "height": 800}
    with shown_panel() as (page, _, heard), closing(browser.new_page(viewport=window)) as tab:
        tab.goto(f"{page.address}/?view=inspect")
        folder, inside = tab.get_by_role("button", name="view", exact=True), tab.get_by_text("front", exact=True)
        folder.wait_for()
        expect(inside).to_be_hidden()
        for place in (folder, tab.get_by_role("slider", name="tempo", exact=True)):
            tab.keyboard.press("Tab")  # what has the focus by keys shows it
            place.focus()
            expect(place).to_have_css("outline-style", "solid")
        folder.press("Space")
        expect(inside).to_be_visible()
        assert heard == []


@pytest.mark.parametrize(
    ("width", "view", "whole"), [(1280, "inspect", True), (390, "operate", True), (390, "inspect", False)]
)
def test_the_scene_is_behind_a_sheet_on_a_phone_that_inspects_alone(browser, width, view, whole):
    with shown_panel() as (page, _, _):
        looks = []
        page.suit = lambda client, look: looks.append(look)
        with closing(browser.new_page(viewport={"width": width, "height": 800}, color_scheme="dark")) as tab:
            tab.goto(f"{page.address}/?view={view}")
            until(lambda: looks[-1:] == [(True, whole)], "what the browser says of its scene")
