"""What the page shows of a run: of its deck, and of the bodies that are simulated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from controller.cli.session.robots.robot_on_deck import RobotOnDeck
from controller.networks.base import Activation
from controller.rotations import Array
from controller.wire.messages.lock_state import LockState


class Showable(Protocol):
    """What the page shows of a deck."""

    time: float
    direct: bool

    @property
    def commanded_tempo(self) -> float:
        """The tempo that was commanded."""
        ...

    @property
    def phase(self) -> float | None:
        """How far the motion is, from 0 to 1; None if that is not known."""
        ...

    @property
    def activation(self) -> Activation | None:
        """The activation of the network's neurons, shape (N,); None if there are none to look at."""
        ...

    @property
    def lock_state(self) -> LockState | None:
        """What the phase is locked to, if it is."""
        ...

    @property
    def motions(self) -> Sequence[str]:
        """All it can play."""
        ...

    @property
    def motion(self) -> str:
        """What is played, or being switched to."""
        ...

    @property
    def playing(self) -> str:
        """What is played now, perhaps on the way to `motion`."""
        ...

    @property
    def way(self) -> Sequence[str]:
        """The motions that the switch under way has still to begin."""
        ...

    @property
    def queue(self) -> Sequence[str]:
        """The motions that are played after that."""
        ...

    @property
    def blend(self) -> Sequence[tuple[str, float]]:
        """The motions that are blended in, each with its present weight."""
        ...

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        ...

    @property
    def paused(self) -> bool:
        """Whether it stands still on command."""
        ...

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        ...


@runtime_checkable
class Driven(Protocol):
    """A simulated body that servos bring to where it is to be."""

    wanted: Array


@runtime_checkable
class OnFloor(Protocol):
    """A simulated body that stands on a floor."""

    def contact_forces(self, out: Array) -> None:
        """Writes where the floor holds it and how hard, shape (N, 6), m and N; NaN for none."""
        ...


def on_floor(robot: RobotOnDeck) -> OnFloor | None:
    """The simulation of a robot that nothing holds but the floor."""
    simulation = robot.simulation
    if simulation is None or simulation.root != "free" or not isinstance(simulation.stage, OnFloor):
        return None
    return simulation.stage
