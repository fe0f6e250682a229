"""The page of a run: the browser view in a process beside it, and the shared state that it draws."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from controller.loop.commands.interfaces import PlayableDeck
from controller.loop.loop import LoopState
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose, Skeleton
from controller.networks.base import Activation
from controller.wire.messages.deck_snapshot import DeckSnapshot
from controller.wire.run_folder import REASON_FILE, write_shared
from controller.wire.snapshot_numbers import SnapshotNumbers
from controller.wire.telemetry import StateWriter
from motiondeck.page.web.page_state import STANDS_STILL, UNCERTAIN, GhostDescription, PageDescription, PictureArrays
from motiondeck.run.beside.child_process import free_port
from motiondeck.run.guard.messages import SERVO_ROWS
from motiondeck.run.recognition.watches import BodyWatch, Watch
from motiondeck.run.robots.rig_output import RigOutput
from motiondeck.run.robots.robot_on_deck import RobotOnDeck
from sim.physics.playback import PhysicsPlayback
from sim.robots.verdict import RobotVerdict

MOST_FORCES = 6  # parts of the body that touch the floor


def on_floor(robot: RobotOnDeck) -> PhysicsPlayback | None:
    """The simulation of a robot that nothing holds but the floor."""
    stage = robot.simulation.stage
    return stage if robot.simulation.root == "free" and isinstance(stage, PhysicsPlayback) else None


@dataclass(frozen=True)
class PageContents:
    """The parts of a run that its page shows."""

    deck: PlayableDeck
    robots: Sequence[RobotOnDeck]  # at least one
    human: Skeleton | None  # the skeleton whose motion is shown beside the robot, if that is known
    watch: Watch | None
    command_port: int
    library: Path | None  # the file of what plays, if it is a library
    network: Path | None  # that, or what was baked of it; the view finds the network there
    servos: RigOutput | None
    learns: bool  # whether recordings can be learned on the page, in a process beside it
    verdicts: Mapping[str, RobotVerdict] = field(default_factory=dict[str, RobotVerdict])  # by motion, those kept

    @property
    def arrays(self) -> PictureArrays:
        """Empty arrays of the shapes that a picture of this run has."""
        first, *others = (robot.simulation for robot in self.robots)
        size, human, floor = first.robot.model.nq, self.human, on_floor(self.robots[0])
        activation = self.deck.activation if self.library is not None else None
        return PictureArrays(
            qpos=np.zeros(size),
            follower=np.zeros(others[0].robot.model.nq) if others else None,
            human_root=np.zeros(3) if human is not None else None,
            human_rotation=np.zeros((1 + len(human), 4)) if human is not None else None,
            human_offsets=np.zeros((len(human), 3)) if human is not None else None,
            target=np.zeros(size) if hasattr(first.stage, "wanted") else None,  # the goals of its servos
            contacts=np.zeros((MOST_FORCES, 6)) if floor is not None else None,
            activation=np.zeros(len(activation)) if activation is not None else None,
            bus=np.zeros(1) if self.servos is not None else None,
            servos=np.zeros((SERVO_ROWS, len(self.servos.rig.names))) if self.servos is not None else None,
        )

    def description(self, models: Sequence[Path], human: GhostDescription | None) -> PageDescription:
        """The run for its page; the models of the robots are files."""
        from sim.models.gravity import GRAVITY
        from sim.physics.playback import usual_push

        deck, simulation = self.deck, self.robots[0].simulation
        robot = simulation.robot
        library = str(self.library.resolve()) if self.library is not None else None
        looks_inside = deck.activation is not None or deck.phase is not None
        standing, refused = on_floor(self.robots[0]) is not None, {*self.robots[0].without_layers}
        groups = [name for name, group in self.robots[0].groups.items() if refused.isdisjoint(group)]
        return PageDescription(
            model_file=str(models[0]),
            follower_file=str(models[1]) if len(models) > 1 else None,
            rest=robot.rest_qpos.tolist(),
            robot=robot.name,
            motions=list(deck.motions),
            joints=list(robot.joints),
            recognizable=list(self.watch.names) if self.watch is not None else [],
            unrecognized=UNCERTAIN if isinstance(self.watch, BodyWatch) else STANDS_STILL,
            command_port=self.command_port,
            direct=deck.direct,
            has_phase=deck.phase is not None,
            network_file=str(self.network.resolve()) if looks_inside and self.network is not None else None,
            library_file=library,
            learn=[sys.executable, "-P", "-m", "motiondeck.run.page.learning"] if self.learns and library else [],
            groups=groups,
            live=[*groups, *(joint for joint in self.robots[0].joints if joint not in refused)],
            gazes=len(self.robots[0].gaze) > 0 and refused.isdisjoint(self.robots[0].gaze),
            human=human,
            behind_s=simulation.stage.behind_s,
            walks=simulation.root != "fixed",
            weight=GRAVITY * float(robot.model.body_mass.sum()) if standing else None,
            push_ns=usual_push(robot.model) if self.robots[0].pushable is not None else 0.0,
            verdicts={name: (verdict.answer, verdict.words) for name, verdict in self.verdicts.items()},
            rig=self.servos.description if self.servos is not None else None,
            shapes=self.arrays.shapes,
        )


if TYPE_CHECKING:
    from motiondeck.page.clip_page import Act

SERVOS_EVERY = 5  # pictures


class Page:
    """Writes the shared state that the view reads; the reason why the run has ended goes beside its file."""

    def __init__(self, state: Path, contents: PageContents, description: PageDescription) -> None:
        names = {"recognizable": description.recognizable, "joints": description.joints}
        self._numbers, empty = SnapshotNumbers(description.motions, **names), contents.arrays
        self._writer = StateWriter(state, msgspec.to_builtins(description), self._numbers.sizes | empty.sizes)
        self._arrays = PictureArrays.over(self._writer.fields, empty.shapes)
        self._reason_file = state.with_name(REASON_FILE)
        self._servos = contents.servos
        self._pictures = 0
        first, *others = (robot.simulation for robot in contents.robots)
        self._stage, self._follower = first.stage, others[0].stage if others else None
        # The human is shown as late as the body follows it.
        self._human = LatePoses(first.stage.behind_s)
        self._on_floor = on_floor(contents.robots[0])
        self._wanted: Array | None = getattr(first.stage, "wanted", None)

    @classmethod
    def open(cls, state: Path, contents: PageContents) -> Page:
        """Puts the robots' models, the human's and the state beside each other, where the view waits for them."""
        from motiondeck.page.ghost import draw_ghost

        robots = [one.simulation.robot for one in contents.robots]
        models = [state.with_name(f"robot{index}.xml") for index in range(len(robots))]
        for robot, model in zip(robots, models, strict=True):
            write_shared(model, robot.spec.to_xml())
        human = None
        if contents.human is not None:
            human = draw_ghost(contents.human, robots[0].path_scale, state.with_name("human.xml"))
        return cls(state, contents, contents.description(models, human))

    def show(self, snapshot: DeckSnapshot, loop: LoopState, activation: Activation | None) -> None:
        """Publishes one picture: the snapshot, the bodies, the network's activation, the servos."""
        arrays = self._arrays
        self._writer.values[: self._numbers.count] = self._numbers.row(snapshot)
        arrays.qpos[:] = self._stage.qpos
        if arrays.follower is not None and self._follower is not None:
            arrays.follower[:] = self._follower.qpos
        if arrays.human_root is not None and arrays.human_rotation is not None:
            pose = self._human.pose(loop.seconds, loop.pose)
            arrays.human_root[:], arrays.human_rotation[:] = pose.root_position, pose.rotation
            if arrays.human_offsets is not None and pose.offsets is not None:
                arrays.human_offsets[:] = pose.offsets
        if arrays.activation is not None and activation is not None:
            arrays.activation[:] = activation
        if arrays.target is not None and self._wanted is not None:
            arrays.target[:] = self._wanted
        if arrays.contacts is not None and self._on_floor is not None:
            self._on_floor.contact_forces(arrays.contacts)
        self._pictures += 1
        if arrays.servos is not None and self._servos is not None:
            rig = self._servos.rig
            arrays.servos[0], arrays.servos[1] = rig.states.goals, rig.positions
            if self._pictures % SERVOS_EVERY == 1:
                for row, values in zip(arrays.servos, rig.states, strict=True):
                    row[:] = values
            if arrays.bus is not None:
                arrays.bus[0] = rig.busy
        self._writer.publish()

    def end(self, reason: str) -> None:
        """Ends the view with the reason why the run has ended."""
        self._reason_file.write_text(reason, encoding="utf-8")
        self._writer.close()

    def close(self) -> None:
        """Ends the view; may be called twice."""
        self._writer.close()


class LatePoses:
    """Delays poses by some seconds; until then the first one is returned."""

    def __init__(self, behind: float) -> None:
        self._behind = behind
        self._poses: deque[tuple[float, Pose]] = deque()

    def pose(self, seconds: float, pose: Pose) -> Pose:
        """Takes the pose of a time, s; the one that was `behind` earlier."""
        kept = Pose(pose.root_position.copy(), pose.heading, pose.rotation.copy(), offsets=pose.offsets)
        self._poses.append((seconds, kept))
        while len(self._poses) > 1 and self._poses[1][0] <= seconds - self._behind:
            self._poses.popleft()
        return self._poses[0][1]


def show_act(act: Act, port: int) -> None:
    """Shows an act on a page until Ctrl-C."""
    from motiondeck.page.clip_page import show

    port = free_port(port)
    print(f"page: http://127.0.0.1:{port}", flush=True)
    show(act, port)
