"""The watch over blends, by itself and in the deck with a pair that is known to turn over."""

from dataclasses import replace

import numpy as np
import pytest

import synthetic
from controller.deck.deck import Deck
from controller.deck.joins.deck_motions import read_motions
from controller.deck.tracks.playing_tracks import BlendCheck
from controller.library.motion_library import load_library
from motiondeck_base.shipped import shipped_configs

DT = 0.005


@pytest.fixture(scope="module")
def march():
    return read_motions(synthetic.small_library())["march"]


def looked(watch, places, dt):
    return [trouble for place in places if (trouble := watch.problem(place, dt, 1.0))]


def test_a_motion_of_its_own_is_in_order(march):
    assert looked(BlendCheck(march, march), np.tile(march.places, (3, 1)), march.spacing) == []


def test_what_does_not_move_stands_still(march):
    held = np.tile(march.places[:1], (round(1.2 / march.spacing), 1))
    assert looked(BlendCheck(march, march), held, march.spacing) == ["stands still"] * 2


@pytest.mark.parametrize("rate", [50, 60, 90, 100, 110, 120, 144])
def test_half_a_second_takes_as_many_ticks_as_it_has(march, rate):
    held = np.tile(march.places[:1], (4 * rate, 1))
    assert looked(BlendCheck(march, march), held, 1.0 / rate) == ["stands still"] * 8


def test_a_pause_is_no_standstill(march):
    assert looked(BlendCheck(march, march), np.tile(march.places[:1], (500, 1)), 0.0) == []


def test_what_goes_faster_than_either_motion_turns_over(march):
    faster = replace(march, velocities=march.velocities * 0.1)
    watch = BlendCheck(faster, faster)
    assert "turns over" in looked(watch, march.places, march.spacing)


@pytest.mark.parametrize("tempo", [0.0, 0.05, -0.3])
def test_the_change_of_weights_in_a_pause_or_at_a_slow_tempo_is_no_turning_over(march, tempo):
    places = march.places[: round(0.4 / march.spacing)]
    watch = BlendCheck(march, march)
    assert not any(watch.problem(place, march.spacing, tempo) for place in places)


@pytest.fixture(scope="module")
def shipped():
    return load_library(shipped_configs() / "libraries" / "thesis15.safetensors")


def blended(shipped, ticks=400):
    deck = Deck(shipped, lambda pose: pose.rotation, "exa-stride")
    for _ in range(200):
        deck.update(DT)
    record = deck.blend_in("exa-stride", "box1", 0.5)
    for _ in range(ticks):
        deck.update(DT)
    return deck, record


def test_bones_that_point_opposite_ways_do_not_turn_over(shipped):
    """Mixed as directions this blend turned over within a second."""
    deck, record = blended(shipped)
    assert record.fell_back == ""
    assert deck.blend == (("box1", 0.5),)


def test_a_blend_that_turns_over_falls_back_to_the_nearer_motion_and_reports_it(shipped, monkeypatch):
    problems = iter([*[""] * 50, "turns over"])
    monkeypatch.setattr(BlendCheck, "problem", lambda *_: next(problems, ""))
    deck, record = blended(shipped)
    assert record.fell_back.endswith("of box1 turns over, fell back to exa-stride")
    assert deck.fell_back == record.fell_back
    assert (deck.playing, deck.blend, deck.settled) == ("exa-stride", (), True)
    assert record.overtaken == (record.settled_s is None)
