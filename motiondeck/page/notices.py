"""Notices in a corner of the page, in every browser, that close by themselves."""

from __future__ import annotations

import time

from motiondeck.page.web.page_style import NOTICE_SECONDS
from motiondeck.page.web.private_page import PrivatePage

MOST_NOTICES = 3  # at a time; what a rig does has its own tab
FAULT = "Fault"
MORE = "All of them are marks in the strip of the last minutes, with their text."


class Notices:
    """The notices of a page."""

    def __init__(self, page: PrivatePage) -> None:
        self._page = page
        self._shown: dict[str, float] = {}  # when each was shown last, s

    def show(self, title: str, text: str, *, alarming: bool = True) -> None:
        """Shows a notice; not twice while the same is still on the page."""
        now = time.monotonic()
        if now - self._shown.get(text, -NOTICE_SECONDS) < NOTICE_SECONDS:
            return
        self._shown = {old: at for old, at in self._shown.items() if now - at < NOTICE_SECONDS} | {text: now}
        if title == FAULT and len(self._shown) > MOST_NOTICES:
            title, text = "More faults", MORE
            if text in self._shown:
                return
            self._shown[text] = now
        for client in self._page.get_clients().values():
            client.add_notification(title, text, auto_close_seconds=NOTICE_SECONDS, color="red" if alarming else "blue")
