"""Blends of several motions in the deck: only weights change from one to the next, and none is dropped with a jump."""

import numpy as np
import pytest

from controller.deck.deck import Deck
from controller.motion.rotations import conjugate, multiply, to_rotation_vector
from motiondeck_base.errors import MotiondeckError
from shipped_libraries import shipped

DT = 0.005


@pytest.fixture(scope="module")
def library():
    return shipped()


def new_deck(library, motion="walk", **options):
    return Deck(library, lambda pose: pose.root_position, motion, **options)


def play(deck, ticks=1):
    """The rotations of root and bones that are shown, shape (ticks, 1 + B, 4)."""
    return np.array([deck.update(DT)[1].rotation for _ in range(ticks)])


def settle(deck, switch):
    shown = [play(deck)]
    while switch.settled_s is None:
        shown.append(play(deck))
        assert len(shown) < 1000, "it has not settled"
    return np.concatenate(shown)


def third_differences(rotations):
    turns = to_rotation_vector(multiply(rotations[1:], conjugate(rotations[:-1])))
    return np.linalg.norm(np.diff(turns, n=2, axis=0), axis=-1)


def test_a_blend_of_four_motions_is_played_and_each_is_dropped_unnoticed(library):
    deck = new_deck(library)
    settle(deck, deck.blend_in("walk", "slow-walk", 0.3, [("jog", 0.2), ("waltz", 0.1)]))
    assert deck.playing == "walk"
    assert dict(deck.blend) == pytest.approx({"slow-walk": 0.3, "jog": 0.2, "waltz": 0.1})
    for command, left in (
        (("walk", "slow-walk", 0.3, [("jog", 0.2)]), ["jog", "slow-walk"]),
        (("walk", "jog", 0.5), ["jog"]),
        (("walk", "jog", 1.0), []),
    ):
        record = deck.blend_in(*command)
        shown = np.concatenate([settle(deck, record), play(deck, 6)])
        assert sorted(name for name, _ in deck.blend) == left
        assert third_differences(shown[-20:]).max() < 0.02
        assert record.fell_back == ""
    assert deck.playing == "jog"


def test_a_blend_goes_over_to_one_that_has_a_motion_in_common_without_a_switch(library):
    deck = new_deck(library)
    settle(deck, deck.blend_in("walk", "jog", 0.5))
    record = deck.blend_in("slow-walk", "jog", 0.4)  # walk plays, and is not named any more
    play(deck)
    assert {deck.playing, *(name for name, _ in deck.blend)} == {"walk", "jog", "slow-walk"}
    settle(deck, record)
    assert (deck.playing, dict(deck.blend)) == ("slow-walk", pytest.approx({"jog": 0.4}))
    assert not record.via


def test_with_nothing_in_common_the_first_is_switched_to(library):
    deck = new_deck(library)
    settle(deck, deck.blend_in("walk", "jog", 0.5))
    settle(deck, deck.blend_in("box1", "box2", 0.4, [("box3", 0.3)]))
    assert deck.playing == "box1"
    assert dict(deck.blend) == pytest.approx({"box2": 0.4, "box3": 0.3})


def test_named_in_another_order_it_shows_the_same(library):
    parts = [("slow-walk", 0.3), ("jog", 0.2), ("waltz", 0.1)]
    shown = []
    for order in (parts, parts[::-1]):
        deck = new_deck(library)
        (second, weight), *also = order
        deck.blend_in("walk", second, weight, also)
        shown.append(play(deck, 300))
    assert np.linalg.norm(to_rotation_vector(multiply(shown[0], conjugate(shown[1]))), axis=-1).max() < 1e-6


def test_the_motions_keep_step(library):
    """In each round of a walk: as many rounds of the others as suit their own tempos, whatever the weights are."""
    deck = new_deck(library)
    record = deck.blend_in("walk", "slow-walk", 0.3, [("jog", 0.3)])
    settle(deck, record)
    tracks = {track.motion.name: track for track in deck.performance.tracks.playing}
    began = {name: track.at for name, track in tracks.items()}
    play(deck, 400)
    rounds = {name: (track.at - began[name]) / track.motion.seconds for name, track in tracks.items()}
    assert rounds["slow-walk"] == pytest.approx(2.0 * rounds["walk"])
    assert rounds["jog"] == pytest.approx(3.0 * rounds["walk"])


def test_a_switch_leaves_a_blend_of_several(library):
    deck = new_deck(library)
    settle(deck, deck.blend_in("walk", "slow-walk", 0.3, [("jog", 0.3)]))
    settle(deck, deck.switch("waltz"))
    assert (deck.playing, deck.blend, deck.settled) == ("waltz", (), True)


def test_a_blend_of_several_that_is_given_up_falls_back_to_the_one_with_most_weight(library):
    deck = new_deck(library)
    settle(deck, deck.blend_in("walk", "slow-walk", 0.3, [("jog", 0.5)]))
    deck.plan.give_up_blend("turns over", deck.time)
    assert deck.fell_back == "walk with 0.50 of jog and 0.30 of slow-walk turns over, fell back to jog"


@pytest.mark.parametrize(
    ("first", "parts", "why"),
    [
        ("walk", [("jog", 0.3), ("walk", 0.3)], "two motions or more, not walk twice"),
        ("walk", [("jog", 0.2), ("waltz", 0.2), ("box1", 0.2), ("box2", 0.2)], "at most 4 motions, not 5"),
        ("walk", [("jog", 0.7), ("waltz", 0.4)], r"sum to at most 1, not to 1\.1; walk has what is left"),
        ("walk", [("jog", 1.2), ("waltz", 0.1)], r"from 0 to 1, not 1\.2"),
        ("walk", [("jog", 0.3), ("standup", 0.3)], "standup is a one-shot"),
        ("walk", [("jog", 0.3), ("crawl", 0.3)], "walk and crawl are too far apart to be blended: getdown lies"),
        ("walk", [("jog", 0.3), ("joggg", 0.3)], "jog"),
    ],
)
def test_what_cannot_be_blended_together_is_refused_with_the_reason(library, first, parts, why):
    (second, weight), *also = parts
    with pytest.raises(MotiondeckError, match=why):
        new_deck(library).blend_in(first, second, weight, also)
