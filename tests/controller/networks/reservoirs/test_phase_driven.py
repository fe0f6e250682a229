"""All phase-driven networks: they play in phase, stop at an end, find back, and are sent to any phase."""

import numpy as np
import pytest

import synthetic
from controller.learning.preparation.training_motion import TrainingMotion
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.networks.reservoirs.phase_reservoir import ANCHOR_EVERY
from synthetic import run

KINDS = {
    "conceptors": synthetic.small_phase_network,
    "echo state": synthetic.small_phase_echo_state,
    "conceptors that share": synthetic.small_shared_conceptor,
}
NEAR = 0.02


@pytest.fixture(scope="module", params=KINDS)
def make(request):
    return KINDS[request.param]


@pytest.fixture(scope="module")
def network(make):
    return make()


def test_it_knows_its_phase(network):
    assert network.as_phase_network is network
    assert synthetic.small_network().as_phase_network is None


@pytest.mark.parametrize("name", ["march", "wave"])
def test_a_loop_stays_in_phase_with_what_it_learned(network, name):
    taught = synthetic.MOTIONS[name]()
    network.cue(name, 0)
    played = run(network, 5 * len(taught))[-len(taught) :]
    assert np.abs(np.roll(taught, -1, axis=0) - played).max() < NEAR


def test_a_one_shot_ends_where_it_was_learned_to_and_holds(network):
    network.cue("bow", 0)
    taught = synthetic.bow()
    played = run(network, len(taught) + 600)
    assert np.abs(played[: len(taught) - 1] - taught[1:]).max() < NEAR
    assert np.abs(played[-1] - taught[-1]).max() < 0.01
    assert np.abs(played[-1] - played[-2]).max() < 1e-5
    assert network.phase == 1.0


def test_an_end_is_held_on_in_the_states_that_its_readout_is_learned_from(network):
    bow = network["bow"]
    network.seek("bow", 1.0)
    run(network, bow.course.held + 40)
    assert np.array_equal(network.snapshot()[2], bow.held_on(40)[-1])


def test_a_one_shot_that_was_cut_out_of_a_movement_begins_in_its_first_frame():
    _, normalisation = synthetic.lessons()
    taught = synthetic.bow()[60:]
    motion = TrainingMotion("bow", normalisation.apply(taught), loop=False)
    network = synthetic.trained(PhaseRecipe(**synthetic.SMALL_PHASE), [motion], normalisation)
    assert np.abs(network.settled("bow")[:10] - taught[:10]).max() < 0.001


@pytest.mark.parametrize("name", list(synthetic.MOTIONS))
def test_any_state_leads_back_to_the_motion(network, name):
    network.cue(name, 0)
    motion, frame, z, inputs = network.snapshot()
    expected = run(network, 300)[-1]
    wrong = np.random.default_rng(1).uniform(-50.0, 50.0, z.shape).astype(np.float32)
    network.restore((motion, frame, wrong, inputs))
    assert np.abs(run(network, 300)[-1] - expected).max() < 1e-3


def test_nothing_of_a_displacement_is_left_after_a_cue(network):
    network.cue("march", 0)
    expected = run(network, 5)
    network.displace(np.full(network.neurons, 3.0, dtype=np.float32))
    network.cue("march", 0)
    assert np.array_equal(run(network, 5), expected)


def test_a_chain_of_pieces_goes_on_smoothly(make):
    chained = make(piece_seconds=0.5)
    for name, pieces in (("wave", 2), ("bow", 3)):
        taught = synthetic.MOTIONS[name]()
        assert len(chained[name].readout) == pieces
        chained.cue(name, 0)
        played = run(chained, len(taught) - 1)
        assert np.abs(played - taught[1:]).max() < NEAR
        bend, own = (np.abs(np.diff(frames, n=2, axis=0)).max(1) for frames in (played, taught[1:]))
        for seam in np.flatnonzero(np.diff(chained[name].course.piece)):
            assert bend[seam - 2 : seam + 1].max() < 1.5 * own.max()


def test_anchors_are_the_frames_it_learned(network):
    for name, make in synthetic.MOTIONS.items():
        assert np.abs(network.anchors(name) - make()[::ANCHOR_EVERY]).max() < NEAR


@pytest.mark.parametrize(("phase", "frame"), [(0.0, 0), (0.25, 24), (0.999, 0), (0.5, 48)])
def test_a_loop_is_sent_to_a_phase(network, phase, frame):
    network.cue("wave", 0)
    network.seek("march", phase)
    assert network.phase == pytest.approx(frame / 96)
    after = run(network, 1)[0]
    assert np.abs(after - synthetic.march()[frame + 1]).max() < NEAR


def test_the_phase_of_a_one_shot_rises_to_one_and_stays(network):
    network.cue("bow", 0)
    frame, phases = np.empty(network.channels), [network.phase]
    for _ in range(len(synthetic.bow())):
        network.advance(frame)
        phases.append(network.phase)
    assert phases[0] == 0.0
    assert phases[-1] == phases[-50] == 1.0
    assert (np.diff(phases) >= 0.0).all()
    network.seek("bow", 0.5)
    assert network.phase == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("name", list(synthetic.MOTIONS))
def test_backwards_it_plays_the_frames_in_the_other_order(network, name):
    network.cue(name, 20)
    there = run(network, 30)
    back = np.empty_like(there)
    for frame in back:
        network.retreat(frame)
    assert np.abs(back[:-1] - there[-2::-1]).max() < 1e-3


def test_a_one_shot_goes_back_to_its_beginning_and_no_further(network):
    network.cue("bow", 1)
    frame = np.empty(network.channels)
    for _ in range(5):
        network.retreat(frame)
    assert network.phase == 0.0


def test_a_twin_has_a_state_of_its_own(network):
    network.cue("march", 0)
    twin = network.twin()
    twin.cue("wave", 3)
    run(twin, 10)
    assert network.phase == 0.0
