"""What frequencies are good for: finding like motions, filling in, expecting what comes, and restyling."""

from itertools import pairwise

import msgspec
import numpy as np
import pytest

import synthetic
from controller.errors import MotiondeckError, UnknownNameError
from controller.training.anticipation import Anticipator, foresight
from controller.training.centralized_training import CentralizedRecipe, train_centralized_network
from controller.training.library import MotionLibrary, load_library, save_library
from controller.training.model_search import score_models
from controller.training.motion_index import load_index, save_index
from controller.training.reconstruction import fill_missing
from controller.training.restyling import restyled
from controller.training.signature import part_weights, signature

ENCODING = synthetic.small_encoding()


@pytest.fixture(scope="module")
def library():
    taught, normalisation = synthetic.lessons()
    recipe = CentralizedRecipe(satellites=16, iterations=20)
    network = train_centralized_network(taught, normalisation, recipe, synthetic.RATE, 0)
    plain = synthetic.small_library()
    return MotionLibrary(msgspec.structs.replace(plain.info, network="centralized"), network, plain.encoding)


def test_a_signature_tells_how_fast_and_how_far_each_part_moves():
    slow = signature(ENCODING, np.tile(synthetic.march(120), (4, 1)), synthetic.RATE).reshape(3, 3)
    fast = signature(ENCODING, np.tile(synthetic.march(60), (8, 1)), synthetic.RATE).reshape(3, 3)
    # One step a second, found on a grid whose neighbours lie a twentieth apart.
    assert slow[0, 0] == pytest.approx(2 * np.pi, rel=0.06)
    assert np.allclose(fast[:2, :2] / slow[:2, :2], 2.0, rtol=0.15)
    assert np.allclose(fast[:2, 2], slow[:2, 2], rtol=0.05)
    still = signature(ENCODING, np.tile(synthetic.march()[:1], (120, 1)), synthetic.RATE)
    assert np.isfinite(still).all()
    assert (still > 0).all()
    with pytest.raises(MotiondeckError, match="too short"):
        signature(ENCODING, synthetic.march()[:10], synthetic.RATE)


def test_weights_of_parts():
    assert part_weights({"arms": 0.0}).tolist() == [1, 1, 1, 0, 0, 0, 1, 1, 1]
    with pytest.raises(MotiondeckError, match="no part 'tail'"):
        part_weights({"tail": 1.0})


def test_an_index_comes_back_from_its_file(tmp_path):
    numbers = np.random.default_rng(0).uniform(0.1, 9, (3, 9))
    save_index(["a", "b", "c"], numbers, tmp_path / "some.index")
    names, back = load_index(tmp_path / "some.index")
    assert names == ["a", "b", "c"]
    assert np.array_equal(back, numbers)
    (tmp_path / "bad.index").write_bytes(b"nothing")
    with pytest.raises(MotiondeckError, match=r"bad\.index"):
        load_index(tmp_path / "bad.index")


def markers(frames=240):
    t = np.arange(frames) / 120.0
    wave = np.stack([np.sin(5 * t), np.cos(5 * t), np.sin(10 * t), t], axis=-1)
    mixture = np.random.default_rng(1).normal(size=(4, 15))
    return 100.0 * (wave @ mixture).reshape(frames, 5, 3)


def test_missing_markers_are_filled_from_the_others():
    whole = markers()
    holes = whole.copy()
    holes[80:140, 2] = np.nan
    holes[200:, 4] = np.nan
    filled = fill_missing(holes, 120.0)
    assert np.array_equal(filled[np.isfinite(holes)], holes[np.isfinite(holes)])
    straight = np.linspace(whole[79, 2], whole[140, 2], 62)[1:-1]
    missed = np.abs(filled[80:140, 2] - whole[80:140, 2]).mean()
    assert missed < 0.25 * np.abs(straight - whole[80:140, 2]).mean()
    assert np.abs(filled[200:, 4] - whole[200:, 4]).mean() < 0.25 * np.abs(whole[199, 4] - whole[200:, 4]).mean()
    assert np.array_equal(fill_missing(whole, 120.0), whole)
    with pytest.raises(MotiondeckError, match="no marker is there all the time"):
        fill_missing(np.full((50, 2, 3), np.nan), 120.0)
    holes[10:, 1] = np.nan
    with pytest.raises(MotiondeckError, match="marker 1 is seen"):
        fill_missing(holes, 120.0)


def test_what_is_known_is_expected_better_than_standing_still(library):
    seen = np.tile(synthetic.march(), (5, 1))
    rows = foresight(Anticipator(library), seen, synthetic.RATE)
    assert [row.ahead_s for row in rows] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5])
    assert rows[-1].network < 0.3 * rows[-1].hold
    assert rows[-1].network < 0.1 * rows[-1].velocity
    with pytest.raises(MotiondeckError, match="too short"):
        foresight(Anticipator(library), seen[:60], synthetic.RATE)
    with pytest.raises(MotiondeckError, match="centralized one"):
        Anticipator(synthetic.small_library())


def test_a_motion_takes_on_the_frequencies_of_another(library, tmp_path):
    styled, outside = restyled(library, "march", "wave")
    info = styled.info.motions[-1]
    assert info.name == "march-like-wave"
    assert not info.passed
    assert info.frames == 120
    assert outside >= 0.0
    part = styled.network.part(info.name)
    assert np.allclose(part.frequency, library.network.part("wave").frequency)
    assert np.array_equal(part.weights, library.network.part("march").weights)
    save_library(styled, tmp_path / "styled.safetensors")
    assert load_library(tmp_path / "styled.safetensors").network.motions == styled.network.motions
    with pytest.raises(MotiondeckError, match="already"):
        restyled(styled, "march", "wave")
    with pytest.raises(UnknownNameError, match="wave"):
        restyled(library, "march", "wvae")
    with pytest.raises(MotiondeckError, match="no centralized network"):
        restyled(synthetic.small_library(), "march", "wave")


def test_the_criterion_prefers_the_sizes_that_a_motion_needs():
    rng = np.random.default_rng(0)
    t = 2 * np.pi * np.arange(240) / 240
    simple = np.stack([np.sin(t), np.cos(t), np.sin(2 * t)], axis=-1) @ rng.normal(size=(3, 10))
    noisy = simple + 0.02 * rng.normal(size=simple.shape)
    scored = score_models(noisy, 120.0, loop=True, centers=(1, 2), satellites=(4, 9, 25))
    assert scored[0].satellites < 25
    assert min(scored, key=lambda one: one.error).satellites == 25
    assert scored[0].error < 0.05
    assert all(a.aicc <= b.aicc for a, b in pairwise(scored))
    with pytest.raises(MotiondeckError, match="too few"):
        score_models(noisy[:8], 120.0, loop=True)
