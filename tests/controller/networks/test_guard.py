import numpy as np
import pytest

import synthetic
from controller.networks.guard import LOOK_SECONDS, Guard
from synthetic import run

LENGTHS = {name: len(frames) for name, frames in synthetic.references().items()}
LOOK_EVERY = round(LOOK_SECONDS * synthetic.RATE)


@pytest.fixture(scope="module")
def weights():
    return synthetic.small_network()


@pytest.fixture
def guard(weights):
    return Guard(weights.twin(), LENGTHS, synthetic.LOOPS, synthetic.RATE)


def push(guard, z):
    """Puts the network below a guard into another state, behind the guard's back."""
    part, bound, was = guard.network.snapshot()
    guard.network.restore((part, bound, np.broadcast_to(np.float32(z), was.shape)))


def off(frame, motion, scale):
    """How far a frame is from the nearest one of a motion."""
    return np.sqrt(np.square((synthetic.references()[motion] - frame) / scale).mean(1)).min()


@pytest.mark.parametrize("motion", list(LENGTHS))
def test_a_run_without_trouble_is_left_alone(weights, guard, motion):
    plain = weights.twin()
    for network in (plain, guard):
        network.cue(motion, 3)
    assert np.array_equal(run(plain, 600), run(guard, 600))
    assert guard.recues == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e6])
def test_an_impossible_state_is_never_played(guard, bad):
    guard.cue("march", 0)
    run(guard, 50)
    push(guard, bad)
    played = run(guard, 100)
    assert np.isfinite(played).all()
    assert max(off(frame, "march", guard.scale) for frame in played) < 0.2
    assert guard.recues == 1


def test_a_frozen_loop_starts_again(guard, monkeypatch):
    guard.cue("march", 0)
    stuck = guard.network.anchors("march")[10]
    with monkeypatch.context() as frozen:
        frozen.setattr(guard.network, "advance", lambda out: np.copyto(out, stuck))
        run(guard, 40 * LOOK_EVERY)
        assert guard.recues >= 1
    assert np.abs(np.diff(run(guard, 96), axis=0)).max() > 0.01


def test_what_is_far_from_the_motion_is_brought_back(guard, monkeypatch):
    guard.cue("march", 0)
    elsewhere = guard.network.anchors("wave")[0]
    with monkeypatch.context() as lost:
        lost.setattr(guard.network, "advance", lambda out: np.copyto(out, elsewhere))
        run(guard, LOOK_EVERY)
    assert guard.recues == 1
    assert off(run(guard, 1)[0], "march", guard.scale) < 0.2


def test_a_motion_that_happens_once_keeps_its_order(guard):
    guard.cue("bow", 0)
    run(guard, 30)
    # Straight to the end, where every pose is one of the motion's own.
    part, bound, _ = guard.network.snapshot()
    guard.network.restore((part, bound, part.states[-1].copy()))
    played = run(guard, 2 * LOOK_EVERY)
    assert guard.recues >= 1
    middle = synthetic.bow()[30 + LOOK_EVERY : 60]
    assert np.sqrt(np.square((middle - played[-1]) / guard.scale).mean(1)).min() < 0.1
    assert np.abs(run(guard, 600)[-1] - synthetic.bow()[-1]).max() < 0.05
