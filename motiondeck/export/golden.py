"""Golden traces of a figure: what the deck plays of it in virtual time, to test a player against."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType

import numpy as np

from controller.deck.deck import Deck
from controller.deck.layers import Layers
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.run_phases import Source, safe_targets
from controller.loop.safety.compiled_envelope import safety_envelope
from controller.loop.stop_requests import StopRequest
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.rotations import Array
from controller.wire.messages.commands import (
    DeckCommand,
    EmergencyStop,
    Heartbeat,
    Jump,
    Pause,
    Queue,
    Reset,
    Resume,
    SetTempo,
    Switch,
)
from controller.wire.messages.replies import Accepted
from motiondeck.export.figure import Figure

Groups = Mapping[str, Sequence[str]]
Script = Sequence[tuple[int, DeckCommand]]
"""Commands, each with the tick before which it is given."""


@dataclass(frozen=True)
class Trace:
    """A run of T ticks and J joints."""

    targets: Array  # of the deck, before the limits, shape (T, J), rad
    safe: Array  # of the envelope, shape (T, J), rad
    accepted: list[bool]  # of each command


class _Start:
    """Joints that are measured at the start."""

    held, at_rest = None, True

    def __init__(self, measured: Array | None) -> None:
        self.measured = measured


def deck_trace(
    figure: Figure, script: Script, ticks: int, measured: Array | None = None, groups: Groups = MappingProxyType({})
) -> Trace:
    """What the deck plays of a figure, from rest at `measured` (J,), rad, or where its first motion begins.

    Layers take each joint, or those of a group.
    """
    dt, library, joints = 1.0 / figure.rate, figure.library, figure.library.skeleton.bones
    retarget = partial(JointRetargeter, library.skeleton, joints, figure.rest)
    deck, stop = Deck(library, retarget(), library.network.motions[0]), StopRequest()
    deck.layers = Layers(library, joints, figure.limits, groups, retarget)
    source, run = Source(deck, dt), CommandedRun(deck)
    steps = safe_targets(source, [_Start(measured)], safety_envelope(figure.limits, dt), stop, np.inf, None)
    due, accepted = list(script), list[bool]()
    targets, safe = np.empty((2, ticks, len(figure.rest)))
    for tick in range(ticks):
        while due and due[0][0] <= tick:
            accepted.append(isinstance(run.carry_out(due.pop(0)[1], stop, remote=False).reply, Accepted))
        safe[tick] = next(steps)
        targets[tick] = source.targets
    return Trace(targets, safe, accepted)


def golden_script(names: Sequence[str]) -> list[tuple[int, DeckCommand]]:
    """Commands of every kind, within LASTS ticks; no angle after them depends on where joints were held."""
    one, other, last = names[1 % len(names)], names[2 % len(names)], names[-1]
    first: list[DeckCommand] = [Switch(to=one), SetTempo(factor=1.5, over=0.3), Switch(to=last, direct=True)]
    then = [Switch(to=other, direct=True), SetTempo(factor=-0.8), Jump(phase=0.4), Pause(), Switch(to=names[0])]
    given = [*first, *then, Resume(), SetTempo(factor=1.0), Queue(to=other), EmergencyStop()]
    return list(zip((60, 150, 200, 215, 300, 400, 470, 500, 560, 570, 600, 1100), given, strict=True))


LASTS, EVERY = 1200, 12  # ticks of the golden trace; each EVERY-th is kept
_KINDS = {Switch: "s", Queue: "q", SetTempo: "t", Jump: "j", Pause: "p", Resume: "g", EmergencyStop: "e", Reset: "r"}


def spelled(command: DeckCommand, names: Sequence[str]) -> tuple[str, int, float, float]:
    """A command for a player in C: its letter, the motion, and two numbers."""
    kind = _KINDS.get(type(command), "h")
    match command:
        case Switch(to=to, direct=direct):
            return kind, names.index(to), float(direct), 0.0
        case Queue(to=to):
            return kind, names.index(to), 0.0, 0.0
        case SetTempo(factor=factor, over=over):
            return kind, 0, factor, over
        case Jump(phase=value) | Heartbeat(within=value):
            return kind, 0, value, 0.0
        case _:
            return kind, 0, 0.0, 0.0
