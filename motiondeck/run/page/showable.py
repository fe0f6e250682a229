"""What the page shows of a run: of its deck, and of the bodies that are simulated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from controller.loop.commands.interfaces import DeckState
from controller.motion.rotations import Array
from controller.networks.base import Activation
from motiondeck.run.robots.robot_on_deck import RobotOnDeck


class Showable(DeckState, Protocol):
    """What the page shows of a deck."""

    direct: bool

    @property
    def commanded_tempo(self) -> float:
        """The tempo that was commanded."""
        ...

    @property
    def activation(self) -> Activation | None:
        """The activation of the network's neurons, shape (N,); None if there are none to look at."""
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
