"""The page's own parts in a browser: keys while a field has the focus, and names in the strip of the last minutes."""

import asyncio
import gc
import inspect
import json
import weakref
from threading import Thread
from types import SimpleNamespace

import pytest

from motiondeck.page.web.parts import OwnPart, PageParts
from motiondeck.page.web.private_page import PrivatePage
from waiting import free_port, until


def test_esc_is_heard_while_a_field_is_typed_in(browser):
    page, heard = PrivatePage(free_port(), "test"), []
    PageParts(page)
    page.gui.add_command("Stop", hotkey="escape").on_trigger(lambda _: heard.append("esc"))
    page.gui.add_command("Two", hotkey="2").on_trigger(lambda _: heard.append("2"))
    page.gui.add_number("weight", 1.0)
    page.gui.add_checkbox("forces", initial_value=False)
    tab = browser.new_page(viewport={"width": 900, "height": 600})
    tab.set_default_timeout(60_000)
    try:
        tab.goto(page.address)
        weight = tab.get_by_role("textbox", name="weight")
        weight.wait_for()
        tab.wait_for_function("window.motiondeck")
        weight.press("2")  # a digit is typed
        weight.press("Escape")
        until(lambda: heard, "Esc in a field")
        tab.get_by_role("checkbox").click()
        tab.keyboard.press("Escape")
        until(lambda: len(heard) == 2, "Esc after a box was ticked")
        tab.keyboard.press("Escape")
        until(lambda: len(heard) == 3, "Esc elsewhere")
        assert heard == ["esc"] * 3
    finally:
        tab.close()
        page.stop()


@pytest.mark.thorough
def test_a_name_in_the_strip_is_whole_or_cut_where_it_still_says_what_was_played(browser):
    page = PrivatePage(free_port(), "test")
    strip = PageParts(page).add("timeline", "timeline")
    blend = "walk + jog + slow-walk"
    shown_in = [
        (8, "walk", ""),
        (38, "walk", "walk"),
        (34, "stool-standup", ""),
        (50, "stool-standup", "stool-standup"),  # ends in dots
        (180, blend, blend),
        (65, blend, "walk + 2"),
        (40, blend, ""),  # with dots it would read as walk alone
    ]
    ends = [sum(width for width, _, _ in shown_in[:place]) for place in range(len(shown_in) + 1)]
    runs = [[begin, end, name] for begin, end, (_, name, _) in zip(ends[:-1], ends[1:], shown_in, strict=True)]
    tab = browser.new_page(viewport={"width": 900, "height": 600})
    tab.set_default_timeout(60_000)
    try:
        tab.goto(page.address)
        strip.show({"seconds": 1.0, "runs": [], "marks": [], "back": 0})
        width = tab.locator(".timeline-strip .bar").bounding_box()["width"]
        shown = [[begin - width, end - width, name] for begin, end, name in runs]
        strip.show({"seconds": width, "runs": shown, "marks": [], "back": 0})
        tab.locator(".timeline-strip .run").first.wait_for()
        texts = [run.inner_text() for run in tab.locator(".timeline-strip .run").all()]
        assert texts == [text for _, _, text in shown_in]
    finally:
        tab.close()
        page.stop()


@pytest.mark.thorough
def test_recognition_says_what_is_wrong_and_nothing_of_names_is_taken_for_html(browser):
    page = PrivatePage(free_port(), "test")
    seen = PageParts(page).add("recognition", "seen", {"unrecognized": "standing still"})
    seen.show({"seen": ["<b>jog", 0.1], "mismatch_s": 1.5, "stuck": "knee"})
    tab = browser.new_page(viewport={"width": 900, "height": 600})
    tab.set_default_timeout(60_000)
    try:
        tab.goto(page.address)
        tab.get_by_text("<b>jog", exact=True).wait_for()
        tab.get_by_text("not what was commanded, for 1.5 s; knee does not follow").wait_for()
        seen.show({"seen": None, "mismatch_s": 0.0, "stuck": ""})
        tab.get_by_text("standing still").wait_for()
        tab.get_by_text("knee does not follow").wait_for(state="detached")
    finally:
        tab.close()
        page.stop()


class Listener:
    """Stands in for the page, whose text field has what any browser has sent last."""

    def __init__(self):
        self.gui, self.value, self.leave = self, "", []

    def add_html(self, content):
        return SimpleNamespace(content=content)

    def add_text(self, *_):
        return self

    def on_update(self, heard):
        self.heard = heard

    def on_client_disconnect(self, leave):
        self.leave.append(leave)


def test_what_two_browsers_send_at_once_is_heard_as_of_the_one_that_sent_it():
    page, heard, left = Listener(), {}, []
    PageParts(page).add("any", "any", heard=lambda said, event: heard.update({said: event.client}))

    async def send():
        for client in ("one", "two"):
            page.value, event = json.dumps(["any", f"of {client}", ""]), SimpleNamespace(client=client)
            if inspect.iscoroutinefunction(page.heard):  # viser awaits it before it takes another event
                await page.heard(event)
            else:  # and leaves it to a thread otherwise
                left.append(event)

    sending = Thread(target=lambda: asyncio.run(send()))  # elsewhere, as the browser's tests have a loop here
    sending.start()
    sending.join()
    for event in left:
        page.heard(event)
    until(lambda: len(heard) == 2, "both browsers")
    assert heard == {"of one": "one", "of two": "two"}


class Widgets:
    """Those of one browser."""

    def __init__(self, number):
        self.client_id, self.gui, self.content = number, self, ""

    def add_html(self, content):
        return self


def test_a_browser_that_has_left_is_forgotten():
    page = Listener()
    part = OwnPart(PageParts(page), "any")
    alive = weakref.WeakSet()
    for number in range(3):
        alive.add(client := Widgets(number))
        part.show(client, 1)
    for leave in page.leave:
        leave(client)
    del client
    gc.collect()
    assert {client.client_id for client in alive} == {0, 1}
