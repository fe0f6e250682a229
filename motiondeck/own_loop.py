# pyright: strict
"""A deck that a program steps itself: joint targets for any time step, without a process, a socket or a clock."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from controller.deck.deck import Deck as PlayingDeck
from controller.deck.interfaces import JointLimits
from controller.deck.layers import Layers
from controller.deck.switch import CommandedSwitch
from controller.deck.target_curve import TargetCurve
from controller.library.motion_library import load_library
from controller.loop.clock import period_ns
from controller.loop.commands.commanded_run import CommandedRun, Outcome, mode_events
from controller.loop.run_phases import Source, Start, safe_targets
from controller.loop.safety.compiled_envelope import safety_envelope
from controller.loop.stop_requests import StopRequest
from controller.motion.skeleton import Pose
from controller.wire.messages import commands
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.command_table import checked, parse_command
from controller.wire.messages.commands import DeckCommand
from controller.wire.messages.replies import Event as DeckEvent
from controller.wire.messages.replies import Refused, Reply
from motiondeck.deck_commands import DeckCommands
from motiondeck.libraries import Library
from motiondeck.robots import Robot
from motiondeck.run.live_deck import with_right_types
from motiondeck.run.spec.program import first_motion
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_library
from sim.models.robot_file import read_robot_file, solver_named
from sim.robots.catalogue import find_robot
from sim.robots.joint_groups import gaze_gains, joint_groups
from sim.robots.robot import load_robot

__all__ = ["CommandedSwitch", "Deck"]

LONGEST_STEP = 10.0  # s


class Deck(DeckCommands[CommandedSwitch]):
    """Plays a library on a robot, one call of `step` at a time.

    The deck itself advances in ticks of 1 / rate seconds, as a live one does, and the joint targets follow a smooth
    curve through these ticks, 2 ticks later. So the limits of position, velocity, acceleration and jerk hold in time
    for steps of any length, and what is played depends on the time alone, not on how it was divided into steps.

    All calls belong into one thread. Nothing waits, and nothing is written or sent.

    Attributes:
        joints: the names of the robot's J joints, the order of every array.
        motions: the names of the motions.
        limits: of the joints: `lower`, `upper` (rad), `velocity`, `acceleration`, `jerk`, each of shape (J,).
        time: s since the start, the sum of all steps.
    """

    __slots__ = (
        "_commanded_run",
        "_curve",
        "_deck",
        "_measured",
        "_rate",
        "_robot",
        "_source",
        "_start",
        "_stop",
        "_targets",
        "_ticks",
        "joints",
        "limits",
        "motions",
        "time",
    )

    def __init__(
        self,
        library: str | Path | Library = "thesis15",
        motion: str | None = None,
        *,
        robot: str | Path | Robot = "mannequin",
        rate: float = 200.0,
        start: ArrayLike | None = None,
    ) -> None:
        """Loads a library and a robot.

        MotiondeckError if a name does not exist (it names the nearest), or a file or a number cannot be used.

        Args:
            library: a shipped one by its name, a file, or one in memory.
            motion: the first motion; by default `walk`, or the library's first.
            robot: a shipped one by its name ("mannequin", "servo20"), a robot file, or one from `load_robot`.
            rate: ticks of the deck a second, Hz.
            start: the joint positions to begin at, shape (J,), rad; the joints then approach the motion slowly. By
                default those that the first step measures, or else those of the motion itself.
        """
        period_ns(rate)
        model = library.model if isinstance(library, Library) else load_library(find_library(library))
        first = first_motion(model, motion)
        file, solver = (robot.file, robot.solver) if isinstance(robot, Robot) else (find_robot(robot), None)
        self._robot = load_robot(file, model.skeleton, solver_named(solver), 1.0 / rate)
        self.joints: tuple[str, ...] = self._robot.joints
        self.motions: tuple[str, ...] = model.network.motions
        self.limits: JointLimits = self._robot.limits
        self.time = 0.0
        self._rate, self._ticks = rate, 0
        self._deck = PlayingDeck(model, self._robot.retarget, first)
        groups = joint_groups(self._robot, read_robot_file(file), model.skeleton)
        gaze = gaze_gains(self._robot, groups)
        self._deck.layers = Layers(model, self.joints, self.limits, groups, self._robot.twin, gaze=gaze)
        self._source = Source(self._deck, 1.0 / rate)
        self._stop = StopRequest()
        self._commanded_run = CommandedRun(self._deck)
        self._start = self._as_joints(start) if start is not None else None
        self._measured: NDArray[np.float64] | None = None
        self._targets: Iterator[NDArray[np.float64]] = iter(())
        self._curve: TargetCurve | None = None

    def step(self, dt: float, measured: ArrayLike | None = None) -> NDArray[np.float64]:
        """Advances by dt seconds; the joint targets at that time, shape (J,), rad.

        MotiondeckError if dt or a shape is wrong; then nothing has advanced.

        Args:
            dt: from 0 to 10 s; it may differ from step to step.
            measured: where the joints are now, shape (J,), rad, NaN for a joint that is not measured. The first step
                begins there if no start was given; later it is what `lock("body")` follows.
        """
        if not 0.0 <= dt <= LONGEST_STEP:
            raise MotiondeckError(f"a step of {dt:g} s: give 0 to {LONGEST_STEP:g} s")
        if measured is not None:
            self._measured = self._as_joints(measured)
            self._deck.measured = lambda: self._measured
        curve = self._curve or self._begin()
        self.time += dt
        while self._ticks < int(self.time * self._rate + 1e-9):
            self._ticks += 1
            targets = next(self._targets, None)
            if targets is not None:  # else the run has ended, and the joints stay at rest
                curve.add(targets, self._source.pose)
            else:
                curve.hold()
        return curve.targets(self._share)

    @property
    def pose(self) -> Pose:
        """The pose at `time`: `root_position` (m), `heading` (rad), `rotation` of each bone, own `offsets` (m)."""
        return (self._curve or self._begin()).pose(self._share)

    @property
    def root(self) -> NDArray[np.float64]:
        """The root of the robot at `time` as the motion has it: position (m) and quaternion (w, x, y, z), shape (7,).

        Its feet stand where they stand from one reading to the next, so read it after each step.
        """
        curve, qpos = self._curve or self._begin(), np.zeros(self._robot.model.nq)
        self._robot.place(curve.targets(self._share), curve.pose(self._share), qpos)
        return qpos[:7]

    @property
    def running(self) -> bool:
        """Whether the deck plays: it ends with the command `stop`, or when it keeps failing; see `reason`."""
        return not self._stop.reason

    @property
    def reason(self) -> str:
        """Why the deck has ended, or an empty string."""
        return self._stop.reason

    def events(self) -> list[DeckEvent]:
        """The events of the deck since the last call, at most 64."""
        events = [*self._deck.events]
        self._deck.events.clear()
        return events

    def send(self, command: str | DeckCommand) -> Reply:
        """Carries out any command, as typed for `motiondeck send` ("blend walk jog 0.3") or as a message; its reply.

        CommandError if it is not a command, or is refused; it says why.
        """
        return self._request(parse_command([command]) if isinstance(command, str) else command)

    def beat(self, ago: float = 0.0) -> None:
        """Gives the deck one beat, `ago` seconds before `time`, from -2 to 2 s, and locks it to beats if it is not.

        CommandError if the network has no phase, or the time is further away.
        """
        self._request(commands.GiveBeat(ago=ago))

    def step_paused(self, seconds: float = 0.0) -> None:
        """In a pause, lets the motion go on for one tick, or for up to 1 s. CommandError if the deck is not paused."""
        self._request(commands.StepOn(seconds=seconds))

    def _request(self, message: DeckCommand) -> Reply:
        return self._carry_out(message).reply

    def _commanded(self, message: DeckCommand) -> CommandedSwitch:
        progress = self._carry_out(message).progress
        assert isinstance(progress, CommandedSwitch), "a deck returns the switch that it begins"
        return progress

    def _carry_out(self, message: DeckCommand) -> Outcome:
        """Carries out a command, and adds the events of a changed mode or pause."""
        if isinstance(message, commands.Heartbeat | commands.Subscribe):
            raise CommandError("heartbeats and subscriptions are for the clients of a live deck")
        before = self._stop.mode, self._deck.paused
        outcome = self._commanded_run.carry_out(checked(with_right_types(message)), self._stop, remote=False)
        if isinstance(outcome.reply, Refused):
            raise CommandError(outcome.reply.reason)
        self._deck.events.extend(mode_events(self._deck, self._stop.mode, before))
        return outcome

    @property
    def _share(self) -> float:
        return min(max(self.time * self._rate - self._ticks, 0.0), 1.0)

    def _begin(self) -> TargetCurve:
        """Begins at the given start, the measured joints, or the motion's own; no time passes."""
        first = np.clip(self._source.targets, self.limits.lower, self.limits.upper)
        start = self._start if self._start is not None else self._measured
        start = first if start is None else np.where(np.isfinite(start), start, first)
        envelope = safety_envelope(self.limits, 1.0 / self._rate)
        self._targets = safe_targets(self._source, [Start(start)], envelope, self._stop, np.inf, self._robot.rest)
        self._curve = TargetCurve(start, self._source.pose)
        return self._curve

    def _as_joints(self, angles: ArrayLike) -> NDArray[np.float64]:
        positions = np.array(angles, dtype=np.float64)
        if positions.shape != (len(self.joints),):
            raise MotiondeckError(
                f"joint positions of shape {positions.shape}; {self._robot.name} has {len(self.joints)} joints"
            )
        return positions
