"""What the page of a show says: the line, the cards of the decks and the cue list, from a state of the show; pure."""

import html

from motiondeck.page.operate import CueRow
from motiondeck.page.web.state_line import AMBER, BLUE, FAULT, GREEN, GREY, RED, VIOLET, StateLine
from motiondeck.shows.messages import ClockHealth, DeckHealth
from motiondeck.shows.show_file import ShowCue
from motiondeck.shows.show_state import DeckRow, ShowState

SILENT_AFTER = 1.0  # s without a word of a deck that is connected
ENDED = StateLine("ENDED", "the conductor is gone", "stop all decks with: motiondeck conduct --stop", GREY)
CONDITIONS = {"here": "all are connected", "settled": "no switch is under way", "in step": "all are in step"}


def show_line(state: ShowState) -> StateLine:
    """What the show does now and what comes next."""
    if state.stopped_by:
        remedies = ("not reached", "has not reached"), ("holds", "reset at each deck")
        lacks = [f"{remedy}: {', '.join(names)}" for stop, remedy in remedies if (names := _at(state, stop))]
        by = "the conductor" if state.stopped_by == "conductor" else state.stopped_by
        remedy = "; ".join(lacks) or "all decks are reset: Go"
        return StateLine("EMERGENCY STOP", f"by {by}", remedy, RED)
    if state.upcoming is None:
        if state.present is None:
            return StateLine("NO CUES", "the decks do what is typed", "", GREY)
        return StateLine("PLAYING", _name(state, state.present), "that was the last cue", GREEN)
    upcoming = _name(state, state.upcoming)
    if state.waits:
        return StateLine("HELD", f"before {upcoming}", "Go brings it", AMBER)
    when = _when_next(state.cues[state.upcoming], state.seconds)
    if state.present is None:
        return StateLine("READY", f"first {upcoming}", when, VIOLET)
    return StateLine("PLAYING", _name(state, state.present), f"next {upcoming} {when}", GREEN)


def silent_line(show: str, seconds: float) -> StateLine:
    """The line while the conductor says nothing."""
    remedy = "stop all decks with: motiondeck conduct --stop" if show else "it is starting"
    return StateLine("NO ANSWER", f"of the conductor for {seconds:.0f} s", remedy, FAULT if show else GREY)


def deck_cards(state: ShowState) -> str:
    """A card for each deck, as HTML."""
    cards = "".join(_card(deck) for deck in state.decks)
    return f'<div id="decks">{cards or "<p>No deck has been seen. Start some with: motiondeck play --show</p>"}</div>'


def cue_table(state: ShowState) -> str:
    """The cue list, with the present cue and the next one marked, as HTML."""
    rows = "".join(
        f'<tr class="{row[0]}">' + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>"
        for row in (_cue(state, *numbered) for numbered in enumerate(state.cues))
    )
    return f'<table id="cues">{rows}</table>'


def cue_rows(state: ShowState) -> list[CueRow]:
    """The cue list in big letters: when each comes, and what it says to whom."""
    rows = (_cue(state, *numbered) for numbered in enumerate(state.cues))
    return [CueRow(mark, name or f"cue {no}", f"{when} · {to}: {said}") for mark, no, name, when, to, said in rows]


def _at(state: ShowState, stop: str) -> list[str]:
    return [deck.name for deck in state.decks if deck.here and deck.stop == stop]


def _name(state: ShowState, number: int) -> str:
    name = state.cues[number].name
    return f'"{name}"' if name else f"cue {number + 1}"


def _when_next(cue: ShowCue, seconds: float | None) -> str:
    if seconds is not None:
        return f"in {seconds:.0f} s"
    return f"as soon as {CONDITIONS[cue.when]}" if cue.when is not None else "at Go"


def _card(deck: DeckRow) -> str:
    word, colour = doing(deck)
    lines = [" · ".join(what for what in (deck.robot, deck.library, deck.host) if what)]
    if deck.health is not None:
        lines += [_phase(deck.health), _clock(deck.health.clock), f"heard {max(deck.heard_ago, 0.0):.1f} s ago"]
    if deck.losses > 1 or (deck.losses and deck.here):
        lines.append(f"gone so far: {deck.losses}")
    problem = deck.health.problem if deck.health is not None else ""
    said = "".join(f"<div>{html.escape(line)}</div>" for line in lines if line)
    said += f'<div class="problem">last problem: {html.escape(problem)}</div>' if problem else ""
    title = f'<b>{html.escape(deck.name)}</b><strong style="background:{colour}">{html.escape(word)}</strong>'
    return f'<div style="border-color:{colour}">{title}{said}</div>'


def doing(deck: DeckRow) -> tuple[str, str]:
    """What a deck does, and the colour of that."""
    health = deck.health
    if not deck.here:
        return ("GONE", FAULT) if deck.losses else ("not here yet", AMBER)
    if health is None:
        return "says nothing yet", AMBER
    if health.mode == "emergency stop":
        return "EMERGENCY STOP", RED
    if deck.stop == "not reached":
        return "STOP NOT REACHED", FAULT
    if deck.heard_ago > SILENT_AFTER:
        return f"SILENT for {deck.heard_ago:.0f} s", FAULT
    if health.mode != "playing":
        return health.mode, AMBER if health.mode == "held" else GREY
    if health.paused:
        return f"paused in {health.motion}", AMBER
    return (f"to {health.motion}", BLUE) if health.switching else (f"plays {health.motion}", GREEN)


def _phase(health: DeckHealth) -> str:
    at = f"phase {health.phase:.2f}" if health.phase is not None else "no phase"
    off = health.lock.partition("(")[1:]
    step = "in step " if health.lock.startswith("locked") else "not in step " if health.lock else "not locked"
    return f"{step}{''.join(off)} · {at}"


def _clock(clock: ClockHealth | None) -> str:
    if clock is None:
        return "clock unknown"
    offset = f"{clock.offset_s:+.3f} s" if abs(clock.offset_s) >= 1.0 else f"{1e3 * clock.offset_s:+.2f} ms"
    return f"clock {offset} ± {clock.uncertainty_ms:.2f} ms, drift {clock.drift_ppm:+.0f} ppm"


def _cue(state: ShowState, number: int, cue: ShowCue) -> tuple[str, str, str, str, str, str]:
    mark = "now" if number == state.present else "next" if number == state.upcoming else ""
    when = f"{cue.at:g} s" if cue.at is not None else "at Go" if cue.hold else f"when {CONDITIONS[cue.when or 'here']}"
    said = "; ".join([cue.say] if isinstance(cue.say, str) else cue.say)
    step = "" if cue.in_step is False else ", in step"
    return mark, str(number + 1), cue.name, when, ", ".join(cue.receivers), said + step
