"""The judge of fault schedules: it reads true shafts and registers of emulated servos, never the rig's own readings.

speed      a shaft turns at most at its joint's limit, and while it catches up after a recovery at a quarter of it
           and it changes its speed no faster than its acceleration limit
position   a shaft stays within its joint's limits, and so does every goal on the wire
torque     comes on only where the goal is the present position, and only on the model that the rig file names
watchdog   is armed on every servo with torque that has been driven for more than a second
end        2 s after it every shaft stands; after a close torque is off, or the joints hold, and the port is closed
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hardware.emulator.bus import Answer, EmulatedBus
from hardware.emulator.faults import FaultPlan
from hardware.emulator.port import EmulatedPort
from hardware.emulator.servos.device import Device
from hardware.emulator.servos.servo_bank import TRIPPED
from hardware.protocol2 import instructions as wire
from hardware.protocol2.frames import Parser
from hardware.rig.rig_file import RigConfig
from hardware.rig.scale import Array

SPEED_MARGIN, SPEED_PLAY = 1.1, 0.2  # of the limit; rad/s, because a shaft swings about its path
_CATCH_UP, _CATCH_UP_PLAY = 0.25, 0.35  # of the limit, rad/s
_COASTS = 0.2  # s that a shaft may need to stop when it is held
_ACCELERATION_MARGIN, _ACCELERATION_PLAY = 1.2, 2.0  # of the limit; rad/s^2, because a shaft swings about its path
_LAG = 0.06  # s that a shaft is behind its servo's path
_OVER = 5  # looks, over which an acceleration is measured
_JERKED = 0.3  # s after its watchdog has stopped it, or torque has changed, in which a shaft may stop at once
_PLAY = 0.05  # rad
_ARMED_WITHIN = 1.2  # s
_STANDS = 0.05  # rad/s


class JudgedBus(EmulatedBus):
    """An emulated bus that notes where torque comes on.

    Attributes:
        problems: what was wrong.
    """

    def __init__(self, config: RigConfig) -> None:
        super().__init__(config)
        self.problems: list[str] = []
        self._joints = config.joints
        # A servo may be swapped for another meanwhile; this is what stands in the rig file.
        self._models = [device["model_number"] for device in self.devices]

    def exchange(self, data: bytes, now: float) -> list[Answer]:
        """As the emulated bus, with a look at every servo before and after."""
        before = [device.torque for device in self.devices]
        answers = super().exchange(data, now)
        for joint, device, model, was_on in zip(self._joints, self.devices, self._models, before, strict=True):
            if was_on or not device.torque:
                continue
            off = abs(device["goal_position"] - device["present_position"]) / abs(joint.pulses_per_radian)
            if off > _PLAY:
                self.problems.append(f"torque of {joint.name} came on {off:.2f} rad from its goal")
            if device["model_number"] != model:
                self.problems.append(f"torque came on in another model's servo at {joint.name}")
        return answers


class JudgedPort(EmulatedPort):
    """An emulated port that knows whether it was closed."""

    def __init__(self, bus: JudgedBus, name: str, faults: FaultPlan) -> None:
        super().__init__(bus, paced=True, faults=faults)
        self.name = name
        self.closed = False

    def close(self) -> None:
        """Notes it."""
        self.closed = True


class ShaftJudge:
    """Judges the joints of one port, tick by tick.

    Attributes:
        problems: what was wrong, each kind once a joint.
        fastest, hardest: the largest speed and acceleration as a part of the joint's limit, over all joints.
    """

    def __init__(self, config: RigConfig, port: JudgedPort, bus: JudgedBus) -> None:
        self._config, self._port, self._bus = config, port, bus
        self._velocity = np.array([joint.velocity for joint in config.joints])
        self._acceleration = np.array([joint.acceleration or np.inf for joint in config.joints])
        self._seen: deque[tuple[float, Array]] = deque(maxlen=_OVER + 1)
        self._jerked = np.full(len(config.joints), -np.inf)
        self._lower = np.array([joint.lower for joint in config.joints])
        self._upper = np.array([joint.upper for joint in config.joints])
        self._before = self._targets = self.angles
        self._at = port.now()
        self._unarmed = np.full(len(config.joints), np.nan)
        self._slow_from = np.full(len(config.joints), np.inf)
        self._problems: dict[tuple[str, str], str] = {}
        self.fastest = self.hardest = 0.0

    @property
    def angles(self) -> Array:
        """Where the shafts really are, shape (J,), rad."""
        shafts = [_shaft(device) for device in self._bus.devices]
        return np.array(
            [
                (shaft - joint.zero) / joint.pulses_per_radian
                for joint, shaft in zip(self._config.joints, shafts, strict=True)
            ]
        )

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

    def recovered(self) -> None:
        """Notes that the rig has just come back: its joints catch up slowly."""
        self._slow_from[:] = self._port.now() + _COASTS

    def look(self, targets: Array, blocked: NDArray[np.bool_], cut_off: NDArray[np.bool_], driven: bool) -> None:
        """Judges what has happened since the last look.

        Args:
            targets: within the limits, shape (J,), rad.
            blocked: joints that something holds, or held a moment ago, shape (J,); their speed is not judged.
            cut_off: joints that missed goals, shape (J,); they may go to the next one at full speed.
            driven: whether the rig took targets in this tick.
        """
        now, angles = self._port.now(), self.angles
        velocity = (angles - self._before) / max(now - self._at, 1e-6)
        speed = np.abs(velocity)
        free = ~blocked
        self.fastest = max(self.fastest, float((speed / self._velocity)[free].max(initial=0.0)))
        self._slow_from[cut_off] = np.inf
        slow = self._at >= self._slow_from
        self._note("was too fast", free & (speed > self._velocity * SPEED_MARGIN + SPEED_PLAY), speed)
        self._note("caught up too fast", free & slow & (speed > self._velocity * _CATCH_UP + _CATCH_UP_PLAY), speed)
        self._slow_from[np.abs(angles - targets) < self._behind(targets, now)] = np.inf
        self._note("left its limits", (angles < self._lower - _PLAY) | (angles > self._upper + _PLAY), angles)
        on = np.array([device.torque and not device.dead for device in self._bus.devices])
        self._judge_acceleration(0.5 * (now + self._at), velocity, free)
        armed = np.array([device["bus_watchdog"] != 0 for device in self._bus.devices])
        self._unarmed[armed | ~on | (not driven)] = np.nan
        self._unarmed[np.isnan(self._unarmed) & ~armed & on & driven] = now
        self._note("had no watchdog", now - self._unarmed > _ARMED_WITHIN, self._unarmed)
        self._before, self._at = angles, now

    def _behind(self, targets: Array, now: float) -> Array:
        """How far a shaft that follows may be behind targets (J,), rad, that move as they do now."""
        pace = np.abs(targets - self._targets) / max(now - self._at, 1e-6)
        self._targets = targets
        pace = np.minimum(pace, self._velocity)
        return 2.0 * _PLAY + pace * (_LAG + pace / (2.0 * self._acceleration))

    def _judge_acceleration(self, at: float, velocity: Array, free: NDArray[np.bool_]) -> None:
        """Judges how velocities (J,), rad/s, at the time `at`, s, have changed over the last looks."""
        powered = np.array([device.torque and device["bus_watchdog"] != TRIPPED for device in self._bus.devices])
        self._jerked[~(powered & free)] = at
        self._seen.append((at, velocity))
        since, before = self._seen[0]
        if len(self._seen) <= _OVER:
            return
        change = np.abs(velocity - before) / (at - since)
        smooth = self._jerked < since - _JERKED
        most = self._acceleration * _ACCELERATION_MARGIN + _ACCELERATION_PLAY
        self.hardest = max(self.hardest, float((change / self._acceleration)[smooth].max(initial=0.0)))
        self._note("was accelerated too hard", smooth & (change > most), change)

    def end(self, closed: bool, hold: bool) -> None:
        """Judges the two seconds after the end, in which nobody says anything."""
        self._port.elapse(2.0)
        before = self.angles
        self._port.elapse(0.5)
        speed = np.abs(self.angles - before) / 0.5
        self._note("did not stand 2 s after the end", speed > _STANDS, speed)
        alive = np.array([not device.dead for device in self._bus.devices])
        on = np.array([device.torque for device in self._bus.devices])
        plugged = not self._port.wire.faults.unplugged
        if closed and plugged:
            down = np.array([device.shut_down for device in self._bus.devices])
            self._note("had the wrong torque after the close", alive & (on != hold) & ~(hold & down), on)
        if closed and not self._port.closed:
            self._problems["", "closed"] = f"the port {self._port.name} was not closed"

    def _note(self, what: str, where: NDArray[np.bool_], values: NDArray[Any]) -> None:
        for index in np.flatnonzero(where).tolist():
            name = self._config.joints[index].name
            problem = f"{name} {what} ({float(values[index]):.2f}) at {self._port.now():.2f} s"
            self._problems.setdefault((name, what), problem)

    def _goals_beyond(self) -> Sequence[str]:
        """Goals on the wire outside the limits."""
        ends = {
            joint.id: sorted((round(joint.pulses(joint.lower)), round(joint.pulses(joint.upper))))
            for joint in self._config.joints
        }
        goal = self._config.joints[0].table["goal_position"]
        beyond = 0
        for frame in Parser().feed(b"".join(self._port.sent)):
            if frame.instruction == wire.SYNC_WRITE and frame.params[:4] == wire.words(goal.address, goal.length):
                for id, pulses in np.frombuffer(frame.params[4:], dtype=[("id", "u1"), ("goal", "<i4")]).tolist():
                    beyond += not ends[id][0] <= pulses <= ends[id][1]
        return [f"{beyond} goals were beyond the limits"] if beyond else []


def _shaft(device: Device) -> float:
    return float(device.bank.shaft[device.row])
