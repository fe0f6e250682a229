"""What the page shows of recognition: the recognized motion, the confidence, and what is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from controller.motion.rotations import Array

GOOD, UNSURE, BAD = "#2b8a3e", "#868e96", "#c92a2a"
SURE = 0.26  # confidence at which the second expert's error is 1.35 times that of the best one
SHOWN_MISMATCH = 0.25  # s for which another motion must be seen before the page turns red


def what_is_seen(state: dict[str, Array], motions: Sequence[str], joints: Sequence[str]) -> str:
    """A line and a bar, and below them a line for what is wrong.

    Args:
        state: what the deck has published, with the numbers seen (-1 for a body that stands still, -2 where nothing is
            sure), confidence, mismatch_s and stuck.
        motions, joints: the names that seen and stuck count along.
    """
    seen, stuck = int(state["seen"][0]), int(state["stuck"][0])
    share, mismatch = float(state["confidence"][0]), float(state["mismatch_s"][0])
    wrong = mismatch > SHOWN_MISMATCH
    colour = BAD if wrong or stuck >= 0 else GOOD if share >= SURE else UNSURE
    name = escape(motions[seen]) if 0 <= seen < len(motions) else "standing still" if seen == -1 else "nothing sure"
    lines = [
        '<div style="opacity:.6;font-size:11px">it looks like</div>',
        f'<div style="display:flex;justify-content:space-between"><b>{name}</b>'
        f'<span style="font-variant-numeric:tabular-nums">confidence {share:.2f}</span></div>',
        '<div style="background:rgba(128,128,128,.25);border-radius:3px;height:5px;margin:2px 0">'
        f'<div style="background:{colour};border-radius:3px;height:5px;width:{100.0 * share:.0f}%"></div></div>',
    ]
    if wrong:
        lines.append(f'<div style="color:{BAD}">not what was commanded, for {mismatch:.1f} s</div>')
    if 0 <= stuck < len(joints):
        lines.append(f'<div style="color:{BAD}">{escape(joints[stuck])} does not follow</div>')
    return f'<div id="seen" style="padding:2px 14px 6px;font-size:13px;line-height:1.35">{"".join(lines)}</div>'
