"""`retarget --physical`: recordings as a simulated robot does them on its own feet."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from motiondeck_base.counted import counted

if TYPE_CHECKING:
    from sim.models.robot_file import Solver
    from sim.physical.files import StoodFile
    from sim.robots.training_files import Format


def stand(recordings: Sequence[Path], robot: Path, out: Path, format: Format, solver: Solver | None) -> list[StoodFile]:
    """Looks for each recording's motion on the robot's feet; a terminal shows how far it is."""
    from rich.console import Console
    from rich.progress import Progress, TextColumn, TimeElapsedColumn

    from sim.physical.files import stood_files

    columns = (TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), disable=not sys.stderr.isatty(), transient=True) as bar:
        task = bar.add_task("")

        def progress(name: str, seconds: float) -> None:
            bar.update(task, description=f"{name}: stands for {seconds:.1f} s")

        return [*stood_files(robot, recordings, out, format, solver, progress=progress)]


def report(rows: list[StoodFile], robot: str, out: Path, as_json: bool) -> None:
    """Prints the rows as a table, or as JSON."""
    from motiondeck.cli.common.tables import show_table

    if as_json:
        import msgspec

        print(json.dumps({"robot": robot, "recordings": msgspec.to_builtins(rows)}))
        return
    lines = []
    for row in rows:
        if row.error is None:
            plain = "stands" if row.plain_s is None else f"falls at {row.plain_s:.2f} s"
            found = f"stands, {row.seconds:.1f} s" if row.fell_s is None else f"falls at {row.fell_s:.2f} s"
            lines.append((Path(row.recording).name, plain, found, f"{row.path_m:.2f}", f"{row.pose_deg:.0f}"))
    show_table(("recording", "targets alone", "with offsets", "path m", "pose deg"), lines)
    for row in rows:
        if row.error is not None:
            print(f"failed: {row.error}")
    written = [row for row in rows if row.error is None]
    stands, failed = sum(row.fell_s is None for row in written), len(rows) - len(written)
    print(f"{counted(len(written), 'motion')} in {out}: {stands} to the end on its feet; {failed} failed")
