"""The loop's figures on the page: rate, lateness, work, lock, and what it has held back."""

from __future__ import annotations

import numpy as np

from controller.motion.rotations import Array
from controller.wire.messages.lock_state import LOCK_SOURCES, LOCK_STAGES, LockState
from motiondeck.page.web.state_line import number_in


def loop_figures(state: dict[str, Array]) -> str:
    """The loop's figures as a small table."""

    def figure(field: str, form: str) -> str:
        value = number_in(state, field, float("nan"))
        return form.format(value) if np.isfinite(value) else "-"

    late = f"{figure('lateness_p50_us', '{:.0f}')} / {figure('lateness_p999_us', '{:.0f} µs')}"
    cells = [
        ("rate", figure("rate_hz", "{:.1f} Hz")),
        ("late p50 / p99.9", late),
        ("work p50", figure("work_p50_us", "{:.0f} µs")),
    ]
    if (lock := _lock(state)) is not None:
        cells.append(("lock", str(lock)))
    if number_in(state, "restarts", 0.0) > 0.0:
        cells.append(("network restarts", figure("restarts", "{:.0f}")))
    if number_in(state, "kept_apart", 0.0) > 0.0:
        cells.append(("limbs kept apart", figure("kept_apart", "{:.0f} times")))
    overruns = number_in(state, "overruns", 0.0)
    word = "On time: no tick was late." if overruns == 0.0 else f"Late: {overruns:.0f} ticks took longer than a period."
    boxes = "".join(
        f'<div><div style="opacity:.6;font-size:11px">{name}</div>'
        f'<div style="font-variant-numeric:tabular-nums;font-weight:600">{value}</div></div>'
        for name, value in cells
    )
    style = (
        "display:grid;grid-template-columns:1fr 1.3fr;gap:2px 12px;padding:2px 14px 6px;font-size:13px;line-height:1.35"
    )
    said = f'<div style="padding:2px 14px;font-size:13px">{word}</div>'
    return f'<div id="health">{said}<div style="{style}">{boxes}</div></div>'


def _lock(state: dict[str, Array]) -> LockState | None:
    """What the phase is locked to, if it is."""
    source, stage = int(number_in(state, "lock_source", -1.0)), int(number_in(state, "lock_stage", -1.0))
    if source < 0 or stage < 0:
        return None
    error, beats = (number_in(state, field, float("nan")) for field in ("lock_error_ms", "beats_per_minute"))
    return LockState(LOCK_SOURCES[source], LOCK_STAGES[stage], _known(error), _known(beats))


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None
