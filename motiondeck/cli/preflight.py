"""`motiondeck preflight`: checks whether a robot can play the motions and switches of a library."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motiondeck.cli.common.options import JsonOption, RootOption, check_plot
from motiondeck.cli.common.options_class import grouped
from motiondeck_base.progress import progress

if TYPE_CHECKING:
    from controller.deck.interfaces import JointLimits
    from controller.library.motion_library import MotionLibrary
    from motiondeck_base.jobs import Jobs
    from sim.physics.preflight.findings import PreflightVerdict
    from sim.physics.preflight.preflight import Preflight
    from sim.robots.robot import Robot

SLOWEST = 0.1  # the lowest tempo to judge at


PER_PROCESS = 4  # motions that are worth the seconds in which another process loads library and robot


@dataclass(frozen=True)
class PreflightRun:
    """What is judged: a library on a robot, with its root, perhaps with a rig, at a tempo."""

    library: Annotated[str, typer.Argument(metavar="LIBRARY", help="A library file, or a shipped one by its name.")] = (
        "thesis15"
    )
    robot: Annotated[str, typer.Option("--robot", metavar="ROBOT", help="A robot file or a name (`robot list`).")] = (
        "servo20"
    )
    rig: Annotated[
        str | None,
        typer.Option(
            "--rig", metavar="RIG", help="A rig file, whose limits of position, velocity and current apply too."
        ),
    ] = None
    root: RootOption = "gantry"
    balance: Annotated[
        bool, typer.Option("--balance", help="A free robot keeps its feet in place and its centre of mass above them.")
    ] = False
    walk: Annotated[bool, typer.Option("--walk", help="A free robot walks where the motion goes.")] = False
    tempo: Annotated[float, typer.Option("--tempo", metavar="TEMPO", help="The tempo to judge at, 0.1 to 3.")] = 1.0

    def motions(self, names: Sequence[str], jobs: Jobs | None = None) -> Iterator[PreflightVerdict]:
        """Verdicts on motions, in order, each as soon as it is known; they are played in physics too."""
        for verdicts in self._spread(_motion, names, jobs):
            yield from verdicts

    def switches(self, names: Sequence[str], jobs: Jobs | None = None) -> Iterator[PreflightVerdict]:
        """Verdicts on the direct switches from motions, in order, each as soon as it is known."""
        for verdicts in self._spread(_switches, names, jobs):
            yield from verdicts

    def _spread(self, judge: Any, names: Sequence[str], jobs: Jobs | None) -> Iterator[list[PreflightVerdict]]:
        from joblib import cpu_count, delayed

        from motiondeck_base.jobs import Jobs, spread

        where = jobs or Jobs(max(1, min(cpu_count(), len(names) // PER_PROCESS)))
        yield from spread((delayed(judge)(self, name) for name in names), where, ordered=True)


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
    import msgspec

    from controller.wire.messages.arguments import TEMPO
    from motiondeck.cli.common.library_report import print_errors
    from motiondeck.cli.preflight_report import print_motion, print_summary, print_switch
    from motiondeck.run.sampled_motions import count_switches, switches_by_way_of
    from motiondeck_base.errors import MotiondeckError
    from motiondeck_base.jobs import Jobs
    from sim.physics.physics_model import check_root

    if not SLOWEST <= run.tempo <= TEMPO.highest:
        raise MotiondeckError(f"--tempo {run.tempo:g} is not between {SLOWEST:g} and {TEMPO.highest:g}")
    check_root(run.root, balance=run.balance, walk=run.walk)
    check_plot(plot)
    where = Jobs.parse(jobs) if jobs is not None else None
    played, judge = loaded(run)
    names = list(played.network.motions)
    verdicts: list[PreflightVerdict] = []

    def take(
        what: str, count: int, judged: Iterable[PreflightVerdict], show: Callable[[PreflightVerdict, float], None]
    ) -> None:
        with progress(what, count) as tick:
            for verdict in judged:
                verdicts.append(verdict)
                if not as_json:
                    show(verdict, run.tempo)
                tick()

    take("motions", len(names), run.motions(names, where), print_motion)
    motions = len(verdicts)
    if not motions_only:
        take("switches", count_switches(played), run.switches(names, where), print_switch)
        verdicts += _by_their_parts({v.name: v for v in verdicts}, switches_by_way_of(played))
    learned = {motion.name: msgspec.to_builtins(motion.against_recording) for motion in played.info.motions}
    report = {
        "library": played.info.name,
        "robot": judge.robot.name,
        "root": run.root,
        "balance": run.balance,
        "walk": run.walk,
        "tempo": run.tempo,
        "ok": all(verdict.ok for verdict in verdicts),
        "motions": [_row(verdict) | {"against_recording": learned[verdict.name]} for verdict in verdicts[:motions]],
        "switches": [_row(verdict) for verdict in verdicts[motions:]],
    }
    if as_json:
        print(json.dumps(report, allow_nan=False))
    else:
        print_summary(verdicts, motions, report, judge.robot)
        print_errors(played.info.motions)
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


def _motion(run: PreflightRun, name: str) -> list[PreflightVerdict]:
    from motiondeck.run.sampled_motions import play_motions

    library, judge = loaded(run)
    return [judge.judge(one, simulate=True, tempo=run.tempo) for one in play_motions(library, judge.robot, [name])]


def _switches(run: PreflightRun, source: str) -> list[PreflightVerdict]:
    from motiondeck.run.sampled_motions import play_switches

    library, judge = loaded(run)
    return [judge.judge(one, simulate=False, tempo=run.tempo) for one in play_switches(library, judge.robot, [source])]


@lru_cache(maxsize=1)
def loaded(run: PreflightRun) -> tuple[MotionLibrary, Preflight]:
    """The library, and the judge of its motions on the robot; raises a MotiondeckError if a file cannot be used."""
    from controller.library.motion_library import load_library
    from controller.loop.safety.safety_envelope import SafetyEnvelope
    from motiondeck_base.shipped import find_library
    from sim.physics.played_motions import load_sampled_robot
    from sim.physics.preflight.preflight import Preflight
    from sim.robots.catalogue import find_robot

    library = load_library(find_library(run.library))
    body, limits = on_rig(load_sampled_robot(find_robot(run.robot), library.skeleton), run.rig)
    return library, Preflight(body, limits, SafetyEnvelope, run.root, run.balance, run.walk)


def on_rig(body: Robot, rig: str | None) -> tuple[Robot, JointLimits]:
    """The robot with the servos of a rig, and the limits that both allow."""
    if rig is None:
        return body, body.limits
    import msgspec

    from hardware.rig.rig_file import load_rig
    from motiondeck.run.robots.rig_output import narrowed
    from motiondeck_base.shipped import find_rig

    config = load_rig(find_rig(rig))
    servo = body.servo
    if servo is not None:
        currents = [joint.current for joint in config.joints if joint.current > 0.0]
        servo = msgspec.structs.replace(
            servo,
            current_limit=min([*currents, servo.current_limit or servo.current]),
            hottest=min(servo.hottest, *(joint.hottest for joint in config.joints)),
        )
    elif any(joint.current > 0.0 for joint in config.joints):
        print(
            f"the rig's current limits are not applied: the file of {body.name} has no table [servo] with the torque "
            "of a current",
            file=sys.stderr,
        )
    return replace(body, servo=servo), narrowed(body.limits, body, config)
