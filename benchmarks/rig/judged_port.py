"""The bus and the port of a judged rig, which see where torque comes on, and look at the shafts while time passes."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.rig.taking_turns import Turns
from benchmarks.simulated_time import EmulatedPort
from hardware.emulator.bus import Answer, EmulatedBus
from hardware.emulator.faults import FaultPlan
from hardware.rig.rig_file import RigConfig

APART = 0.01  # s from one look at the shafts to the next, at most
PLAY = 0.05  # rad


class JudgedBus(EmulatedBus):
    """An emulated bus that notes where torque comes on.

    Attributes:
        problems: what was wrong.
    """

    def __init__(self, config: RigConfig) -> None:
        super().__init__(config)
        self.problems: list[str] = []
        self._joints = config.servos.joints
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
            if off > PLAY:
                self.problems.append(f"torque of {joint.name} came on {off:.2f} rad from its goal")
            if device["model_number"] != model:
                self.problems.append(f"torque came on in another model's servo at {joint.name}")
        return answers


class JudgedPort(EmulatedPort):
    """An emulated port that knows whether it was closed, and looks at the shafts while time passes on it.

    Time passes by the main thread; any other waits for it.

    Attributes:
        closed: whether it is.
        was_out: whether its adapter was out when it was closed, so that nothing reached the servos.
        watch: called at least every 10 ms of its time.
        on_send: called with all bytes sent.
    """

    def __init__(self, bus: JudgedBus, name: str, faults: FaultPlan, turns: Turns) -> None:
        super().__init__(bus, paced=True, faults=faults)
        self.name = name
        self._turns = turns
        self.closed = self.was_out = False
        self.watch: Callable[[], None] = lambda: None
        self.on_send: Callable[[bytes], None] = lambda data: None

    def send(self, data: bytes) -> bool:
        """Hands the bytes to the wire."""
        self.on_send(data)
        return super().send(data)

    def now(self) -> float:
        """The simulated time, s; another thread's first question waits for its first turn."""
        if self._turns.is_other and not self._turns.has_turn:
            self._turns.wait_until(self._now)
        return super().now()

    def elapse(self, seconds: float) -> None:
        """Lets time pass in short steps, or waits until it has passed."""
        if self._turns.is_other:
            until = self._now + seconds
            self._turns.wait_until(until)
            seconds = max(0.0, until - self._now)  # not yet passed if the threads were set free meanwhile
        while seconds > APART:
            super().elapse(APART)
            self.watch()
            seconds -= APART
        super().elapse(seconds)
        self.watch()

    def close(self) -> None:
        """Notes it."""
        self.closed, self.was_out = True, self.wire.faults.unplugged
