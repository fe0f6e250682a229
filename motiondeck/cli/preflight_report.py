"""What `motiondeck preflight` prints: a line for each motion as it is judged, then tables, causes and remedies."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motiondeck.cli.common.tables import show_table

if TYPE_CHECKING:
    from sim.physics.preflight.findings import Finding, PreflightVerdict
    from sim.robots.robot import Robot

REMEDIES = {
    "out of reach": "if the hardware turns farther, widen `lower` and `upper` under \\[limits.joints.NAME] in the "
    "robot file",
    "self-collision": "`play --check-collisions` keeps the bodies apart; if they are slimmer than in the model file, "
    "correct their shapes there",
    "torque": "a stronger servo or a lighter limb; or, if the figure is wrong, the right one: `effort` in a URDF, "
    "`forcerange` in an MJCF, `torque` under \\[limits.joints.NAME] or \\[servo] in the robot file",
    "servo lag": "a faster servo; or, if the figure is wrong, the right `speed` under \\[servo] in the robot file",
    "heat in 10 min": "a stronger servo, a lighter limb, or pauses between the motions",
    "held back": "if the hardware can do more, raise `velocity`, `acceleration` and `jerk` under \\[limits] in the "
    "robot file",
    "physics: off target": "a stronger or stiffer servo: `effort` in a URDF, `kp` and `forcerange` in an MJCF, "
    "\\[servo] in the robot file",
    "off balance": "--balance keeps its feet in place, --walk takes steps, --root gantry carries it",
    "physics: stands": "--balance keeps its feet in place, --walk takes steps, --root gantry carries it",
    "capture point off": "`motiondeck robot tune-walk` finds the settings of its walk",
    "walking: heat in 10 min": "a stronger servo, or a lighter robot",
}
"""What helps when no slower tempo does."""


def print_motion(verdict: PreflightVerdict, tempo: float) -> None:
    """Prints the tempo at which a motion passes, and the checks that it fails at the given one."""
    if verdict.ok:
        _say(f"{verdict.name}: [green]passes[/] at tempo {tempo:g}")
    else:
        passes = "[red]passes at no tempo[/]"
        if verdict.passes_at is not None:
            passes = f"[yellow]passes at tempo {verdict.passes_at:.2f}[/]"
        _say(f"{verdict.name}: {passes}; at {tempo:g} beyond its limit: {_names(verdict.troubles)}")


def print_switch(verdict: PreflightVerdict, tempo: float) -> None:
    """Prints a line for a switch that fails."""
    if not verdict.ok:
        print_motion(verdict, tempo)


def print_summary(verdicts: Sequence[PreflightVerdict], motions: int, report: dict[str, Any], robot: Robot) -> None:
    """Prints all numbers in tables, a row for each motion; what fails at every tempo, and what would help."""
    from rich.console import Console

    held = {"gantry": "on a gantry", "fixed": "fixed"}.get(
        report["root"], "free" + ", balancing" * report["balance"] + ", walking" * report["walk"]
    )
    every = [finding for verdict in verdicts[:motions] for finding in verdict.findings]
    judged = {finding.check for finding in every if finding.limit is not None or finding.check == "speed"}
    title = f"{report['library']} on {report['robot']}, {held}, at tempo {report['tempo']:g}"
    for words, among in ((title, judged), ("for information", {finding.check for finding in every} - judged)):
        units = {finding.check: finding.unit for finding in every if finding.check in among}
        tempo = ("passes at",) if among is judged else ()
        rows = []
        for verdict in verdicts[:motions]:
            found = {finding.check: _cell(finding.value, finding.limit, finding.ok) for finding in verdict.findings}
            passes = (_tempo(verdict),) if among is judged else ()
            rows.append((verdict.name, *passes, *(found.get(check, "-") for check in units)))
        headings = ("", *tempo, *(f"{check}\n[dim]{unit}[/]" for check, unit in units.items()))
        show_table(headings, rows, title=words)
    _print_obstacles(verdicts[:motions])
    console = Console()
    switches = verdicts[motions:]
    if switches:
        right = sum(verdict.ok for verdict in switches)
        console.print(f"{right} of {len(switches)} switches pass at this tempo")
        console.print("Switches by way of other motions are judged by their parts.", style="dim")
    for note in strength_notes(robot):
        console.print(note, highlight=False)
    console.print("Where each number comes from: --json. What it means: docs/physics.md", style="dim")
    if any(verdict.passes_at is not None and not verdict.ok for verdict in verdicts):
        console.print("A number in red is beyond its limit; slower: `tempo TEMPO` at the prompt or with `send`.")


def strength_notes(robot: Robot) -> list[str]:
    """What is not judged because the robot's files have no strength of its servos."""
    if robot.servo is not None:
        return []
    unknown = [name for name, most in zip(robot.joints, robot.strength, strict=True) if not np.isfinite(most)]
    notes = []
    if unknown:
        which = "any joint" if len(unknown) == len(robot.joints) else f"{len(unknown)} of {len(robot.joints)} joints"
        notes.append(
            f"Torque is not judged for {which}: the files of {robot.name} give no limit (URDF: effort; MJCF: "
            "forcerange; robot file: `torque`, \\[servo]), so unlimited torque is assumed."
        )
    return [*notes, f"Heat is not judged: the robot file of {robot.name} has no table \\[servo]."]


def _print_obstacles(verdicts: Sequence[PreflightVerdict]) -> None:
    from rich.console import Console

    blocked = [(verdict.name, finding) for verdict in verdicts for finding in verdict.obstacles]
    if not blocked:
        return
    rows = [
        (name, finding.check, finding.where, f"{_number(finding.value)} {finding.unit}", _limit(finding), finding.cause)
        for name, finding in blocked
    ]
    headings = ("", "check", "where", "measured", "limit", "why")
    if not any(finding.cause for _, finding in blocked):
        headings, rows = headings[:-1], [row[:-1] for row in rows]
    show_table(headings, rows, title="failures at every tempo", left={"check", "where", "why"})
    console = Console(soft_wrap=True)
    for check in dict.fromkeys(finding.check for _, finding in blocked):
        console.print(f"{check}: {REMEDIES[check]}.", highlight=False)


def _names(findings: Sequence[Finding]) -> str:
    return ", ".join(f"{one.check} ({one.where})" if one.where else one.check for one in findings)


def _say(line: str) -> None:
    from rich.console import Console

    Console(soft_wrap=True).print(line, highlight=False)
    sys.stdout.flush()


def _number(value: float) -> str:
    return f"{value:.2f}" if abs(value) < 10.0 else f"{value:.0f}"


def _limit(finding: Finding) -> str:
    return "-" if finding.limit is None else f"{_number(finding.limit)} {finding.unit}"


def _cell(value: float, limit: float | None, ok: bool) -> str:
    words = _number(value)
    return words if limit is None else f"[{'green' if ok else 'red'}]{words}[/]"


def _tempo(verdict: PreflightVerdict) -> str:
    if verdict.passes_at is None:
        return "[red]none[/]"
    return f"[{'green' if verdict.ok else 'yellow'}]{verdict.passes_at:.2f}[/]"
