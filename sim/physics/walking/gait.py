"""Gait: places of the feet, the present step, and where it lands to catch the body."""

from collections.abc import Sequence

import numpy as np

from controller.motion.rotations import Array
from sim.models.gravity import GRAVITY
from sim.models.robot_file import WalkSettings
from sim.physics.walking.preview import Swing
from sim.physics.walking.rolling import Rolling
from sim.physics.walking.steps import MEETS, Step, pressure_course, rotated, swing_path, wrapped

GROWS, STOOD = (0.3, 0.55, 0.8, 1.0), 0.6  # shares of the first steps after standing for STOOD, s
SHORTEST, UNKNOWN = 0.2, 0.3  # least duration of a step, and of a swing whose end is not in the preview yet, s
FROZEN = 0.15  # last share of a swing in which its goal is fixed
# Largest turn of the robot in a step, of a landing foot from the heading, and of a standing foot from it, rad.
TURN, FOOT_TURN, TWIST = 1.0, 0.5, 0.6
# Share of an error of the heading that a step makes up for, and the largest such turn, rad: feet slip as they stand.
STEERS, STEERING = 0.5, 0.1
APART = 0.9  # largest width of a step beyond the least one, in widths, as far as the foot lands flat
# Largest lengthening of a step by a capture step, heights of the root, and bounds of its width, in widths.
LONGER, NARROW, WIDE = 0.7, 0.85, 2.2
STRETCH = 1.1  # largest distance of the feet, in longest steps at their least width
DOUBT = 0.15  # uncertainty of the capture point's error, relative to the lengthening of a step
# Error of the capture point, heights of the root, at which a standing robot steps, and that step's duration, s.
TOO_FAR, QUICK = 0.12, 0.35


