"""`motiondeck preflight`: checks whether a robot can play the motions and switches of a library."""

from __future__ import annotations

import json
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.common.options_class import grouped
from motiondeck.cli.preflight_run import PreflightRun
from motiondeck_base.progress import progress

if TYPE_CHECKING:
    from sim.physics.preflight.findings import PreflightVerdict

SLOWEST = 0.1  # the lowest tempo to judge at


@grouped
def preflight(
    run: PreflightRun,
    jobs: Annotated[
        str | None,
        typer.Option(
            "--jobs",
            metavar="N|dask://HOST:PORT",
            help="Parallel processes, -1 for one per core, or a Dask scheduler; default: as many as save time.",
        ),
    ] = None,
    motions_only: Annotated[bool, typer.Option("--motions-only", help="Check no switches.")] = False,
    as_json: JsonOption = False,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
) -> None:
    """Check whether a robot can play a library, and at which tempo.

    Every motion and every switch is checked against limits of position and speed, torque, heat and self-collision;
    motions are also played in physics. With `--root free` the robot must stand; with `--walk` the table also shows how
    far it goes and how near it is to a fall. The exit code is 1 if a check fails.

    [bold]Examples[/]

      motiondeck preflight thesis15 --robot servo20
      motiondeck preflight thesis15 --robot servo20 --tempo 0.46 --motions-only
      motiondeck preflight cmu86 --robot mannequin --root free --balance --json
      motiondeck preflight thesis15 --robot servo20 --root free --walk --motions-only
    """
    from controller.wire.messages.arguments import TEMPO
    from motiondeck.cli.preflight_report import print_motion, print_summary, print_switch
    from motiondeck.cli.preflight_run import loaded
    from motiondeck.run.sampled_motions import count_switches, switches_by_way_of
    from motiondeck_base.errors import MotiondeckError
    from motiondeck_base.jobs import Jobs
    from sim.physics.physics_model import check_root

    if not SLOWEST <= run.tempo <= TEMPO.highest:
        raise MotiondeckError(f"--tempo {run.tempo:g} is not between {SLOWEST:g} and {TEMPO.highest:g}")
    check_root(run.root, balance=run.balance, walk=run.walk)
    if plot is not None:
        from motiondeck.pictures.figures import check_picture

        check_picture(plot)
    where = Jobs.parse(jobs) if jobs is not None else None
    played, judge = loaded(run)
    names = list(played.network.motions)
    verdicts: list[PreflightVerdict] = []
    with progress("motions", len(names)) as tick:
        for verdict in run.motions(names, where):
            verdicts.append(verdict)
            if not as_json:
                print_motion(verdict, run.tempo)
            tick()
    motions = len(verdicts)
    if not motions_only:
        with progress("switches", count_switches(played)) as tick:
            for verdict in run.switches(names, where):
                verdicts.append(verdict)
                if not as_json:
                    print_switch(verdict, run.tempo)
                tick()
        verdicts += _by_their_parts({v.name: v for v in verdicts}, switches_by_way_of(played))
    report = {
        "library": played.info.name,
        "robot": judge.robot.name,
        "root": run.root,
        "balance": run.balance,
        "walk": run.walk,
        "tempo": run.tempo,
        "ok": all(verdict.ok for verdict in verdicts),
        "motions": [_row(verdict) for verdict in verdicts[:motions]],
        "switches": [_row(verdict) for verdict in verdicts[motions:]],
    }
    if as_json:
        print(json.dumps(report, allow_nan=False))
    else:
        print_summary(verdicts, motions, report, judge.robot)
    if plot is not None:
        from motiondeck.pictures.table_plots import draw

        draw(verdicts[:motions], plot)
    if not report["ok"]:
        raise typer.Exit(1)


def _by_their_parts(
    judged: dict[str, PreflightVerdict], ways: dict[tuple[str, str], tuple[str, ...]]
) -> list[PreflightVerdict]:
    """Switches by way of other motions: the findings of all their parts, and the slowest of their tempos."""
    from sim.physics.preflight.findings import PreflightVerdict

    found = []
    for (source, target), via in ways.items():
        stops = (source, *via, target)
        names = [f"{a} > {b}" for a, b in pairwise(stops)] + list(via)
        parts = [judged[name] for name in names if name in judged]
        tempos = [part.passes_at for part in parts]
        passes = None if None in tempos else min(tempo for tempo in tempos if tempo is not None)
        findings = tuple(finding for part in parts for finding in part.findings)
        found.append(PreflightVerdict(f"{source} > {target}", findings, passes, via))
    return found


def _row(verdict: PreflightVerdict) -> dict[str, Any]:
    # A switch by way of other motions has its findings in the rows of its parts.
    findings = [] if verdict.way else [asdict(finding) for finding in verdict.findings]
    return {
        "name": verdict.name,
        "ok": verdict.ok,
        "passes_at": verdict.passes_at,
        "way": list(verdict.way),
        "troubles": sorted({finding.check for finding in verdict.troubles}),
        "findings": findings,
        "obstacles": [asdict(finding) for finding in verdict.obstacles],
    }
