"""Arms of three servos, judged by arms that were turned by known angles."""

from math import cos, pi, sin

import pytest

from sim.retargeting.arm_angles import ThreeServoArm

ROLL, ELBOW = (-0.2, 1.5), (0.0, 2.4)


def turned(pitch, roll, elbow):
    """The directions of upper arm and forearm: Ry(pitch) Rx(roll) of those of an arm that hangs."""

    def world(x, y, z):
        y, z = y * cos(roll) - z * sin(roll), y * sin(roll) + z * cos(roll)
        return cos(pitch) * x + sin(pitch) * z, y, -sin(pitch) * x + cos(pitch) * z

    return world(0.0, 0.0, -1.0), world(sin(elbow), 0.0, -cos(elbow))


@pytest.mark.parametrize("pitches", [(-pi, pi), (2.0, 6.0), (-6.5, -3.0)])
def test_an_arm_that_is_far_off_finds_the_pitch_within_its_range_whatever_turn_that_is(pitches):
    arm = ThreeServoArm((pitches[0], ROLL[0], ELBOW[0]), (pitches[1], ROLL[1], ELBOW[1]))
    pitch = pitches[0] + 0.7 * (pitches[1] - pitches[0])
    upper, fore = turned(pitch, 0.4, 1.1)
    assert arm.elsewhere(upper, fore, pitch - 1.9, 1.1) == pytest.approx(pitch, abs=0.1)  # after three rounds
    assert arm.elsewhere(upper, fore, pitch + 0.1, 1.1) is None


def test_a_pitch_outside_the_range_is_not_offered():
    arm = ThreeServoArm((2.0, ROLL[0], ELBOW[0]), (3.0, ROLL[1], ELBOW[1]))
    assert arm.elsewhere(*turned(0.5, 0.4, 1.1), 2.5, 1.1) is None
