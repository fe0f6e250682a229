"""The judge of fault schedules: it reads true shafts and registers of emulated servos, never the rig's own readings.

speed      a shaft turns at most at its joint's limit, and while it catches up after a recovery at a quarter of it;
           it changes its speed no faster than its acceleration limit. A servo that has taken another's ID may have
           heard that one's speed before its silence could be seen: it may keep that for 0.1 s, its shaft for 0.2 s
           A shaft hurries after one of two servos that has heard another joint's goals when the other restarts
position   a shaft stays within its joint's limits, and so does every goal on the wire
rest       a shaft that is held while it turns comes to rest at its goal, not behind it, from where it would hurry back
torque     comes on only where the goal is the present position, and only on the model that the rig file names
watchdog   is armed on every servo with torque that has been driven for more than a second
end        2 s after it every shaft with torque, or without a load, stands; at a close torque is off and stays off, or
           the joints hold but for those without torque when a rig has stopped, and the port is closed
burdens, actuators    see `burden_judge` and `actuator_judge`
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.rig.actuator_judge import ActuatorJudge
from benchmarks.rig.burden_judge import BurdenJudge, true_goals
from benchmarks.rig.burdens import Burdens, dead_torque
from benchmarks.rig.judged_port import APART, PLAY, JudgedBus, JudgedPort
from hardware.emulator.servos.device import Device
from hardware.emulator.servos.servo_bank import TRIPPED
from hardware.families import frames as codes
from hardware.families.dynamixel2 import frames as wire
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import POSITION_MODE, RigJoint
from hardware.rig.scale import Array
from hardware.rig.turn_file import TurnFile

SPEED_MARGIN, SPEED_PLAY = 1.1, 0.2  # of the limit; rad/s, because a shaft swings about its path
_CATCH_UP, _CATCH_UP_PLAY = 0.25, 0.35  # of the limit, rad/s
_COASTS = 0.2  # s that a shaft may need to stop when it is held
_ACCELERATION_MARGIN, _ACCELERATION_PLAY = 1.2, 2.0  # of the limit; rad/s^2, because a shaft swings about its path
_PAST = 0.1  # rad that a shaft may run past the goal at which it is held
_LAG = 0.06  # s that a shaft is behind its servo's path
_OVER = 0.05  # s, over which an acceleration is measured
_JERKED = 0.3  # s after its watchdog has stopped it, or torque has changed, in which a shaft may stop at once
_TAKEN_BACK, _SETTLED = 0.1, 0.2  # s in which a servo and its shaft may have the speed of one whose ID it has taken
# s in which a shaft may be fast after a weight has turned it without torque, after its servo was starved unseen, or
# after a restart of one of two servos that worked against each other, where the rig could not reach both.
_FALLEN = 0.3
_AT, _AT_ONCE = 0.02, 0.1  # rad from a goal to the target; s after a joint is held
_ARMED_WITHIN = 1.2  # s
_STANDS = 0.05  # rad/s


Struck = Callable[[float], tuple[NDArray[np.bool_], NDArray[np.bool_]]]
"""From a time, s: which joints something holds, or held a moment ago; which ones miss goals. Both (J,)."""


class ShaftJudge:
    """Judges the joints of one port while time passes on it.

    Attributes:
        problems: what was wrong, each kind once a joint.
        fastest, hardest: the largest speed and acceleration as a part of the joint's limit, over all joints.
    """

    def __init__(self, config: RigConfig, port: JudgedPort, bus: JudgedBus, struck: Struck, burdens: Burdens) -> None:
        self._actuated = ActuatorJudge(config, bus)
        self._burdened = BurdenJudge(config, bus, burdens, self._actuated.others)
        self._loaded = burdens.weight > 0.0
        count = len(config.joints)
        self._config, self._port, self._bus, self._struck = config, port, bus, struck
        self._velocity = np.array([joint.velocity for joint in config.joints])
        self._acceleration = np.array([joint.acceleration or np.inf for joint in config.joints])
        self._zero = np.array([joint.zero for joint in config.joints])
        self._per_radian = np.array([joint.pulses_per_radian for joint in config.joints])
        self._watched = np.array(["bus_watchdog" in joint.table.registers for joint in config.joints])
        self._seen: deque[tuple[float, Array]] = deque()
        # A rig is switched on between two looks; until then a weight may turn the shafts.
        self._jerked = np.where(self._powered(), -np.inf, port.now())
        self._lower = np.array([joint.lower for joint in config.joints])
        self._upper = np.array([joint.upper for joint in config.joints])
        self._targets = self.angles
        self._turning = np.zeros(count)
        self._at = self._looked = port.now()
        self._unsent = np.zeros(count, dtype=np.int64)
        self._unarmed = np.full(count, np.nan)
        self._slow_from = np.full(count, np.inf)
        self._coasting = np.zeros(count)
        self._held_at = np.zeros(count)
        self._coasts_until = np.full(count, -np.inf)
        self._fell = np.where(self._loaded & ~self._powered(), port.now(), -np.inf)
        self._starved = np.full(count, -np.inf)
        self._renamed = np.full(count, np.inf)  # when a servo has taken another's ID, s
        # A servo ignores its position limits in other modes, also if it is misled by goals for another with its ID.
        self._unbounded = np.array([joint.mode != POSITION_MODE for joint in config.joints])
        self._misled, self._limp, self._thrown = np.zeros((3, count), dtype=bool)
        self._problems: dict[tuple[str, str], str] = {}
        self.fastest = self.hardest = 0.0
        self._holds = {_single_goal(joint): index for index, joint in enumerate(config.joints)}
        port.watch, port.on_send = self._watch, self._note_sent
        burdens.press(bus.devices, self.angles, self._per_radian)

    @property
    def angles(self) -> Array:
        """Where the shafts really are, shape (J,), rad."""
        shafts = np.array([device.bank.shaft[device.row] for device in self._bus.devices])
        return (shafts - self._zero) / self._per_radian

    @property
    def speeds(self) -> Array:
        """How fast the shafts really turn, shape (J,), rad/s."""
        speeds = np.array([device.bank.drive.speed[device.row] for device in self._bus.devices])
        return speeds / self._per_radian

    @property
    def sag(self) -> Array:
        """How far off its goal each joint may be because of its weight, shape (J,), rad."""
        return self._burdened.sag

    @property
    def now(self) -> float:
        """The time on the port, s."""
        return self._port.now()

    @property
    def problems(self) -> list[str]:
        """What was wrong so far."""
        return [*self._problems.values(), *dict.fromkeys(self._bus.problems), *self._goals_beyond()]

    @property
    def is_wrong(self) -> bool:
        """Whether something was wrong in what a look shows; what was sent is judged in `problems`."""
        return bool(self._problems or self._bus.problems)

    def switched_on(self) -> None:
        """Notes that what comes now is no catching up: the rig has been switched on."""
        self._slow_from[:] = np.inf
        self._burdened.switched_on(self._note)

    def ask(self, targets: Array) -> None:
        """Takes the targets of a tick (J,), rad, within the limits, before the rig does."""
        self._burdened.asked(targets, self._port.now())
        self._actuated.asked(targets)

    def look(self, targets: Array, unsent: NDArray[np.int64]) -> None:
        """Judges what only the loop knows, after a tick.

        Args:
            targets: within the limits, shape (J,), rad.
            unsent: how many targets each joint has not been sent so far, shape (J,).
        """
        now = self._port.now()
        driven, self._unsent = unsent == self._unsent, unsent.copy()
        self._slow_from[np.abs(self.angles - targets) < self._behind(targets, now)] = np.inf
        # A joint that is held where it was going to come to rest has nothing to catch up with.
        self._slow_from[(np.abs(self._goals() - targets) < _AT) & (now - self._slow_from < _AT_ONCE)] = np.inf
        on = np.array([device.torque and not device.dead for device in self._bus.devices])
        armed = (self._watchdogs() != 0) | ~self._watched
        self._unarmed[armed | ~on | ~driven] = np.nan
        self._unarmed[np.isnan(self._unarmed) & ~armed & on & driven] = now
        self._note("had no watchdog", now - self._unarmed > _ARMED_WITHIN, self._unarmed)
        self._looked = now

    def _watch(self) -> None:
        """Judges how the shafts have turned since the last time."""
        now = self._port.now()
        if now - self._at < 0.5 * APART:
            return
        angles, velocity = self.angles, self.speeds
        blocked, cut_off = self._struck(now)
        powered = self._powered()
        self._burdened.watch(now, now - self._at, blocked, cut_off, powered, self._note)
        self._actuated.watch(now, now - self._at, angles, self._goals(), cut_off, powered, self._note)
        self._fell[(self._loaded & ~powered) | self._actuated.freed] = now
        # One that the rig cannot reach cannot be eased while its supply is low, and hurries when that is back.
        self._starved[cut_off & ~self._supplied()] = now
        speed = np.abs(velocity)
        free = ~blocked & (now - np.maximum(self._fell, self._starved) > _FALLEN)
        self.fastest = max(self.fastest, float((speed / self._velocity)[free].max(initial=0.0)))
        self._slow_from[cut_off] = np.inf
        self._coasting[(velocity * self._coasting <= 0.0) | (self._at > self._coasts_until) | cut_off] = 0.0
        self._held_at = np.maximum(self._held_at, self._coasting * self._goals())
        past = self._coasting * angles - self._held_at
        far = (past > _PAST + self._burdened.sag) & ~self._misled
        self._note("ran past the goal at which it was held", free & (self._coasting != 0.0) & far, past)
        slow = (self._at >= self._slow_from) & (self._coasting == 0.0)
        most = np.maximum(self._velocity * SPEED_MARGIN + SPEED_PLAY, self._velocity * self._swings())
        self._judge_renamed(now)
        renamed_lately = now - self._renamed < _SETTLED
        self._note("was too fast", free & (speed > np.where(renamed_lately, most.max(), most)), speed)
        self._note("caught up too fast", free & slow & (speed > self._velocity * _CATCH_UP + _CATCH_UP_PLAY), speed)
        outside = (angles < self._lower - PLAY) | (angles > self._upper + PLAY)
        self._misled = (self._misled & outside) | (cut_off & self._unbounded)
        # One that the end of a jam threw out of its limits may be stopped there by its watchdog, until it is driven.
        self._thrown = (self._thrown | blocked) & outside
        self._note("left its limits", outside & ~self._thrown & ~self._misled, angles)
        # Where one of two servos loses its torque, the other one turns it too.
        both = powered & powered[self._actuated.others]
        # Where one of two hears another joint's goals or none, their paths part, and voltages that end stop the shaft.
        apart = (cut_off | cut_off[self._actuated.others]) & self._actuated.paired
        self._judge_acceleration(now, velocity, free & both & ~apart & ~self._sticks(velocity))
        self._at, self._turning = now, velocity

    def _judge_renamed(self, now: float) -> None:
        """Judges which servos have taken another's ID, and have kept that one's speed."""
        joints = zip(self._config.joints, self._bus.devices, strict=True)
        other = np.array([device.id != joint.id for joint, device in joints])
        self._renamed = np.where(other, np.minimum(self._renamed, now), np.inf)
        tops = [device.bank.drive.top_speed[device.row] for device in self._bus.devices]
        tops = np.array(tops) / np.abs(self._per_radian)
        kept = now - self._renamed > _TAKEN_BACK
        self._note("kept another's speed", kept & self._powered() & (tops > self._velocity * SPEED_MARGIN), tops)

    def _swings(self) -> Array:
        """The largest speed of each shaft as a part of the largest of its path, shape (J,)."""
        return np.array([swings(_loop(device)) for device in self._bus.devices])

    def _goals(self) -> Array:
        """The goal registers of the servos, shape (J,), rad."""
        return (true_goals(self._bus.devices) - self._zero) / self._per_radian

    def _watchdogs(self) -> NDArray[np.int64]:
        """The watchdog registers of the servos, shape (J,)."""
        return np.array([device.bank.registers["bus_watchdog"][device.row] for device in self._bus.devices])

    def _note_sent(self, data: bytes) -> None:
        """Notes which joint is held: it comes to rest the way it turns now, and catches up slowly."""
        index = next((index for start, index in self._holds.items() if data.startswith(start)), None)
        if index is not None:
            now, turning = self._port.now(), self._turning[index]
            self._coasting[index], self._held_at[index] = np.sign(turning), -np.inf
            self._coasts_until[index] = now + _COASTS + abs(turning) / self._acceleration[index]
            self._slow_from[index] = now

    def _behind(self, targets: Array, now: float) -> Array:
        """How far a shaft that follows may be behind targets (J,), rad, that move as they do now."""
        pace = np.abs(targets - self._targets) / max(now - self._looked, 1e-6)
        self._targets = targets
        pace = np.minimum(pace, self._velocity)
        return 2.0 * PLAY + self._burdened.sag + pace * (_LAG + pace / (2.0 * self._acceleration))

    def _sticks(self, velocity: Array) -> NDArray[np.bool_]:
        """Which shafts are held by the friction of an identified motor, from which they break loose, shape (J,)."""
        frictions = [device.bank.drive.motor.friction is not None for device in self._bus.devices]
        return np.array(frictions) & (velocity == 0.0)

    def _supplied(self) -> NDArray[np.bool_]:
        """Which servos have the voltage that they need, shape (J,)."""
        return np.array([_has_voltage(device) for device in self._bus.devices])

    def _powered(self) -> NDArray[np.bool_]:
        """Which servos have torque, voltage and a watchdog that has not stopped them, shape (J,)."""
        powered = np.array([device.torque for device in self._bus.devices]) & self._supplied()
        return powered & (self._watchdogs() != TRIPPED)

    def _judge_acceleration(self, at: float, velocity: Array, steady: NDArray[np.bool_]) -> None:
        """Judges how velocities (J,), rad/s, at the time `at`, s, have changed over the last looks."""
        self._jerked[~steady] = at
        self._seen.append((at, velocity))
        while len(self._seen) > 1 and at - self._seen[1][0] >= _OVER:
            self._seen.popleft()
        since, before = self._seen[0]
        if at - since < _OVER:
            return
        change = np.abs(velocity - before) / (at - since)
        smooth = self._jerked < since - _JERKED
        most = self._acceleration * _ACCELERATION_MARGIN + _ACCELERATION_PLAY
        most += [_release(device) / _OVER for device in self._bus.devices]
        self.hardest = max(self.hardest, float((change / self._acceleration)[smooth].max(initial=0.0)))
        self._note("was accelerated too hard", smooth & (change > most), change)

    def stopped(self) -> None:
        """Notes which servos have no torque when the rig has stopped, because it gives none any more."""
        self._limp = ~np.array([device.torque for device in self._bus.devices])

    def end(self, closed: bool, hold: bool, turns: TurnFile | None) -> None:
        """Judges the two seconds after the end, of silence, and the turns that were kept, if they can be known."""
        self._burdened.end(self._note)
        reached = closed and not self._port.was_out
        if reached and turns is not None:
            self._actuated.end(turns, self.angles, self._note)
        if reached:
            self._judge_torque(hold)
        self._port.elapse(2.0)
        before = self.angles
        self._port.elapse(0.5)
        speed = np.abs(self.angles - before) / 0.5
        on = np.array([device.torque for device in self._bus.devices])
        self._note("did not stand 2 s after the end", (on | ~self._loaded) & (speed > _STANDS), speed)
        if reached and not hold:
            self._judge_torque(hold)
        if closed and not self._port.closed:
            self._problems["", "closed"] = f"the port {self._port.name} was not closed"

    def _judge_torque(self, hold: bool) -> None:
        alive = np.array([not device.dead for device in self._bus.devices])
        on = np.array([device.torque for device in self._bus.devices])
        down = np.array([device.shut_down for device in self._bus.devices])
        alive &= ~(hold & (down | self._misled | self._limp))
        self._note("had the wrong torque after the close", alive & (on != hold), on)

    def _note(self, what: str, where: NDArray[np.bool_], values: NDArray[Any]) -> None:
        if not np.logical_or.reduce(where):
            return
        for index in np.flatnonzero(where).tolist():
            name = self._config.joints[index].name
            problem = f"{name} {what} ({float(values[index]):.2f}) at {self._port.now():.2f} s"
            self._problems.setdefault((name, what), problem)

    def _goals_beyond(self) -> Sequence[str]:
        """Goals on the wire outside the limits."""
        sent, beyond = b"".join(self._port.sent), 0
        for family in {joint.table.family for joint in self._config.joints}:
            joints = [joint for joint in self._config.joints if joint.table.family is family]
            frames = (
                [frame for frame in family.parser().feed(sent) if frame.instruction == codes.SYNC_WRITE]
                if joints
                else []
            )
            for joint in joints:
                goal = joint.table["goal_position"]
                place = bytes((goal.address, goal.length)) if family.spoken else wire.words(goal.address, goal.length)
                low, high = sorted((round(joint.pulses(joint.lower)), round(joint.pulses(joint.upper))))
                for entries in (frame.params[len(place) :] for frame in frames if frame.params.startswith(place)):
                    at = entries[:: goal.length + 1].find(joint.id) * (goal.length + 1) + 1
                    beyond += at > 0 and not inside(joint, goal.decode(entries[at : at + goal.length]), low, high)
        return [f"{beyond} goals were beyond the limits"] if beyond else []


def inside(joint: RigJoint, goal: int, low: int, high: int) -> bool:
    """Whether a goal is between two positions, pulses; where the joint's range leaves one turn, in any turn."""
    turns = 0 if joint.in_one_turn else (goal - low) // joint.table.pulses_per_turn
    return low <= goal - turns * joint.table.pulses_per_turn <= high


