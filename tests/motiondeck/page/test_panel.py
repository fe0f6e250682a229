"""The panel in two browsers: the state line in fourteen situations, a reload, and a lost link."""

import threading
import time
from contextlib import closing, suppress
from functools import partial

import pytest
from playwright.sync_api import expect

from controller.wire.command_socket import CommandClient, CommandServer
from controller.wire.messages.commands import EmergencyStop, Push, StepOn, Switch
from controller.wire.messages.deck_snapshot import BlendPart, DeckSnapshot
from controller.wire.messages.replies import Accepted, Event
from controller.wire.stop_door import StopDoor
from motiondeck.page.panel import Panel
from motiondeck.page.web.page_state import PageDescription
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage
from motiondeck_base.errors import MotiondeckError
from waiting import PATIENCE, free_port, until

MOTIONS = ["walk", "jog", "crawl", "standup", "waltz"]


def state(playing="walk", motion="", blend=(), **others):
    blended = tuple(map(BlendPart, blend, (0.4, 0.25)))
    return DeckSnapshot(motion=motion or playing, playing=playing, blend=blended, phase=0.4, **others)


SITUATIONS = [
    (state(), ["PLAYING", "walk"]),
    (state(queue=["jog", "waltz"]), ["PLAYING", "walk", "next: jog, waltz"]),
    (state(motion="jog", switching=True), ["ON ITS WAY", "to jog"]),
    (
        state(playing="crawl", motion="waltz", way=("standup", "waltz"), switching=True),
        ["ON ITS WAY", "crawl → standup → waltz"],
    ),
    (state(motion="jog", way=("jog",), queue=["waltz"], switching=True), ["ON ITS WAY", "walk → jog", "next: waltz"]),
    (state(blend=["jog"]), ["BLEND", "walk + 40 % jog"]),
    (state(blend=["jog", "waltz"]), ["BLEND", "walk + 40 % jog + 25 % waltz"]),
    (state(paused=True), ["PAUSED", "walk"]),
    (state(paused=True, queue=["jog"]), ["PAUSED", "walk", "next: jog"]),
    (state(fallen=True), ["FALLEN", "playing walk", "if it stays down: End run, and start it again"]),
    (state(approaching=True), ["ON ITS WAY", "slowly to walk"]),
    (state(mode="home"), ["HOME", "at rest, or on the way there", "choose a motion to play on"]),
    (state(mode="held"), ["HELD", "nothing moves", "choose a motion, or Home"]),
    (state(mode="emergency stop"), ["EMERGENCY STOP", "every joint is held", "Reset releases it"]),
]


@pytest.mark.thorough
def test_two_browsers_see_what_happens_and_both_command(browser):
    page, heard, over = PrivatePage(free_port(), "test"), [], threading.Event()
    with closing(CommandServer(0)) as server, closing(CommandClient(server.port)) as client:

        def answer():
            while not over.wait(0.01):
                for message, sender in server.poll():
                    what = f"{message.side} {message.impulse:g}" if isinstance(message, Push) else ""
                    heard.append((type(message), getattr(message, "to", what)))
                    server.reply(sender, Accepted(message.id))

        deck = threading.Thread(target=answer)
        deck.start()
        looks = []
        about = PageDescription(model_file="", robot="test", motions=MOTIONS, has_phase=True, push_ns=0.25)
        panel = Panel(page, about, client, look_from=lambda _, way: looks.append(way))
        panel.show(state())
        tabs = [browser.new_page(viewport={"width": width, "height": 700}) for width in (900, 390)]
        try:
            for tab in tabs:
                tab.set_default_timeout(60_000)
                tab.goto(f"{page.address}/?view=inspect")
                tab.locator("#state-line").wait_for()

            def lines(tab):
                return [line for line in tab.locator("#state-line").inner_text().split("\n") if line.strip("\xa0 ")]

            for shown, said in SITUATIONS:
                panel.show(shown)
                for tab in tabs:
                    until(lambda tab=tab, said=said: lines(tab) == said, said)
            wide, phone = tabs
            jog = wide.get_by_role("button", name="jog", exact=True)
            until(lambda: not jog.is_enabled(), "no motion to choose in an emergency stop")
            panel.show(state())
            for name in ("Pause", "Home"):
                wide.get_by_role("button", name=name, exact=True).click(trial=True)  # neither covers the other
            expect(wide.get_by_role("button", name="Step", exact=True)).to_be_disabled()
            panel.show(state(paused=True))
            wide.get_by_role("button", name="Step", exact=True).click()
            until(lambda: (StepOn, "") in heard, "the step")
            panel.show(state())
            jog.click()
            until(lambda: (Switch, "jog") in heard, "the first browser's command")
            phone.keyboard.press("Escape")
            until(lambda: (EmergencyStop, "") in heard, "the second browser's emergency stop")

            wide.get_by_text("view", exact=True).click()
            front = wide.get_by_role("button", name="front", exact=True)
            # While a folder opens, a click may fall beside the button.
            until(lambda: front.click() or looks[-1:] == ["front"], "the camera in front")
            wide.get_by_text("push", exact=True).click()
            left = wide.get_by_role("button", name="left", exact=True)
            until(lambda: left.click() or (Push, "left 0.25") in heard, "the push")
            panel.show_event(Event("via", "crawl, on the way to standup", "crawl", 0.5, 0))
            wide.locator(".notices").get_by_text("crawl, on the way to standup").wait_for()
            for _ in range(2):
                panel.show_event(Event("fault", "id 3 is hot", "walk", 1.0, 1))
            panel.show_event(Event("fault", "id 4 is hot", "walk", 1.0, 2))
            wide.get_by_text("id 4 is hot").wait_for()
            expect(wide.locator(".notice.alarm")).to_be_visible()
            wide.get_by_role("button", name="Acknowledge (1 more)").click()
            phone.get_by_text("id 3 is hot").wait_for()
            expect(phone.get_by_text("id 4 is hot")).to_have_count(0)
            phone.get_by_role("button", name="Acknowledge").click()
            wide.locator(".notice.alarm").wait_for(state="hidden")

            card = panel.parts.add("network-card", "network-card")
            near = {"motion": "walk", "names": ["walk", "jog"], "overlap": [[1, 0.7], [0.7, 1]], "centers": [0.25, 0.5]}
            card.show(near)
            wide.get_by_text("walk: most with jog 70 %").wait_for()
            expect(wide.locator(".network-card .dials svg")).to_have_count(2)
            card.show(None)
            wide.locator(".network-card").wait_for(state="hidden")

            phone.reload()
            phone.locator("#state-line").get_by_text("PLAYING").wait_for()

            panel.end("the rig is lost: id 3")
            for tab in tabs:
                until(lambda tab=tab: lines(tab)[:2] == ["ENDED", "the rig is lost: id 3"], "the end")
        finally:
            over.set()
            deck.join()
            for tab in tabs:
                tab.close()
            page.stop()


