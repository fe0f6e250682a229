"""Shortcuts while something has the focus: a key that it uses is no shortcut, Esc stops, and a held key acts once."""

from contextlib import closing, contextmanager

import pytest
from playwright.sync_api import expect
from test_operate import shown_panel

from controller.wire.messages.commands import EmergencyStop, Home, Jump, Pause, SetTempo, StepOn, Switch
from waiting import PATIENCE, until

ALL = {"Space": Pause, "s": StepOn, "2": Switch}
BUTTON = ALL | {"Space": None, "Enter": None}
FIELD = dict.fromkeys(["Space", "s", "2", "Enter"])

# What has the focus, by its place on the page, with what each key does there: a command's type, or None.
FOCUSED = {
    "nothing": ("body", ALL | {"Enter": None}),
    "a button": ("button:has-text('Home')", BUTTON | {"Space": Home, "Enter": Home}),
    "a part's own button": (".motion[data-key='jog'] .play", BUTTON | {"Space": Switch, "Enter": Switch}),
    "a folder's summary": ("#tried", BUTTON),
    "a slider": (".mantine-Slider-root [role='slider']", ALL | {"ArrowRight": SetTempo, "Home": SetTempo}),
    "a part's own slider": ("circle.ring", ALL | {"ArrowRight": Jump, "ArrowLeft": Jump}),
    "a checkbox": ("input[type='checkbox']:visible", FIELD),
    "a text field": ("input[placeholder='search a motion']", FIELD | {"ArrowLeft": None}),
    "a select": ("[data-part='layers'] select >> nth=0", {"s": None, "2": None, "ArrowDown": None, "Space": None}),
}


@contextmanager
def inspected(browser):
    """A browser that shows the panel in the view inspect, with the commands that have come."""
    with shown_panel() as (page, _, heard), closing(browser.new_page(viewport={"width": 1280, "height": 800})) as tab:
        tab.set_default_timeout(1000.0 * PATIENCE)
        tab.goto(f"{page.address}/?view=inspect&fixedDpr=0.1")
        tab.locator(".motion").last.wait_for()
        yield tab, heard


@pytest.mark.thorough
def test_a_key_that_the_focused_control_uses_is_no_shortcut_and_escape_always_stops(browser):
    with inspected(browser) as (tab, heard):
        tab.locator(".motion[data-key='jog'] .play").click()
        until(lambda: heard, "the click")
        tab.keyboard.press("Space")  # a button that was clicked keeps no focus
        until(lambda: len(heard) == 2, "the pause")
        assert [type(one) for one in heard] == [Switch, Pause]
        for folder in ("layer", "view"):
            tab.get_by_text(folder, exact=True).click()
        tab.evaluate(
            "document.querySelector('.part').innerHTML += '<details><summary id=tried>more</summary></details>'"
        )
        wrong = []
        for focused, (place, keys) in FOCUSED.items():
            for key, command in keys.items():
                heard.clear()
                if place == "body":
                    tab.evaluate("document.activeElement.blur()")
                else:
                    tab.locator(place).first.wait_for()  # its folder may still be opening
                    tab.locator(place).first.focus()
                    assert tab.locator(place).first.evaluate("e => e === document.activeElement"), focused
                tab.keyboard.press(key)
                if command is not None:
                    until(lambda: heard, f"what {key} does on {focused}")
                if focused == "a select" and key == "Space":
                    tab.keyboard.press("Escape")  # closes its list
                tab.keyboard.press("Escape")
                until(lambda: any(isinstance(one, EmergencyStop) for one in heard), f"Esc on {focused}")
                found = [type(one).__name__ for one in heard if not isinstance(one, EmergencyStop)]
                if found != ([command.__name__] if command else []):
                    wrong.append(f"{key} on {focused}: {found}")
        assert "; ".join(wrong) == ""


HELD = {
    "body": {"Space": Pause, "s": StepOn, "2": Switch},
    "button:has-text('Home')": {"Enter": Home, "Space": Home},
    ".motion[data-key='jog'] .play": {"Enter": Switch, "Space": Switch},
}


@pytest.mark.thorough
def test_a_key_that_is_held_acts_once(browser):
    with inspected(browser) as (tab, heard):

        def held(place, key):
            """What a key does that is held there for five repeats, until a stop that comes after it is heard."""
            heard.clear()
            tab.evaluate("document.activeElement.blur()")
            if place != "body":
                tab.locator(place).first.focus()
            for _ in range(6):
                tab.keyboard.down(key)
            tab.keyboard.up(key)
            until(lambda: heard, f"what {key} does on {place}")
            tab.keyboard.press("Escape")
            until(lambda: any(isinstance(one, EmergencyStop) for one in heard), f"Esc after {key} on {place}")
            return [type(one) for one in heard if not isinstance(one, EmergencyStop)]

        found = {place: {key: held(place, key) for key in keys} for place, keys in HELD.items()}
        assert found == {place: {key: [one] for key, one in keys.items()} for place, keys in HELD.items()}
        folder = tab.get_by_role("button", name="view", exact=True)
        folder.focus()
        for _ in range(2):  # an even number of toggles would leave it as it was
            tab.keyboard.down("Enter")
        tab.keyboard.up("Enter")
        expect(tab.get_by_text("camera", exact=True)).to_be_visible()
        # What moves by steps goes on: here with arrow keys on the ring.
        tab.evaluate("document.activeElement.blur()")
        assert len(held("circle.ring", "ArrowRight")) > 0
