"""The style of the panel: the state line and the emergency stop stay in sight, and some buttons share a line.

viser lays a panel out in one column that scrolls as a whole; on a phone it is a sheet at the lower edge. These rules go
by marks of our own in that column; where a browser or another version of viser does not match them, the panel is as
viser makes it.
"""

from __future__ import annotations

STATE_LINE = "state-line"
CURRENT, STOPS = (38, 110, 200), (201, 42, 42)
NOTICE_SECONDS = 8.0

STYLE = f"""<style>
#{STATE_LINE} {{
  height: 6.5em; box-sizing: border-box; margin: 4px 10px 6px; padding: 8px 12px; border-radius: 8px;
  color: white; line-height: 1.25; overflow: hidden; white-space: nowrap; }}
div:has(> div > div > div > #{STATE_LINE}) {{ overflow: visible !important; }}
div:has(> #{STATE_LINE}), div:has(> #{STATE_LINE}) + div {{
  position: sticky; z-index: 5; background: var(--mantine-color-body, white); }}
div:has(> #{STATE_LINE}) {{ top: 0; padding-top: 2px; box-shadow: 0 4px var(--mantine-color-body, white); }}
div:has(> #{STATE_LINE}) + div {{ top: 7em; padding-bottom: 4px; }}
div:has(> #{STATE_LINE}) + div button {{ min-height: 2.6em; font-size: 1.05em; font-weight: 700; }}
div[style*="max-height: 60%"], div[style*="max-height: 60%"] div[style="width: 20em;"] {{ width: 100vw !important; }}
div[style="width: 20em;"] div:has(#{STATE_LINE}):not(:has(> #{STATE_LINE})) {{ display: contents !important; }}
div[style*="pointer-events: none"] #{STATE_LINE} {{ height: auto; }}
div[style*="pointer-events: none"]:has(#{STATE_LINE}) {{ opacity: 1 !important; }}
div[style*="pointer-events: none"] div:has(> #{STATE_LINE}) ~ div {{ opacity: .5; }}
div[style*="pointer-events: none"] #{STATE_LINE}:not([data-word="ENDED"])::before {{
  content: "NO CONNECTION"; display: block; margin: -8px -12px 4px; padding: 2px 12px; background: black;
  font-weight: 800; font-size: 17px; }}
div:has(> #{STATE_LINE}) ~ div button {{ padding-inline: 6px; }}
</style>"""


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
