"""What the page shows of recognition: the recognized motion, the confidence, and what is wrong."""

from __future__ import annotations

from html import escape

from controller.wire.messages.deck_snapshot import DeckSnapshot

GOOD, UNSURE, BAD = "#2b8a3e", "#868e96", "#c92a2a"
SURE = 0.26  # confidence at which the second expert's error is 1.35 times that of the best one
SHOWN_MISMATCH = 0.25  # s for which another motion must be seen before the page turns red


def recognition_text(state: DeckSnapshot, unrecognized: str) -> str:
    """A line and a bar, and below them a line for what is wrong; `unrecognized` stands for no recognized motion."""
    name, share = state.seen or (unrecognized, 0.0)
    wrong = state.mismatch_s > SHOWN_MISMATCH
    colour = BAD if wrong or state.stuck else GOOD if share >= SURE else UNSURE
    name = escape(name)
    lines = [
        '<div style="opacity:.6;font-size:11px">it looks like</div>',
        f'<div style="display:flex;justify-content:space-between"><b>{name}</b>'
        f'<span style="font-variant-numeric:tabular-nums">confidence {share:.2f}</span></div>',
        '<div style="background:rgba(128,128,128,.25);border-radius:3px;height:5px;margin:2px 0">'
        f'<div style="background:{colour};border-radius:3px;height:5px;width:{100.0 * share:.0f}%"></div></div>',
    ]
    if wrong:
        lines.append(f'<div style="color:{BAD}">not what was commanded, for {state.mismatch_s:.1f} s</div>')
    if state.stuck:
        lines.append(f'<div style="color:{BAD}">{escape(state.stuck)} does not follow</div>')
    return f'<div id="seen" style="padding:2px 14px 6px;font-size:13px;line-height:1.35">{"".join(lines)}</div>'
