"""The page of a run: the browser view in a process of its own, and the shared state that it draws."""

from __future__ import annotations

import math
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from controller.cli.session.child_process import free_port
from controller.cli.session.recognition.watch import NUMBERS, Watch
from controller.cli.session.robots.rig_output import RigOutput
from controller.cli.session.robots.robot_on_deck import RobotOnDeck, Simulation
from controller.cli.session.tick_recorder import set_blend
from controller.loop.loop import LoopState
from controller.loop.stop_requests import StopRequest
from controller.mocap.posture import Pose
from controller.mocap.skeleton import Skeleton
from controller.networks.base import Activation
from controller.rotations import Array
from controller.wire.messages.blends import MOST_BLENDED
from controller.wire.messages.lock_state import LockState, lock_numbers
from controller.wire.run_folder import REASON_FILE, write_shared
from controller.wire.run_recording import MODES
from controller.wire.telemetry import StateWriter

if TYPE_CHECKING:
    from sim.view.clip_page import Act

PICTURE_HZ = 50.0
HEALTH_EVERY = 12  # pictures
SERVOS_EVERY = 5  # pictures
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
_OF_SERVOS = tuple(
    f"servo {what}"
    for what in ("goal", "position", "current", "temperature", "voltage", "error", "torque", "condition")
)


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


class LatePoses:
    """Gives poses back so many seconds after they came; the first one until then."""

    def __init__(self, behind: float) -> None:
        self._behind = behind
        self._poses: deque[tuple[float, Array, Array]] = deque()

    def pose(self, seconds: float, pose: Pose) -> tuple[Array, Array]:
        """Takes the pose of a time, s; place and rotation of the one that was `behind` earlier."""
        self._poses.append((seconds, pose.root_position.copy(), pose.rotation.copy()))
        while len(self._poses) > 1 and self._poses[1][0] <= seconds - self._behind:
            self._poses.popleft()
        return self._poses[0][1:]


class Page:
    """The shared state that the view reads.

    Args:
        writer: of that state.
        reason_file: where the view reads why the run has ended.
        robots: whose positions are drawn, each with a simulation.
        watch: recognizes motions, if that is wanted.
        servos: of the first robot's rig, if it has one.
    """

    def __init__(
        self,
        writer: StateWriter,
        reason_file: Path,
        robots: Sequence[RobotOnDeck],
        watch: Watch | None = None,
        servos: RigOutput | None = None,
    ) -> None:
        self._writer, self._reason_file, self._watch, self._servos = writer, reason_file, watch, servos
        self._pictures = 0
        first, *others = _simulations(robots)
        self._stage, self._followers = first.stage, [simulation.stage for simulation in others]
        # The human is shown as the body is that follows it.
        self._human = LatePoses(first.stage.behind_s)
        self._body, self._on_floor = robots[0].pushable, _on_floor(robots[0])
        self._driven = first.stage if isinstance(first.stage, Driven) else None
        self._guards = [robot.guard for robot in robots if robot.guard is not None]

    @classmethod
    @contextmanager
    def open(
        cls,
        state: Path,
        deck: Showable,
        robots: Sequence[RobotOnDeck],
        human: Skeleton | None,
        watch: Watch | None = None,
        command_port: int = 0,
        library: Path | None = None,
        servos: RigOutput | None = None,
        learns: bool = False,
    ) -> Iterator[Page]:
        """Puts the robots' models, the human's and the state beside each other, where the view waits for them.

        The library's file is where the view finds the network that plays; servos are those of the first robot. With
        `learns` recordings can be learned on the page, in a process of their own.
        """
        from sim.physics.physics_model import usual_push
        from sim.view.ghost import draw_ghost

        shown = [simulation.robot for simulation in _simulations(robots)]
        robot = shown[0]
        models = [state.with_name(f"robot{index}.xml") for index in range(len(shown))]
        for one, model in zip(shown, models, strict=True):
            write_shared(model, one.spec.to_xml())
        rest = robot.model.qpos0.copy()
        robot.layout.place(robot.rest, rest)
        description = {
            "model_file": str(models[0]),
            "followers": [str(model) for model in models[1:]],
            "rest": rest.tolist(),
            "motions": list(deck.motions),
            "direct": deck.direct,
            "has_phase": deck.phase is not None,
            "joints": list(robot.joints),
            "robot": robot.name,
            "command_port": command_port,
            "recognizable": list(watch.names) if watch is not None else [],
        }
        numbers = {"qpos": robot.model.nq, "root_xy": 2} | dict.fromkeys(_NUMBERS + (NUMBERS if watch else ()), 1)
        numbers |= {"way": MOST_SHOWN, "queue": MOST_SHOWN}
        numbers |= dict.fromkeys(("blend", "blend_weight"), MOST_BLENDED - 1)
        numbers |= {f"qpos {index}": one.model.nq for index, one in enumerate(shown[1:])}
        if library is not None and (deck.activation is not None or deck.phase is not None):
            description["library"] = str(library.resolve())
        if library is not None and deck.activation is not None:
            numbers["activation"] = len(deck.activation)
        if human is not None:
            description["human"] = draw_ghost(human, robot.path_scale, state.with_name("human.xml"))
            numbers |= {"human_root": 3, "human_turn": 4 * (1 + len(human))}
        if library is not None:
            description["library_file"] = str(library.resolve())
        if learns and library is not None:
            description["learn"] = [sys.executable, "-P", "-m", "controller.cli.session.page_learning"]
        if _on_floor(robots[0]) is not None:
            from sim.models.gravity import GRAVITY

            description["weight"] = GRAVITY * float(robot.model.body_mass.sum())
            numbers["contacts"] = 6 * MOST_FORCES
        if isinstance(_simulations(robots)[0].stage, Driven):
            description["has_target"] = True
            numbers["target"] = robot.model.nq
        if robots[0].pushable is not None:
            description["push_ns"] = usual_push(robot.model)
        if servos is not None:
            description["rig"] = servos.description
            numbers |= dict.fromkeys(_OF_SERVOS, len(servos.description["servos"]))
        page = cls(StateWriter.create(state, description, numbers), state.with_name(REASON_FILE), robots, watch, servos)
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
            _set_names(fields["way"], deck.way, deck.motions)
            _set_names(fields["queue"], deck.queue, deck.motions)
            lateness = state.lateness.percentiles()
            fields["lateness_p50_us"][0] = lateness.p50
            fields["lateness_p999_us"][0] = lateness.p999
            fields["work_p50_us"][0] = state.work.percentiles().p50
        self._pictures += 1
        if self._servos is not None:
            fields["servo position"][:] = self._servos.positions
            if self._pictures % SERVOS_EVERY == 1:
                for name, values in zip(_OF_SERVOS, self._servos.states, strict=True):
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


def _on_floor(robot: RobotOnDeck) -> OnFloor | None:
    """The simulation of a robot that nothing holds but the floor."""
    simulation = robot.simulation
    if simulation is None or simulation.root != "free" or not isinstance(simulation.stage, OnFloor):
        return None
    return simulation.stage


def _simulations(robots: Sequence[RobotOnDeck]) -> list[Simulation]:
    """The simulations of robots, without those that are a rig alone."""
    return [robot.simulation for robot in robots if robot.simulation is not None]


def show_act(act: Act, port: int) -> None:
    """Shows an act on a page of its own until Ctrl-C."""
    from sim.view.clip_page import show

    port = free_port(port)
    print(f"page: http://127.0.0.1:{port}", flush=True)
    show(act, port)
