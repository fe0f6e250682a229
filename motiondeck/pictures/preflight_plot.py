"""A preflight as a picture: a field a motion and check, coloured by how near to its limit the number is."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from motiondeck.pictures.figures import new_figure, save

if TYPE_CHECKING:
    from sim.physics.preflight.findings import PreflightVerdict


def draw(verdicts: Sequence[PreflightVerdict], path: Path) -> None:
    """Draws the checks that have a limit, as shares of it, and the tempo at which each motion passes.

    Raises:
        MotiondeckError: if the file cannot be written.
    """
    limited = [f for f in verdicts[0].findings if f.limit is not None]
    checks = [finding.check for finding in limited]
    share = np.zeros((len(verdicts), len(checks)))
    figure = new_figure(2.5 + 0.95 * len(checks), 1.8 + 0.33 * len(verdicts))
    axes = figure.add_subplot()
    for row, verdict in enumerate(verdicts):
        by_check = {finding.check: finding for finding in verdict.findings}
        for column, check in enumerate(checks):
            found = by_check[check]
            assert found.limit is not None
            share[row, column] = found.value / found.limit
            if check == "physics: stands":  # here more is better
                share[row, column] = 2.0 - found.value / found.limit if not found.ok else 0.0
            words = f"{found.value:.2f}" if abs(found.value) < 10.0 else f"{found.value:.0f}"
            axes.text(column, row, words, ha="center", va="center", fontsize=8)
        passes = "no tempo" if verdict.passes_at is None else f"{verdict.passes_at:.2f}"
        axes.text(len(checks) - 0.4, row, passes, va="center", fontsize=8, weight="normal" if verdict.ok else "bold")
    axes.imshow(np.clip(share, 0.0, 2.0), cmap="RdYlGn_r", vmin=0.0, vmax=2.0, aspect="auto", alpha=0.75)
    axes.set_xticks(range(len(checks)), [f"{f.check}\n{f.unit}, limit {f.limit:g}" for f in limited], fontsize=8)
    axes.tick_params(axis="x", rotation=30)
    axes.set_yticks(range(len(verdicts)), [verdict.name for verdict in verdicts], fontsize=8)
    axes.text(len(checks) - 0.4, -0.8, "passes at", fontsize=8)
    save(figure, path)
