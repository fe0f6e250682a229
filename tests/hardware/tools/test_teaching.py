"""Teaching by hand, against emulated servos whose horns a hand swings while they have no torque."""

import numpy as np
import pytest

from hardware.bus.servo_bus import Bus
from hardware.emulator.handling import Handling
from hardware.errors import RigError
from hardware.tools.loose_joints import loosen
from hardware.tools.teaching import Moment, beyond_limits, taught, watch_hands


def watch(config, port, seconds, hands=None):
    """What is seen in so many seconds; hands do something from the first second on."""

    def elapse(dt):
        port.elapse(dt)
        if hands is not None and port.now() > 1.0:
            hands.move([port.bus], port.now())

    moments = []
    for moment in watch_hands(config, [(config, Bus(port, config.baud))], elapse):
        moments.append(moment)
        if moment.time >= seconds:
            break
    return moments


def test_what_a_hand_did_is_written_down(rig_of_four, port):
    for device in port.bus.devices:
        device["torque_enable"] = 1
    loosen(rig_of_four, Bus(port, rig_of_four.baud))
    hands = Handling(rig_of_four)
    hands.command("swing joint_1 0.4 joint_2 -0.4 joint_3 0.4 joint_4 0.4 every 2")
    moments = watch(rig_of_four, port, 4.0, hands)
    assert len(moments) == pytest.approx(400, abs=5)
    motion = taught(moments, 100.0)
    assert len(motion.whole) == pytest.approx(401, abs=3)
    assert motion.first == pytest.approx(88, abs=8)  # the first second, in which nothing moved
    assert motion.end == len(motion.whole)
    # joint_2 is mounted the other way round, joint_3 has its zero elsewhere; both start at angle 0
    assert motion.moving.max(axis=0) == pytest.approx([0.4, 0.0, 0.4, 0.4], abs=0.01)
    assert motion.moving.min(axis=0) == pytest.approx([0.0, -0.4, 0.0, 0.0], abs=0.01)


def test_a_joint_is_followed_across_the_servos_own_zero(rig_of_four, port):
    row = port.bus.devices[0]
    row.bank.shaft[0] = 3 * 4096 + 4000.0  # counted on while it was loose
    port.elapse(0.01)

    def push(seconds):
        row.bank.shaft[0] += 300.0 * seconds
        port.elapse(seconds)

    seen = []
    for moment in watch_hands(rig_of_four, [(rig_of_four, Bus(port, rig_of_four.baud))], push):
        seen.append(moment.angles[0])
        if moment.time > 1.0:
            break
    assert seen[0] == pytest.approx((4000 - 2048) / 4096 * 2 * np.pi, abs=0.01)
    assert seen[-1] > (4096 - 2048) / 4096 * 2 * np.pi
    assert (np.diff(seen) >= 0.0).all()


def test_a_servo_that_falls_silent_is_named(rig_of_four, port):
    port.bus[3].dead = True
    with pytest.raises(RigError, match=r"joint_3 \(id 3\) does not answer"):
        watch(rig_of_four, port, 3.0)
    with pytest.raises(RigError, match=r"joint_3 \(id 3\)"):
        loosen(rig_of_four, Bus(port, rig_of_four.baud))


def test_lost_answers_leave_no_gap():
    t = np.arange(300) / 100.0
    rng = np.random.default_rng(0)
    moments = [Moment(at, np.array([np.sin(at), np.cos(at)])) for at in t]
    for moment in moments:
        moment.angles[rng.random(2) < 0.2] = np.nan
    clean = taught(moments, 100.0).whole
    assert clean[:, 0] == pytest.approx(np.sin(t), abs=2e-3)


@pytest.mark.parametrize(
    ("moments", "said"),
    [
        ([Moment(0.0, np.zeros(1))], "too short"),
        ([Moment(i / 100, np.zeros(1)) for i in range(10)], "too short"),
        ([Moment(i / 100, np.zeros(1)) for i in range(200)], "no joint was moved"),
        ([Moment(i / 100, np.full(1, np.nan)) for i in range(200)], "never heard"),
    ],
)
def test_what_teaches_nothing_is_refused(moments, said):
    with pytest.raises(RigError, match=said):
        taught(moments, 100.0)


def test_what_the_rig_may_not_repeat_is_named(rig_of_four):
    t = np.arange(100) / 100.0
    angles = np.zeros((100, 4))
    angles[:, 2] = -1.4 * t
    angles[:, 0] = np.where(t > 0.5, 0.5, 0.0)
    said = beyond_limits(rig_of_four, angles, 100.0)
    assert len(said) == 2
    assert "joint_3 went -1.39 to -0.00 rad, it may -1 to 1.5" in said[1]
    assert "joint_1 was moved at 25.0 rad/s, it may 4" in said[0]