def swings(loop: float) -> float:
    """The largest speed of a shaft as a part of the largest of its path, for a loop gain (1/s) times motor lag (s).

    The loop answers a change of its path's speed with swings, each smaller than the one before by
    r = exp(-pi z / sqrt(1 - z^2)), with z = 1 / (2 sqrt(loop)). A path that turns back at each swing adds them up to
    1 + 2 r + 2 r^2 + ... = (1 + r) / (1 - r); no path within that speed gives more.
    """
    damping = min(0.5 / math.sqrt(max(loop, 1e-9)), 0.999)
    smaller = math.exp(-math.pi * damping / math.sqrt(1.0 - damping * damping))
    return (1.0 + smaller) / (1.0 - smaller)


def _loop(device: Device) -> float:
    """The gain of a servo's position loop (1/s) times its motor's lag (s)."""
    drive, motor = device.bank.drive, device.bank.drive.motor
    fastest = motor.no_load_speed / 60.0 * device.bank.table.pulses_per_turn
    return float(drive.p_gain[device.row] * fastest / motor.full_pwm * motor.lag)


def _release(device: Device) -> float:
    """How much the speed of a shaft changes when friction lets go of it, rad/s."""
    motor = device.bank.drive.motor
    return dead_torque(motor) * motor.no_load_speed / 60.0 * 2.0 * math.pi


def _has_voltage(device: Device) -> bool:
    """Whether a servo's supply has not broken down, which slows it."""
    drive = device.bank.drive
    return bool(drive.supply[device.row] >= drive.motor.voltage)


def _single_goal(joint: RigJoint) -> bytes:
    """How the frame begins that gives this joint's servo alone a goal, as it is held: all but goal and checksum."""
    goal, words = joint.table["goal_position"], joint.table.family.instructions
    whole = words.write(joint.id, goal.address, bytes(goal.length))
    return whole[: -goal.length - len(joint.table.family.trailer(whole))]
