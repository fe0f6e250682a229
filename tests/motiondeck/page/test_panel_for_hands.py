"""What hands and eyes need of the panel, measured in a browser at three sizes: targets, letters, contrast, no moves."""

from contextlib import closing

import pytest
from playwright.sync_api import expect
from test_panel import SITUATIONS

from controller.wire.command_socket import CommandClient, CommandServer
from motiondeck.page.panel import Panel
from motiondeck.page.web.page_state import PageDescription
from motiondeck.page.web.private_page import PrivatePage
from waiting import free_port, soon, until

TOUCH = {"phone": (390, 844), "tablet": (1024, 768)}
SIZES = {**TOUCH, "large": (1920, 1080)}
MOTIONS = ["walk", "jog", "crawl", "standup", "waltz", "stool-stand", "slow-walk", "exa-stride", "cartwheel"]
MOTIONS += ["getdown", "sitting", "getseated", "box1"]
VERDICTS = {"walk": ("at tempo 0.74", "x"), "waltz": ("does not fit", "x"), "stool-stand": ("plays", "")}
FOLDERS = ("beat", "view", "loop")  # closed at first: what is not for a hand in a hurry
LEAST, LETTERS, CONTRAST, FAR = 44, 16, 4.5, 16  # pixels; pixels; times; pixels from the stop

# Boxes of all that can be pressed, letters and contrast of all that can be read, in the panel without its folders.
MEASURE = """() => {
  const visible = (e) => e.checkVisibility({ visibilityProperty: true, opacityProperty: true });
  const view = document.querySelector("body > .operate");
  const column = view ?? document.querySelector("#state-line").parentElement.parentElement;
  const parts = view ? [view] : [...column.children];
  const all = (what) => parts.flatMap((e) => [...e.querySelectorAll(what)]).filter(visible);
  const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
  const light = (rgb) => rgb.map((v) => (v /= 255, v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const over = (rgb, [r, g, b, a = 1], share) => rgb.map((v, i) => v * (1 - a * share) + [r, g, b][i] * a * share);
  const chain = (e) => (e ? [...chain(e.parentElement), e] : []);
  const filled = (rgb, e) => over(rgb, numbers(getComputedStyle(e).backgroundColor), 1);
  const contrast = (e) => {
    if (chain(e).some((n) => getComputedStyle(n).filter !== "none")) return 0; // what it does is not measured
    const ground = chain(e).reduce(filled, [255, 255, 255]);
    const share = chain(e).reduce((share, n) => share * Number(getComputedStyle(n).opacity), 1);
    const style = getComputedStyle(e);
    const ink = over(ground, numbers(e.closest("svg") ? style.fill : style.color), share);
    const [more, less] = [light(ink), light(ground)].sort((a, b) => b - a);
    return (more + 0.05) / (less + 0.05);
  };
  const box = (e) => { const { x, y, width, height } = e.getBoundingClientRect(); return [x, y, width, height]; };
  const name = (e) => e.getAttribute("aria-label") || e.innerText || e.placeholder || e.className || e.id;
  const read = [];
  const walk = document.createTreeWalker(column, NodeFilter.SHOW_TEXT);
  for (let n = walk.nextNode(); n; n = walk.nextNode()) {
    const e = n.parentElement;
    if (n.textContent.trim() && visible(e) && !e.closest("pre, style, :disabled"))
      read.push([n.textContent.trim(), parseFloat(getComputedStyle(e).fontSize), contrast(e)]);
  }
  const pressed = 'button, select, input:not([type="search"]), [role="slider"], summary';
  const targets = all(pressed).map((e) => [name(e), box(e)]);
  const names = all(".motion b").map((e) => [e.innerText, e.scrollWidth <= e.clientWidth + 1]);
  return { targets, read, names };
}"""

VISERS = """() => [...document.querySelectorAll("#root button, #root [role=button]")].filter((e) => e.checkVisibility())
  .map((e) => [e.getAttribute("aria-label") || e.innerText, e.offsetWidth, e.offsetHeight])"""


@pytest.fixture
def panel():
    page = PrivatePage(free_port(), "test")
    with closing(CommandServer(0)) as server, closing(CommandClient(server.port)) as client:
        about = PageDescription(model_file="", motions=MOTIONS, robot="", has_phase=True, verdicts=VERDICTS)
        shown = Panel(page, about, client, look_from=lambda *_: None)
        yield page, shown
        page.stop()


def of_stop(targets):
    return next(box for name, box in targets if name.strip() in ("Emergency stop", "Reset"))


@pytest.mark.thorough
@pytest.mark.parametrize(("size", "scheme"), [*((size, "light") for size in SIZES), ("large", "dark")])
def test_hands_hit_and_eyes_read_the_panel_and_nothing_moves(panel, browser, size, scheme):
    page, shown = panel
    width, height = SIZES[size]
    tab = browser.new_page(viewport={"width": width, "height": height}, has_touch=size in TOUCH, color_scheme=scheme)
    try:
        shown.show(SITUATIONS[0][0])
        tab.goto(f"{page.address}/?view=inspect")
        tab.locator(f"[data-mantine-color-scheme={scheme}]").wait_for()
        tab.locator("#state-line").wait_for()
        tab.locator(".motion").last.wait_for()
        tab.wait_for_function(
            """() => !document.querySelector('#root [role="slider"][aria-label=""]')"""
        )  # all are named
        expect(tab.get_by_label("search a motion")).to_have_count(1)
        first = []

        def fits():
            found = tab.evaluate(MEASURE)
            targets, read = found["targets"], found["read"]
            assert [text for text, _, contrast in read if contrast < CONTRAST] == []
            assert sorted(name for name, whole in found["names"] if whole) == sorted(MOTIONS)
            _, y, _, tall = of_stop(targets)
            assert min(box[1] for _, box in targets if box[1] > y) - (y + tall) >= FAR
            if size in TOUCH:
                assert [one for one in tab.evaluate(VISERS) if min(one[1:]) < LEAST] == []  # viser's own, too
                assert [target for target in targets if min(target[1][2:]) < LEAST] == []
                assert [
                    text for text in read if text[1] < LETTERS and text[0] not in FOLDERS and not text[0].isdigit()
                ] == []
            # The queue is a line of its own; a disabled slider has no thumb.
            passing = ("sooner", "take out", "tempo")
            places = [box for name, box in targets if not any(word in name for word in passing)]
            before = first or places
            assert len(places) == len(before)
            moved = [
                (one, other) for one, other in zip(places, before, strict=True) if one != pytest.approx(other, abs=1.0)
            ]
            assert moved == []
            return places

        for state, lines in SITUATIONS:
            shown.show(state)
            until(lambda lines=lines: tab.locator("#state-line").inner_text().split("\n")[: len(lines)] == lines, "it")
            tab.wait_for_timeout(250)  # parts are drawn ten times a second, on a machine that is not busy
            places = soon(fits)
            first = first or places
    finally:
        tab.close()
