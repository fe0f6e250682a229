"""The state line of the page: what the deck does now and what comes next, readable across a room."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from controller.motion.rotations import Array
from controller.wire.run_recording import MODES
from motiondeck.page.web.page_style import STATE_LINE

LONG = 26  # characters; longer text is set smaller
GREEN, BLUE, VIOLET, AMBER, RED, GREY = "#2b8a3e", "#1c7ed6", "#7048e8", "#e67700", "#c92a2a", "#495057"


@dataclass(frozen=True)
class RunState:
    """What a deck does.

    Attributes:
        mode: of the joints, one of MODES.
        paused: whether the motion stands still on command.
        motion: the motion that is played or being switched to.
        playing: the motion that is played now.
        way: the motions that the switch under way has still to begin.
        queue: the motions that are played after that.
        blend: the motions that are blended in, each with its weight.
        settled: whether no switch is under way.
        fallen: whether the simulated robot lies on the floor.
        approaching: whether the joints are on their slow way to the motion.
    """

    mode: str = "playing"
    paused: bool = False
    motion: str = ""
    playing: str = ""
    way: tuple[str, ...] = ()
    queue: tuple[str, ...] = ()
    blend: tuple[tuple[str, float], ...] = ()
    settled: bool = True
    fallen: bool = False
    approaching: bool = False

    @classmethod
    def of(cls, state: Mapping[str, Array], motions: Sequence[str]) -> RunState:
        """Reads the shared state of a run, where motions are numbers and none is negative."""

        def names(field: str) -> tuple[str, ...]:
            numbers = state.get(field, np.empty(0))
            return tuple(motions[int(n)] for n in numbers if np.isfinite(n) and 0 <= n < len(motions))

        blended = names("blend")
        weights = state.get("blend_weight", np.empty(0)).tolist()
        motion = next(iter(names("motion")), "")
        return cls(
            mode=MODES[int(number_in(state, "mode", 0.0))],
            paused=bool(number_in(state, "paused", 0.0)),
            motion=motion,
            playing=next(iter(names("playing")), motion),
            way=names("way"),
            queue=names("queue"),
            blend=tuple(zip(blended, weights, strict=False)),
            settled=bool(number_in(state, "settled", 1.0)),
            fallen=bool(number_in(state, "fallen", 0.0)),
            approaching=bool(number_in(state, "approaching", 0.0)),
        )

    @property
    def shown(self) -> str:
        """What is shown now, in few words: a motion, or all of a blend, as in "walk + jog"."""
        return " + ".join((self.playing, *(name for name, _ in self.blend)))


def number_in(state: Mapping[str, Array], field: str, default: float) -> float:
    """One number of the shared state of a run; the default where there is none yet."""
    values = state.get(field)
    return float(values[0]) if values is not None and len(values) and np.isfinite(values[0]) else default


@dataclass(frozen=True)
class StateLine:
    """What is written: one word or two, what is played, what comes next, and the colour of it all."""

    word: str
    played: str
    upcoming: str
    colour: str

    def as_html(self) -> str:
        """A box for the page."""
        size = 19 if len(self.played) <= LONG else 14
        played = f'<div style="font-size:{size}px;font-weight:600">{html.escape(self.played) or "&nbsp;"}</div>'
        upcoming = f'<div style="font-size:12px;opacity:.85">{html.escape(self.upcoming) or "&nbsp;"}</div>'
        word = f'<div style="font-size:26px;font-weight:800">{html.escape(self.word)}</div>'
        about = f'data-word="{html.escape(self.word)}" style="background:{self.colour}"'
        return f'<div id="{STATE_LINE}" {about}>{word}{played}{upcoming}</div>'


def state_line(state: RunState) -> StateLine:
    """The line for a state."""
    upcoming = f"next: {', '.join(state.queue)}" if state.queue else ""
    if state.mode == "emergency stop":
        return StateLine("EMERGENCY STOP", "every joint is held", "Reset releases it", RED)
    if state.fallen:
        return StateLine(
            "FALLEN", f"playing {state.shown}", upcoming or "if it stays down: End run, and start it again", RED
        )
    if state.mode == "held":
        return StateLine("HELD", "nothing moves", "choose a motion, or Home", AMBER)
    if state.mode == "home":
        return StateLine("HOME", "at rest, or on the way there", "choose a motion to play on", GREY)
    if state.approaching:
        return StateLine("ON ITS WAY", f"slowly to {state.playing}", upcoming, VIOLET)
    if state.paused:
        return StateLine("PAUSED", state.shown, upcoming, AMBER)
    if state.way:
        return StateLine("ON ITS WAY", " → ".join((state.playing, *state.way)), upcoming, VIOLET)
    if state.blend:
        parts = [f"{100.0 * weight:.0f} % {name}" for name, weight in state.blend]
        return StateLine("BLEND", " + ".join((state.playing, *parts)), upcoming, BLUE)
    if not state.settled:
        return StateLine("ON ITS WAY", f"to {state.motion}", upcoming, VIOLET)
    return StateLine("PLAYING", state.playing, upcoming, GREEN)


def ended_line(reason: str) -> StateLine:
    """The line that stays when the run is over."""
    return StateLine("ENDED", reason or "the deck is gone", "start it again with: motiondeck play", GREY)


def button_labels(state: RunState, motions: Sequence[str]) -> list[str]:
    """What is written on the button of each motion: its name, and its part in what is played."""
    parts: dict[str, str] = {}
    for place, name in reversed([*enumerate(state.queue, 1)]):
        parts[name] = f"queued {place}"
    if not state.settled:
        parts[state.motion] = "next"
    for name, weight in state.blend:
        parts[name] = f"{100.0 * weight:.0f} %"
    if state.mode == "playing":
        parts[state.playing] = "paused" if state.paused else "playing"
    return [f"{motion} · {parts[motion]}" if motion in parts else motion for motion in motions]
