import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import synthetic
from controller.errors import MotiondeckError, UnknownNameError
from controller.realtime.deck import FASTEST, SLOWEST, Deck

DT = 0.005


@pytest.fixture(scope="module")
def library():
    return synthetic.small_library()


def bone_directions(pose):
    """A stand-in for a robot: its joints are the bones' directions."""
    return pose.rotation.ravel().copy()


def new_deck(library, motion="march"):
    return Deck(library, bone_directions, motion)


def joints(library, deck, seconds):
    """Joint positions while the deck plays on, shape (ticks, joints, 3), m."""
    out = []
    for _ in range(round(seconds / DT)):
        deck.update(DT)
        out.append(library.skeleton.joints(deck.pose.root_position, deck.pose.rotation))
    return np.array(out)


def peak_acceleration(places):
    return np.linalg.norm(np.diff(places, n=2, axis=0), axis=-1).max() / DT**2


def test_it_walks_forward_at_the_recorded_speed(library):
    deck = new_deck(library)
    joints(library, deck, 4.0)
    assert deck.pose.root_position[0] == pytest.approx(1.2 * 4.0, rel=0.1)


@pytest.mark.parametrize("pair", [(a, b) for a in synthetic.MOTIONS for b in synthetic.MOTIONS])
def test_a_switch_neither_jumps_nor_freezes(library, pair):
    source, target = pair
    own = [peak_acceleration(joints(library, new_deck(library, name), 2.0)) for name in pair]
    deck = new_deck(library, source)
    joints(library, deck, 0.53)
    deck.switch(target)
    places = joints(library, deck, 2.5)
    assert peak_acceleration(places) <= 2.0 * max(*own, 5.0)
    assert deck.settled
    assert deck.motion == target
    if target != "bow":
        assert np.abs(np.diff(places[-50:], axis=0)).max() > 1e-4


def test_a_switch_is_on_record(library):
    deck = new_deck(library)
    joints(library, deck, 0.5)
    record = deck.switch("wave")
    assert (record.to, record.commanded_s) == ("wave", pytest.approx(0.5))
    joints(library, deck, 2.5)
    assert record.first_change_s is not None
    assert record.first_change_s - record.commanded_s <= 2.01 * DT
    assert record.settled_s is not None
    assert record.first_change_s < record.settled_s < 2.5


def test_a_switch_to_what_plays_changes_nothing(library):
    first, second = new_deck(library), new_deck(library)
    joints(library, first, 0.4)
    joints(library, second, 0.4)
    assert second.switch("march").settled_s == second.time
    assert np.array_equal(joints(library, first, 0.3), joints(library, second, 0.3))


def test_a_motion_that_happens_once_can_be_repeated(library):
    deck = new_deck(library, "bow")
    low = joints(library, deck, 3.0)[-1, 0, 2]
    deck.switch("bow")
    again = joints(library, deck, 3.0)[:, 0, 2]
    assert again.max() > low + 0.05
    assert again[-1] == pytest.approx(low, abs=0.03)


def test_a_pause_stands_still_and_a_resume_goes_on(library):
    deck = new_deck(library)
    joints(library, deck, 0.5)
    deck.pause()
    joints(library, deck, 0.5)
    assert np.ptp(joints(library, deck, 0.5), axis=0).max() < 1e-9
    deck.resume()
    assert np.ptp(joints(library, deck, 1.0), axis=0).max() > 0.3


def test_half_the_tempo_takes_twice_the_time(library):
    deck = new_deck(library)
    deck.set_speed(0.5)
    joints(library, deck, 1.0)
    start = deck.pose.root_position[0]
    joints(library, deck, 2.0)
    assert deck.pose.root_position[0] - start == pytest.approx(1.2, rel=0.1)


@pytest.mark.parametrize("factor", [0.0, -1.0, SLOWEST / 2, FASTEST * 2, float("nan"), float("inf")])
def test_an_impossible_tempo_is_refused(library, factor):
    with pytest.raises(MotiondeckError, match="between"):
        new_deck(library).set_speed(factor)


def test_an_unknown_motion_is_refused_with_the_nearest_name(library):
    deck = new_deck(library)
    with pytest.raises(UnknownNameError, match="wave"):
        deck.switch("wavee")
    assert not deck.switches
    with pytest.raises(UnknownNameError, match="march"):
        new_deck(library, "marsh")


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(1, 60),
            st.sampled_from([*synthetic.MOTIONS, "pause", "resume", 0.1, 0.5, 3.0]),
        ),
        max_size=8,
    )
)
def test_whatever_is_commanded_targets_are_finite_and_repeatable(library, commands):
    runs = []
    for _ in range(2):
        deck, targets = new_deck(library), []
        for ticks, command in commands:
            if command == "pause":
                deck.pause()
            elif command == "resume":
                deck.resume()
            elif isinstance(command, float):
                deck.set_speed(command)
            else:
                deck.switch(command)
            targets += [deck.update(DT)[0] for _ in range(ticks)]
        runs.append(np.array(targets))
    assert np.isfinite(runs[0]).all()
    assert np.array_equal(runs[0], runs[1])
