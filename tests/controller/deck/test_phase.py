"""The phase as a command: how far a motion is, played backwards, frozen and sent elsewhere, through joins alone."""

import numpy as np
import pytest

import synthetic
from controller.deck.deck import Deck
from controller.deck.motion_generator import MotionGenerator
from motiondeck_base.errors import MotiondeckError

DT = 0.005
PERIOD = 96 / synthetic.RATE  # of the march, s


@pytest.fixture(scope="module")
def library():
    return synthetic.small_phase_library()


def new_deck(library, motion="march", phase=0.0):
    return Deck(library, lambda pose: pose.rotation.ravel().copy(), motion, phase=phase)


def played(library, deck, seconds):
    """Joint positions while the deck plays on, shape (ticks, joints, 3), m."""
    roots, rotations = [], []
    for _ in range(round(seconds / DT)):
        deck.update(DT)
        roots.append(deck.pose.root_position.copy())
        rotations.append(deck.pose.rotation.copy())
    return library.skeleton.joints(np.array(roots), np.array(rotations))


def peaks(places):
    """The largest speed and acceleration of a joint, m/s and m/s^2."""
    step = np.diff(places, axis=0)
    change = np.diff(step, axis=0)
    return np.linalg.norm(step, axis=-1).max() / DT, np.linalg.norm(change, axis=-1).max() / DT**2


def apart(phase, other):
    """The way from one phase to another, in [-0.5, 0.5)."""
    return (phase - other + 0.5) % 1.0 - 0.5


def test_the_phase_goes_round_with_the_motion(library):
    deck = new_deck(library, phase=0.25)
    played(library, deck, 0.6 * PERIOD)
    assert apart(deck.phase, 0.85) == pytest.approx(0.0, abs=0.02)
    played(library, deck, 0.4 * PERIOD)
    assert apart(deck.phase, 0.25) == pytest.approx(0.0, abs=0.02)


def test_backwards_the_body_goes_back_where_it_came_from(library):
    deck = new_deck(library)
    there = played(library, deck, 4.0)
    deck.set_tempo(-1.0)
    # 0.8 s from tempo 1 to -1, in which it goes on and comes back by the same way.
    back = played(library, deck, 4.8)
    assert there[-1, 0, 0] - there[0, 0, 0] > 4.0
    assert back[-1, 0, 0] - there[0, 0, 0] == pytest.approx(0.0, abs=0.05)
    turning = np.concatenate([there[-200:], back[:400]])
    speed, acceleration = peaks(turning)
    own_speed, own_acceleration = peaks(there)
    assert speed <= 1.02 * own_speed
    assert acceleration <= own_acceleration + 2.5 * own_speed + 0.5  # the tempo changes by 2.5 a second


def test_tempo_zero_freezes_and_keeps_the_phase(library):
    deck = new_deck(library)
    deck.set_tempo(0.0)
    played(library, deck, 0.5)
    phase = deck.phase
    assert np.ptp(played(library, deck, 1.0), axis=0).max() < 1e-9
    assert deck.phase == phase
    deck.set_tempo(1.0)
    assert np.ptp(played(library, deck, 1.0), axis=0).max() > 0.3


def test_a_one_shot_is_played_back_to_its_beginning(library):
    deck = new_deck(library, "bow")
    low = played(library, deck, 3.0)[-1]
    assert deck.phase == 1.0
    deck.set_tempo(-1.0)
    high = played(library, deck, 3.0)[-1]
    assert deck.phase == 0.0
    assert high[0, 2] - low[0, 2] > 0.2
    assert np.abs(high - played(library, new_deck(library, "bow"), DT)[0]).max() < 0.02


def test_backwards_what_is_queued_comes_when_the_motion_has_gone_round(library):
    for motion in ("march", "bow"):
        deck = new_deck(library, motion, phase=0.5)
        deck.set_tempo(-1.0)
        played(library, deck, 0.8)
        queued = deck.enqueue("wave")
        played(library, deck, 0.3)
        assert queued.first_change_s is None or motion == "march"
        played(library, deck, 2.5)
        assert deck.motion == "wave"
        assert queued.settled_s is not None


@pytest.fixture(scope="module")
def own_peaks(library):
    return {motion: peaks(played(library, new_deck(library, motion), 2.0)) for motion in synthetic.MOTIONS}


