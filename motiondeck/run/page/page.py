"""The page of a run: the browser view in a process of its own, and the shared state that it draws."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from controller.loop.loop import LoopState
from controller.loop.stop_requests import StopRequest
from controller.motion.rotations import Array
from controller.wire.messages.lock_state import lock_numbers
from controller.wire.run_folder import REASON_FILE, write_shared
from controller.wire.run_recording import MODES
from controller.wire.telemetry import StateWriter
from motiondeck.run.beside.child_process import free_port
from motiondeck.run.beside.tick_recorder import set_blend
from motiondeck.run.page.contents import MOST_FORCES, OF_SERVOS, PageContents
from motiondeck.run.page.late_poses import LatePoses
from motiondeck.run.page.showable import Driven, Showable, on_floor

if TYPE_CHECKING:
    from motiondeck.page.clip_page import Act

PICTURE_HZ = 50.0
HEALTH_EVERY = 12  # pictures
SERVOS_EVERY = 5  # pictures


class Page:
    """The shared state that the view reads.

    Args:
        writer: of that state.
        reason_file: where the view reads why the run has ended.
        contents: what there is to show.
    """

    def __init__(self, writer: StateWriter, reason_file: Path, contents: PageContents) -> None:
        self._writer, self._reason_file = writer, reason_file
        self._watch, self._servos = contents.watch, contents.servos
        self._pictures = 0
        first, *others = contents.simulations
        self._stage, self._followers = first.stage, [simulation.stage for simulation in others]
        # The human is shown as the body is that follows it.
        self._human = LatePoses(first.stage.behind_s)
        self._body, self._on_floor = contents.robots[0].pushable, on_floor(contents.robots[0])
        self._driven = first.stage if isinstance(first.stage, Driven) else None
        self._guards = [robot.guard for robot in contents.robots if robot.guard is not None]

    @classmethod
    @contextmanager
    def open(cls, state: Path, contents: PageContents) -> Iterator[Page]:
        """Puts the robots' models, the human's and the state beside each other, where the view waits for them."""
        from motiondeck.page.ghost import draw_ghost

        robots = [simulation.robot for simulation in contents.simulations]
        models = [state.with_name(f"robot{index}.xml") for index in range(len(robots))]
        for robot, model in zip(robots, models, strict=True):
            write_shared(model, robot.spec.to_xml())
        description = contents.description(models)
        if contents.human is not None:
            description["human"] = draw_ghost(contents.human, robots[0].path_scale, state.with_name("human.xml"))
        page = cls(StateWriter.create(state, description, contents.numbers()), state.with_name(REASON_FILE), contents)
        try:
            yield page
        finally:
            page.close()

    def show(self, state: LoopState, stop: StopRequest, deck: Showable, *, health: bool) -> None:
        """Shows the robot as it is, and how the loop is doing: with `health` also the figures that take time."""
        fields = self._writer.fields
        fields["qpos"][:] = self._stage.qpos
        fields["root_xy"][:] = self._stage.qpos[:2]
        for index, follower in enumerate(self._followers):
            fields[f"qpos {index}"][:] = follower.qpos
        if "human_root" in fields:
            root, rotation = self._human.pose(state.seconds, state.pose)
            fields["human_root"][:] = root
            fields["human_turn"][:] = rotation.ravel()
        if "activation" in fields:
            fields["activation"][:] = deck.activation
        fields["tick"][0] = state.tick
        fields["time_s"][0] = deck.time
        fields["run_s"][0] = state.seconds
        fields["motion"][0] = deck.motions.index(deck.motion)
        fields["tempo"][0] = deck.commanded_tempo
        fields["phase"][0] = deck.phase if deck.phase is not None else math.nan
        fields["playing"][0] = deck.motions.index(deck.playing)
        set_blend(fields, deck.blend, deck.motions)
        _set_names(fields["way"], deck.way, deck.motions)
        _set_names(fields["queue"], deck.queue, deck.motions)
        fields["paused"][0] = deck.paused
        fields["settled"][0] = deck.settled
        lock = deck.lock_state
        for name, value in lock_numbers(lock).items():
            fields[name][0] = value
        beats = lock.per_minute if lock is not None else None
        fields["beats_per_minute"][0] = beats if beats is not None else math.nan
        fields["mode"][0] = MODES.index(stop.mode)
        if self._driven is not None:
            fields["target"][:] = self._driven.wanted
        if self._on_floor is not None:
            self._on_floor.contact_forces(fields["contacts"].reshape(MOST_FORCES, 6))
        fields["fallen"][0] = self._body is not None and self._body.fallen
        fields["approaching"][0] = stop.approaching
        fields["rate_hz"][0] = state.rate
        fields["overruns"][0] = state.overruns
        fields["restarts"][0] = deck.restarts
        fields["kept_apart"][0] = sum(guard.kept_apart.total() for guard in self._guards)
        if health:
            lateness = state.lateness.percentiles()
            fields["lateness_p50_us"][0] = lateness.p50
            fields["lateness_p999_us"][0] = lateness.p999
            fields["work_p50_us"][0] = state.work.percentiles().p50
        self._pictures += 1
        if self._servos is not None:
            fields["servo position"][:] = self._servos.positions
            if self._pictures % SERVOS_EVERY == 1:
                for name, values in zip(OF_SERVOS, self._servos.states, strict=True):
                    fields[name][:] = values
        if self._watch is not None:
            self._watch.show(fields)
        self._writer.publish()

    def end(self, reason: str) -> None:
        """Ends the view with the reason why the run has ended."""
        self._reason_file.write_text(reason, encoding="utf-8")
        self._writer.close()

    def close(self) -> None:
        """Ends the view; may be called twice."""
        self._writer.close()


def _set_names(field: Array, names: Sequence[str], motions: Sequence[str]) -> None:
    """Writes names as their places among the motions; -1 where there is none."""
    field[:] = -1.0
    for place, name in enumerate(names[: len(field)]):
        field[place] = motions.index(name)


def show_act(act: Act, port: int) -> None:
    """Shows an act on a page of its own until Ctrl-C."""
    from motiondeck.page.clip_page import show

    port = free_port(port)
    print(f"page: http://127.0.0.1:{port}", flush=True)
    show(act, port)
