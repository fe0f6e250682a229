"""The log of the page: found by words, in the browser that looks at it, and a click looks back to an entry's moment."""

import pytest
from playwright.sync_api import expect
from test_viewer import FakeDeck, end, open_inspect, reachable, start

from controller.wire.messages.replies import Event
from waiting import free_port, until

HAPPENED = [
    Event("fault", "rig: the port /dev/ttyUSB0 was silent. Check adapter. Servos: l_hip, l_knee", "walk", 1.0, 1),
    Event("settled", "jog after 0.40 s", "jog", 2.0, 2),
    Event("fault", "rig: l_knee (id 18) is getting hot. Check what it carries.", "jog", 3.0, 3),
    Event("fell", "the robot has fallen", "jog", 4.0, 4),
]


@pytest.mark.thorough
def test_the_log_is_found_by_cause_servo_and_time_and_leads_back(tmp_path, browser):
    deck, port = FakeDeck(tmp_path), free_port()
    viewer = start(deck, port)
    page, other = (browser.new_page(viewport={"width": 1280, "height": 800}) for _ in range(2))
    try:
        until(lambda: reachable(port), "the page")
        for one in (page, other):
            open_inspect(one, port)
        until(lambda: deck.subscribers, "the page's wish for events")
        deck.news += HAPPENED
        page.locator(".notices").get_by_text("the robot has fallen").wait_for()
        page.get_by_text("Log", exact=True).click()
        count = page.locator(".log").get_by_role("status")
        count.get_by_text("4 of 4", exact=True).wait_for()
        entries = page.locator(".log .entry")
        expect(entries.first).to_contain_text("the robot has fallen")
        find = page.get_by_label("find in the log")
        for words, found in (
            ("L_KNEE", "2 of 4"),
            ("l_knee hot", "1 of 4"),
            ("silent adapter", "1 of 4"),
            ("none", "0 of 4"),
        ):
            find.fill(words)
            count.get_by_text(found, exact=True).wait_for()
        at = page.evaluate(
            "JSON.parse(document.querySelector('[data-state-of=log-entries]').dataset.state).entries[0][0]"
        )
        find.fill(f"0:{at:04.1f} fallen")
        count.get_by_text("1 of 4", exact=True).wait_for()
        find.fill("")
        page.get_by_label("alarms only").check()
        count.get_by_text("3 of 4", exact=True).wait_for()
        expect(other.locator("[data-state-of=log-entries]")).to_have_count(0)
        page.wait_for_timeout(600)  # so long after a fault no browser looks back
        entries.first.click()
        page.get_by_role("button", name="back to now").wait_for()
        expect(other.locator(".past-frame")).to_be_hidden()
    finally:
        end(viewer, page, other)
        deck.end()
