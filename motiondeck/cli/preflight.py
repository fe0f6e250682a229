"""`motiondeck preflight`: checks whether a robot can play the motions and switches of a library."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from typer import Argument, Option

from motiondeck.cli.common.options import JsonOption, RootOption

if TYPE_CHECKING:
    from sim.robots.verdict import RobotVerdict


def preflight(
    library: Annotated[str, Argument(metavar="LIBRARY", help="A library file, or a shipped one's name.")] = "thesis15",
    robot: Annotated[str, Option(metavar="ROBOT", help="A robot file or a name (`robot list`).")] = "servo20",
    rig: Annotated[str | None, Option(metavar="RIG", help="A rig file, whose limits apply too.")] = None,
    root: RootOption = "gantry",
    balance: Annotated[bool, Option("--balance", help="A free robot's feet stay, its centre of mass above.")] = False,
    walk: Annotated[bool, Option("--walk", help="A free robot walks where the motion goes.")] = False,
    tempo: Annotated[float, Option(metavar="TEMPO", help="The tempo to judge at, 0.1 to 3.")] = 1.0,
    jobs: Annotated[
        str | None,
        Option(
            metavar="N|dask://HOST:PORT",
            help="Parallel processes, -1 for one per core, or a Dask scheduler; default: as many as save time.",
        ),
    ] = None,
    motions_only: Annotated[bool, Option("--motions-only", help="Check no switches.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Check whether a robot can play a library, and at which tempo.

    Every motion and every switch is checked against limits of position and speed, torque, heat and self-collision; of
    motions also how limbs point, and they are played in physics. With `--root free` the robot must stand. Verdicts are
    kept beside the robot file until library, robot or program change. The exit code is 1 if a check fails.

    [bold]Examples[/]

      motiondeck preflight thesis15 --robot servo20
      motiondeck preflight thesis15 --robot servo20 --tempo 0.46 --motions-only
      motiondeck preflight cmu86 --robot mannequin --root free --balance --json
      motiondeck preflight thesis15 --robot servo20 --root free --walk --motions-only
    """
    from controller.library.motion_library import load_library
    from controller.wire.messages.arguments import TEMPO
    from motiondeck.cli.common.verdict_report import print_answers, print_causes, print_verdict
    from motiondeck.run.verdicts import Judged
    from motiondeck_base.errors import MotiondeckError
    from motiondeck_base.jobs import Jobs
    from motiondeck_base.progress import collected
    from sim.physics.physics_model import check_root
    from sim.robots.verdict import SLOWEST, summed

    if not SLOWEST <= tempo <= TEMPO.highest:
        raise MotiondeckError(f"--tempo {tempo:g} is not between {SLOWEST:g} and {TEMPO.highest:g}")
    check_root(root, balance=balance, walk=walk)
    where = Jobs.parse(jobs) if jobs is not None else None
    judged = Judged.of(library, robot, rig, root=root, balance=balance, walk=walk, tempo=tempo)
    played = load_library(judged.library)
    names, learned = list(played.network.motions), {motion.name: motion for motion in played.info.motions}
    motions = collected(judged.motions(names, where), "motions", len(names), None if as_json else print_verdict)
    switches: list[RobotVerdict] = []
    if not motions_only:
        from motiondeck.run.sampled_motions import switches_by_way_of

        direct, ways = judged.switches(names, where), switches_by_way_of(played)
        count = len(names) * (len(names) - 1) - len(ways)
        switches = collected(direct, "switches", count)
        switches += _by_their_parts({v.name: v for v in (*motions, *switches)}, ways, tempo)
    ok = all(verdict.ok for verdict in (*motions, *switches))
    errors = {name: msgspec.to_builtins(motion.against_recording) for name, motion in learned.items()}
    report = {
        "library": played.info.name,
        "robot": judged.robot.stem,
        "root": root,
        "balance": balance,
        "walk": walk,
        "tempo": tempo,
        "ok": ok,
        "motions": [verdict.row() | {"against_recording": errors[verdict.name]} for verdict in motions],
        "switches": [verdict.row() for verdict in switches],
    }
    if as_json:
        print(json.dumps(report, allow_nan=False))
    else:
        held = "free" + ", balancing" * balance + ", walking" * walk if root == "free" else root
        print_answers(motions, f"{played.info.name} on {judged.robot.stem} ({held}), at tempo {tempo:g}")
        if switches:
            print(f"switches: {summed(switches)}; those by way of other motions are judged by their parts")
            wrong = (one for one in switches if not one.ok and not one.way)
            print_causes((one.name, (one.obstacles or one.troubles)[0]) for one in wrong)
        print('All that was measured: --json. What it means: the page "Physics". Slower: `tempo TEMPO` at the prompt.')
    if not ok:
        raise typer.Exit(1)


def _by_their_parts(
    judged: dict[str, RobotVerdict], ways: dict[tuple[str, str], tuple[str, ...]], tempo: float
) -> list[RobotVerdict]:
    """Switches by way of other motions: the findings of all their parts, and the slowest of their tempos."""
    from sim.robots.verdict import RobotVerdict

    found = []
    for (source, target), via in ways.items():
        stops = (source, *via, target)
        names = [f"{a} > {b}" for a, b in pairwise(stops)] + list(via)
        parts = [judged[name] for name in names if name in judged]
        tempos = [part.passes_at for part in parts]
        passes = None if None in tempos else min(tempo for tempo in tempos if tempo is not None)
        findings, obstacles = (tuple(f for part in parts for f in getattr(part, n)) for n in ("findings", "obstacles"))
        found.append(RobotVerdict(f"{source} > {target}", findings, passes, via, obstacles, tempo))
    return found
