"""What frequencies are good for: finding like motions, expecting what comes, and restyling."""

from itertools import pairwise

import msgspec
import numpy as np
import pytest
from scipy.optimize import nnls

import synthetic
from benchmarks.centralized.anticipation import Anticipator, foresight
from benchmarks.centralized.anticipation_trust import Experience, Trust, at_last_velocity, shares_of
from benchmarks.centralized.motion_index import load_index, save_index
from benchmarks.centralized.motion_signature import part_weights, signature
from benchmarks.centralized.restyling import restyled, with_frequencies
from controller.learning.centralized.motion_training import score_models
from controller.learning.trainers.centralized import CentralizedRecipe
from controller.library.motion_library import MotionLibrary, load_library, save_library
from motiondeck_base.errors import MotiondeckError, UnknownNameError

ENCODING = synthetic.small_encoding()


@pytest.fixture(scope="module")
def library():
    taught, normalisation = synthetic.lessons()
    recipe = CentralizedRecipe(satellites=16, iterations=20)
    network = synthetic.trained(recipe, taught, normalisation)
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


def test_what_is_known_is_expected_better_than_standing_still(library):
    seen = np.tile(synthetic.march(), (5, 1))
    rows = foresight(Anticipator(library), seen, synthetic.RATE)
    assert [row.ahead_s for row in rows] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5])
    assert rows[-1].anticipated < 0.3 * rows[-1].hold
    assert rows[-1].anticipated < 0.25 * rows[-1].velocity  # which is damped, and so half as far off as a line
    assert rows[-1].trust > 0.8
    with pytest.raises(MotiondeckError, match="too short"):
        foresight(Anticipator(library), seen[:60], synthetic.RATE)
    with pytest.raises(MotiondeckError, match="centralized one"):
        Anticipator(synthetic.small_library())


@pytest.mark.parametrize("every", [2, 4])
def test_a_recording_at_60_or_30_hz_is_expected_too(library, every):
    """At 60 Hz as it is, at 30 Hz on lines between the frames."""
    seen = np.tile(synthetic.march(), (5, 1))
    whole = foresight(Anticipator(library), seen, synthetic.RATE)
    thinned = foresight(Anticipator(library), seen[::every], synthetic.RATE / every)
    assert thinned[-1].anticipated < 0.35 * thinned[-1].hold
    assert thinned[-1].hold == pytest.approx(whole[-1].hold, rel=0.1)


def test_a_damped_velocity_comes_to_rest():
    past = np.outer(np.arange(5.0), [6.0, -3.0])  # mm a frame
    way = at_last_velocity(past)
    assert np.allclose(way[0], [6.0, -3.0], rtol=0.1)
    assert np.allclose(way[-1], 0.15 * 60.0 * np.array([6.0, -3.0]), rtol=0.05)
    assert (np.abs(np.diff(way, 2, axis=0)) > 0.0).all()


def test_what_is_unlike_all_that_is_known_is_not_made_of_it(library):
    """A body that lies still after it marched upside down: the motions known would have it march on."""
    rng = np.random.default_rng(0)
    stranger = synthetic.march().mean(0) + 0.3 * rng.normal(size=synthetic.march().shape[1])
    rows = foresight(Anticipator(library), np.tile(stranger, (240, 1)), synthetic.RATE)
    assert all(row.network > 1.0 for row in rows)
    assert all(row.anticipated < 0.7 * row.network for row in rows)
    assert all(row.trust < 0.7 for row in rows)


def test_trust_never_rises_with_the_distance():
    rng = np.random.default_rng(0)
    distance = rng.uniform(1.0, 100.0, 80)
    came = rng.normal(size=(80, 30, 6))
    # Of what the network says, most comes true far away, and little near.
    network = came * (distance / 100.0)[:, None, None] ** -1.0
    trust = Trust.learn(distance, network, np.zeros_like(came), came)
    assert (np.diff(trust.network, axis=0) <= 1e-12).all()
    assert np.all(trust.at(0.0)[0] == 1.0)
    assert (trust.at(1000.0)[0] < trust.at(100.0)[0]).all()
    assert np.allclose(Trust.learn(distance, network, 2.0 * came, came).alone, 0.5)
    assert np.all(Trust.learn(np.zeros(0), came[:0], came[:0], came[:0]).at(50.0)[0] == 1.0)


def test_shares_are_those_of_least_squares_without_negative_ones():
    rng = np.random.default_rng(0)
    ways, came = rng.normal(size=(50, 2, 6)), rng.normal(size=(50, 6))
    shares = shares_of(ways @ ways.swapaxes(1, 2), (ways @ came[..., None])[..., 0])
    expected = [nnls(two.T, one)[0] for two, one in zip(ways, came, strict=True)]
    assert np.allclose(shares, np.minimum(expected, 1.0))
    assert (np.count_nonzero(shares, axis=1) < 2).any()
    alike = shares_of(np.ones((2, 2)), np.full(2, 0.5))
    assert alike.sum() == pytest.approx(0.5)


