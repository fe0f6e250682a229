"""The page's own parts in a browser: what their common script adds to the keys."""

from sim.view.web.parts import PageParts
from sim.view.web.private_page import PrivatePage
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
