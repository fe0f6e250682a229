"""Golden traces of a figure: what the deck plays of it in virtual time, to test a player against."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from controller.deck.deck import Deck
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.run_phases import Source, safe_targets
from controller.loop.safety.compiled_envelope import safety_envelope
from controller.loop.stop_requests import StopRequest
from controller.motion.encodings.joint_angles import JointRetargeter
from controller.motion.rotations import Array
from controller.wire.messages.commands import DeckCommand, EmergencyStop, Jump, Pause, Queue, Resume, SetTempo, Switch
from controller.wire.messages.replies import Accepted
from motiondeck.export.figure import Figure

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


def deck_trace(figure: Figure, script: Script, ticks: int, measured: Array | None = None) -> Trace:
    """What the deck plays of a figure, from rest at `measured` (J,), rad, or where its first motion begins."""
    dt, library = 1.0 / figure.rate, figure.library
    retarget = JointRetargeter(library.skeleton, library.skeleton.bones, figure.rest)
    deck, stop = Deck(library, retarget, library.network.motions[0]), StopRequest()
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


def golden_script(motions: Sequence[str]) -> list[tuple[int, DeckCommand]]:
    """Commands of every kind, to be given within LASTS ticks; no angle after them depends on where joints were held."""
    one, other, last = motions[1 % len(motions)], motions[2 % len(motions)], motions[-1]
    return [
        (60, Switch(to=one)),
        (150, SetTempo(factor=1.5, over=0.3)),
        (200, Switch(to=last, direct=True)),
        (215, Switch(to=other, direct=True)),
        (300, SetTempo(factor=-0.8)),
        (400, Jump(phase=0.4)),
        (470, Pause()),
        (500, Switch(to=motions[0], direct=True)),
        (560, Resume()),
        (570, SetTempo(factor=1.0)),
        (600, Queue(to=other)),
        (1100, EmergencyStop()),
    ]


LASTS, EVERY = 1200, 12  # ticks of the golden trace; each EVERY-th is kept
