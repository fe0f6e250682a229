"""A centralized network closes its loops, holds its ends, obeys its weights, and switches without a jump."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controller.networks.centralized.centralized import CentralizedGenerator, CentralizedMotion
from controller.networks.centralized.satellites import GaussianSatellites
from motiondeck_base.errors import MotiondeckError, UnknownNameError

DT = 0.005


def motion(seed, seconds=1.6, loop=True, channels=5, turns=(1, 3)):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0, 2 * np.pi, (20, 2))
    places = np.stack([np.cos(angle), np.sin(angle)], axis=-1).reshape(20, 4)
    return CentralizedMotion(
        frequency=2 * np.pi * np.array(turns, dtype=float) / seconds,
        phase=rng.uniform(0, 6, 2),
        satellites=GaussianSatellites(places, rng.uniform(0.6, 1.5, 20)),
        weights=rng.normal(size=(channels, 20)),
        rest=rng.normal(size=channels),
        seconds=seconds,
        loop=loop,
    )


def three():
    return CentralizedGenerator({"walk": motion(1), "kick": motion(2, 2.3), "bow": motion(3, 1.1, loop=False)})


def play(generator, seconds, dt=DT):
    return np.array([generator.step(dt).copy() for _ in range(round(seconds / dt))])


def test_steps_say_what_the_equations_say():
    generator, part = three(), motion(2, 2.3)
    generator.cue("kick", 0.25)
    seen = play(generator, 3.0)
    time = 0.25 * 2.3 + DT * np.arange(1, len(seen) + 1)
    assert np.allclose(seen, part.at(time), atol=1e-9)


def test_ten_minutes_stay_where_the_first_round_was():
    generator = three()
    first = play(generator, 1.6)
    for _ in range(3):
        later = play(generator, 200.0, dt=0.02)
        room = 0.1 * np.ptp(first, axis=0)
        assert (later >= first.min(0) - room).all()
        assert (later <= first.max(0) + room).all()
    generator.cue("walk")
    assert np.allclose(play(generator, 1.6), first)


@given(st.floats(0.2, 3.0), st.floats(0.0, 0.99))
def test_tempo_scales_time_and_nothing_else(tempo, phase):
    slow, fast = three(), three()
    fast.tempo = tempo
    slow.cue("walk", phase)
    fast.cue("walk", phase)
    assert np.allclose(play(slow, 0.5, dt=0.01 * tempo)[:16], play(fast, 0.5, dt=0.01)[:16], atol=1e-9)


def test_a_motion_that_happens_once_holds_its_end():
    generator, part = three(), motion(3, 1.1, loop=False)
    generator.cue("bow")
    seen = play(generator, 3.0)
    assert np.allclose(seen[-1], part.at(np.array([1.1]))[0], atol=1e-9)
    assert np.array_equal(seen[-1], seen[-200])


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 10))
def test_motions_superpose_in_their_weights(alpha, beta, time):
    first = motion(1)
    second = replace(first, weights=motion(4).weights, rest=motion(4).rest)
    both = replace(
        first, weights=alpha * first.weights + beta * second.weights, rest=alpha * first.rest + beta * second.rest
    )
    t = np.array([time])
    assert np.allclose(both.at(t), alpha * first.at(t) + beta * second.at(t), atol=1e-9)


@pytest.mark.parametrize("warm_up", [0.0, 0.31, 1.07])
def test_a_reset_generator_repeats_itself_bit_for_bit(warm_up):
    generator = three()
    generator.tempo = 1.1
    play(generator, warm_up)
    generator.switch("kick")
    play(generator, 0.1)
    before = generator.snapshot()
    generator.switch("bow")
    first = play(generator, 3.0)
    generator.restore(before)
    generator.switch("bow")
    assert np.array_equal(play(generator, 3.0), first)
    assert np.array_equal(play(three(), 2.0), play(three(), 2.0))


def test_a_switch_arrives_without_a_jump_and_waits_its_turn():
    generator = three()
    steady = max(np.abs(np.diff(play(generator, 1.6), axis=0)).max(), np.abs(np.diff(play_of("kick"), axis=0)).max())
    play(generator, 0.4)
    generator.switch("kick")
    path = [play(generator, 0.2)]
    assert not generator.settled
    generator.switch("bow")
    generator.switch("walk")
    path.append(play(generator, 3.0))
    assert generator.settled
    assert generator.motion == "walk"
    assert generator.module.state == 0
    # Mixing adds its own speed to that of the motions: not more than three times theirs.
    assert np.abs(np.diff(np.concatenate(path), axis=0)).max() < 3.0 * steady


def test_noise_on_z_is_not_heard_until_it_drives_z_into_another_state():
    still, noisy = three(), CentralizedGenerator({"walk": motion(1), "kick": motion(2, 2.3)}, noise=0.02)
    assert np.array_equal(play(noisy, 2.0), play(still, 2.0))
    assert noisy.module.z != 1.0
    wild = CentralizedGenerator({"walk": motion(1), "kick": motion(2, 2.3)}, noise=0.6, seed=3)
    seen, heard = play(wild, 1.0), {wild.motion}
    before = wild.snapshot()
    for _ in range(20):
        seen = np.concatenate([seen[-1:], play(wild, 1.0)])
        heard.add(wild.motion)
        assert np.abs(np.diff(seen, axis=0)).max() < 0.5
    assert heard == {"walk", "kick"}
    wild.restore(before)
    first = play(wild, 5.0)
    wild.restore(before)
    assert np.array_equal(play(wild, 5.0), first)
    with pytest.raises(MotiondeckError, match="not negative"):
        CentralizedGenerator({"walk": motion(1)}, noise=-1.0)


def play_of(name):
    generator = three()
    generator.cue(name)
    return play(generator, 2.3)


def test_the_same_loop_again_changes_nothing_and_the_same_end_starts_anew():
    generator, other = three(), three()
    play(generator, 0.3)
    play(other, 0.3)
    generator.switch("walk")
    assert np.array_equal(play(generator, 1.0), play(other, 1.0))
    generator.switch("bow")
    play(generator, 4.0)
    held = generator.step(DT).copy()
    generator.switch("bow")
    moving = play(generator, 1.0)
    assert np.abs(moving - held).max() > 0.1
    assert generator.settled
    assert np.abs(np.diff(moving, axis=0)).max() < 0.5
    alone = CentralizedGenerator({"bow": motion(3, 1.1, loop=False)})
    play(alone, 2.0)
    alone.switch("bow")
    again = play(alone, 1.0)
    assert np.abs(again[0] - held).max() < 1e-3
    assert np.abs(np.diff(again, axis=0)).max() < 0.5
    assert np.allclose(again[-1], moving[-1], atol=1e-6)


def test_a_switch_enters_a_loop_where_it_is_most_alike():
    part = motion(1)
    shifted = replace(part, phase=part.phase + part.frequency * 0.64)
    generator = CentralizedGenerator({"walk": part, "later": shifted})
    before = play(generator, 0.5)
    generator.switch("later")
    path = np.concatenate([before, play(generator, 1.6)])
    # Entered at the right phase the two are one motion, so nothing shows (to one in fifty of the period).
    straight = part.at(DT * np.arange(1, len(path) + 1))
    assert np.abs(path - straight).max() < 0.15 * np.ptp(straight, axis=0).max()


def test_where_the_module_rests_frequencies_and_weights_are_those_of_its_motion():
    generator = CentralizedGenerator({"walk": motion(1), "kick": motion(2, 2.3)})
    for k, name in enumerate(generator.motions):
        z = float(generator.module.design.targets[k])
        assert np.allclose(generator.frequency_at(z), generator[name].frequency, rtol=1e-4)
        weights = generator.weights_at(z).reshape(5, 2, 20)
        assert np.allclose(weights[:, k], generator[name].weights, atol=1e-3)
        assert np.abs(weights[:, 1 - k]).max() < 1e-3


def test_impossible_motions_are_refused():
    part = motion(1)
    with pytest.raises(MotiondeckError, match="does not close"):
        replace(part, seconds=1.7)
    with pytest.raises(MotiondeckError, match="centers"):
        replace(part, frequency=np.array([1.0]), loop=False)
    with pytest.raises(MotiondeckError, match="do not fit W"):
        replace(part, weights=part.weights[:, :3])
    with pytest.raises(MotiondeckError, match="same number of channels"):
        CentralizedGenerator({"walk": part, "kick": motion(2, channels=4)})
    with pytest.raises(MotiondeckError, match="needs motions"):
        CentralizedGenerator({})
    with pytest.raises(UnknownNameError, match="walk"):
        three().switch("wlak")
