"""A limp joint that swings takes torque on where it is, and where it is slow."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.families.models import MODELS
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint, SecondServo
from hardware.rig.switching.torque import switch_on

_ARM, _MASS = 0.2, 0.06  # m, kg


class Pendulums:
    """Two arms without friction, let go at 1.1 and 0.9 rad: they swing through at 7 rad/s."""

    def __init__(self):
        self.angles, self.speeds = np.array([1.1, -0.9]), np.zeros(2)

    def advance(self, torques, seconds):
        pull = torques / (_MASS * _ARM**2) - 9.81 / _ARM * np.sin(self.angles)
        self.speeds = self.speeds + pull * seconds
        self.angles = self.angles + self.speeds * seconds
        return self.angles, self.speeds


class WatchedBus(EmulatedBus):
    """Notes how far from its goal, rad, and how fast, rad/s, each servo is where its torque comes on."""

    def __init__(self, config):
        self.plant, self.came_on = Pendulums(), []
        super().__init__(config, plant=self.plant)
        self.joints, self.of = config.servos.joints, config.joint_of

    def exchange(self, data, now):
        before = [device.torque for device in self.devices]
        answers = super().exchange(data, now)
        for joint, of, device, was_on in zip(self.joints, self.of, self.devices, before, strict=True):
            if device.torque and not was_on:
                off = joint.angle(device["goal_position"]) - self.plant.angles[of]
                self.came_on.append((device.id, abs(off), abs(self.plant.speeds[of])))
        return answers


def swinging(model):
    """A rig of a joint with two servos, and one with a single one; and its bus, after the arms have been let go."""
    zero = sum(MODELS[model].one_turn) // 2
    limits = {"lower": -1.4, "upper": 1.4, "velocity": 2.0}
    both = RigJoint("both", 1, model, 1, zero, **limits, second=SecondServo(2, -1, zero))
    config = RigConfig("emulated", 1_000_000, 100.0, (both, RigJoint("alone", 3, model, -1, zero, **limits)))
    port = EmulatedPort(WatchedBus(config), paced=True)
    bus = Bus(port, 1_000_000)
    bus.families = config.families
    port.elapse(0.23)
    return config.servos, port, bus


@pytest.mark.parametrize("model", ["XL330-M288", "MX-64(1.0)"])
def test_torque_comes_on_where_the_goal_is_and_the_joint_is_slow(model):
    servos, port, bus = swinging(model)
    held = switch_on(servos, bus, None)
    assert [id for id, _, _ in port.bus.came_on] == [1, 2, 3]
    assert max(off for _, off, _ in port.bus.came_on) < 0.05
    assert max(speed for *_, speed in port.bus.came_on) < 2.0
    goals = [joint.angle(port.bus[joint.id]["goal_position"]) for joint in servos.joints]
    assert held.angles == pytest.approx(goals, abs=1e-6)


def test_one_that_is_never_slow_is_named(monkeypatch):
    """Its shaft is turned on and on, within its limits."""
    monkeypatch.setattr("hardware.rig.switching.torque._SWINGS", 0.2)
    servos, port, bus = swinging("XL330-M288")
    port.bus.plant.advance = lambda *_: (np.array([np.sin(30.0 * port.now()), 0.0]), np.array([7.0, 0.0]))
    with pytest.raises(RigError, match=r"^both.* swings\. Hold it still while it is switched on\.$"):
        switch_on(servos, bus, None)
