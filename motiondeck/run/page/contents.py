"""What the page of a run shows: its description, and which arrays go with every picture."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

from controller.motion.rotations import Array
from controller.motion.skeleton import Skeleton
from controller.networks.base import Activation
from controller.wire.messages.deck_snapshot import DeckState
from controller.wire.snapshot_numbers import SnapshotNumbers
from motiondeck.page.web.page_state import STANDS_STILL, UNCERTAIN, GhostDescription, PageDescription, PictureArrays
from motiondeck.run.recognition.watches import BodyWatch, Watch
from motiondeck.run.robots.rig_output import RigOutput
from motiondeck.run.robots.robot_on_deck import RobotOnDeck, Simulation
from sim.robots.verdict import RobotVerdict

MOST_FORCES = 6  # parts of the body that touch the floor
SERVO_ROWS = 8  # of `ServoStates`


class ShownDeck(DeckState, Protocol):
    """A deck as the page shows it."""

    direct: bool

    @property
    def activation(self) -> Activation | None:
        """The activation of the network's neurons, shape (N,); None for a network without neurons."""
        ...


@runtime_checkable
class Driven(Protocol):
    """A simulated body that servos drive; `wanted` is their target as qpos, shape (nq,)."""

    wanted: Array


@runtime_checkable
class OnFloor(Protocol):
    """A simulated body that stands on a floor."""

    def contact_forces(self, out: Array) -> None:
        """Writes contact points, m, and forces, N, shape (N, 6); NaN for none."""


def on_floor(robot: RobotOnDeck) -> OnFloor | None:
    """The simulation of a robot that nothing holds but the floor."""
    simulation = robot.simulation
    if simulation.root != "free" or not isinstance(simulation.stage, OnFloor):
        return None
    return simulation.stage


@dataclass(frozen=True)
class PageContents:
    """The parts of a run that its page shows."""

    deck: ShownDeck
    robots: Sequence[RobotOnDeck]  # at least one
    human: Skeleton | None  # the skeleton whose motion is shown beside the robot, if that is known
    watch: Watch | None
    command_port: int
    library: Path | None  # the file of what plays, if it is a library; the view finds the network there
    servos: RigOutput | None
    learns: bool  # whether recordings can be learned on the page, in a process beside it
    verdicts: Mapping[str, RobotVerdict] = field(default_factory=dict[str, RobotVerdict])  # by motion, those kept

    @property
    def simulations(self) -> list[Simulation]:
        """Of the robots, in order."""
        return [robot.simulation for robot in self.robots]

    @property
    def numbers(self) -> SnapshotNumbers:
        """The snapshots of this run as numbers."""
        recognizable = self.watch.names if self.watch is not None else ()
        return SnapshotNumbers(self.deck.motions, recognizable=recognizable, joints=self.robots[0].own_joints)

    @property
    def arrays(self) -> PictureArrays:
        """Empty arrays of the shapes that a picture of this run has."""
        first, *others = self.simulations
        size, human, floor = first.robot.model.nq, self.human, on_floor(self.robots[0])
        activation = self.deck.activation if self.library is not None else None
        return PictureArrays(
            qpos=np.zeros(size),
            follower=np.zeros(others[0].robot.model.nq) if others else None,
            human_root=np.zeros(3) if human is not None else None,
            human_rotation=np.zeros((1 + len(human), 4)) if human is not None else None,
            target=np.zeros(size) if isinstance(first.stage, Driven) else None,
            contacts=np.zeros((MOST_FORCES, 6)) if floor is not None else None,
            activation=np.zeros(len(activation)) if activation is not None else None,
            servos=np.zeros((SERVO_ROWS, self.servos.count)) if self.servos is not None else None,
        )

    def description(self, models: Sequence[Path], human: GhostDescription | None) -> PageDescription:
        """The run for its page; the models of the robots are files."""
        from sim.models.gravity import GRAVITY
        from sim.physics.pushes import usual_push

        deck, robot = self.deck, self.simulations[0].robot
        rest = robot.model.qpos0.copy()
        robot.layout.place(robot.rest, rest)
        library = str(self.library.resolve()) if self.library is not None else None
        standing = on_floor(self.robots[0]) is not None
        return PageDescription(
            model_file=str(models[0]),
            follower_file=str(models[1]) if len(models) > 1 else None,
            rest=rest.tolist(),
            robot=robot.name,
            motions=list(deck.motions),
            joints=list(robot.joints),
            recognizable=list(self.watch.names) if self.watch is not None else [],
            unrecognized=UNCERTAIN if isinstance(self.watch, BodyWatch) else STANDS_STILL,
            command_port=self.command_port,
            direct=deck.direct,
            has_phase=deck.phase is not None,
            has_network=library is not None and (deck.activation is not None or deck.phase is not None),
            library_file=library,
            learn=[sys.executable, "-P", "-m", "motiondeck.run.page.learning"] if self.learns and library else [],
            groups=[*self.robots[0].groups] if not self.robots[0].why_no_layers else [],
            human=human,
            walks=self.simulations[0].root != "fixed",
            weight=GRAVITY * float(robot.model.body_mass.sum()) if standing else None,
            push_ns=usual_push(robot.model) if self.robots[0].pushable is not None else 0.0,
            verdicts={name: (verdict.answer, verdict.words) for name, verdict in self.verdicts.items()},
            rig=self.servos.description if self.servos is not None else None,
            shapes=self.arrays.shapes,
        )
