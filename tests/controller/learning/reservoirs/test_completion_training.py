"""Test that what is not measured is told from what is and from its past."""

from __future__ import annotations

import numpy as np
import pytest

from controller.learning.reservoirs.completion_training import CompletionRecipe, learn_completion
from controller.networks.reservoirs.completion import Completion
from motiondeck_base.errors import MotiondeckError

RATE = 60.0
SMALL = CompletionRecipe(neurons=60, ridge=1e-5)
FORGETFUL = CompletionRecipe(neurons=60, ridge=1e-5, spectral_radius=0.0, memory_seconds=0.0)


def swing(seconds: float, tempo: float, start: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """A hand that swings to and fro, and a foot a quarter turn behind: one place of the hand is two of the foot."""
    turn = start + 2.0 * np.pi * tempo * np.arange(round(seconds * RATE)) / RATE
    return np.sin(turn)[:, None], np.column_stack([np.sin(turn), np.cos(turn)])


@pytest.fixture(scope="module")
def completion() -> Completion:
    return learn_completion([swing(4.0, 1.0), swing(4.0, 1.3, 1.0)], RATE, recipe=SMALL, seed=3)


def test_the_past_tells_what_one_moment_cannot(completion: Completion) -> None:
    measured, whole = swing(3.0, 1.15, 2.0)
    forgetful = learn_completion([swing(4.0, 1.0), swing(4.0, 1.3, 1.0)], RATE, recipe=FORGETFUL, seed=3)
    off, off_forgetful = (np.abs(one.complete(measured) - whole)[30:].max(0) for one in (completion, forgetful))
    assert off.max() < 0.25
    assert off_forgetful[1] > 0.9


def test_frame_by_frame_is_the_same(completion: Completion) -> None:
    measured, _ = swing(1.0, 1.1)
    follower = completion.follow(measured[0])
    assert np.array([follower.step(frame) for frame in measured]) == pytest.approx(completion.complete(measured))


def test_what_is_in_proportion_is_told_beyond_what_was_learned() -> None:
    """Through neurons alone, which saturate, twice the swing was told 0.25 too small."""
    hand, _ = swing(4.0, 1.0)
    found = learn_completion([(hand, -hand)], RATE, recipe=SMALL, seed=3).complete(2.0 * hand)
    assert np.abs(found + 2.0 * hand).max() < 0.05


def test_a_value_that_is_not_seen_keeps_its_last(completion: Completion) -> None:
    first, second = completion.follow(np.array([0.3])), completion.follow(np.array([0.3]))
    first.step(np.array([0.5]))
    second.step(np.array([0.5]))
    assert first.step(np.array([np.nan])) == pytest.approx(second.step(np.array([0.5])))


def test_units_do_not_matter(completion: Completion) -> None:
    scaled = [(1000.0 * part + 5.0, whole) for part, whole in (swing(4.0, 1.0), swing(4.0, 1.3, 1.0))]
    in_mm = learn_completion(scaled, RATE, recipe=SMALL, seed=3)
    measured, _ = swing(1.0, 1.1)
    assert in_mm.complete(1000.0 * measured + 5.0) == pytest.approx(completion.complete(measured), abs=1e-6)


@pytest.mark.parametrize(
    ("examples", "says"),
    [
        ([], "no recordings"),
        ([(np.zeros((5, 1)), np.zeros((4, 2)))], "recording 0: 5 measured and 4 whole frames"),
        ([swing(1.0, 1.0), (np.zeros((5, 2)), np.zeros((5, 2)))], "what is measured in recording 1"),
        ([np.zeros((5, 2))], "recording 0: give a pair"),
        ([(np.full((5, 1), np.nan), np.zeros((5, 2)))], "what is measured in recording 0"),
    ],
)
def test_what_does_not_fit_is_refused_by_name(examples: list[tuple[np.ndarray, np.ndarray]], says: str) -> None:
    with pytest.raises(MotiondeckError, match=says):
        learn_completion(examples, RATE, recipe=SMALL)


@pytest.mark.parametrize(
    ("first", "says"),
    [
        (np.zeros(2), "of shape .2,.; 1 values are needed"),
        (np.array([np.nan]), "begin with one that is whole"),
        (["a"], "a measurement is 1 numbers"),
    ],
)
def test_a_measurement_that_does_not_fit_is_refused(completion: Completion, first: np.ndarray, says: str) -> None:
    with pytest.raises(MotiondeckError, match=says):
        completion.follow(first)


def test_later_measurements_of_another_size_are_refused(completion: Completion) -> None:
    with pytest.raises(MotiondeckError, match="1 values are needed"):
        completion.follow(np.zeros(1)).step(np.zeros(2))
    with pytest.raises(MotiondeckError, match="the measured signal"):
        completion.complete(np.zeros((5, 2)))


def test_a_recipe_that_cannot_be_is_refused() -> None:
    for bad in (CompletionRecipe(memory_seconds=-1.0), CompletionRecipe(memory_seconds=float("nan"))):
        with pytest.raises(MotiondeckError, match="memory_seconds"):
            learn_completion([swing(1.0, 1.0)], RATE, recipe=bad)
