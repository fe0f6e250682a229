"""The body that a deck shows: that of the motion's recording at rest, and a smooth way to the next one in a switch."""

import numpy as np
import pytest

from controller.deck.deck import Deck
from controller.motion.canonical.canonical_body import root_height
from shipped_libraries import shipped

DT = 0.005


def deck_of(motion):
    library = shipped()
    return library, Deck(library, lambda pose: pose.root_position, motion, direct=True)


def test_a_motion_at_rest_has_the_body_of_its_recording():
    library, deck = deck_of("walk")
    body, skeleton = library.body("walk"), library.skeleton
    assert np.abs(body.length - skeleton.length).max() > 0.05
    assert np.linalg.norm(deck.pose.offsets, axis=1) / skeleton.leg_length == pytest.approx(
        body.length / body.leg_length
    )
    begun = deck.pose.offsets
    for _ in range(50):
        deck.update(DT)
        assert deck.pose.offsets is begun  # a body that does not change costs nothing


def test_bodies_change_smoothly_in_a_switch_even_if_it_is_interrupted():
    library, deck = deck_of("walk")
    seen = []
    for tick in range(600):
        if tick == 100:
            deck.switch("waltz")
        elif tick == 180:
            deck.switch("box2")
        deck.update(DT)
        seen.append(deck.pose.offsets)
    assert seen[-1] is seen[-2]
    assert seen[-1] == pytest.approx(library.offsets("box2"))
    assert np.ptp(seen, axis=0).max() > 0.04
    speed = np.diff(seen, axis=0) / DT
    assert np.abs(speed).max() < 0.3  # m/s
    assert np.abs(np.diff(speed, axis=0)).max() / DT < 3.0  # m/s^2


def test_a_blend_has_the_mean_of_its_bodies():
    library, deck = deck_of("walk")
    for tick in range(500):
        if tick == 50:
            deck.blend_in("walk", "jog", 0.4)
        deck.update(DT)
    assert dict(deck.blend) == pytest.approx({"jog": 0.4})
    assert deck.pose.offsets == pytest.approx(0.6 * library.offsets("walk") + 0.4 * library.offsets("jog"))


def test_another_body_has_its_lowest_joint_as_high():
    library, deck = deck_of("walk")
    for _ in range(40):
        deck.update(DT)
        pose, skeleton = deck.pose, library.skeleton
        own = skeleton.with_offsets(pose.offsets)
        place = np.append(pose.root_position[:2], root_height(pose, skeleton, own))
        lows = [
            body.joints(root, pose.rotation)[:, 2].min()
            for body, root in ((skeleton, pose.root_position), (own, place))
        ]
        assert lows[0] == pytest.approx(lows[1], abs=0.02)
