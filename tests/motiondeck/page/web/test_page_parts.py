"""The page's own parts in a browser: keys while a field has the focus, and names in the strip of the last minutes."""

import pytest

from motiondeck.page.web.parts import PageParts
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