def test_an_emergency_stop_waits_for_no_other_command(monkeypatch):
    monkeypatch.setattr("motiondeck.page.panel.ANSWER_WITHIN", PATIENCE)
    page = PrivatePage(free_port(), "test")
    with (
        closing(CommandServer(0)) as server,
        closing(StopDoor(server.port)) as door,
        closing(CommandClient(server.port)) as client,
    ):
        panel = Panel(page, PageDescription(model_file="", robot="test", motions=MOTIONS), client, look_from=print)
        clicks = [threading.Thread(target=panel.send, args=(message,)) for message in (Switch("jog"), EmergencyStop())]
        clicks[0].start()
        taken = until(lambda: [*server.poll()], "the first command")
        clicks[1].start()
        until(lambda: door.poll() == 1, "the emergency stop")
        clicks[1].join()
        assert clicks[0].is_alive()
        ((message, sender),) = taken
        server.reply(sender, Accepted(message.id))
        clicks[0].join()
        page.stop()


@pytest.mark.parametrize("groups", [[], ["arms"]])
@pytest.mark.parametrize("live", [[], ["jaw"]])
@pytest.mark.parametrize("gazes", [False, True])
@pytest.mark.parametrize("file", ["", "talk.safetensors"])
def test_live_values_are_shown_where_a_joint_or_a_gaze_takes_them_also_without_groups(
    monkeypatch, groups, live, gazes, file
):
    shown, add = [], PageParts.add
    monkeypatch.setattr(PageParts, "add", lambda self, name, *a, **b: shown.append(name) or add(self, name, *a, **b))
    page = PrivatePage(free_port(), "test")
    about = PageDescription(
        model_file="", robot="head", motions=MOTIONS, groups=groups, live=live, gazes=gazes, library_file=file
    )
    with closing(CommandClient(free_port())) as client:
        Panel(page, about, client, look_from=print)
        page.stop()
    assert ("live-values" in shown) == bool((live or gazes) and file)


def reopened(port):
    with suppress(MotiondeckError):  # the one before may still be closing it
        return PrivatePage(port, "test")


@pytest.mark.thorough
@pytest.mark.parametrize(("ended", "said"), [(False, '"NO CONNECTION"'), (True, "none")])
def test_a_page_says_that_it_lost_a_deck_but_not_after_the_end_and_comes_back(browser, ended, said):
    page = PrivatePage(page_port := free_port(), "test")
    with closing(CommandClient(free_port())) as client, closing(browser.new_page()) as tab:
        about = PageDescription(model_file="", robot="test", motions=MOTIONS)
        panel = Panel(page, about, client, look_from=lambda *_: None)
        panel.show(state())
        tab.goto(page.address)
        tab.locator("#state-line").get_by_text("PLAYING").wait_for()
        if ended:
            panel.end("")
            tab.locator("#state-line").get_by_text("ENDED").wait_for()
        page.flush()
        time.sleep(0.2)
        page.stop()
        # viser fades its controls when the link is lost, whatever we write on them.
        until(tab.locator("div[style*='pointer-events: none'] #state-line").count, "the lost link")
        style = "e => getComputedStyle(e, '::before').content"
        until(lambda: tab.locator("#state-line").evaluate(style) == said, said)
        expect(tab.locator("body > .notices .lost")).to_be_visible(visible=not ended)
        tab.get_by_role("button", name="Operate", exact=True).dispatch_event("click")
        expect(tab.locator(".operate .link")).to_be_visible(visible=not ended)
        notice = tab.locator(".operate .notice.lost")
        expect(notice).to_be_visible(visible=not ended)
        if not ended:
            expect(notice).to_contain_text("No connection to the deck: the robot may still move. Reconnecting.")
            expect(tab.locator(".operate .stop")).to_have_text("STOP NOT CONNECTED")
        again = until(partial(reopened, page_port), "the port")  # the browser finds it by itself
        Panel(again, about, client, look_from=lambda *_: None).show(state())
        try:
            expect(tab.locator(".operate .word")).to_have_text("PLAYING")
            expect(notice).to_be_hidden()
            expect(tab.locator(".operate .stop")).to_have_text("EMERGENCY STOP")
            expect(tab.locator(".operate .stop")).to_be_enabled()
        finally:
            again.stop()
