"""Twenty switches between the shipped motions: none refused, none frozen, none harsher than the motions themselves."""

import numpy as np
import pytest

from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from motiondeck_base.shipped import shipped_configs

DT = 0.005
SWITCHES = 20
STILL = {"sitting", "standup", "getdown", "getseated", "stool-standup"}


@pytest.fixture(scope="module")
def library():
    return load_library(shipped_configs() / "libraries" / "thesis15.safetensors")


def play(library, deck, seconds):
    """Joint positions in the world, shape (ticks, joints, 3), m."""
    roots, rotations = [], []
    for _ in range(round(seconds / DT)):
        deck.update(DT)
        roots.append(deck.pose.root_position.copy())
        rotations.append(deck.pose.rotation.copy())
    return library.skeleton.joints(np.array(roots), np.array(rotations))


def peak_acceleration(places):
    """The largest of any joint, m/s^2."""
    return np.linalg.norm(np.diff(places, n=2, axis=0), axis=-1).max() / DT**2


@pytest.fixture(scope="module")
def own_peaks(library):
    peaks = {}
    for motion in library.network.motions:
        peaks[motion] = peak_acceleration(play(library, Deck(library, lambda pose: pose.rotation, motion), 3.0))
    return peaks


@pytest.mark.thorough
def test_twenty_switches_in_one_run(library, own_peaks):
    rng = np.random.default_rng(20)
    motions = list(library.network.motions)
    deck = Deck(library, lambda pose: pose.rotation, "walk", direct=True)
    shown = play(library, deck, 1.0)
    for _ in range(SWITCHES):
        source, target = deck.motion, str(rng.choice([m for m in motions if m != deck.motion]))
        deck.switch(target)
        places = np.concatenate([shown[-2:], play(library, deck, 2.0)])
        assert deck.settled
        assert peak_acceleration(places) <= 2.0 * max(own_peaks[source], own_peaks[target]), (source, target)
        if target not in STILL:
            assert np.abs(np.diff(places[-60:], axis=0)).max() > 1e-3, f"{target} is frozen"
        shown = places
    assert len(deck.switches) == SWITCHES
    assert all(switch.first_change_s - switch.commanded_s <= 2.01 * DT for switch in deck.switches)
    assert all(switch.settled_s - switch.commanded_s <= 1.7 for switch in deck.switches)


@pytest.mark.thorough
def test_out_of_a_cartwheel_too(library, own_peaks):
    """A body upside down: bones are half a turn away from where they are to go, and the hips' heading flies round."""
    allowed = 2.0 * max(own_peaks["cartwheel"], own_peaks["standup"])
    for wait in (0.4, 0.9, 1.4, 1.9, 2.4):
        deck = Deck(library, lambda pose: pose.rotation, "cartwheel", direct=True)
        shown = play(library, deck, wait)
        deck.switch("standup")
        places = np.concatenate([shown[-2:], play(library, deck, 0.6)])
        assert peak_acceleration(places) <= allowed, f"after {wait} s"