@pytest.mark.thorough
@pytest.mark.parametrize("tempo", [1.0, 0.0, -1.0])
@pytest.mark.parametrize("motion", list(synthetic.MOTIONS))
def test_a_jump_arrives_without_a_step(library, own_peaks, motion, tempo):
    own_speed, own_acceleration = own_peaks[motion]
    for start, goal in ((0.1, 0.9), (0.8, 0.3), (0.45, 0.03)):
        deck = new_deck(library, motion, phase=start)
        deck.set_tempo(tempo)
        before = played(library, deck, 0.8)
        deck.jump(goal)
        after = played(library, deck, 0.2)
        if motion != "bow":
            # What it is sent to plays on from there while the difference fades.
            way = tempo * 0.2 * synthetic.RATE / len(synthetic.references()[motion])
            assert apart(deck.phase, goal + way) == pytest.approx(0.0, abs=0.04)
        speed, acceleration = peaks(np.concatenate([before[-3:], after, played(library, deck, 1.5)]))
        assert speed <= 1.5 * max(own_speed, 0.5)
        assert acceleration <= 2.0 * max(own_acceleration, 2.0)
        assert deck.settled


def test_jumps_that_interrupt_each_other_at_a_fast_tempo_swing_no_body_out(library):
    """Under the limits of the recorded tempo no fade passed: it took 1.6 s, and the body swung out by 1.5 m."""

    def shapes(places):
        return places - places[:, :1]

    alone = {motion: shapes(played(library, new_deck(library, motion), 1.5)) for motion in ("march", "wave")}
    for seed in (1, 8, 14):
        rng = np.random.default_rng(seed)
        motion, tempo = str(rng.choice([*alone])), rng.choice([-1.0, 1.0]) * rng.uniform(1.3, 3.0)
        deck = new_deck(library, motion)
        deck.set_tempo(tempo)
        played(library, deck, 1.4)
        for _ in range(2):
            deck.jump(rng.uniform())
            deck.set_tempo(rng.uniform(0.5, 1.0) * tempo)
            played(library, deck, rng.uniform(0.05, 0.25))
        off = np.linalg.norm(shapes(played(library, deck, 0.9))[:, None] - alone[motion], axis=-1).max(-1).min(-1)
        reach = np.linalg.norm(alone[motion][::5, None] - alone[motion], axis=-1).max()
        assert off.max() < 0.5 * reach, (seed, motion, tempo)
        assert off[-1] < 0.04, (seed, motion, tempo)


def test_a_jump_leaves_a_switch_that_waits_alone(library):
    deck = new_deck(library, "bow")
    played(library, deck, 0.2)
    waiting = deck.switch("march")
    deck.jump(0.8)
    played(library, deck, 3.0)
    assert deck.motion == deck.playing == "march"
    assert waiting.settled_s is not None


def test_what_has_no_phase_says_so(library):
    by_itself = synthetic.small_library()
    deck = new_deck(by_itself)
    assert deck.phase is None
    for command in (lambda: deck.jump(0.5), lambda: deck.set_tempo(-0.5)):
        with pytest.raises(MotiondeckError, match=r'runs by itself: it has no phase .* type = "phase-conceptor"'):
            command()
    deck.set_tempo(0.0)
    assert (deck.commanded_tempo, new_deck(library).phase) == (0.0, 0.0)
    with pytest.raises(MotiondeckError, match="runs by itself"):
        MotionGenerator(by_itself, "march", tempo=-1.0)


def test_a_blend_is_not_jumped_in(library):
    deck = new_deck(library)
    deck.blend_in("march", "wave", 0.5)
    played(library, deck, 2.0)
    with pytest.raises(MotiondeckError, match="motions are blended"):
        deck.jump(0.5)
    with pytest.raises(MotiondeckError, match="PHASE must be a number from 0 to 1"):
        deck.jump(1.5)


def test_a_generator_goes_back_and_tells_its_phase(library):
    generator = MotionGenerator(library, "bow", tempo=-1.0, phase=1.0)
    shown = [generator.step(0.0), *(generator.step(DT) for _ in range(400))]
    assert generator.phase == 0.0
    bow = synthetic.bow()
    assert np.abs(shown[0] - bow[-1]).max() < 0.03
    assert np.abs(shown[-1][0] - bow[0][0]) < 0.03
    forward = MotionGenerator(library, "march", phase=0.5)
    back = MotionGenerator(library, "march", tempo=-1.0, phase=0.5)
    velocities = library.encoding.velocities
    assert np.allclose(forward.step(0.0)[velocities], -back.step(0.0)[velocities])
