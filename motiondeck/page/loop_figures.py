"""The loop's figures on the page: rate, lateness, work, lock, network restarts, limbs kept apart."""

from __future__ import annotations

from controller.wire.messages.deck_snapshot import DeckSnapshot

_GRID = "display:grid;grid-template-columns:1fr 1.3fr;gap:2px 12px;padding:2px 14px 6px;font-size:13px;line-height:1.35"


def loop_figures(state: DeckSnapshot) -> str:
    """The loop's figures as a small table."""

    def figure(value: float | None, form: str) -> str:
        return form.format(value) if value is not None else "-"

    health = state.health
    late = f"{figure(health.late_p50_us, '{:.0f}')} / {figure(health.late_p999_us, '{:.0f} µs')}"
    cells = [
        ("rate", f"{state.rate_hz:.1f} Hz"),
        ("late p50 / p99.9", late),
        ("work p50", figure(health.work_p50_us, "{:.0f} µs")),
    ]
    if state.lock is not None:
        cells.append(("lock", str(state.lock)))
    if state.restarts:
        cells.append(("network restarts", str(state.restarts)))
    if state.kept_apart:
        cells.append(("limbs kept apart", f"{state.kept_apart} times"))
    late_ticks = state.overruns
    word = f"Late: {late_ticks} ticks took longer than a period." if late_ticks else "On time: no tick was late."
    boxes = "".join(
        f'<div><div style="opacity:.6;font-size:11px">{name}</div>'
        f'<div style="font-variant-numeric:tabular-nums;font-weight:600">{value}</div></div>'
        for name, value in cells
    )
    text = f'<div style="padding:2px 14px;font-size:13px">{word}</div>'
    return f'<div id="health">{text}<div style="{_GRID}">{boxes}</div></div>'
