"""The figures of the loop and of recognition on the page, as HTML."""

from html import escape

from controller.wire.messages.deck_snapshot import DeckSnapshot

GOOD, UNSURE, BAD = "var(--good)", "var(--quiet)", "var(--fault)"
SURE = 0.26  # confidence at which the second expert's error is 1.35 times that of the best one
SHOWN_MISMATCH = 0.25  # s for which another motion must be seen before the page says so
_GRID = "display:grid;grid-template-columns:1fr 1.3fr;gap:2px 12px;padding:2px 14px 6px;font-size:13px;line-height:1.35"


def loop_figures(state: DeckSnapshot) -> str:
    """The loop's figures as a small table."""

    def figure(value: float | None, form: str) -> str:
        return form.format(value) if value is not None else "-"

    health = state.health
    cells = [
        ("rate", f"{state.rate_hz:.1f} Hz"),
        ("late p50 / p99.9", f"{figure(health.late_p50_us, '{:.0f}')} / {figure(health.late_p999_us, '{:.0f} µs')}"),
        ("work p50", figure(health.work_p50_us, "{:.0f} µs")),
    ]
    if state.lock is not None:
        cells.append(("lock", str(state.lock)))
    if state.restarts:
        cells.append(("network restarts", str(state.restarts)))
    if state.kept_apart:
        cells.append(("limbs kept apart", f"{state.kept_apart} times"))
    late = (
        f"Late: {state.overruns} ticks took longer than a period." if state.overruns else "On time: no tick was late."
    )
    boxes = "".join(
        f'<div><div style="color:var(--quiet);font-size:12px">{name}</div>'
        f'<div style="font-variant-numeric:tabular-nums;font-weight:600">{value}</div></div>'
        for name, value in cells
    )
    text = f'<div style="padding:2px 14px;font-size:13px">{late}</div>'
    return f'<div id="health">{text}<div style="{_GRID}">{boxes}</div></div>'


def recognition_text(state: DeckSnapshot, unrecognized: str) -> str:
    """A line and a bar, and below them a line for what is wrong; `unrecognized` stands for no recognized motion."""
    name, share = state.seen or (unrecognized, 0.0)
    wrong = state.mismatch_s > SHOWN_MISMATCH
    colour = BAD if wrong or state.stuck else GOOD if share >= SURE else UNSURE
    lines = [
        '<div style="color:var(--quiet);font-size:12px">it looks like</div>',
        f'<div style="display:flex;justify-content:space-between"><b>{escape(name)}</b>'
        f'<span style="font-variant-numeric:tabular-nums">confidence {share:.2f}</span></div>',
        '<div style="background:rgba(128,128,128,.25);border-radius:3px;height:5px;margin:2px 0">'
        f'<div style="background:{colour};border-radius:3px;height:5px;width:{100.0 * share:.0f}%"></div></div>',
    ]
    if wrong:
        lines.append(f'<div style="color:{BAD}">not what was commanded, for {state.mismatch_s:.1f} s</div>')
    if state.stuck:
        lines.append(f'<div style="color:{BAD}">{escape(state.stuck)} does not follow</div>')
    return f'<div id="seen" style="padding:2px 14px 6px;font-size:13px;line-height:1.35">{"".join(lines)}</div>'
