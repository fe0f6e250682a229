"""The style of the panel: the state line and the emergency stop stay in sight, and some buttons share a line.

viser lays a panel out in one column that scrolls as a whole; on a phone it is a sheet at the lower edge. These rules go
by marks of our own in that column; where a browser or another viser does not match them, the panel is viser's own.
"""

from pathlib import Path

# Of buttons: what is usual, what stops and nothing else, and what is quiet.
CURRENT, STOPS, QUIET = (38, 110, 200), (201, 42, 42), (73, 80, 87)
UNSURE, BAD = "var(--quiet)", "var(--fault)"  # colours of text


def style_in(file: Path) -> str:
    """A file of style rules as an element of a page."""
    return f"<style>\n{file.read_text(encoding='utf-8')}</style>"


STYLE = style_in(Path(__file__).with_name("panel.css"))
