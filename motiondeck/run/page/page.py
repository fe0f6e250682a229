"""The page of a run: the browser view in a process beside it, and the shared state that it draws."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from controller.loop.loop import LoopState
from controller.motion.posture import Pose
from controller.motion.rotations import Array
from controller.networks.base import Activation
from controller.wire.messages.deck_snapshot import DeckSnapshot
from controller.wire.run_folder import REASON_FILE, write_shared
from controller.wire.telemetry import StateWriter
from motiondeck.page.web.page_state import PictureArrays
from motiondeck.run.beside.child_process import free_port
from motiondeck.run.page.contents import Driven, PageContents, on_floor

if TYPE_CHECKING:
    from motiondeck.page.clip_page import Act

SERVOS_EVERY = 5  # pictures
_POSITIONS = 1  # row of `ServoStates`


class Page:
    """Writes the shared state that the view reads; the reason why the run has ended goes beside its file."""

    def __init__(self, state: Path, contents: PageContents, description: msgspec.Struct | None = None) -> None:
        self._numbers, empty = contents.numbers, contents.arrays
        described = msgspec.to_builtins(description) if description is not None else {}
        self._writer = StateWriter.create(state, described, self._numbers.sizes | empty.sizes)
        self._arrays = PictureArrays.over(self._writer.fields, empty.shapes)
        self._reason_file = state.with_name(REASON_FILE)
        self._servos = contents.servos
        self._pictures = 0
        first, *others = contents.simulations
        self._stage, self._follower = first.stage, others[0].stage if others else None
        # The human is shown as late as the body follows it.
        self._human = LatePoses(first.stage.behind_s)
        self._on_floor = on_floor(contents.robots[0])
        self._driven = first.stage if isinstance(first.stage, Driven) else None

    @classmethod
    @contextmanager
    def open(cls, state: Path, contents: PageContents) -> Iterator[Page]:
        """Puts the robots' models, the human's and the state beside each other, where the view waits for them."""
        from motiondeck.page.ghost import draw_ghost

        robots = [simulation.robot for simulation in contents.simulations]
        models = [state.with_name(f"robot{index}.xml") for index in range(len(robots))]
        for robot, model in zip(robots, models, strict=True):
            write_shared(model, robot.spec.to_xml())
        human = None
        if contents.human is not None:
            human = draw_ghost(contents.human, robots[0].path_scale, state.with_name("human.xml"))
        page = cls(state, contents, contents.description(models, human))
        try:
            yield page
        finally:
            page.close()

    def show(self, snapshot: DeckSnapshot, loop: LoopState, activation: Activation | None) -> None:
        """Publishes one picture: the snapshot, the bodies, the network's activation, the servos."""
        arrays = self._arrays
        self._writer.values[: self._numbers.count] = self._numbers.row(snapshot)
        arrays.qpos[:] = self._stage.qpos
        if arrays.follower is not None and self._follower is not None:
            arrays.follower[:] = self._follower.qpos
        if arrays.human_root is not None and arrays.human_rotation is not None:
            arrays.human_root[:], arrays.human_rotation[:] = self._human.pose(loop.seconds, loop.pose)
        if arrays.activation is not None and activation is not None:
            arrays.activation[:] = activation
        if arrays.target is not None and self._driven is not None:
            arrays.target[:] = self._driven.wanted
        if arrays.contacts is not None and self._on_floor is not None:
            self._on_floor.contact_forces(arrays.contacts)
        self._pictures += 1
        if arrays.servos is not None and self._servos is not None:
            arrays.servos[_POSITIONS] = self._servos.positions
            if self._pictures % SERVOS_EVERY == 1:
                for row, values in zip(arrays.servos, self._servos.states, strict=True):
                    row[:] = values
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
        self._poses: deque[tuple[float, Array, Array]] = deque()

    def pose(self, seconds: float, pose: Pose) -> tuple[Array, Array]:
        """Takes the pose of a time, s; place and rotation of the one that was `behind` earlier."""
        self._poses.append((seconds, pose.root_position.copy(), pose.rotation.copy()))
        while len(self._poses) > 1 and self._poses[1][0] <= seconds - self._behind:
            self._poses.popleft()
        return self._poses[0][1:]


def show_act(act: Act, port: int) -> None:
    """Shows an act on a page until Ctrl-C."""
    from motiondeck.page.clip_page import show

    port = free_port(port)
    print(f"page: http://127.0.0.1:{port}", flush=True)
    show(act, port)
