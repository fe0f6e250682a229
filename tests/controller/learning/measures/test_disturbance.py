import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import synthetic
from controller.learning.evaluation.failure_rates import grouped, sweep, wilson
from controller.learning.evaluation.tables import failure_table
from controller.learning.fit import TrainedNetwork
from controller.learning.measures.disturbance import STEPS, disturbed, stress_test
from controller.learning.measures.self_test import after_disturbance, self_test
from controller.learning.trainers.echo_state import EchoStateRecipe
from controller.networks.guard import Guard, LossWatch, beat, spread

SMALL_ECHO = EchoStateRecipe(neurons=200, washout=60)


def cued(network, motion, runs):
    """Several runs of a motion at its first anchor, and the frames that they write."""
    player = network.twin(runs)
    player.cue(motion, 0)
    return player, np.empty((runs, player.channels))


@pytest.fixture(scope="module")
def conceptors():
    return synthetic.small_network()


@pytest.fixture(scope="module")
def echo():
    lessons, normalisation = synthetic.lessons()
    return synthetic.trained(SMALL_ECHO, lessons, normalisation)


@pytest.fixture(scope="module")
def syllabus():
    return synthetic.training_set()


@pytest.fixture(scope="module")
def driven():
    return synthetic.small_phase_network(piece_seconds=0.5)


@pytest.fixture(scope="module")
def driven_echo():
    return synthetic.small_phase_echo_state(piece_seconds=0.5)


@pytest.mark.parametrize("kind", ["conceptors", "echo", "driven", "driven_echo"])
@pytest.mark.parametrize("motion", list(synthetic.MOTIONS))
def test_several_runs_play_what_one_plays(kind, motion, request):
    network = request.getfixturevalue(kind)
    network.cue(motion, 0)
    frame = np.empty(network.channels)
    player, frames = cued(network, motion, 3)
    for _ in range(130):
        network.advance(frame)
        player.advance(frames)
    assert np.allclose(frames, frame, atol=2e-3)
    lost = player.as_autonomous
    assert (lost is not None) is (kind in {"conceptors", "echo"})
    assert lost is None or not lost.astray().any()


@pytest.mark.parametrize("kind", ["conceptors", "echo", "driven", "driven_echo"])
def test_several_runs_do_not_touch_each_other(kind, request):
    network = request.getfixturevalue(kind)
    (calm, first), (shaken, second) = cued(network, "march", 2), cued(network, "march", 2)
    noise = np.zeros((2, network.neurons), dtype=np.float32)
    noise[1] = 3.0
    shaken.displace(noise)
    for _ in range(5):
        calm.advance(first)
        shaken.advance(second)
    assert np.allclose(first[0], second[0], atol=1e-5)
    assert not np.allclose(first[1], second[1], atol=1e-3)


@pytest.mark.parametrize("kind", ["conceptors", "echo"])
def test_a_cued_run_goes_on_from_its_anchor(kind, request):
    network = request.getfixturevalue(kind)
    player, frames = cued(network, "wave", 2)
    player.displace(np.full((2, network.neurons), 50.0, dtype=np.float32))
    player.cue("wave", np.array([4]), np.array([1]))
    network.cue("wave", 4)
    frame = np.empty(network.channels)
    network.advance(frame)
    player.advance(frames)
    assert np.allclose(frames[1], frame, atol=1e-4)


def test_noise_beyond_what_neurons_can_be_counts_as_astray(conceptors, echo):
    batch, _ = cued(echo, "march", 2)
    batch.displace(np.array([[0.0], [50.0]], dtype=np.float32) * np.ones((1, echo.neurons), dtype=np.float32))
    assert batch.astray().tolist() == [False, True]
    weights = np.eye(conceptors.neurons, dtype=np.float32)
    batch, _ = cued(conceptors, "march", 1)
    batch.displace(np.full((1, conceptors.neurons), 50.0, dtype=np.float32), weights)
    assert batch.astray().all()


@pytest.mark.parametrize("kind", ["robustness", "stability"])
def test_the_same_seed_gives_the_same_runs(conceptors, kind):
    first, second = (disturbed(kind, conceptors, "march", 2, np.random.default_rng(5)) for _ in range(2))
    assert first.shape == (2, STEPS, conceptors.channels)
    assert np.array_equal(first, second)
    assert not np.array_equal(first[0], first[1])


def test_a_guarded_run_is_what_a_guard_plays(conceptors):
    frames, scale = len(synthetic.bow()), spread(conceptors)
    watch = LossWatch(
        beat(conceptors, "bow", scale, frames, synthetic.RATE, loop=False), scale, conceptors.anchors("bow")[:1]
    )
    (run,) = disturbed("robustness", conceptors, "bow", 1, np.random.default_rng(0), watch)
    lengths = {name: len(taught) for name, taught in synthetic.references().items()}
    guard = Guard(conceptors.twin(), lengths, synthetic.LOOPS, synthetic.RATE)
    out = np.empty((STEPS, conceptors.channels))
    guard.cue("bow", 0)
    for frame in out:
        guard.advance(frame)
    assert np.allclose(run[-1], out[-1], atol=0.05)


