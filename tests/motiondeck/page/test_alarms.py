"""Alarms stay until somebody acknowledges them, are counted by cause, and the latest comes first."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from playwright.sync_api import expect
from test_viewer import NO_SERVOS, FakeDeck, end, figure_box, open_inspect, reachable, start

from controller.wire.messages.replies import Event
from motiondeck.page.alarms import NOTICE_SECONDS, Notices
from waiting import free_port, until

SILENT = "rig: the port /dev/ttyUSB0 was silent. Check adapter, cable and supply."
KNEE = "l_knee (id 18) does not answer. Check its plug and cable."
MANY = "r_shoulder_roll, r_elbow, l_shoulder_pitch, l_shoulder_roll, l_elbow, r_hip_yaw, r_hip_roll, r_hip_pitch, ..."


class Parts:
    """Stands in for the page, and keeps what is shown."""

    def add(self, kind, name, heard):
        self.heard = heard
        return self

    def show(self, state):
        self.state = state


DEEDS = st.lists(st.tuples(st.booleans(), st.integers(0, 3), st.sampled_from(["a, b", "c"])), max_size=20)


@given(DEEDS)
def test_each_cause_is_counted_until_it_is_acknowledged_and_the_latest_comes_first(deeds):
    parts = Parts()
    notices, kept = Notices(parts), {}
    for comes, number, servos in deeds:
        cause = f"cause {number}"
        if comes:
            kept = {cause: (servos, kept.pop(cause, ("", 0))[1] + 1), **kept}
            notices.add("Fault", f"{cause} Servos: {servos}", alarming=True)
        else:
            kept.pop(cause, None)
            parts.heard({"acknowledge": ["Fault", cause, servos, 1]}, None)
        first = [("Fault", cause, *about) for cause, about in kept.items()][:1]
        notices.show()
        assert (list(parts.state["alarms"]), parts.state["more"]) == (first, len(kept) - 1)


def test_a_cause_that_spreads_to_more_servos_is_the_same_alarm():
    parts = Parts()
    notices = Notices(parts)
    for count in (3, 5):
        cut = f"rig: {count} of 20 servos of l stopped answering. Check the cable to their branch."
        notices.add("Fault", f"{cut} Servos: a, b", alarming=True)
        notices.add("Fault", f"rig: {count} servos have a low supply voltage. Check the supply.", alarming=True)
    assert parts.state == {
        "alarms": [("Fault", "rig: 5 servos have a low supply voltage. Check the supply.", "", 2)],
        "more": 1,
        "passing": None,
    }


@pytest.mark.parametrize("said", ["acknowledge", {"acknowledge": "Fault"}, {"acknowledge": [1, 2]}, [3]])
def test_what_no_part_has_sent_acknowledges_nothing(said):
    parts = Parts()
    Notices(parts).add("Fault", SILENT, alarming=True)
    parts.heard(said, None)
    assert parts.state["alarms"] == [("Fault", SILENT, "", 1)]


def test_what_is_no_alarm_passes(monkeypatch):
    parts, now = Parts(), [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    notices = Notices(parts)
    notices.add("Push", "from the left")
    assert parts.state["passing"] == ("Push", "from the left")
    now[0] += NOTICE_SECONDS
    notices.show()
    assert parts.state["passing"] is None


def apart(one, other):
    """Whether two boxes have nothing in common."""
    return (
        one["x"] + one["width"] <= other["x"]
        or other["x"] + other["width"] <= one["x"]
        or one["y"] + one["height"] <= other["y"]
        or other["y"] + other["height"] <= one["y"]
    )


SEEN_WHOLE = """() => {
  const alarm = document.querySelector(".notices .alarm"), { left, right, top, bottom } = alarm.getBoundingClientRect();
  const corners = [left + 12, right - 12].flatMap((x) => [top + 6, bottom - 6].map((y) => [x, y]));
  return corners.every(([x, y]) => alarm.contains(document.elementFromPoint(x, y)));
}"""


@pytest.mark.thorough
def test_one_notice_covers_neither_body_nor_stop_and_is_acknowledged_in_all_browsers(tmp_path, browser):
    deck, port, pages = FakeDeck(tmp_path, rig=NO_SERVOS), free_port(), []  # its panel is beside the scene
    viewer = start(deck, port)
    try:
        until(lambda: reachable(port), "the page")
        for width, height in ((390, 844), (1024, 768), (1920, 1080)):
            page = browser.new_page(viewport={"width": width, "height": height})
            pages.append(page)
            open_inspect(page, port)
        until(lambda: deck.subscribers, "the page's wish for events")
        bodies = [until(lambda page=page: figure_box(page), "the figure") for page in pages]
        deck.news += [
            Event("fault", f"{SILENT} Servos: l_hip, l_knee, r_hip, r_knee", "walk", 1.0, 1),
            Event("fault", f"rig: {KNEE}", "walk", 2.0, 2),
            Event("fault", f"{SILENT} Servos: {MANY}", "walk", 3.0, 3),
        ]
        for page, body in zip(pages, bodies, strict=True):
            page.get_by_role("button", name="Acknowledge (1 more)").wait_for()
            page.locator(".notices").get_by_text("Fault × 2").wait_for()
            expect(page.locator(".notices").get_by_text(SILENT)).to_be_visible()
            stop = page.get_by_role("button", name="Emergency stop").bounding_box()
            line = page.locator(".notices").bounding_box()
            assert apart(line, body)
            assert apart(line, stop)
            page.wait_for_function(SEEN_WHOLE)
        pages[1].get_by_role("button", name="Acknowledge (1 more)").click()
        for page in pages:
            page.locator(".notices").get_by_text(KNEE).wait_for()
        pages[2].get_by_role("button", name="Acknowledge").click()
        for page in pages:
            page.locator(".notice.alarm").wait_for(state="hidden")
    finally:
        end(viewer, *pages)
        deck.end()
