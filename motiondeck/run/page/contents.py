"""What the page of a run is told once, and which numbers it gets with every picture."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from controller.motion.skeleton import Skeleton
from controller.wire.messages.blends import MOST_BLENDED
from motiondeck.run.page.showable import Driven, Showable, on_floor
from motiondeck.run.recognition.watch import NUMBERS, Watch
from motiondeck.run.robots.rig_output import RigOutput
from motiondeck.run.robots.robot_on_deck import RobotOnDeck, Simulation

MOST_SHOWN = 8  # motions on the way, and in the queue
MOST_FORCES = 6  # parts of the body that touch the floor

# What the page shows besides the position of the robot: each field is one number.
_NUMBERS = (
    "tick",
    "time_s",
    "run_s",
    "motion",
    "tempo",
    "phase",
    "paused",
    "lock_source",
    "lock_stage",
    "lock_error_ms",
    "beats_per_minute",
    "mode",
    "playing",
    "settled",
    "rate_hz",
    "lateness_p50_us",
    "lateness_p999_us",
    "overruns",
    "restarts",
    "work_p50_us",
    "kept_apart",
    "fallen",
    "approaching",
)
# What it shows of the servos of a rig, in the order of their `ServoStates`: each field has one number a servo.
OF_SERVOS = tuple(
    f"servo {what}"
    for what in ("goal", "position", "current", "temperature", "voltage", "error", "torque", "condition")
)


@dataclass(frozen=True)
class PageContents:
    """What there is to show of a run.

    Attributes:
        deck: what plays.
        robots: whose positions are drawn, at least one with a simulation.
        human: whose motion is shown beside the robot, if that is known.
        watch: recognizes motions, if that is wanted.
        command_port: where the page sends commands.
        library: the file of what plays, if it is a library; the view finds the network there.
        servos: of the first robot's rig, if it has one.
        learns: whether recordings can be learned on the page, in a process of their own.
    """

    deck: Showable
    robots: Sequence[RobotOnDeck]
    human: Skeleton | None
    watch: Watch | None
    command_port: int
    library: Path | None
    servos: RigOutput | None
    learns: bool

    @property
    def simulations(self) -> list[Simulation]:
        """Of the robots, without those that are a rig alone."""
        return [robot.simulation for robot in self.robots if robot.simulation is not None]

    def description(self, models: Sequence[Path]) -> dict[str, Any]:
        """What the view is told once; the models of the robots are files."""
        from sim.models.gravity import GRAVITY
        from sim.physics.pushes import usual_push

        deck, first = self.deck, self.simulations[0]
        robot = first.robot
        rest = robot.model.qpos0.copy()
        robot.layout.place(robot.rest, rest)
        told: dict[str, Any] = {
            "model_file": str(models[0]),
            "followers": [str(model) for model in models[1:]],
            "rest": rest.tolist(),
            "motions": list(deck.motions),
            "direct": deck.direct,
            "has_phase": deck.phase is not None,
            "joints": list(robot.joints),
            "robot": robot.name,
            "command_port": self.command_port,
            "recognizable": list(self.watch.names) if self.watch is not None else [],
        }
        if self.library is not None:
            told["library_file"] = str(self.library.resolve())
            if deck.activation is not None or deck.phase is not None:
                told["library"] = told["library_file"]
            if self.learns:
                told["learn"] = [sys.executable, "-P", "-m", "motiondeck.run.page.learning"]
        if on_floor(self.robots[0]) is not None:
            told["weight"] = GRAVITY * float(robot.model.body_mass.sum())
        if isinstance(first.stage, Driven):
            told["has_target"] = True
        if self.robots[0].pushable is not None:
            told["push_ns"] = usual_push(robot.model)
        if self.servos is not None:
            told["rig"] = self.servos.description
        return told

    def numbers(self) -> dict[str, int]:
        """The fields of a picture, and how many numbers each has."""
        first, *others = self.simulations
        size = first.robot.model.nq
        numbers = {"qpos": size, "root_xy": 2} | dict.fromkeys(_NUMBERS + (NUMBERS if self.watch else ()), 1)
        numbers |= {"way": MOST_SHOWN, "queue": MOST_SHOWN}
        numbers |= dict.fromkeys(("blend", "blend_weight"), MOST_BLENDED - 1)
        numbers |= {f"qpos {index}": other.robot.model.nq for index, other in enumerate(others)}
        if self.library is not None and self.deck.activation is not None:
            numbers["activation"] = len(self.deck.activation)
        if self.human is not None:
            numbers |= {"human_root": 3, "human_turn": 4 * (1 + len(self.human))}
        if on_floor(self.robots[0]) is not None:
            numbers["contacts"] = 6 * MOST_FORCES
        if isinstance(first.stage, Driven):
            numbers["target"] = size
        if self.servos is not None:
            numbers |= dict.fromkeys(OF_SERVOS, len(self.servos.description["servos"]))
        return numbers
