"""The page of a run: the browser view in a process of its own, and the shared state that it draws."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from controller.cli.session.child_process import free_port
from controller.cli.session.recognition_watch import NUMBERS, RecognitionWatch
from controller.cli.session.robot_on_deck import RobotOnDeck, Simulation
from controller.loop.loop import LoopState
from controller.loop.stop_requests import StopRequest
from controller.mocap.skeleton import Skeleton
from controller.wire.run_recording import MODES
from controller.wire.telemetry import StateWriter

if TYPE_CHECKING:
    from sim.view.clip_page import Act

PICTURE_HZ = 50.0
HEALTH_EVERY = 12  # pictures

# What the page shows besides the position of the robot: each field is one number.
_NUMBERS = (
    "tick",
    "time_s",
    "motion",
    "tempo",
    "phase",
    "paused",
    "mode",
    "rate_hz",
    "lateness_p50_us",
    "lateness_p999_us",
    "overruns",
    "restarts",
    "work_p50_us",
    "kept_apart",
)


class Showable(Protocol):
    """What the page shows of a deck."""

    time: float

    @property
    def commanded_tempo(self) -> float:
        """The tempo that was commanded."""
        ...

    @property
    def phase(self) -> float | None:
        """How far the motion is, from 0 to 1; None if that is not known."""
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
    def paused(self) -> bool:
        """Whether it stands still on command."""
        ...

    @property
    def restarts(self) -> int:
        """How often the network lost its motion and was restarted."""
        ...


class Page:
    """The shared state that the view reads.

    Args:
        writer: of that state.
        robots: whose positions are drawn, each with a simulation.
        watch: recognizes the motion of the joints, if that is wanted.
    """

    def __init__(
        self, writer: StateWriter, robots: Sequence[RobotOnDeck], watch: RecognitionWatch | None = None
    ) -> None:
        self._writer, self._watch = writer, watch
        self._stage, *self._followers = [simulation.stage for simulation in _simulations(robots)]
        self._guards = [robot.guard for robot in robots if robot.guard is not None]

    @classmethod
    @contextmanager
    def open(
        cls,
        state: Path,
        deck: Showable,
        robots: Sequence[RobotOnDeck],
        human: Skeleton | None,
        watch: RecognitionWatch | None = None,
        command_port: int = 0,
    ) -> Iterator[Page]:
        """Puts the robots' models, the human's and the state beside each other, where the view waits for them."""
        from sim.view.ghost import draw_ghost

        shown = [simulation.robot for simulation in _simulations(robots)]
        robot = shown[0]
        models = [state.with_name(f"robot{index}.xml") for index in range(len(shown))]
        for one, model in zip(shown, models, strict=True):
            one.spec.to_file(str(model))
        rest = robot.model.qpos0.copy()
        robot.layout.place(robot.rest, rest)
        description = {
            "model_file": str(models[0]),
            "followers": [str(model) for model in models[1:]],
            "rest": rest.tolist(),
            "motions": list(deck.motions),
            "has_phase": deck.phase is not None,
            "joints": list(robot.joints),
            "robot": robot.name,
            "command_port": command_port,
        }
        numbers = {"qpos": robot.model.nq, "root_xy": 2} | dict.fromkeys(_NUMBERS + (NUMBERS if watch else ()), 1)
        numbers |= {f"qpos {index}": one.model.nq for index, one in enumerate(shown[1:])}
        if human is not None:
            description["human"] = draw_ghost(human, robot.path_scale, state.with_name("human.xml"))
            numbers |= {"human_root": 3, "human_turn": 4 * (1 + len(human))}
        page = cls(StateWriter.create(state, description, numbers), robots, watch)
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
            fields["human_root"][:] = state.pose.root_position
            fields["human_turn"][:] = state.pose.rotation.ravel()
        fields["tick"][0] = state.tick
        fields["time_s"][0] = deck.time
        fields["motion"][0] = deck.motions.index(deck.motion)
        fields["tempo"][0] = deck.commanded_tempo
        fields["phase"][0] = deck.phase if deck.phase is not None else math.nan
        fields["paused"][0] = deck.paused
        fields["mode"][0] = MODES.index(stop.mode)
        fields["rate_hz"][0] = state.rate
        fields["overruns"][0] = state.overruns
        fields["restarts"][0] = deck.restarts
        fields["kept_apart"][0] = sum(guard.kept_apart.total() for guard in self._guards)
        if health:
            lateness = state.lateness.percentiles()
            fields["lateness_p50_us"][0] = lateness.p50
            fields["lateness_p999_us"][0] = lateness.p999
            fields["work_p50_us"][0] = state.work.percentiles().p50
        if self._watch is not None:
            self._watch.show(fields, deck.motions)
        self._writer.publish()

    def close(self) -> None:
        """Ends the view; may be called twice."""
        self._writer.close()


def _simulations(robots: Sequence[RobotOnDeck]) -> list[Simulation]:
    """The simulations of robots, without those that are a rig alone."""
    return [robot.simulation for robot in robots if robot.simulation is not None]


def show_act(act: Act, port: int) -> None:
    """Shows an act on a page of its own until Ctrl-C."""
    from sim.view.clip_page import show

    port = free_port(port)
    print(f"page: http://127.0.0.1:{port}", flush=True)
    show(act, port)
