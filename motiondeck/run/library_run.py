"""The run of a library on a robot, as `motiondeck play` and `motiondeck.play` start it."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from controller.deck.deck import Deck
from motiondeck.run.assembly import ALONE, Host, Played, open_session
from motiondeck.run.robots.robot_on_deck import open_robots, robot_files
from motiondeck.run.session import Session
from motiondeck.run.spec.program import Program, checked_rate
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck.run.verdicts import Judged


@contextmanager
def library_run(spec: RunSpec, program: Program, host: Host = ALONE) -> Iterator[Session]:
    """An open run of a program in the block; MotiondeckError if it is too fast for the network, or cannot be opened."""
    library, first = program.library, program.first
    rate = checked_rate(library, first, spec.rate, lower=spec.lower_rate)
    if rate != spec.rate:
        print(f"playing at {rate:g} Hz, which the network can hold", file=sys.stderr)
    spec = replace(spec, rate=rate, seconds=program.seconds)
    judged = Judged(program.file, *robot_files(spec), spec.root, spec.balance, spec.walk)
    played = Played(
        library,
        lambda opening: open_robots(opening, spec, library),
        lambda retarget: Deck(library, retarget, first, direct=spec.direct, joining=spec.join),
        program.timeline,
        program.file,
        judged.kept() or (replace(judged, rig=None).kept() if judged.rig is not None else {}),
    )
    with open_session(spec, played, host) as session:
        yield session
