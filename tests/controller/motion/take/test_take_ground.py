"""The floor is found where feet stand: moved to 0, levelled, or left as it is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.motion.clip import Clip
from controller.motion.rotations import about, multiply, rotate
from controller.motion.take.ground import SOLE, contacts_of, grounded
from simulated_bodies import human

RATE = 60.0
PLACES = [(0.0, 0.0), (0.6, 0.1), (1.1, 0.9), (0.4, 1.5), (-0.5, 1.0), (-0.9, 0.2), (-0.2, -0.7), (0.8, -0.6)]
LEG = human().leg_length


def hops(floor=lambda x, y, t: 0.0 * t, stands=0.5, flies=0.4):
    """A body that hops from place to place and stands half a second in each, on a floor of some height."""
    stand, fly = round(stands * RATE), round(flies * RATE)
    share = 0.5 - 0.5 * np.cos(np.pi * np.arange(fly) / fly)
    way, lift = [], []
    for here, there in zip(PLACES, [*PLACES[1:], PLACES[0]], strict=True):
        way += [np.tile(here, (stand, 1)), here + share[:, None] * np.subtract(there, here)]
        lift += [np.zeros(stand), 0.3 * np.sin(np.pi * np.arange(fly) / fly)]
    xy = np.concatenate(way)
    time = np.arange(len(xy)) / RATE
    height = LEG + SOLE * LEG + np.concatenate(lift) + floor(xy[:, 0], xy[:, 1], time)
    rotation = np.tile([1.0, 0.0, 0.0, 0.0], (len(xy), 20, 1))
    return Clip("hops", human(), RATE, np.column_stack([xy, height]), rotation, "hops.bvh")


def off(found):
    """How far feet that stand are from where they are on a floor at 0, m."""
    return np.abs(contacts_of(found.joints(), RATE).place[:, 2] - SOLE * LEG).max()


def test_a_floor_at_0_stays():
    clip = hops()
    found, decision = grounded(clip, "auto")
    assert found is clip
    assert (decision.decided, decision.notable) == ("at 0", False)
    assert "slope" not in decision.evidence


def test_feet_in_one_place_do_not_show_a_slope():
    clip = hops()
    in_place = Clip("hops", clip.skeleton, RATE, clip.root_position * [0.1, 0.1, 1.0], clip.rotation, "hops.bvh")
    decision = grounded(in_place, "auto")[1]
    assert (decision.decided, decision.notable) == ("at 0, not checked for a slope", True)


def test_a_slope_that_is_too_slight_to_be_levelled_is_said():
    clip = hops(lambda x, y, t: 0.028 * x)
    found, decision = grounded(clip, "auto")
    assert found is clip
    assert decision.evidence == "feet stand as on a floor that slopes by 1.6 degrees"
    assert decision.notable


@given(st.floats(0.2, 30.0) | st.floats(-30.0, -0.2))
def test_a_floor_elsewhere_is_moved_to_0(height):
    found, decision = grounded(hops(lambda x, y, t: height + 0.0 * t), "auto")
    assert off(found) < 0.01
    assert decision.notable


@given(st.floats(2.0, 12.0), st.floats(0.0, 6.28))
def test_a_slope_is_levelled(degrees, heading):
    clip = hops()
    turn = about(np.array([np.cos(heading), np.sin(heading), 0.0]), np.radians(degrees))
    rotation = multiply(np.broadcast_to(turn, clip.rotation.shape), clip.rotation)
    tilted = Clip("tilted", clip.skeleton, RATE, rotate(turn, clip.root_position), rotation, "tilted.bvh")
    found, decision = grounded(tilted, "auto")
    assert off(found) < 0.01
    assert f"slopes by {degrees:.1f}" in decision.decided


@given(st.floats(0.02, 0.2) | st.floats(-0.2, -0.02))
def test_a_floor_that_drifts_is_levelled(speed):
    found, decision = grounded(hops(lambda x, y, t: speed * t), "auto")
    assert off(found) < 0.01
    assert ("sinks" if speed < 0.0 else "rises") in decision.decided


def test_stairs_are_no_drift_and_no_slope():
    clip = hops(lambda x, y, t: 0.17 * np.floor(t / 0.9))
    found, decision = grounded(clip, "auto")
    np.testing.assert_array_equal(np.ptp(found.root_position, axis=0), np.ptp(clip.root_position, axis=0))
    assert decision.decided.startswith("at 0, but it may")
    assert "feet stand at heights from" in decision.evidence


def test_a_body_that_leans_aside_is_doubted_where_no_slope_can_be_seen():
    clip = hops()
    turn = about(np.array([1.0, 0.0, 0.0]), np.radians(8.0))
    still = np.tile([0.0, 0.0, LEG + SOLE * LEG], (len(clip), 1))
    rotation = multiply(np.broadcast_to(turn, clip.rotation.shape), clip.rotation)
    found, decision = grounded(Clip("leans", clip.skeleton, RATE, still, rotation, "leans.bvh"), "auto")
    np.testing.assert_array_equal(found.rotation, rotation)
    assert "leans by 8 degrees to the right" in decision.evidence


def bending(clip, hip=0.5):
    """Both thighs forwards while it stands, so that the hips would sink."""
    turn = about(np.array([0.0, 1.0, 0.0]), -hip * (0.5 - 0.5 * np.cos(np.arange(len(clip)) / 20.0)))
    rotation = clip.rotation.copy()
    for bone in (clip.skeleton.bones.index("lkne"), clip.skeleton.bones.index("rkne")):
        rotation[:, 1 + bone] = turn
    return rotation


@pytest.mark.parametrize("height", [0.0, 0.03])
def test_hips_without_height_are_raised_by_the_lowest_foot(height):
    clip = hops()
    centred = Clip(
        "centred", clip.skeleton, RATE, clip.root_position * [1, 1, 0] + [0, 0, height], bending(clip), "c.bvh"
    )
    found, decision = grounded(centred, "auto")
    lowest = found.joints()[..., 2].min(axis=1)
    assert np.ptp(lowest) < 0.01
    assert 0.0 < lowest.min() < 0.1
    assert "hips stay at" in decision.evidence


def test_what_never_stands_stays_as_it_is_and_that_is_said():
    clip = hops()
    time = np.arange(len(clip)) / RATE
    swims = clip.root_position * [1, 1, 0] + np.column_stack([time, 0 * time, 2.0 + 0.3 * np.sin(4.0 * time)])
    swimming = Clip("swims", clip.skeleton, RATE, swims, clip.rotation, "swims.bvh")
    found, decision = grounded(swimming, "auto")
    assert found is swimming
    assert (decision.decided, decision.notable) == ("as in the file, not checked", True)


def test_a_given_height_and_none_overrule():
    clip = hops(lambda x, y, t: 1.0 + 0.0 * t)
    assert grounded(clip, "none")[0] is clip
    np.testing.assert_allclose(grounded(clip, 1.0)[0].root_position, hops().root_position, atol=1e-12)
