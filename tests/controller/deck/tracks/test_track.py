"""A track: what it foresees of its motion is what it plays next."""

import numpy as np
import pytest

import synthetic
from controller.deck.joins.deck_motions import HELD_M, read_motions
from controller.deck.tracks.track import Track

DT = 0.005


@pytest.fixture(scope="module")
def library():
    return synthetic.small_phase_library()


@pytest.mark.parametrize("motion", ["march", "bow"])
@pytest.mark.parametrize("phase", [0.0, 0.3, 0.8])
def test_after_a_phase_is_commanded_what_comes_is_what_was_foreseen(library, motion, phase):
    """Of a one-shot the phase was counted until its last pose is nearly reached, and what came was 40 ms off."""
    track = Track(library, read_motions(library))
    track.cue_phase(motion, phase)
    track.step(0.0, 1.0)
    foreseen = track.postures_ahead(np.arange(40) * DT, 1.0)
    heights, rotations = [float(track.posture.height)], [track.posture.rotation]
    for _ in range(39):
        posture = track.step(DT, 1.0)
        heights.append(float(posture.height))
        rotations.append(posture.rotation)
    still = np.zeros((40, 3))
    seen, played = (library.skeleton.joints(still, rotation) for rotation in (foreseen.rotation, np.array(rotations)))
    moved = np.abs(played - played[0]).max()
    assert np.abs(seen - played).max() < HELD_M + 0.05 * moved
    assert foreseen.height == pytest.approx(heights, abs=HELD_M)


def test_a_one_shot_is_foreseen_to_get_going_from_the_pace_it_has(library):
    track = Track(library, read_motions(library))
    track.cue_phase("bow", 0.2)
    times = np.linspace(0.0, 0.4, 9)
    full, half, none = (track.ahead(1.0, onset)(times)[:, :-4] for onset in (1.0, 0.5, 0.0))
    assert np.abs(half[0] - full[0]).max() == 0.0
    way = [np.linalg.norm(course[-1] - course[0]) for course in (none, half, full)]
    assert way[0] < way[1] < way[2]