def test_a_sweep_counts_by_motion_and_seed(conceptors, syllabus):
    ticks = []
    counts = sweep(
        "stability",
        [TrainedNetwork(3, conceptors, {}, asked=3)],
        syllabus,
        4,
        motions=["march", "bow"],
        tick=lambda: ticks.append(1),
    )
    assert [(count.motion, count.loop, count.seed, count.runs) for count in counts] == [
        ("march", True, 3, 4),
        ("bow", False, 3, 4),
    ]
    assert len(ticks) == 2
    assert counts[0].intrinsic == 0
    assert all(count.guarded is not None and count.guarded <= count.intrinsic for count in counts)
    table = failure_table("t", counts, [])
    assert [row["motion"] for row in table.rows] == ["march", "bow", "all loops", "everything"]
    assert table.rows[-1]["runs"] == 8


def test_motions_are_counted_alone_and_without_a_guard(conceptors, syllabus):
    counts = sweep(
        "robustness", [TrainedNetwork(0, conceptors, {})], syllabus, 2, motions=["march", "wave"], guarded=False
    )
    rows = failure_table("t", counts, []).rows
    assert [row["motion"] for row in rows[:2]] == ["march", "wave"]
    assert "guarded %" not in rows[0]


def test_a_loop_that_does_not_survive_noise_fails_the_stress_test(conceptors, syllabus, monkeypatch):
    judge = synthetic.judge()
    free = self_test(conceptors, judge)
    assert stress_test(conceptors, free, judge, 0) == free

    def dying(kind, network, motion, runs, rng):
        return np.zeros((runs, STEPS, conceptors.channels), dtype=np.float32) + conceptors.anchors("march")[0]

    monkeypatch.setattr("controller.learning.measures.disturbance.disturbed", dying)
    verdicts = stress_test(conceptors, free, judge, 0)
    assert verdicts["march"].reason == "fails 5 of 5 times when started from noise"
    assert verdicts["bow"].passed


@given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_surrounds_the_rate(seen):
    failures, runs = seen
    low, high = wilson(failures, runs)
    assert 0.0 <= low <= failures / runs <= high <= 1.0
    assert high - low > 0.0


def test_wilson_is_that_of_the_books():
    assert wilson(0, 100) == pytest.approx((0.0, 0.0370), abs=1e-4)
    assert wilson(10, 100) == pytest.approx((0.0552, 0.1744), abs=1e-4)
    assert wilson(0, 0) == (0.0, 1.0)


def test_runs_that_fail_together_count_less():
    alone = grouped([1] * 10 + [0] * 90, [1] * 100)
    assert alone == pytest.approx(wilson(10, 100), abs=1e-3)
    together = grouped([10] + [0] * 9, [10] * 10)
    assert together[1] - together[0] > 2.0 * (alone[1] - alone[0])
    assert together == pytest.approx(wilson(1, 10), abs=0.02)
    # As many groups as there are, where none fails or all do; a single group is one run.
    assert grouped([0] * 15, [20] * 15) == wilson(0, 15)
    assert grouped([20] * 15, [20] * 15) == wilson(15, 15)
    assert grouped([3], [20]) == wilson(0.15, 1)
    assert grouped([], []) == (0.0, 1.0)


@pytest.mark.thorough
@pytest.mark.parametrize("network", ["driven", "driven_echo"])
@pytest.mark.parametrize("kind", ["robustness", "stability"])
def test_a_disturbed_phase_network_finds_back_to_its_phase(network, kind, request):
    driven = request.getfixturevalue(network)
    judge = synthetic.judge()
    for motion in driven.motions:
        for run in disturbed(kind, driven, motion, 4, np.random.default_rng(2)):
            assert after_disturbance(driven, judge, motion, run.astype(np.float64)).passed
            assert not after_disturbance(driven, judge, motion, run[7:].astype(np.float64)).passed or motion == "bow"


def test_a_push_acts_through_all_of_the_weights(driven):
    # The network steps from x = s + d with dense weights; the player has only z and what is orthogonal to it.
    motion, reservoir = driven["march"], driven.reservoir
    push = np.random.default_rng(4).uniform(-2.0, 2.0, (1, driven.neurons)).astype(np.float32)
    player, frames = cued(driven, "march", 1)
    player.displace(push)
    player.advance(frames)
    played = frames[0]
    directions, estimate = motion.stored.basis[0].astype(np.float64), motion.stored.estimate[0].astype(np.float64)
    mean = motion.stored.mean[0].astype(np.float64)
    x = mean + directions @ motion.states[0] + push[0]
    inputs = estimate[:, :-1] @ (directions.T @ (x - mean)) + estimate[:, -1]
    hidden = np.tanh(
        reservoir.weights @ x
        + reservoir.input_weights @ inputs
        + reservoir.phase_weights @ motion.inputs[1]
        + reservoir.bias
    )
    z = motion.stored.strength[0] * (directions.T @ (hidden - mean))
    assert np.allclose(played, motion.readout[0, :, :-1] @ z + motion.readout[0, :, -1], atol=5e-3)
