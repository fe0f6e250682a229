"""The run of a library or a taught clip on a robot or a rig, as `motiondeck play` and `motiondeck.play` start it."""

import sys
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial

from controller.deck.deck import Deck
from controller.deck.interfaces import Retargeter
from controller.library.motion_library import MotionLibrary
from controller.loop.commands.interfaces import PlayableDeck
from controller.motion.clip import Clip
from motiondeck.run.assembly import open_session
from motiondeck.run.baked_libraries import find_baked
from motiondeck.run.robots.robot_on_deck import open_robots, robot_files, with_robot
from motiondeck.run.session import ALONE, Host, Played, Session
from motiondeck.run.spec.program import Program, checked_rate
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck.run.verdicts import Judged
from sim.robots.verdict import RobotVerdict


def library_run(spec: RunSpec, program: Program, host: Host = ALONE) -> AbstractContextManager[Session]:
    """An open run of a program in the block; MotiondeckError if it is too fast for the network, or cannot be opened."""
    source, first, rate, spec = program.source, program.first, spec.rate, with_robot(spec, program.source.skeleton)
    files = robot_files(spec) if program.file is not None and spec.robot is not None else None
    played, learned_from = program.file, None
    if isinstance(source, MotionLibrary):
        if program.file is not None and files is not None:
            source, played = find_baked(spec, program.file, files[0]) or (source, played)
        if program.file is not None:
            sources = {motion.name: motion.source for motion in source.info.motions}
            learned_from = program.file.parent / sources[first]
        rate = checked_rate(source, first, spec.rate, lower=spec.lower_rate)
    if rate != spec.rate:
        print(f"playing at {rate:g} Hz, which the network can hold", file=sys.stderr)
    spec = replace(spec, rate=rate, seconds=program.seconds)

    def deck(retarget: Retargeter) -> PlayableDeck:
        if isinstance(source, Clip):
            from motiondeck.run.robots.rig_on_deck import recorded_deck

            return recorded_deck(source, retarget)
        return Deck(source, retarget, first, direct=spec.direct, joining=spec.join)

    verdicts = dict[str, RobotVerdict]()
    if program.file is not None and files is not None:
        judged = Judged(program.file, *files, spec.root, spec.balance, spec.walk)
        verdicts = judged.kept() or (replace(judged, rig=None).kept() if judged.rig is not None else {})
    robots = partial(open_robots, spec=spec, source=source, first=learned_from)
    run = Played(source, robots, deck, program.timeline, program.file, played, verdicts)
    return open_session(spec, run, host)
