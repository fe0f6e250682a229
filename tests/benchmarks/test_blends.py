"""The benchmark of blends: all ways begin in the first motion, and the whole of the second one ends in it."""

import numpy as np
import pytest

import synthetic
from benchmarks.deck.blends import WAYS, judged, played
from controller.motion.encodings.motion_matching import joint_features


@pytest.fixture(scope="module")
def library():
    return synthetic.small_library()


@pytest.mark.parametrize("way", WAYS)
def test_the_mixture_leads_from_the_first_motion_to_the_second(library, way):
    first, second = [motion.name for motion in library.info.motions if motion.plays == "loop"][:2]
    places = played(library, first, second, 1.0, seed=0, way=way)

    own = {name: joint_features(library.encoding, library.network.anchors(name)) for name in (first, second)}

    def away(motion, frame):
        return np.linalg.norm(own[motion] - frame, axis=1).min()

    assert away(first, places[0]) < away(second, places[0])
    late = places[round(2 * library.info.rate) :]
    assert np.mean([away(second, frame) < away(first, frame) for frame in late]) > 0.9


def test_a_mixture_that_stands_still_or_turns_over_is_told():
    waving = np.sin(np.arange(400) / 10.0)[:, None] * np.array([100.0, 40.0])
    assert judged(waving, 60.0, least=200.0, fastest=10.0) == (False, False)
    stopped = np.where(np.arange(400)[:, None] < 200, waving, waving[200])
    assert judged(stopped, 60.0, least=200.0, fastest=10.0) == (True, False)
    jumping = waving + np.where(np.arange(400)[:, None] < 200, 0.0, 50.0)
    assert judged(jumping, 60.0, least=200.0, fastest=10.0) == (False, True)
