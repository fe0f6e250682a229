"""The state line of the page: the present state and the next motions, readable across a room."""

import html
from collections.abc import Sequence
from dataclasses import dataclass

from controller.wire.messages.deck_snapshot import DeckSnapshot

STATE_LINE = "state-line"  # the element, as `panel.css` and `show.css` name it
LONG = 26  # characters; longer text is set smaller
GREEN, BLUE, VIOLET, AMBER, GREY = "#237032", "#1864ab", "#6741d9", "#9c4f00", "#495057"
RED, FAULT = "#c92a2a", "#a61e6b"  # a stop alone is red


def shown_motions(state: DeckSnapshot) -> str:
    """The motion that is played, or all of a blend, as in "walk + jog"."""
    return " + ".join((state.playing, *(part.motion for part in state.blend)))


@dataclass(frozen=True)
class StateLine:
    """The text of the line: state, present motions, next motions, and the colour."""

    word: str
    played: str
    upcoming: str
    colour: str

    def as_html(self) -> str:
        """A box for the page."""
        size = 19 if len(self.played) <= LONG else 16
        played = f'<div style="font-size:{size}px;font-weight:600">{html.escape(self.played) or "&nbsp;"}</div>'
        upcoming = f'<div style="font-size:12px">{html.escape(self.upcoming) or "&nbsp;"}</div>'
        word = f'<div style="font-size:26px;font-weight:800">{html.escape(self.word)}</div>'
        about = f'data-word="{html.escape(self.word)}" style="background:{self.colour}"'
        return f'<div id="{STATE_LINE}" {about}>{word}{played}{upcoming}</div>'


def state_line(state: DeckSnapshot) -> StateLine:
    """The line for a state."""
    upcoming = f"next: {', '.join(state.queue)}" if state.queue else ""
    if state.mode == "emergency stop":
        return StateLine("EMERGENCY STOP", "every joint is held", "Reset releases it", RED)
    if state.fallen:
        remedy = upcoming or "if it stays down: End run, and start it again"
        return StateLine("FALLEN", f"playing {shown_motions(state)}", remedy, FAULT)
    if state.mode == "held":
        return StateLine("HELD", "nothing moves", "choose a motion, or Home", AMBER)
    if state.mode == "home":
        return StateLine("HOME", "at rest, or on the way there", "choose a motion to play on", GREY)
    if state.approaching:
        return StateLine("ON ITS WAY", f"slowly to {state.playing}", upcoming, VIOLET)
    if state.paused:
        return StateLine("PAUSED", shown_motions(state), upcoming, AMBER)
    if state.way:
        return StateLine("ON ITS WAY", " → ".join((state.playing, *state.way)), upcoming, VIOLET)
    if state.blend:
        parts = [f"{100.0 * weight:.0f} % {name}" for name, weight in state.blend]
        return StateLine("BLEND", " + ".join((state.playing, *parts)), upcoming, BLUE)
    if state.switching:
        return StateLine("ON ITS WAY", f"to {state.motion}", upcoming, VIOLET)
    return StateLine("PLAYING", state.playing, upcoming, GREEN)


def ended_line(reason: str) -> StateLine:
    """The line that stays when the run is over."""
    return StateLine("ENDED", reason or "the deck is gone", "start it again with: motiondeck play", GREY)


def button_labels(state: DeckSnapshot, motions: Sequence[str]) -> list[str]:
    """The label of each motion's button: its name, and whether it plays, comes next, or is queued or blended in."""
    parts: dict[str, str] = {}
    for place, name in reversed([*enumerate(state.queue, 1)]):
        parts[name] = f"queued {place}"
    if state.switching:
        parts[state.motion] = "next"
    for name, weight in state.blend:
        parts[name] = f"{100.0 * weight:.0f} %"
    if state.mode == "playing":
        parts[state.playing] = "paused" if state.paused else "playing"
    return [f"{motion} · {parts[motion]}" if motion in parts else motion for motion in motions]
