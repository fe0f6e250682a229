"""A rig as an output of the deck: what it is given, what it gives back, and what becomes of it when it is lost."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from command_line import invoked
from controller.deck.interfaces import JointLimits
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.skeleton import Pose
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.pty_server import PtyServer
from hardware.families.dynamixel2.frames import Parser
from hardware.families.frames import SYNC_WRITE
from hardware.rig.rig_file import RigConfig, RigJoint, load_rig
from hardware.rig.supervision.rig import Rig
from motiondeck.run.robots.rig_output import RigOutput, narrowed
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_rig

JOINTS = ("a", "b", "c")
PERIOD_NS = 5_000_000
LIMIT = 4.7  # rad/s
POSE = Pose(np.zeros(3), np.array(0.0), np.zeros((1, 4)))


class FakeRig:
    """Answers each write a tick later with what was written, until it breaks."""

    names = ("c", "a")

    def __init__(self, *lags):
        self.config = SimpleNamespace(joints=[SimpleNamespace(lag=lag) for lag in lags or (0.0, 0.0)])
        self.positions = np.zeros(2)
        self.written = []
        self.broken = False
        self.unconfirmed = []

    def collect_state(self):
        if self.written:
            self.positions = self.written[-1] - 0.01
        return bool(self.written)

    def write(self, targets):
        if self.broken:
            raise MotiondeckError("servo 7 is silent")
        self.written.append(targets.copy())

    def close(self):
        return self.unconfirmed


def test_each_joint_gets_its_own_target_and_its_measurement_comes_back():
    rig = FakeRig()
    output = RigOutput(rig, JOINTS, 100.0)
    output.write(np.array([1.0, 2.0, 3.0]), POSE)
    output.write(np.array([1.0, 2.0, 3.0]), POSE)
    assert rig.written[0].tolist() == [3.0, 1.0]
    measured = output.measured()
    assert measured[[0, 2]] == pytest.approx([0.99, 2.99])
    assert np.isnan(measured[1])


def test_a_joint_that_lags_is_measured_against_its_targets_of_one_lag_ago():
    rig = FakeRig(0.02, 0.0)  # of joints c and a; FakeRig itself is a tick late, and 0.01 rad off
    output = RigOutput(rig, JOINTS, 100.0)
    assert output.lag.tolist() == [0.0, 0.0, 0.02]
    for tick in range(200):
        output.write(np.array([0.0, 0.0, 0.1 * tick]), POSE)
    # Joint c is where its targets are, so 0.2 rad ahead of those of two ticks ago.
    assert np.sqrt(output._squares / output._samples) == pytest.approx(np.sqrt((0.19**2 + 0.01**2) / 2.0), rel=0.02)


def test_a_correction_learns_from_what_is_measured_of_joints_that_are_well():
    rig, heard = FakeRig(), []
    rig.states = SimpleNamespace(conditions=np.array([0, 4]))  # of c and a; 4 gives way
    output = RigOutput(rig, JOINTS, 100.0)
    output.correction = SimpleNamespace(
        learn=lambda measured, age, free: heard.append((measured.copy(), age, free.tolist(), len(rig.written)))
    )
    output.write(np.array([1.0, 2.0, 3.0]), POSE)
    assert not heard
    output.write(np.array([1.0, 2.0, 3.0]), POSE)
    measured, age, free, written = heard[0]
    assert written == 2  # goals do not wait for it
    assert measured[[0, 2]] == pytest.approx([0.99, 2.99])
    assert age == pytest.approx(0.01)
    assert free == [False, False, True]


def test_a_rig_that_is_lost_says_so_at_every_write():
    rig = FakeRig()
    output = RigOutput(rig, JOINTS, 100.0)
    output.write(np.zeros(3), POSE)
    rig.broken = True
    for _ in range(3):
        with pytest.raises(MotiondeckError, match="servo 7 is silent"):
            output.write(np.zeros(3), POSE)
        rig.broken = False
    assert len(rig.written) == 1


def test_joints_whose_torque_may_still_be_on_are_named(capsys):
    rig = FakeRig()
    rig.unconfirmed = ["c"]
    RigOutput(rig, JOINTS, 100.0).close()
    assert "torque may still be on: c" in capsys.readouterr().err


def test_a_rig_with_joints_the_robot_lacks_is_refused():
    with pytest.raises(MotiondeckError, match="rig's joints c"):
        RigOutput(FakeRig(), ("a", "b"), 100.0)


def robot_and_rig(rest=0.0):
    wide = np.full(3, 2.0)
    limits = JointLimits(-wide, wide, wide, wide, wide)
    robot = SimpleNamespace(name="r", joints=JOINTS, rest=np.array([rest, 0.0, 0.0]))
    joint = SimpleNamespace(name="a", lower=-0.5, upper=3.0, velocity=1.0)
    return limits, robot, SimpleNamespace(joints=[joint])


def test_the_narrower_limit_of_robot_and_rig_holds():
    limits = narrowed(*robot_and_rig())
    assert limits.lower.tolist() == [-0.5, -2.0, -2.0]
    assert limits.upper.tolist() == [2.0, 2.0, 2.0]
    assert limits.velocity.tolist() == [1.0, 2.0, 2.0]


def test_a_rest_pose_that_the_rig_cannot_take_is_refused():
    with pytest.raises(MotiondeckError, match=r"rest pose of r has a at -1\.00 rad"):
        narrowed(*robot_and_rig(rest=-1.0))


class WatchedPort(EmulatedPort):
    """Emulated servos in the time that passes while a deck works; keeps each goal of the first with its time."""

    def __init__(self, bus):
        super().__init__(bus)
        self.goals = []

    def send(self, data):
        for frame in Parser().feed(data):
            if frame.instruction == SYNC_WRITE and frame.params[:2] == bytes((116, 0)):
                self.goals.append((self.now(), int.from_bytes(frame.params[5:9], "little")))
        return super().send(data)


class CatchingUp:
    """A clock on a port's time that makes up for ticks that were missed, as `--overruns catch-up` does."""

    period, skipped, overruns = PERIOD_NS * 1e-9, 0, 0

    def __init__(self, port):
        self.port = port

    def now(self):
        return round(self.port.now() * 1e9)

    def start(self):
        self.deadline = self.now()

    def wait(self):
        self.deadline += PERIOD_NS
        self.port.elapse(max(0, self.deadline - self.now()) * 1e-9)
        return self.now() - self.deadline


