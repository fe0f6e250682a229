"""Where a deck is in its motion, for what is learned by phase."""

import numpy as np
import pytest

import synthetic
from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from motiondeck_base.shipped import shipped_configs

DT = 0.01


def deck_of(library):
    return Deck(library, lambda pose: np.zeros(1), "march")


def test_a_network_with_a_phase_is_at_its_phase_at_the_present_tempo():
    deck = deck_of(synthetic.small_phase_library())
    deck.set_tempo(0.5)
    for _ in range(60):
        deck.update(DT)
    place = deck.place
    assert (place.motion, place.loop, place.alone, place.tempo) == ("march", True, True, 0.5)
    assert place.phase == deck.phase
    deck.switch("wave")
    deck.update(DT)
    assert deck.place.motion == "wave"
    assert not deck.place.alone


def test_nothing_is_known_of_blends_and_of_networks_that_run_by_themselves():
    deck = deck_of(synthetic.small_phase_library())
    deck.blend_in("march", "wave", 0.5)
    for _ in range(200):
        deck.update(DT)
    assert deck.blend
    assert deck.place is None
    assert deck_of(synthetic.small_library()).place is None


def test_a_network_of_centers_keeps_time_without_a_phase_and_comes_back_to_it_after_switches():
    library = load_library(shipped_configs() / "libraries" / "cmu86.safetensors")
    deck = Deck(library, lambda pose: np.zeros(1), "stroll")

    def visit():
        rows = []
        while not (deck.place.alone and deck.place.motion == "stroll") or len(rows) < 150:
            deck.update(DT)
            if deck.place.alone and deck.place.motion == "stroll":
                rows.append((deck.place.phase, deck.posture.rotation.ravel()[8:40].copy()))
        phases, postures = (np.array(one) for one in zip(*rows, strict=True))
        order = np.argsort(phases)
        return phases[order], postures[order]

    first = visit()
    deck.switch("box", direct=True)
    for _ in range(250):
        deck.update(DT)
    assert deck.place.motion == "box"
    deck.switch("stroll", direct=True)
    again = visit()
    for one, other in zip(first[1].T, again[1].T, strict=True):
        assert np.interp(again[0], first[0], one, period=1.0) == pytest.approx(other, abs=0.02)
    assert np.ptp(first[1], axis=0).max() > 0.3
