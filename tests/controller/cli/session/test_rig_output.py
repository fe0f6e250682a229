"""A rig as an output of the deck: what it is given, what it gives back, and what becomes of it when it is lost."""

from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from controller.cli.main import app
from controller.cli.session.rig_output import RigOutput, narrowed
from controller.deck.interfaces import JointLimits
from controller.mocap.posture import Pose
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.pty_server import PtyServer
from hardware.rig.rig_file import load_rig
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.shipped import find_rig

JOINTS = ("a", "b", "c")
POSE = Pose(np.zeros(3), np.array(0.0), np.zeros((1, 4)))


class FakeRig:
    """Answers each write a tick later with what was written, until it breaks."""

    names = ("c", "a")

    def __init__(self):
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

    def request_state(self):
        pass

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


def test_stopping_a_rig_that_another_program_plays_on_says_how_to_stop_that():
    config = load_rig(find_rig("servo20"))
    server = PtyServer(EmulatedBus(config))
    player = Bus.open(server.port, config.baud)
    result = CliRunner().invoke(app, ["rig", "stop", "servo20", "--port", server.port])
    player.close()
    server.close()
    assert result.exit_code == 1
    assert "torque off: 0 of 20 servos" in result.stdout
    assert "motiondeck send estop" in result.stderr
