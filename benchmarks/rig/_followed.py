"""A rig in simulated time, its true shafts, and where the motion had them at that time, by a second deck.

The judge asks neither the rig nor the deck that plays: shafts are those of the emulated servos, and the motion is that
of a run of its own, with the same library and commands, on no rig at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.simulated_time import EmulatedPort, VirtualClock
from controller.deck.deck import Deck
from controller.deck.interfaces import JointLimits
from controller.library.motion_library import MotionLibrary
from controller.loop.correction import Correction, Key
from controller.loop.lead import Lead
from controller.loop.loop import LoopState, run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.skeleton import Pose
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.rig.rig_file import RigConfig
from hardware.rig.supervision.rig import Rig
from hardware.tools.identify import JointTrials
from motiondeck.run.robots.rig_output import RigOutput, narrowed
from motiondeck_base.shipped import find_library, find_rig, find_robot
from sim.robots.robot import Robot

Array = NDArray[np.float64]
RATE = 200.0  # Hz, of the deck

Do = Callable[[Deck, EmulatedPort | None], None]
Timeline = Sequence[tuple[float, Do]]


class RigClock(VirtualClock):
    """A clock whose waiting lets time pass on an emulated bus."""

    port: EmulatedPort | None = None

    def wait(self) -> int:
        """Lets one period pass, here and on the bus."""
        if self.port is not None:
            self.port.elapse(self.period)
        return super().wait()


class Written:
    """An output that keeps what it is given, as the page would show it."""

    name = "picture"

    def __init__(self) -> None:
        self.targets: list[Array] = []

    def write(self, targets: Array, pose: Pose) -> None:
        """Keeps the targets."""
        self.targets.append(targets.copy())

    def measured(self) -> None:
        """Measures nothing."""

    def report(self) -> dict[str, object]:
        """Nothing."""
        return {}

    def close(self) -> None:
        """Does nothing."""


class TimedDeck:
    """A deck whose time is noted with each update, and that is commanded at its own times."""

    def __init__(self, deck: Deck, timeline: Timeline, port: EmulatedPort | None) -> None:
        self.deck, self._port = deck, port
        self.targets = np.zeros(0)  # of the last update, before any limit
        self._waiting = sorted(timeline, key=lambda timed: timed[0])

    def update(self, dt: float) -> tuple[Array, Pose]:
        """Commands what is due, and advances."""
        while self._waiting and self._waiting[0][0] <= self.deck.time + 1e-9:
            self._waiting.pop(0)[1](self.deck, self._port)
        targets, pose = self.deck.update(dt)
        self.targets = targets.copy()
        return targets, pose


@dataclass
class Course:
    """A run, in ticks of the deck.

    Attributes:
        deck: the deck's time when each tick was written, shape (T,), s.
        picture: targets of an output that does not lag, shape (T, J), rad, in the robot's order.
        shafts: true angles at that time, shape (T, J), rad; NaN for joints that the rig lacks.
        goals: sent to the servos last, shape (T, J), rad.
        wanted: the deck's own targets at its time, before any limit, shape (T, J), rad.
    """

    deck: Array
    picture: Array
    shafts: Array
    goals: Array
    wanted: Array


@dataclass
class Stage:
    """A library, a robot and its limits with a rig."""

    library: MotionLibrary
    robot: Robot
    config: RigConfig
    limits: JointLimits

    @classmethod
    def of(cls, library: str, model: str, robot: str = "servo20") -> Stage:
        """A shipped library on a shipped robot, with the rig of its name of servos of one model."""
        from controller.library.motion_library import load_library
        from hardware.rig.rig_file import load_rig
        from sim.robots.robot import load_robot

        loaded, config = load_library(find_library(library)), load_rig(find_rig(robot))
        joints = tuple(msgspec.structs.replace(joint, model=model) for joint in config.joints)
        config = msgspec.structs.replace(config, joints=joints)
        body = load_robot(find_robot(robot), loaded.skeleton, None, 1.0 / RATE)
        return cls(loaded, body, config, narrowed(body.limits, body, config))

    @property
    def loops(self) -> list[str]:
        """The names of its loops."""
        return [motion.name for motion in self.library.info.motions if motion.plays == "loop"]

    def seconds(self, motion: str) -> float:
        """The duration of a round, s."""
        info = next(one for one in self.library.info.motions if one.name == motion)
        return info.frames / self.library.info.rate

    def identify(self) -> Array:
        """The lag of each joint, s, as `rig identify` finds it for one: all have the same servo and no load."""
        port, rig = self._rig(self.config)
        found = JointTrials(rig, port.now, port.elapse, lambda: False).joint(self.config.names.index("r_elbow"))
        rig.close()
        return np.full(len(self.config.joints), found.lag)

    def _rig(self, config: RigConfig) -> tuple[EmulatedPort, Rig]:
        port = EmulatedPort(EmulatedBus(config))
        for device in port.bus.devices:
            device["return_delay_time"] = 0  # as `rig doctor --fix` would
        return port, Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse, spare=1.0)

    def play(
        self,
        motion: str,
        timeline: Timeline,
        seconds: float,
        *,
        lags: Array | None = None,
        rigged: bool = True,
        each: Callable[[Deck, EmulatedPort | None], None] | None = None,
        learned: dict[Key, Array] | None = None,
        until: float = math.inf,
    ) -> Course:
        """Plays on a rig whose joints lag as the rig file says, or, without servos, on none.

        Args:
            lags: written into the rig file, in its order, s.
            rigged: whether there is a rig at all.
            learned: a correction to begin with, which learns on; None for none.
            until: the deck's time at which it stops learning, and stays what it is.
        """
        clock, robot = RigClock(RATE), self.robot
        channels, picture = list[Channel](), Written()
        order, port = np.zeros(0, dtype=np.int64), None
        rig: Rig | None = None
        if rigged:
            given = np.zeros(len(self.config.joints)) if lags is None else lags
            joints = [
                msgspec.structs.replace(joint, lag=float(lag))
                for joint, lag in zip(self.config.joints, given, strict=True)
            ]
            config = msgspec.structs.replace(self.config, joints=tuple(joints))
            port, rig = self._rig(config)
            clock.port = port
            channels.append(Channel(RigOutput(rig, robot.joints, config.rate_hz), round(RATE / config.rate_hz)))
            order = np.array([robot.joints.index(name) for name in config.names])
        channels.append(Channel(picture))
        deck = Deck(self.library, deepcopy(robot.retarget), motion)
        lead = Lead(channels, len(robot.joints), clock.period)
        deck.lead = lead.seconds
        correction = None
        if learned is not None and isinstance(output := channels[0].output, RigOutput):
            correction = output.correction = Correction(
                lambda: deck.place, lead.delays, lead.seconds, self.limits, clock.period, learned
            )
        times, shafts, goals, wanted = list[float](), list[Array](), list[Array](), list[Array]()

        player = TimedDeck(deck, timeline, port)

        def publish(state: LoopState) -> None:
            row, sent = np.full(len(robot.joints), np.nan), np.full(len(robot.joints), np.nan)
            if port is not None and rig is not None:
                devices = port.bus.devices
                row[order] = [
                    joint.angle(float(device.bank.shaft[device.row]))
                    for joint, device in zip(rig.config.joints, devices, strict=True)
                ]
                sent[order] = rig.goals
            times.append(deck.time)
            shafts.append(row)
            goals.append(sent)
            wanted.append(player.targets)
            if each is not None:
                each(deck, port)
            if deck.time >= until and isinstance(output := channels[0].output, RigOutput):
                output.correction = None

        envelope = SafetyEnvelope(self.limits, clock.period)
        run(
            player,
            channels,
            clock,
            envelope,
            seconds=seconds,
            publish=publish,
            publish_every=1,
            lead=lead,
            correction=correction,
        )
        for channel in channels:
            channel.output.close()
        count = min(len(times), len(picture.targets))
        return Course(*(np.array(rows[:count]) for rows in (times, picture.targets, shafts, goals, wanted)))


def at_times(course: Course, rows: Array, deck: Array) -> Array:
    """Rows of a course at other times of its deck, shape (T, J), rad; NaN outside it."""
    first = np.concatenate([[True], np.diff(course.deck) > 0.0])
    times = course.deck[first]
    places = np.column_stack([np.interp(deck, times, column) for column in rows[first].T])
    places[(deck < times[0]) | (deck > times[-1])] = np.nan
    return places


def lead_of(lags: Array) -> float:
    """How far a deck has to run ahead of joints that lag, s: whole ticks."""
    return math.ceil(float(lags.max(initial=0.0)) * RATE - 1e-6) / RATE