class Gait:
    """Plans one step after another, on a plane where the feet never slip."""

    def __init__(self, settings: WalkSettings, height: float, sole: float, sides: Array, widest: float) -> None:
        """Args: walk settings; height of the root, m; length of a sole, m; sides (2,), 1 for left; widest stance, m."""
        self._set, self._height, self._sides = settings, height, sides
        self._roll = 0.5 * sole * settings.roll
        self._width = settings.width * height
        self._apart = min(APART * self._width, widest - self._width)
        self._reach = STRETCH * height * float(np.hypot(settings.longest, settings.width))
        self._slowest = settings.slowest * float(np.sqrt(height / GRAVITY))  # on one foot errors grow

    def start(self, middle: Array, facing: float, yaws: Array) -> None:
        """Stands with both feet beside a point (2,), m, facing a direction, rad, with the feet at yaws (2,), rad."""
        apart = 0.5 * self._width * np.array([-np.sin(facing), np.cos(facing)])
        self.places = np.array([middle + side * apart for side in self._sides])  # of the standing soles, (2, 2), m
        self.yaws = facing + np.array([_clipped(yaw - facing) for yaw in yaws])
        self.step: Step | None = None  # the present one
        self._swing: Swing | None = None
        self._longer = np.zeros(2)
        self._from = self.places[0].copy(), 0.0
        self._now = self._tick = 0.0
        self._landed: tuple[float, Array] | None = None
        self._count = self.recoveries = 0  # recoveries: steps that are not the motion's
        self._heading, self._astray = facing, 0.0
        self.slipped = 0.0  # turn of the standing feet to the right of the plan, rad
        self._own: list[Swing] = []
        self.rolling = Rolling(self._set.toe, self._set.heel, self._set.longest * self._height)  # pitches of the soles

    def advance(self, now: float, swings: Sequence[Swing], preview: float) -> Swing | None:
        """Advances to a time, s, with the motion's swings until `preview` later; the swing that ended, if any."""
        self._horizon = now + preview
        self._now, self._tick = now, now - self._now
        ended = None
        if self.step is not None and self._swing is not None:
            self.step.end = self._end(self._swing, self.step.start)
            if self.step.end <= now:
                ended = self._swing
                self.places[self.step.foot], self.yaws[self.step.foot] = self.step.place, self.step.yaw
                self._heading, self._astray = self.step.heading, self.step.astray
                other = 1 - self.step.foot
                toes = rotated((self._roll, 0.0), float(self.yaws[other]))
                self._landed = now - MEETS, self.places[other] + toes
                self.step = self._swing = None
        if ended in self._own:
            self._own.remove(ended)
        # The present step and those to come.
        self.coming = self._chain(now, self._own + [swing for swing in swings if swing is not ended])
        self.rolling.advance(now, self.places, self.step, self.coming)
        return ended

    def course(self, now: float) -> tuple[Array, Array]:
        """The course of the centre of pressure, as of `pressure_course`."""
        return pressure_course(now, self._landed, self.places, self.yaws, self.coming, self._roll)

    def catch(self, now: float, off: Array, effect: float) -> Array:
        """Moves the step's goal so that the capture point returns to its plan, as fast as the foot can follow.

        For the error of the capture point with the present goal, `off` (2,), m, and its change by the goal's, `effect`.
        Returns the displacement of the goal, (2,), m.
        """
        step, s = self.step, self._set
        if step is None or now > step.end - FROZEN * (step.end - step.start):
            return np.zeros(2)
        before = self._longer
        alone = off + effect * before
        wanted = rotated(alone * (effect / (effect**2 + DOUBT**2)), -step.direction) * (s.ahead, s.aside)
        most = LONGER * self._height
        x = min(max(wanted[0], -most), most)
        side = self._sides[step.foot]
        planned = side * rotated(step.place - before - self.places[1 - step.foot], -step.direction)[1]
        y = side * (min(max(planned + side * wanted[1], NARROW * self._width), WIDE * self._width) - planned)
        stands, unmoved = self.places[1 - step.foot], step.place - before
        place = unmoved + rotated((x, y), step.direction)
        place = stands + (place - stands) * min(1.0, self._reach / float(np.hypot(*(place - stands))))
        along, _ = swing_path((now - step.start) / (step.end - step.start))
        moves = place - unmoved - before
        most = s.fastest * self._height * self._tick
        moves = moves * min(1.0, most / max(along * float(np.hypot(*moves)), 1e-9))
        self._longer, step.place = before + moves, unmoved + before + moves
        return moves

    def recover(self, now: float, off: Array, capture: Array) -> None:
        """Begins two recovery steps if the robot stands and the capture point (2,), m, is `off` (2,), m, too far."""
        if self.coming or np.hypot(*off) < TOO_FAR * self._height:
            return
        away = self.places - capture
        foot = int(np.argmax(np.hypot(away[:, 0], away[:, 1])))
        heading, start = self._heading - self._astray, now
        for swings in (foot, 1 - foot):
            # Side by side, and then as they stood.
            x, y = rotated(self.places[swings] - self.places[1 - swings], -self._heading)
            share, side = self._set.share, self._sides[swings]
            x = 0.0 if swings == foot else x / share
            y = side * ((side * y - self._width) / share + self._width)
            yaw = float(self.yaws[swings]) - self._astray
            self._own.append(Swing(swings, start, start + QUICK, np.array([x, y]), yaw, heading))
            start += QUICK + self._set.double_support
        self.recoveries += 1

    def swing(self, now: float) -> tuple[Array, float, float]:
        """Start of the swinging foot, (2,), m, its yaw there, rad, and the share of its time that has passed."""
        assert self.step is not None
        place, yaw = self._from
        return place, yaw, (now - self.step.start) / (self.step.end - self.step.start)

    def turn(self, now: float, heading: float) -> float:
        """The robot's heading relative to the motion's, rad, within what the hips turn on a standing foot."""
        astray, stands = self._astray, self.yaws
        if self.step is not None:
            along, _ = swing_path((now - self.step.start) / (self.step.end - self.step.start))
            astray += along * (self.step.astray - self._astray)
            stands = self.yaws[[1 - self.step.foot]]
        twist = [wrapped(heading + astray - yaw) for yaw in stands]
        excess = max(max(twist) - TWIST, 0.0) + min(min(twist) + TWIST, 0.0)
        self._astray -= excess
        return astray - excess

    @property
    def standing(self) -> Array:
        """The feet's shares of the weight, shape (2,)."""
        return np.array([0.5, 0.5]) if self.step is None else np.eye(2)[1 - self.step.foot]

    def _chain(self, now: float, swings: Sequence[Swing]) -> list[Step]:
        places, yaws, steps, s = [*self.places], [*self.yaws], list[Step](), self._set
        heading, astray = self._heading, self._astray
        landed = None if self._landed is None else self._landed[0] + MEETS
        free = -np.inf if landed is None else landed + s.double_support
        count = self._count
        for swing in swings:
            if swing is self._swing:
                assert self.step is not None
                start, end, grown = self.step.start, self.step.end, count - 1
            else:
                end = self._end(swing, max(swing.start, free))
                start = max(swing.start, free, end - self._slowest)
                end = max(end, start + SHORTEST)
                if landed is not None and swing.start - landed > STOOD and not steps:
                    count = 0
                grown, count = count, count + 1
            grown = len(GROWS) if swing in self._own else grown
            other = 1 - swing.foot
            step = self._planned(swing, places[other], yaws[other], heading, astray, grown)
            step.start, step.end = start, end
            if swing is self._swing:
                step.place = step.place + self._longer
                self.step = step
            elif start <= now and self.step is None:
                self.step, self._swing, self._count = step, swing, count
                self._longer = np.zeros(2)
                self._from = self.places[step.foot].copy(), float(self.yaws[step.foot])
            places[step.foot], yaws[step.foot] = step.place, step.yaw
            heading, astray = step.heading, step.astray
            free = step.end + s.double_support
            steps.append(step)
        return steps

    def _end(self, swing: Swing, start: float) -> float:
        end = swing.end if swing.end is not None else max(self._horizon, swing.start + UNKNOWN)
        return max(end, start + SHORTEST)

    def _planned(self, swing: Swing, other: Array, stands: float, heading: float, astray: float, count: int) -> Step:
        """The step for a swing, with the place `other` (2,), m, and the yaw `stands`, rad, of the standing foot.

        Heading of the robot before the step, and relative to the motion, rad; `count` of the steps since it stood.
        """
        turn = wrapped(swing.heading + astray - heading)
        steered = turn + _clipped(STEERS * wrapped(self.slipped - astray), STEERING)
        turned = min(max(steered, -TURN), TURN)
        # Hips that turn to and fro with each step would put one foot in front of the other.
        half = 0.5 * turned
        turned += _clipped(heading + turned - stands, TWIST) - wrapped(heading + turned - stands)
        heading, astray = heading + turned, astray + turned - turn
        direction = heading - half
        share = self._set.share * GROWS[min(count, len(GROWS) - 1)]
        x, y = rotated((swing.from_other[0], swing.from_other[1]), half)
        end = self._end(swing, swing.start)
        # A foot that passes the other one goes twice as far as it lands ahead of it.
        seconds = min(end - swing.start, self._slowest)
        most = self._height * min(self._set.longest, 0.5 * self._set.fastest * seconds)
        side = self._sides[swing.foot]
        aside = share * max(side * y - self._width, 0.0) if self._apart > 0.0 else 0.0
        # Legs that are apart reach less far ahead.
        far = max(1.0, float(np.hypot(share * x / most, aside / max(self._apart, 1e-9))))
        place = other + rotated((share * x / far, side * (self._width + aside / far)), direction)
        yaw = heading + _clipped(swing.yaw - swing.heading)
        # A foot that only follows the other one, as in boxing, does not roll.
        leaves, lands = (max(swing.leaves, 0.0), max(-swing.lands, 0.0)) if x > 0.0 else (0.0, 0.0)
        return Step(swing.foot, swing.start, end, place, yaw, heading, astray, direction, leaves, lands)


def _clipped(turn: float, most: float = FOOT_TURN) -> float:
    """A turn, rad, of at most so much to either side."""
    return min(max(wrapped(turn), -most), most)
