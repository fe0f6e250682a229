"""The search for a fade's duration takes place while the fade begins, without a jump and a little in each tick."""

import numpy as np
import pytest

from controller.deck.joins import fade_search
from controller.deck.joins.deck_motions import course_of
from controller.deck.joins.fade_search import LONGEST, SHORTEST, FadeSearch, Fading
from controller.deck.joins.join_limits import Bounds
from controller.deck.joins.transition import Fade, displaced
from controller.motion.rotations import conjugate, multiply, to_rotation_vector
from controller.motion.skeleton import ROOT, Posture, Skeleton

BODY = Skeleton("rod", ("rod",), np.array([ROOT]), np.array([[1.0, 0.0, 0.0]]), np.array([1.0]))
STILL = Posture(np.array(1.0), np.zeros(2), np.array(0.0), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)))
TURN, RATE = np.array([[0.0] * 3, [0.0, 1.2, 0.5], [0.1, 0.3, 0.0]]), np.array([[0.0] * 3, [0.0, 3.0, -8.0], [0.5] * 3])


def search_of(acceleration=60.0, trials=None):
    """The search for a fade of a rod that is turned and turning away, to one at rest."""

    def ahead(times):
        if trials is not None:
            trials.append(times[-1])
        resting = Posture(
            np.ones(len(times)), *np.zeros((2, len(times), 2)), np.tile(STILL.rotation, (len(times), 1, 1))
        )
        resting.turn_rate = np.zeros(len(times))
        return course_of(resting, BODY)

    return FadeSearch(lambda: (TURN, RATE), ahead, BODY.chain, Bounds(np.inf, acceleration))


@pytest.mark.parametrize(("seconds", "ticks"), [(0.449, 45), (0.45, 45), (0.45001, 45), (0.451, 45), (0.4512, 46)])
def test_a_fade_ends_with_the_tick_that_rounding_could_take_for_its_end(seconds, ticks):
    search = search_of()
    search.fade, search.found = Fade(seconds, seconds, TURN, RATE), True
    search.advance = lambda dt: search.fade
    assert len(run(Fading(search), 0.01)) - 1 == ticks


def run(fading, dt):
    """What is shown from the first tick on until nothing is left."""
    shown = [displaced(STILL, TURN, 0.0)]
    while fading.lasts:
        fading.advance(dt, 0.0)
        shown.append(fading.shown(STILL))
    return shown


def ends_of(shown):
    """Where the rod's end is, relative to the ground, in each tick."""
    places = [BODY.joints(np.zeros(3), posture.rotation)[1] for posture in shown]
    return np.array(places) + np.array([[0.0, 0.0, float(posture.height)] for posture in shown])


@pytest.mark.parametrize("rate", [50.0, 100.0, 200.0, 500.0, 1000.0])
def test_looks_are_spread_over_time_whatever_the_rate(rate):
    trials, counts = [], []
    search = search_of(trials=trials)
    while not search.found:
        search.advance(1.0 / rate)
        counts.append(len(trials))
    assert len(trials) > 3
    assert counts[0] == max(0, round(200.0 / rate) - 1)
    assert max(np.diff(counts)) <= max(1, round(200.0 / rate))
    assert 0.0 < len(counts) / rate - 0.005 * len(trials) <= 1.001 / rate


def test_the_fade_that_is_found_does_not_depend_on_the_rate():
    found = []
    for rate in (50.0, 200.0, 1000.0):
        search = search_of()
        while not search.found:
            search.advance(1.0 / rate)
        found.append((search.fade.duration, search.fade.slowing))
    assert found[0] == found[1] == found[2]
    assert SHORTEST < found[0][0] < LONGEST


@pytest.mark.parametrize("rate", [100.0, 200.0, 1000.0])
@pytest.mark.parametrize("acceleration", [25.0, 60.0])
def test_going_over_to_longer_fades_is_as_smooth_as_one_fade(rate, acceleration):
    known = search_of(acceleration)
    known.advance(10.0)
    planned, found = (ends_of(run(Fading(search), 1.0 / rate)) for search in (known, search_of(acceleration)))
    hardest, begun = (
        np.linalg.norm(np.diff(places, n=2, axis=0), axis=1).max() * rate**2 for places in (planned, found)
    )
    assert begun <= 1.1 * hardest


