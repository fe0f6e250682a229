import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.deck.interfaces import JointLimits
from controller.deck.target_curve import DELAY_TICKS, TargetCurve
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.skeleton import Pose

DT = 0.005
LIMITS = JointLimits(*(np.full(3, x) for x in (-2.0, 2.0, 6.0, 60.0, 2000.0)))


def pose_at(x, angle=0.0):
    turn = np.array([np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)])
    return Pose(np.array([x, 0.0, 1.0]), np.array(angle), np.array([turn, turn]))


def divided_differences(times, values):
    """The means of the first, second and third derivative over neighbouring times, each (n, J)."""
    orders = []
    for order in (1, 2, 3):
        values = order * np.diff(values, axis=0) / (times[order:] - times[:-order])[:, None]
        orders.append(values)
    return orders


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.1, 1.0, 30.0]))
def test_the_curve_through_safe_targets_keeps_the_limits_at_all_times(seed, scale):
    rng = np.random.default_rng(seed)
    envelope, curve = SafetyEnvelope(LIMITS, DT), TargetCurve(np.zeros(3), pose_at(0.0))
    times, read = [], []
    for tick in range(80):
        curve.add(envelope(rng.normal(0.0, scale, 3)), pose_at(0.0))
        for share in np.sort(rng.uniform(0.0, 1.0, rng.integers(0, 4))):
            if not times or (tick + share) * DT - times[-1] > 1e-4:
                times.append((tick + share) * DT)
                read.append(curve.targets(share))
    positions = np.array(read)
    assert (np.abs(positions) <= 2.0).all()
    for differences, most in zip(divided_differences(np.array(times), positions), (6.0, 60.0, 2000.0), strict=True):
        assert np.abs(differences).max() <= most * (1.0 + 1e-6)


def test_a_steady_movement_is_followed_two_ticks_later():
    curve = TargetCurve(np.zeros(1), pose_at(0.0))
    for tick in range(1, 9):
        curve.add(np.array([0.1 * tick]), pose_at(0.1 * tick, 0.2 * tick))
    for share in (0.0, 0.3, 1.0):
        there = 8 + share - DELAY_TICKS
        assert curve.targets(share) == pytest.approx([0.1 * there])
        pose = curve.pose(share)
        assert pose.root_position == pytest.approx([0.1 * there, 0.0, 1.0])
        assert pose.heading == pytest.approx(0.2 * there)
        assert pose.rotation[1] == pytest.approx(pose_at(0.0, 0.2 * there).rotation[1], abs=1e-4)


def test_the_two_sides_of_a_rotation_do_not_cancel():
    curve = TargetCurve(np.zeros(1), pose_at(0.0))
    curve.add(np.zeros(1), Pose(np.zeros(3), np.zeros(()), -pose_at(0.0).rotation))
    assert np.abs(curve.pose(0.5).rotation[0]) == pytest.approx([1.0, 0.0, 0.0, 0.0])
