"""Judges the motions and switches of a library on a robot, on all cores."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motiondeck.cli.common.options import RootOption

if TYPE_CHECKING:
    from controller.deck.interfaces import JointLimits
    from controller.library.motion_library import MotionLibrary
    from motiondeck_base.jobs import Jobs
    from sim.physics.preflight.findings import PreflightVerdict
    from sim.physics.preflight.preflight import Preflight
    from sim.robots.robot import Robot

PER_PROCESS = 4
"""Motions that are worth the seconds in which another process loads library and robot."""


@dataclass(frozen=True)
class PreflightRun:
    """What is judged: a library on a robot, with its root, perhaps with a rig, at a tempo."""

    library: Annotated[str, typer.Argument(metavar="LIBRARY", help="A library file, or a shipped one by its name.")] = (
        "thesis15"
    )
    robot: Annotated[str, typer.Option("--robot", metavar="ROBOT", help="A robot file, or: mannequin, servo20.")] = (
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
    from motiondeck_base.shipped import find_library, find_robot
    from sim.physics.played_motions import load_sampled_robot
    from sim.physics.preflight.preflight import Preflight

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