def test_a_one_shot_that_is_under_way_goes_on_as_fast_as_it_did():
    """It was stopped at once, where a crossfade into it was replaced."""
    fading = Fading(search_of(), onset=0.6)
    assert fading.onset == 0.6
    onsets = []
    while fading.lasts:
        fading.advance(0.005, 0.0)
        onsets.append(fading.onset)
    assert onsets[0] == pytest.approx(0.6, abs=1e-3)
    assert np.diff(onsets).min() > -1e-3  # while longer fades are considered, their progress is a little less
    assert onsets[-1] == 1.0


@pytest.mark.parametrize(("share", "trials"), [(0.99, 1), (1.09, 11), (1.19, 16), (5.0, 12)])
def test_the_longer_a_search_takes_the_more_the_best_so_far_may_exceed_the_bounds(share, trials, monkeypatch):
    """A body swings on until its fade is found; far beyond the bounds fades grow so fast that twelve are all."""
    monkeypatch.setattr(fade_search, "peaks", lambda *_: (np.zeros(1), share * fade_search.PLANNED_SHARE * 60.0))
    search = search_of(60.0)
    search.advance(10.0)
    assert search.found
    assert search.trials == trials


def test_a_body_that_is_better_slowed_down_sooner_swings_on_no_longer(monkeypatch):
    def peaks(fade, ahead, chain):
        return np.array([1.0, 5.0 if fade.slowing < fade.duration else 10.0]), 0.0

    monkeypatch.setattr(fade_search, "peaks", peaks)
    search = FadeSearch(lambda: (TURN, RATE), None, BODY.chain, Bounds(5.0, 1.0))
    swings_on = [search.advance(0.005).slowing for _ in range(8)]
    assert not search.found
    assert swings_on[-1] < SHORTEST < max(swings_on)


def test_two_runs_are_identical():
    first, second = (ends_of(run(Fading(search_of()), 0.005)) for _ in range(2))
    assert np.array_equal(first, second)


def test_nothing_is_left_in_the_end_and_all_in_the_beginning():
    fading = Fading(search_of())
    assert fading.lasts
    assert fading.onset == 0.0
    fading.advance(1e-6, 0.0)
    away = to_rotation_vector(multiply(fading.shown(STILL).rotation, conjugate(STILL.rotation)))
    assert away == pytest.approx(TURN[:2], abs=1e-4)
    onsets = []
    while fading.lasts:
        fading.advance(0.005, 0.0)
        onsets.append(fading.onset)
    assert fading.shown(STILL).rotation == pytest.approx(STILL.rotation, abs=1e-12)
    assert onsets == sorted(onsets)
    assert onsets[-1] == 1.0


@pytest.mark.parametrize("best", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("first", [1.0, 6.0])
def test_a_body_that_swings_farther_the_longer_it_is_given_is_slowed_down_soon(monkeypatch, first, best):
    tried, uses = [], []

    def peaks(fade, *_):
        tried.append(fade)
        swinging = 6.0 + 20.0 * abs(fade.duration - best)
        uses.append(swinging if fade.slowing == fade.duration else 5.5 if fade.slowing > 0.3 * fade.duration else 5.2)
        return np.array([first, max(first, uses[-1])]), 0.0

    monkeypatch.setattr(fade_search, "peaks", peaks)
    search = FadeSearch(lambda: (TURN, RATE), lambda times: times, BODY.chain, Bounds(5.0, 1.0))
    while not search.found and len(tried) < 30:
        shown = search.advance(fade_search.TRIAL_EVERY)
        if uses and uses[-1] > min(uses):  # what was tried last is worse: back to the best, not on to what is longer
            assert shown is tried[int(np.argmin(uses))]
    slowed = [fade.slowing < fade.duration for fade in tried]
    longer = [fade.duration > best for fade in tried[: slowed.index(True)]]
    assert longer.count(True) <= 3
    if first > 4.0:  # beyond the planned share of 5 already
        assert slowed.index(True) == 1
