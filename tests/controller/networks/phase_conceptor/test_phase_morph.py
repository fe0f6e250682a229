"""Two loops of a phase-driven network mixed inside it: exact at its ends, alive between and beyond them."""

import numpy as np
import pytest

import synthetic
from controller.networks.phase_conceptor.morph import PhaseMorph
from motiondeck_base.errors import MotiondeckError, UnknownNameError

KNOTS = (-0.3, 0.0, 0.5, 1.0, 1.3)


@pytest.fixture(scope="module")
def network():
    return synthetic.small_phase_network()


@pytest.fixture
def started(network):
    twin = network.twin()
    twin.seek("march", 0.25)
    return twin, PhaseMorph(twin, "march", "wave", KNOTS)


def played(morph, mu, frames):
    out = np.empty((frames, 28))
    for frame in out:
        morph.advance(mu, frame)
    return out


def activity(frames):
    return np.sqrt(np.square(np.diff(frames[:, 4:], axis=0)).mean())


@pytest.mark.parametrize(("mu", "motion"), [(0.0, "march"), (1.0, "wave")])
def test_at_either_end_it_plays_that_motion(started, mu, motion):
    _, morph = started
    taught = synthetic.MOTIONS[motion]()
    shown = played(morph, mu, 3 * len(taught))[-len(taught) :]
    assert min(np.abs(np.roll(taught, shift, axis=0) - shown).max() for shift in range(len(taught))) < 0.05


def test_it_begins_at_the_phase_of_the_network(started):
    _, morph = started
    assert np.abs(played(morph, 0.0, 1)[0] - synthetic.march()[25]).max() < 0.05


@pytest.mark.parametrize("mu", KNOTS)
def test_no_mixture_stands_still_and_each_moves_as_both_in_step_do(started, mu):
    _, morph = started
    shown = played(morph, mu, 500)[-240:]
    share = np.arange(110) / 110
    march, wave = (frames[(share * len(frames)).astype(int)] for frames in (synthetic.march(), synthetic.wave()))
    together = activity((1.0 - mu) * march + mu * wave)
    assert activity(shown) > 0.8 * together


def test_it_goes_over_without_a_jump_and_leaves_the_network_in_phase(started):
    network, morph = started
    shown = np.empty((240, 28))
    for step, frame in enumerate(shown):
        morph.advance(step / 239, frame)
    own = max(np.abs(np.diff(synthetic.MOTIONS[name](), axis=0)).max() for name in ("march", "wave"))
    assert np.abs(np.diff(shown, axis=0)).max() < 2.0 * own
    morph.settle()
    frame = np.empty(28)
    network.advance(frame)
    assert np.abs(frame - shown[-1]).max() < 0.1


def test_it_is_given_up_at_the_phase_of_the_mixture(started):
    network, morph = started
    played(morph, 0.0, 24)
    morph.give_up()
    assert network.phase == pytest.approx(0.5)
    frame = np.empty(28)
    network.advance(frame)
    assert np.abs(frame - synthetic.march()[49]).max() < 0.02


@pytest.mark.parametrize(
    ("names", "knots", "error", "message"),
    [
        (("march", "bow"), KNOTS, MotiondeckError, "'bow' is a one-shot"),
        (("march", "wav"), KNOTS, UnknownNameError, "wave"),
        (("march", "wave"), (0.5,), MotiondeckError, "at least two"),
        (("march", "wave"), (1.0, 0.0), MotiondeckError, "rising"),
    ],
)
def test_what_cannot_be_mixed_is_refused(network, names, knots, error, message):
    with pytest.raises(error, match=message):
        PhaseMorph(network.twin(), *names, knots)


def test_a_share_beyond_the_knots_is_refused(started):
    with pytest.raises(MotiondeckError, match=r"mu 1\.4 lies outside of the knots from -0\.3 to 1\.3"):
        started[1].advance(1.4, np.empty(28))
