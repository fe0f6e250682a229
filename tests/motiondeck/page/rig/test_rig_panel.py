"""The rig on the page: what its cards say and do, in a browser; and how servos are judged."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from controller.wire.messages.commands import ReadRegisters, ScanPorts, ServoTorque, WriteRegister
from controller.wire.messages.replies import OnPorts, Registers, ServoOnPort, ServoRegister
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.rig.rig_panel import RigPanel
from motiondeck.page.rig.servo_look import ServoLook, ServoLooks
from motiondeck.page.web.page_state import RigDescription, ServoDescription
from motiondeck.page.web.parts import PageParts
from motiondeck.page.web.private_page import PrivatePage
from waiting import free_port, until
from web_pages import coarse

CONDITIONS = ["well", "is getting hot", "is off on command", "does not answer"]
RIG = RigDescription(
    CONDITIONS,
    25.0,
    [
        ServoDescription(name, place, "XM430-W350", -3.14, 3.14, 80.0)
        for place, name in enumerate(("neck", "l_knee"), 1)
    ],
)


def state(conditions, **values):
    usual = {"goals": 0.5, "positions": 0.5, "currents": 0.1, "temperatures": 41.0, "voltages": 12.0, "errors": 0}
    rows = {name: np.full(2, float(value)) for name, value in (usual | {"torque": 1.0} | values).items()}
    return ServoStates(**rows, conditions=np.array([float(CONDITIONS.index(word)) for word in conditions]))


@pytest.mark.parametrize(
    ("condition", "values", "look"),
    [
        ("well", {}, ServoLook("ok", "ok")),
        ("well", {"positions": 0.2}, ServoLook("warn", "is late")),
        ("is getting hot", {}, ServoLook("warn", "is getting hot")),
        ("is off on command", {}, ServoLook("off", "is off on command")),
        ("does not answer", {}, ServoLook("bad", "does not answer")),
    ],
)
def test_a_servo_looks_as_it_is(condition, values, look):
    looks = ServoLooks(RIG)
    assert looks.of(state(["well", condition], **values), 0.0)[1].words != "is late"
    assert looks.of(state(["well", condition], **values), 0.6)[1] == look


def test_nothing_is_said_of_servos_before_the_rig_has_spoken():
    assert ServoLooks(RIG).of(ServoStates(*np.full((8, 2), np.nan)), 0.0) == []


def test_cards_say_how_servos_are_and_torque_is_taken_off_after_a_question(browser):
    page = PrivatePage(free_port(), "test")
    asked, looked = [], []

    def look(message):
        looked.append(message)
        if isinstance(message, ScanPorts):
            return OnPorts([ServoOnPort("neck", 1, "XM430-W350", 46), ServoOnPort("", 9, "XL-320", 30)], ["l_knee"])
        count = message.count if isinstance(message, WriteRegister) else 10
        rows = [
            ServoRegister("operating_mode", 11, 3, "position", False),
            ServoRegister("moving_threshold", 24, count, "", True),
        ]
        return Registers(message.joint, "XM430-W350", rows)

    panel = RigPanel(PageParts(page), RIG, lambda event, title, text, yes, then: asked.append((title, then)), look)
    panel.show(state(["well", "does not answer"]), 0.0)
    tab = browser.new_page(viewport={"width": 900, "height": 700})
    try:
        tab.goto(coarse(page.address))
        knee = tab.get_by_role("button", name="l knee does not answer")
        knee.wait_for()
        expect(knee).to_contain_text("29/29°")
        expect(knee).to_have_class(re.compile(r"\bbad\b"))
        knee.click()
        until(lambda: panel.joint == "l_knee", "the choice")
        panel.show(state(["well", "is getting hot"], temperatures=71.0), 0.1)
        tab.get_by_role("button", name="l knee is getting hot").wait_for()
        expect(tab.locator(".servo-card.chosen .alarm")).to_have_text("71°C")
        tab.get_by_role("button", name="Torque off", exact=True).click()
        until(lambda: asked, "the command")
        assert asked.pop() == ("Take the torque off l_knee?", ServoTorque("l_knee", "off"))

        tab.get_by_role("button", name="Registers").click()
        tab.get_by_role("row", name="11 operating_mode 3 position").wait_for()
        tab.get_by_text("switch the torque of this servo off first").wait_for()
        tab.get_by_role("button", name="Close").click()
        panel.show(state(["well", "is off on command"], torque=0.0), 0.2)
        tab.get_by_role("button", name="Torque on").wait_for()
        tab.get_by_role("button", name="Registers").click()
        tab.get_by_label("count").fill("25")
        tab.get_by_label("count").press("Enter")
        tab.get_by_role("button", name="Write").click()
        until(lambda: asked, "the question")
        title, write = asked.pop()
        assert title == "Write 25 into moving_threshold of l_knee?"
        assert looked == [ReadRegisters("l_knee")] * 2
        write()
        tab.get_by_role("row", name="24 moving_threshold 25").wait_for()
        assert looked[-1] == WriteRegister("l_knee", "moving_threshold", 25)
        tab.get_by_role("button", name="Close").click()
        tab.get_by_role("button", name="Scan ports").click()
        until(lambda: asked, "the question")
        asked.pop()[1]()
        for row in ("9 not in the rig file XL-320 30", "l_knee does not answer"):
            tab.get_by_role("row", name=row).wait_for()
    finally:
        tab.close()
        page.stop()