def foretold(trust, ways, shares, count=60, ahead=6):
    """The forecast after so many predictions of which came what these shares of network and velocity make."""
    rng, experience = np.random.default_rng(0), Experience(np.zeros((0, 40)))
    for _ in range(count):
        network, velocity = ways(rng)
        forecast = experience.forecast(trust, 50.0, network, velocity)
        experience.add(ahead, forecast, (shares[0] * network + shares[1] * velocity)[ahead - 1])
    return experience.forecast(trust, 50.0, *ways(rng))


def trusted(network=0.9, velocity=0.1, alone=0.4):
    """The same trust at every distance and frame ahead."""
    return Trust(np.zeros(1), np.full((1, 30), network), np.full((1, 30), velocity), np.full(30, alone))


@pytest.mark.parametrize(("steady", "least", "most"), [(True, 0.75, 1.0), (False, 0.0, 0.1)])
def test_before_anything_was_predicted_the_frames_seen_tell_how_far_the_velocity_comes_true(steady, least, most):
    """A body that goes on steadily, and one that trembles on the spot."""
    trembling = np.random.default_rng(0).normal(size=(24, 40))
    seen = np.multiply.outer(np.arange(24.0), np.ones(40)) if steady else trembling
    forecast = Experience(seen).forecast(trusted(), 50.0, np.zeros((30, 40)), np.ones((30, 40)))
    assert least <= forecast.alone[5] <= most
    assert forecast.alone[20] == pytest.approx(0.4)


def unlike(rng):
    return rng.normal(size=(2, 30, 40))


def test_what_came_of_earlier_predictions_corrects_the_trust():
    """The network says nothing that comes true, half of the last velocity does; at 0.3 s nothing is known yet."""
    first = foretold(trusted(), unlike, (0.0, 0.5), count=0)
    say = 0.9**3
    assert np.allclose(first.shares, [say * 0.9, say * 0.1 + (1 - say) * 0.4])
    assert np.allclose(first.movement, say * 0.9 * first.network + (say * 0.1 + (1 - say) * 0.4) * first.velocity)
    after = foretold(trusted(), unlike, (0.0, 0.5))
    assert after.shares[5, 0] < 0.1
    assert after.shares[5, 1] == pytest.approx(0.5, abs=0.05)
    assert np.allclose(after.shares[17], first.shares[17])


@pytest.mark.parametrize(("network", "told"), [(0.9, 0.0), (0.2, 1.0)])
def test_who_errs_more_loses_its_say(network, told):
    """Trusted or not at first, the network gets its say by what it tells of: nothing of what comes, or all of it."""

    def ways(rng):
        # The network's movement is mixed with the velocity's, so that no shares of both undo what it does.
        came = rng.normal(size=(30, 40))
        return (came, 0.3 * rng.normal(size=(30, 40))) if told else (rng.normal(size=(30, 40)), came)

    shares = (1.0, 0.0) if told else (0.0, 1.0)
    before = foretold(trusted(network, 0.0), ways, shares, count=0)
    after = foretold(trusted(network, 0.0), ways, shares, count=20)
    assert before.say[5] == pytest.approx(network**3)
    assert (after.say[5] > 0.95) if told else (after.say[5] < 0.05)


def test_a_motion_takes_on_the_frequencies_of_another(library, tmp_path):
    styled, outside = restyled(library, "march", "wave")
    info = styled.info.motions[-1]
    assert info.name == "march-like-wave"
    assert not info.passed
    assert info.frames == 120
    assert outside >= 0.0
    part = styled.network[info.name]
    assert np.allclose(part.frequency, library.network["wave"].frequency)
    assert np.array_equal(part.weights, library.network["march"].weights)
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


def test_frequencies_of_another_clip_change_its_tempo_and_keep_it_closed(library):
    walk = library.network["march"]
    seconds = walk.seconds
    styled = with_frequencies(walk, walk.frequency * 0.5)
    assert styled.seconds == pytest.approx(2.0 * seconds)
    assert np.allclose(styled.at(np.array([0.0])), styled.at(np.array([2.0 * seconds])))
    assert np.allclose(styled.at(np.array([0.2])), walk.at(np.array([0.1])))
    with pytest.raises(MotiondeckError, match="1 frequencies for 2 centers"):
        with_frequencies(walk, np.array([1.0]))
    with pytest.raises(MotiondeckError, match="does not close"):
        with_frequencies(walk, walk.frequency * np.array([1.0, 1.1]))
