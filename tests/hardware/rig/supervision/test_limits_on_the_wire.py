"""No goal beyond the rig file's limits of position and speed reaches the wire, whatever the targets are."""

import numpy as np
import pytest

import motiondeck.rigs
from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.families.dynamixel2.frames import Parser
from hardware.families.frames import SYNC_WRITE
from hardware.rig.supervision.rig import Rig
from motiondeck import open_rig

GOAL_POSITION = 116
TICK = 0.01


@pytest.fixture
def port(rig_of_four):
    return EmulatedPort(EmulatedBus(rig_of_four), paced=True)


@pytest.fixture
def rig(rig_of_four, port):
    rig = Rig(rig_of_four, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)
    port.sent.clear()
    return rig


def goals_on_the_wire(config, port):
    """The goal positions that were sent, shape (sent, J), rad."""
    rows = []
    for frame in Parser().feed(b"".join(port.sent)):
        if frame.instruction == SYNC_WRITE and frame.params[0] == GOAL_POSITION:
            entries = np.frombuffer(frame.params[4:], dtype=[("id", "u1"), ("count", "<i4")])
            counts = dict(zip(entries["id"].tolist(), entries["count"].tolist(), strict=True))
            rows.append([(counts[joint.id] - joint.zero) / joint.pulses_per_radian for joint in config.joints])
    return np.array(rows)


def wild_targets(ticks):
    """Jumps far beyond the limits, small values, and no numbers."""
    random = np.random.default_rng(3)
    targets = random.choice([-1e300, -7.0, -0.3, 0.0, 0.4, 9.0, 1e12, np.nan, np.inf, -np.inf], size=(ticks, 4))
    targets[ticks // 3 : ticks // 2] = 5.0
    return targets


def test_wild_targets_stay_within_position_and_speed(rig, port, rig_of_four):
    for targets in wild_targets(400):
        rig.collect_state()
        rig.write(targets)
        port.elapse(TICK)
    sent = goals_on_the_wire(rig_of_four, port)
    assert len(sent) == 400
    assert (sent >= [joint.lower - 8e-4 for joint in rig_of_four.joints]).all()  # half a pulse
    assert (sent <= [joint.upper + 8e-4 for joint in rig_of_four.joints]).all()
    assert np.abs(np.diff(sent, axis=0)).max() <= 4.0 * TICK + 1.6e-3
    assert np.ptp(sent, axis=0).min() > 1.0


def test_a_joint_that_is_pushed_beyond_its_limit_gets_no_goal_there(rig, port, rig_of_four):
    """A yielding joint's goal stays near its position, but within the limits."""
    servo = port.bus.devices[2]
    servo.bank.shaft[2], servo.bank.drive.jammed[2] = 3000.0, True  # at 2.3 rad
    for _ in range(80):
        rig.collect_state()
        rig.write(np.full(4, 5.0))
        port.elapse(TICK)
    assert rig.pace.strain.yielding.tolist() == [False, False, True, False]
    sent = goals_on_the_wire(rig_of_four, port)
    assert (sent <= [joint.upper + 8e-4 for joint in rig_of_four.joints]).all()


def test_used_alone_a_rig_refuses_what_is_no_angle_and_bounds_the_rest(rig, port, rig_of_four):
    alone = motiondeck.rigs.Rig(rig)
    for target in (9.0, -9.0, 0.3):
        alone.write(np.full(4, target))
        port.elapse(TICK)
    for bad in (np.nan, np.inf):
        with pytest.raises(RigError, match="angle"):
            alone.write({"joint_1": bad})
    sent = goals_on_the_wire(rig_of_four, port)
    assert (sent >= [joint.lower - 8e-4 for joint in rig_of_four.joints]).all()
    assert (sent <= [joint.upper + 8e-4 for joint in rig_of_four.joints]).all()


def test_a_simulated_rig_keeps_its_servos_within_the_limits():
    with open_rig("servo20", servos="simulated") as rig:
        for target in (9.0, -9.0):
            rig.write(np.full(len(rig.joints), target))
            rig.wait(3.0)
            assert (rig.read() >= rig.lower - 2e-3).all()
            assert (rig.read() <= rig.upper + 2e-3).all()
