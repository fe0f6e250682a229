import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.simulated_time import VirtualClock
from controller.loop.loop import run
from controller.loop.output_channel import Channel
from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck_base.errors import FileFormatError
from sim.models.servo_motor import ROOM, Motors, ServoMotor
from sim.physics.playback import PhysicsPlayback
from sim.robots.robot import load_robot
from simulated_bodies import ROBOTS, bent_pose, human

XM430 = ServoMotor(torque=4.1, speed=4.8, current=2.3)


def one_of(servo, allowed=np.inf):
    return Motors(servo, np.array([servo.torque]), np.array([servo.speed]), np.array([allowed]))


def servo20(tmp_path, extra):
    text = (ROBOTS / "servo20.toml").read_text().replace('"servo20.xml"', f'"{ROBOTS / "servo20.xml"}"')
    head, _, tail = text.partition("[servo]\n")
    (tmp_path / "robot.toml").write_text(f"{head}[servo]\n{extra}\n{tail}")
    return load_robot(tmp_path / "robot.toml", human())


@given(st.floats(-20.0, 20.0))
def test_the_torque_falls_along_a_line_from_stall_to_the_no_load_speed(velocity):
    ((back, forth),) = one_of(XM430).line(np.array([velocity]))
    assert forth == pytest.approx(4.1 * (1.0 - velocity / 4.8))
    assert back == pytest.approx(-4.1 * (1.0 + velocity / 4.8))


def test_a_current_limit_is_a_torque_limit():
    limited = ServoMotor(torque=4.1, speed=4.8, current=2.3, current_limit=1.15)
    most = [float(one_of(*which).most[0]) for which in ((XM430,), (limited,), (XM430, 3.0))]
    assert most == pytest.approx([4.1, 2.05, 3.0])
    assert one_of(limited).drawn(np.array([-2.05]))[0] == pytest.approx(1.15)


def test_it_warms_up_towards_where_warming_and_cooling_meet():
    square = np.array([0.5 * 2.3**2])
    assert XM430.temperature(square, 0.0)[0] == pytest.approx(ROOM)
    assert XM430.temperature(square, 1.0)[0] == pytest.approx(ROOM + 0.75, rel=0.01)
    assert XM430.temperature(square, 1e6)[0] == pytest.approx(ROOM + 0.5 * 1.5 * 240.0)


def test_a_weak_servo_cannot_hold_what_a_strong_one_can(tmp_path):
    pose = bent_pose(human(), lelb=(0.0, 0.0, 0.0))
    sag = []
    for extra in ("", "current_limit = 0.02"):
        robot = servo20(tmp_path, extra)
        output = PhysicsPlayback(robot, 0.005)
        targets = robot.retarget(pose).copy()
        for _ in range(100):
            output.write(targets, pose)
        sag.append(np.abs(output.measured() - targets).max())
    assert sag[0] < 0.05 < sag[1]


def test_play_and_latency_show(tmp_path):
    pose = bent_pose(human())
    robot = servo20(tmp_path, "latency = 0.05\nbacklash = 0.1")
    output = PhysicsPlayback(robot, 0.005)
    targets = robot.rest.copy()
    output.write(targets, pose)
    moved = targets + 0.3 * (np.arange(20) == robot.joints.index("r_elbow"))
    elbow = robot.joints.index("r_elbow")
    way = []
    for _ in range(60):
        output.write(moved, pose)
        way.append(output.measured()[elbow] - targets[elbow])
    assert abs(way[8]) < 0.06
    assert 0.2 < way[-1] < 0.3


def test_a_deck_leads_servos_that_are_late(tmp_path):
    """Their joints are where another output, which is not late, shows them."""
    pose, robot = bent_pose(human()), servo20(tmp_path, "latency = 0.05")
    elbow = robot.joints.index("r_elbow")

    class Waving:
        time = 0.0

        def update(self, dt):
            self.time += dt
            return robot.rest + 0.3 * np.sin(6.0 * self.time) * (np.arange(20) == elbow), pose

    class Picture:
        name, last = "picture", robot.rest

        def write(self, targets, pose):
            self.last = targets.copy()

        def measured(self):
            return None

        def report(self):
            return {}

    physics, picture, off = PhysicsPlayback(robot, 0.005), Picture(), []
    assert physics.lag == pytest.approx(np.full(20, 0.05))
    assert PhysicsPlayback(servo20(tmp_path, ""), 0.005).lag is None
    run(
        Waving(),
        [Channel(physics), Channel(picture)],
        VirtualClock(200.0),
        SafetyEnvelope(robot.limits, 0.005),
        seconds=2.5,
        publish=lambda state: off.append(physics.measured()[elbow] - picture.last[elbow]),
        publish_every=1,
    )
    assert np.abs(off[100:490]).max() < 0.02  # 0.09 without the lead


@pytest.mark.parametrize(
    ("extra", "error", "complaint"),
    [
        ("torqe = 3.0", FileFormatError, r"'torqe' in \[servo\].*Did you mean 'torque'"),
        ("backlash = -1.0", FileFormatError, r"servo\.backlash"),
        ("latency = inf", FileFormatError, r"servo\.latency is inf"),
    ],
)
def test_a_servo_that_cannot_be_is_refused(tmp_path, extra, error, complaint):
    with pytest.raises(error, match=complaint):
        servo20(tmp_path, extra)


def test_the_report_says_what_the_servos_have_been_through():
    robot = load_robot(ROBOTS / "servo20.toml", human())
    output = PhysicsPlayback(robot, 0.005)
    pose = bent_pose(human())
    for _ in range(20):
        output.write(robot.rest, pose)
    said = output.report()["servos"]
    assert isinstance(said, dict)
    assert 0.0 < said["peak_torque_nm"] <= 4.1
    assert said["hottest_degc"] >= ROOM
