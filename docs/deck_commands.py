"""Writes the table of commands in docs/deck.md from their rows: python docs/deck_commands.py"""

from __future__ import annotations

import re
import sys
from pathlib import Path

PAGE = Path(__file__).with_name("deck.md")
sys.path.insert(0, str(PAGE.parents[1]))

from controller.wire.messages.command_table import COMMANDS  # noqa: E402

_BETWEEN = re.compile(r"(<!-- commands, by deck_commands.py -->\n).*?(<!-- end of commands -->)", re.S)


def with_table(text: str) -> str:
    """The page with the table that the rows give."""
    rows = ["| command | what it does | also in | in an emergency stop |", "|---|---|---|---|"]
    for row in COMMANDS:
        words = ", ".join(f"`{word}`" for word in (row.usage, *row.aliases)).replace("|", r"\|")
        uses = ", ".join("at" if use == "timed" else use for use in row.uses)
        stopped = "taken" if "emergency stop" in row.modes else ""
        rows.append(f"| {words} | {row.help} | {uses} | {stopped} |")
    table = "\n".join(rows)
    return _BETWEEN.sub(lambda found: f"{found[1]}\n{table}\n\n{found[2]}", text)


if __name__ == "__main__":
    PAGE.write_text(with_table(PAGE.read_text()))
