"""Golden traces of a figure: what the deck plays of it in virtual time, to test a player against."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np

from controller.deck.layers import Layers
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.run_phases import Source, Start, safe_targets
from controller.loop.safety.compiled_envelope import safety_envelope
from controller.loop.stop_requests import StopRequest
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.rotations import Array
from controller.wire.messages import commands
from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.replies import Accepted
from motiondeck.export.figure import Figure
from motiondeck.export.spread_deck import SpreadDeck

Groups = Mapping[str, Sequence[str]]
Script = Sequence[tuple[int, DeckCommand]]
"""Commands, each with the tick before which it is given."""


@dataclass(frozen=True)
class Trace:
    """A run of T ticks and J joints."""

    targets: Array  # of the deck, before the limits, shape (T, J), rad
    safe: Array  # of the envelope, shape (T, J), rad
    accepted: list[bool]  # of each command


def deck_trace(
    figure: Figure, script: Script, ticks: int, measured: Array | None = None, groups: Groups = MappingProxyType({})
) -> Trace:
    """What the deck plays of a figure, from rest at `measured` (J,), rad, or where its first motion begins.

    Layers take each joint, or those of a group.
    """
    dt, library, joints = 1.0 / figure.rate, figure.library, figure.library.skeleton.bones
    retarget = partial(JointRetargeter, library.skeleton, joints, figure.rest)
    deck, stop = SpreadDeck(library, retarget(), library.network.motions[0]), StopRequest()
    deck.layers = Layers(library, joints, figure.limits, groups, retarget)
    source, run = Source(deck, dt), CommandedRun(deck)
    steps = safe_targets(source, [Start(measured)], safety_envelope(figure.limits, dt), stop, np.inf, None)
    due, accepted = list(script), list[bool]()
    targets, safe = np.empty((2, ticks, len(figure.rest)))
    for tick in range(ticks):
        while due and due[0][0] <= tick:
            accepted.append(isinstance(run.carry_out(due.pop(0)[1], stop, remote=False).reply, Accepted))
        safe[tick] = next(steps)
        targets[tick] = source.targets
    return Trace(targets, safe, accepted)


LASTS, EVERY = 1200, 12  # ticks of the golden trace; each EVERY-th is kept


def golden_script(names: Sequence[str]) -> Script:
    """Commands of every kind, within LASTS ticks; no angle after them depends on where joints were held."""
    one, other, last = names[1 % len(names)], names[2 % len(names)], names[-1]
    given: list[DeckCommand] = [
        *(commands.Switch(to=one), commands.SetTempo(factor=1.5, over=0.3), commands.Switch(to=last, direct=True)),
        *(commands.Switch(to=other, direct=True), commands.SetTempo(factor=-0.8), commands.Jump(phase=0.4)),
        *(commands.Pause(), commands.Switch(to=names[0]), commands.Resume(), commands.SetTempo(factor=1.0)),
        *(commands.Queue(to=other), commands.EmergencyStop()),
    ]
    return list(zip((60, 150, 200, 215, 300, 400, 470, 500, 560, 570, 600, 1100), given, strict=True))


def spelled(command: DeckCommand, names: Sequence[str]) -> tuple[str, int, float, float]:
    """A command for a player in C: its letter, the motion, and two numbers."""
    match command:
        case commands.Switch(to=to, direct=direct):
            return "s", names.index(to), float(direct), 0.0
        case commands.Blend(first=first, second=second, weight=weight):
            return "m", names.index(first), weight, float(names.index(second))
        case commands.Queue(to=to):
            return "q", names.index(to), 0.0, 0.0
        case commands.SetTempo(factor=factor, over=over):
            return "t", 0, factor, over
        case commands.Jump(phase=value) | commands.Heartbeat(within=value):
            return ("j" if isinstance(command, commands.Jump) else "h"), 0, value, 0.0
        case _:
            letters = {commands.Pause: "p", commands.Resume: "g", commands.EmergencyStop: "e", commands.Reset: "r"}
            return letters[type(command)], 0, 0.0, 0.0