class StallingDeck:
    """Swings as fast as the limit allows; its updates take 50 us, and some 150 ms."""

    def __init__(self, port):
        self.port, self.updates = port, 0

    def update(self, dt):
        self.updates += 1
        self.port.elapse(0.15 if self.updates % 130 == 0 else 5e-5)
        return np.array([1.2 * np.sin(self.updates * dt * LIMIT / 1.2)]), POSE


def test_a_loop_that_stalls_and_catches_up_never_asks_the_servo_for_more_than_its_limit():
    joint = RigJoint("a", 1, "XM430-W350", 1, 2048, -1.5, 1.5, LIMIT)
    config = RigConfig("emulated", 4_000_000, 200.0, (joint,))
    port = WatchedPort(EmulatedBus(config))
    rig = Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)
    limits = JointLimits(*(np.array([value]) for value in (-1.5, 1.5, LIMIT, 200.0, 20_000.0)))
    clock, output = CatchingUp(port), RigOutput(rig, ("a",), 200.0)
    run(StallingDeck(port), [Channel(output)], clock, SafetyEnvelope(limits, clock.period), seconds=3.0)
    times, goals = np.array(port.goals).T
    angles = goals / joint.pulses_per_radian
    stalled = np.diff(times) > 0.14
    assert stalled.sum() >= 3
    speeds = np.abs(np.diff(angles))[~stalled] / PERIOD_NS * 1e9
    assert np.percentile(speeds, 90) > 0.9 * LIMIT
    pulse = 1.0 / joint.pulses_per_radian
    for ticks in (1, 2, 5, 20, 50):
        asked = np.abs(angles[ticks:] - angles[:-ticks]) - pulse
        assert (asked <= 1.05 * LIMIT * (times[ticks:] - times[:-ticks])).all()


def test_stopping_a_rig_that_another_program_plays_on_says_how_to_stop_that():
    config = load_rig(find_rig("servo20"))
    server = PtyServer(EmulatedBus(config))
    player = Bus.open(server.port, config.baud)
    result = invoked("rig", "stop", "servo20", "--port", server.port)
    player.close()
    server.close()
    assert result.exit_code == 1
    assert "torque off: 0 of 20 servos" in result.stdout
    assert "motiondeck send estop" in result.stderr
