"""Verdicts as text: a line for each as it is made, then a table, what fails at every tempo, and what helps."""

from collections.abc import Sequence
from pathlib import Path

from motiondeck.cli.common.tables import show_table
from motiondeck_base.progress import collected
from sim.robots.verdict import QUESTIONS, REMEDIES, RobotVerdict, summed

_COLOURS = {"plays": "green", "does not fit": "red", "yes": "green", "not judged": "dim"}


def verdicts_on(robot: str | None, library: Path, names: Sequence[str]) -> list[RobotVerdict]:
    """The verdicts on motions of a library, carried by a gantry, kept or made now; none without a robot."""
    if robot is None:
        return []
    from motiondeck.run.verdicts import Judged

    return collected(Judged.of(library, robot).motions(names), "verdicts", len(names))


def print_verdict(verdict: RobotVerdict) -> None:
    """Prints one line: "walk: at tempo 0.54 (held back: l_knee, 0.31 rad)"."""
    print(f"{verdict.name}: {verdict.words}", flush=True)


def print_verdicts(verdicts: Sequence[RobotVerdict], title: str) -> None:
    """Prints the table of motions, failures at every tempo with their remedies, and what is not judged."""
    rows = [(one.name, _coloured(one.answer), *(_coloured(one.answer_to(q)) for q in QUESTIONS)) for one in verdicts]
    headings = ("", "verdict", *QUESTIONS)
    show_table(headings, rows, title=f"{title}: {summed(verdicts)}", left=headings)
    _print_obstacles(verdicts)
    found = {finding.check: finding for finding in verdicts[0].findings} if verdicts else {}
    if "joints of unknown torque" in found:
        print(
            f"Torque is not judged for {found['joints of unknown torque'].figure}: the robot's files give no limit "
            "(URDF: effort; MJCF: forcerange; robot file: `torque`, [servo]), so unlimited torque is assumed."
        )
    if found and "heat in 10 min" not in found:
        print("Heat is not judged: the robot file has no table [servo].")


def _coloured(words: str) -> str:
    from rich.markup import escape

    colour = _COLOURS.get(words, "yellow" if words.startswith("at tempo") else "red")
    return f"[{colour}]{escape(words)}[/]"


def _print_obstacles(verdicts: Sequence[RobotVerdict]) -> None:
    blocked = [(verdict.name, finding) for verdict in verdicts for finding in verdict.obstacles]
    if not blocked:
        return
    rows = [
        (name, one.check, one.where, one.figure, "-" if one.limit is None else f"{one.limit:g} {one.unit}", one.cause)
        for name, one in blocked
    ]
    headings = ("", "check", "where", "measured", "limit", "why")
    if not any(finding.cause for _, finding in blocked):
        headings, rows = headings[:-1], [row[:-1] for row in rows]
    show_table(headings, rows, title="failures at every tempo", left={"check", "where", "why"})
    for check in dict.fromkeys(finding.check for _, finding in blocked):
        print(f"{check}: {REMEDIES[check]}.")
