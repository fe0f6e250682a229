"""The page of a show in a browser: it shows the cue list, and its buttons reach the conductor as typed words."""

import socket
import threading

import msgspec
from playwright.sync_api import expect

from motiondeck.cli.show.conduct import ShowPage
from motiondeck.page.show.viewer import view
from motiondeck.shows.show_file import ShowCue
from motiondeck.shows.show_state import DeckRow, ShowNotice, ShowState
from waiting import free_port, until

CUES = [ShowCue(say="switch walk", name="opening", at=0.0), ShowCue(say="home", hold=True)]
DECKS = [DeckRow(name, "servo20", "thesis15", "stage", True, 0, 0.0, None) for name in ("left", "middle", "right")]
SHOW = ShowState("gala", CUES, 0, 1, decks=DECKS)


def in_lines_of(tab, width):
    """Whether go and hold share a line of a window, and the cards of the decks have all of the next one."""
    go, hold = (tab.get_by_role("button", name=name, exact=True).bounding_box() for name in ("Go", "Hold"))
    cards = [card.bounding_box() for card in tab.locator("#decks > div").all()]
    if not cards or None in (go, hold, *cards):  # the window is being laid out
        return False
    beside = abs(go["y"] - hold["y"]) < 2 and go["x"] + go["width"] <= hold["x"]
    across = go["x"] < 30 and hold["x"] + hold["width"] > width - 40 and cards[0]["x"] < 30
    in_sight = all(card["x"] + card["width"] <= width for card in cards)
    return beside and across and in_sight and cards[0]["y"] >= go["y"] + go["height"]


def test_the_page_shows_the_cues_and_its_buttons_say_words(browser, monkeypatch):
    monkeypatch.setattr("motiondeck.page.web.private_page.LAST_WORD", 0.5)
    monkeypatch.setattr("motiondeck.page.show.viewer.SILENT_AFTER", 60.0)  # a slow browser is there later
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    port, conductor, heard = free_port(), ShowPage(ours), []
    viewer = threading.Thread(target=view, args=(theirs, port))
    viewer.start()
    conductor.show(SHOW)
    tab = browser.new_page(viewport={"width": 900, "height": 600})
    tab.set_default_timeout(60_000)

    def said(word):
        heard.extend(conductor.words())
        return heard[-1:] == [word]

    try:
        with socket.socket() as probe:
            until(lambda: probe.connect_ex(("127.0.0.1", port)) == 0, "the page")
        tab.goto(f"http://127.0.0.1:{port}")
        tab.locator("#cues .now").get_by_text("switch walk").wait_for()
        tab.locator("#state-line").get_by_text("PLAYING").wait_for()
        for width in (390, 900, 1366):
            tab.set_viewport_size({"width": width, "height": 700})
            until(
                lambda width=width: in_lines_of(tab, width),
                f"go and hold in a line, and all decks in sight, at {width}",
            )
        tab.set_viewport_size({"width": 900, "height": 600})
        for name, word in (("Go", "go"), ("Hold", "hold"), ("Emergency stop", "stop")):
            tab.get_by_role("button", name=name, exact=True).click()
            until(lambda word=word: said(word), word)
        heard.clear()
        tab.keyboard.press("Escape")
        until(lambda: said("stop"), "Esc")
        conductor.show(msgspec.structs.replace(SHOW, stopped_by="conductor"))
        conductor.show(ShowNotice("first reset the emergency stop at: left"))
        tab.locator("#state-line").get_by_text("EMERGENCY STOP").wait_for()
        tab.locator(".notices").get_by_text("first reset the emergency stop").wait_for()
        ours.close()
        tab.locator("#state-line").get_by_text("ENDED").wait_for()
        expect(tab.get_by_role("button", name="Emergency stop")).to_be_disabled()
    finally:
        ours.close()
        tab.close()
        viewer.join()
        theirs.close()
