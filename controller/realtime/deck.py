"""The deck: plays a library's motions, switches them on command, and turns them into joint targets.

Each update goes the way of the data: generator -> channels -> posture -> fade of the last switch -> path -> pose ->
joints. Whoever drives it (the loop) calls `update` once a tick and hands it commands in between.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from controller.errors import MotiondeckError, UnknownNameError
from controller.generators.frame_player import FramePlayer
from controller.mocap.posture import Pose, Posture
from controller.realtime.interfaces import Retargeter
from controller.realtime.repertoire import Motion, read_repertoire
from controller.realtime.transition import Fade, best_anchor, difference
from controller.rotations import Array, multiply, yaw
from controller.training.library import MotionLibrary

SLOWEST, FASTEST = 0.1, 3.0

# How fast the tempo itself may change, 1/s: a pause takes 0.4 s.
TEMPO_RATE = 2.5

# A difference in joint velocity counts as much as the way it goes in this time (8 frames at 120 Hz), s.
VELOCITY_REACH = 8.0 / 120.0

REMEMBERED_SWITCHES = 10_000


@dataclass(slots=True)
class Switch:
    """A switch that was commanded; times in s since the deck's start, None while still to come.

    Attributes:
        to: the motion.
        commanded_s: when the command came.
        first_change_s: the first tick whose targets it changed.
        settled_s: when nothing was left of the motion before.
    """

    to: str
    commanded_s: float
    first_change_s: float | None = None
    settled_s: float | None = None


class Deck:
    """Plays one library for one robot.

    Args:
        library: the motions.
        retarget: from the skeleton's poses to the robot's joints.
        motion: what to play first.

    Attributes:
        time: s since the start, in ticks of the loop.
        switches: what was commanded, the latest REMEMBERED_SWITCHES of it.
        speed: the tempo that is being played; it follows the commanded one smoothly.
        paused: whether the deck stands still on command.
        posture, pose: what is shown.
    """

    def __init__(self, library: MotionLibrary, retarget: Retargeter, motion: str) -> None:
        self.motions = library.network.motions
        self._encoding = library.encoding
        self._retarget = retarget
        self._repertoire = read_repertoire(library)
        self._check(motion)
        self._player = FramePlayer(library.network.twin(), library.info.rate)
        self._player.cue(motion)
        self._fade: Fade | None = None
        self._fade_start = 0.0
        self._wanted: Switch | None = None
        self._fading: Switch | None = None
        self.time = 0.0
        self.switches: deque[Switch] = deque(maxlen=REMEMBERED_SWITCHES)
        self.speed = 1.0
        self.paused = False
        self._commanded_speed = 1.0
        self._root_xy = np.zeros(2)
        self._heading = 0.0
        self._before = self.posture = self._decode(self._player.step(0.0), 1.0)
        self.pose = self._place(self.posture, 0.0)

    @property
    def motion(self) -> str:
        """What is played, or being switched to."""
        return self._wanted.to if self._wanted else self._player.motion

    @property
    def settled(self) -> bool:
        """Whether no switch is under way."""
        return self._wanted is None and self._fade is None

    def switch(self, to: str) -> Switch:
        """Starts a switch at the next update; a switch to the loop that is playing is settled at once.

        Raises:
            UnknownNameError: if there is no such motion; it names the nearest.
        """
        self._check(to)
        switch = Switch(to, self.time)
        self.switches.append(switch)
        if to == self.motion and self._repertoire[to].loop:
            switch.first_change_s = switch.settled_s = self.time
        else:
            self._wanted = switch
        return switch

    def set_speed(self, factor: float) -> None:
        """Plays at another tempo, SLOWEST to FASTEST times as fast as recorded.

        Raises:
            MotiondeckError: if the factor is outside.
        """
        if not SLOWEST <= factor <= FASTEST:
            raise MotiondeckError(f"speed {factor:g} is not between {SLOWEST:g} and {FASTEST:g}")
        self._commanded_speed = factor

    def pause(self) -> None:
        """Comes to a standstill and stays there."""
        self.paused = True

    def resume(self) -> None:
        """Goes on after a pause."""
        self.paused = False

    def update(self, dt: float) -> tuple[Array, Pose]:
        """Goes dt seconds on; the joint targets (J,), rad, and the pose they come from."""
        self.time += dt
        goal = 0.0 if self.paused else self._commanded_speed
        self.speed += float(np.clip(goal - self.speed, -TEMPO_RATE * dt, TEMPO_RATE * dt))
        tempo = self.speed * self._onset()
        shown = self._faded(self._decode(self._player.step(dt * tempo), tempo))
        if self._fading is not None and self._fading.first_change_s is None:
            self._fading.first_change_s = self.time
        if self._wanted is not None:
            self._begin(self._wanted, shown, dt)
            self._wanted = None
        self._before, self.posture = self.posture, shown
        self.pose = self._place(shown, dt)
        return self._retarget(self.pose), self.pose

    def _begin(self, switch: Switch, shown: Posture, dt: float) -> None:
        """Starts the wanted motion where it resembles the body most, and the fade towards it."""
        leaving, entering = self._repertoire[self._player.motion], self._repertoire[switch.to]
        place = self._joints(shown)
        velocity = (place - self._joints(self.posture)) / dt
        anchor = best_anchor(place, velocity, entering.places, entering.velocities, VELOCITY_REACH)
        self._player.cue_anchor(switch.to, anchor)
        tempo = self.speed if entering.loop else 0.0
        target_before = self._decode(self._player.step(0.0), tempo)
        target = self._decode(self._player.step(dt * tempo), tempo)
        bound = _briskness(leaving, entering)
        self._fade = difference((self.posture, shown), (target_before, target), dt, bound)
        self._fade_start = self.time
        self._fading = switch

    def _onset(self) -> float:
        """The share of the tempo at which a motion that happens once gets going while the fade into it lasts.

        At full tempo half of it would be over before it can be seen.
        """
        if self._fade is None or self._repertoire[self._player.motion].loop:
            return 1.0
        return min(1.0, (self.time - self._fade_start) / self._fade.duration) ** 2

    def _faded(self, target: Posture) -> Posture:
        """The target with what is left of the last switch."""
        if self._fade is None:
            return target
        elapsed = self.time - self._fade_start
        if elapsed < self._fade.duration:
            return self._fade.apply(target, elapsed)
        self._fade = None
        if self._fading is not None:
            self._fading.settled_s = self.time
            self._fading = None
        return target

    def _decode(self, channels: Array, speed: float) -> Posture:
        """The posture of channels, its path played at a speed."""
        posture = self._encoding.decode(channels)
        return replace(
            posture,
            height=posture.height.copy(),
            velocity=posture.velocity * speed,
            turn_rate=posture.turn_rate * speed,
        )

    def _place(self, posture: Posture, dt: float) -> Pose:
        """Where a posture stands after walking on for dt seconds."""
        self._heading += float(posture.turn_rate) * dt
        cos, sin = np.cos(self._heading), np.sin(self._heading)
        forward, left = posture.velocity * dt
        self._root_xy += cos * forward - sin * left, sin * forward + cos * left
        position = np.array([self._root_xy[0], self._root_xy[1], float(posture.height)])
        return Pose(position, np.array(self._heading), multiply(yaw(self._heading), posture.rotation))

    def _joints(self, posture: Posture) -> Array:
        """Joint positions relative to the root in the heading frame, and the root's height, shape (F,), m."""
        skeleton = self._encoding.skeleton
        joints = skeleton.joints(np.zeros(3), posture.rotation)[1:]
        return np.append(joints.ravel(), posture.height)

    def _check(self, motion: str) -> None:
        if motion not in self._repertoire:
            raise UnknownNameError.among("motion", motion, self.motions)


def _briskness(leaving: Motion, entering: Motion) -> Array:
    """What the bones are used to in the brisker of two motions."""
    return np.maximum(leaving.briskness, entering.briskness)
