"""The style of the panel: the state line and the emergency stop stay in sight, and some buttons share a line.

viser lays a panel out in one column that scrolls as a whole; on a phone it is a sheet at the lower edge. These rules go
by marks of our own in that column; where a browser or another viser does not match them, the panel is viser's own.
"""

from pathlib import Path

STATE_LINE = "state-line"  # the element, as `panel.css` and `show.css` name it
CURRENT, STOPS = (38, 110, 200), (201, 42, 42)
NOTICE_SECONDS = 8.0


def style_in(file: Path) -> str:
    """A file of style rules as an element of a page."""
    return f"<style>\n{file.read_text(encoding='utf-8')}</style>"


STYLE = style_in(Path(__file__).with_name("panel.css"))


def buttons_in_line(count: int) -> str:
    """The style in which the first buttons after the emergency stop share a line."""
    rules: list[str] = []
    for place in range(count):
        button = f"div:has(> #{STATE_LINE}) + div" + (place + 1) * " + div"
        if place > 0:
            left = f"calc({100.0 * place / count:.1f}% + 2px)"
            rules.append(f"{button} {{ margin-left: {left} !important; margin-top: -2.25em; }}")
        if place < count - 1:
            right = f"calc({100.0 * (count - 1 - place) / count:.1f}% + 2px)"
            rules.append(f"{button} {{ margin-right: {right} !important; }}")
    return "<style>" + "\n".join(rules) + "</style>"
