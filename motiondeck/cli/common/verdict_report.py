"""Verdicts as text: a line for each, how many play, what fails at every tempo, and what helps."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from motiondeck_base.progress import collected
from sim.robots.verdict import QUESTIONS, REMEDIES, Finding, RobotVerdict, summed

MOST_CAUSES, MOST_NAMES = 8, 3  # that are printed of what is wrong


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
    """Prints a line for each verdict, then `print_answers`."""
    for verdict in verdicts:
        print_verdict(verdict)
    print_answers(verdicts, title)


def print_answers(verdicts: Sequence[RobotVerdict], title: str) -> None:
    """Prints how many play and have a yes to each question, failures with their remedies, and what is not judged."""
    answers = [(question, [one.answer_to(question) for one in verdicts]) for question in QUESTIONS]
    yes = [f"{question} {given.count('yes')}" for question, given in answers if {*given} != {"not judged"}]
    print(f"{title}: {summed(verdicts)} ({', '.join(yes)})")
    blocked = [(verdict.name, finding) for verdict in verdicts for finding in verdict.obstacles]
    if blocked:
        print("no tempo mends:")
        print_causes(blocked)
    for check in dict.fromkeys(finding.check for _, finding in blocked):
        print(f"{check}: {REMEDIES[check]}.")
    found = {finding.check: finding for finding in verdicts[0].findings} if verdicts else {}
    if "joints of unknown torque" in found:
        print(
            f"Torque is not judged for {found['joints of unknown torque'].figure}: the robot's files give no limit "
            "(URDF: effort; MJCF: forcerange; robot file: `torque`, [servo]), so unlimited torque is assumed."
        )
    if found and "heat in 10 min" not in found:
        print("Heat is not judged: the robot file has no table [servo].")


def print_causes(found: Iterable[tuple[str, Finding]]) -> None:
    """Prints findings by check and part of the robot, the commonest first, each with the names of the worst."""
    groups = dict[tuple[str, str], list[tuple[str, Finding]]]()
    for name, one in found:
        groups.setdefault((one.check, one.where), []).append((name, one))
    ordered = sorted(groups.values(), key=len, reverse=True)
    for group in ordered[:MOST_CAUSES]:
        (_, worst), *_ = group = sorted(group, key=lambda pair: -pair[1].value)
        limit = f" (limit {worst.limit:g} {worst.unit})" if worst.limit is not None else ""
        names = ", ".join(name for name, _ in group[:MOST_NAMES])
        more = f" and {len(group) - MOST_NAMES} more" if len(group) > MOST_NAMES else ""
        print(f"  {worst.words}{limit}: {names}{more}{worst.cause and f'; {worst.cause}'}")
    if len(ordered) > MOST_CAUSES:
        rest = ordered[MOST_CAUSES:]
        print(f"  and {len(rest)} more causes, in {sum(map(len, rest))}")
