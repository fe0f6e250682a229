"""The table of phase-driven networks, on the synthetic motions."""

import msgspec
import pytest

import synthetic
from benchmarks.reservoirs.phase_morphs import COLUMNS, mixtures
from benchmarks.reservoirs.phase_networks import ABLATION, channels_mb, clip_row, fitted, line, measured
from controller.learning.trainers.clip import ClipRecipe
from controller.learning.trainers.phase_conceptor import PhaseRecipe
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.library.motion_library import MotionLibrary

KNOWN = synthetic.training_set()


def test_a_row_has_what_was_measured():
    row = measured("small", "phase", PhaseRecipe(**synthetic.SMALL_PHASE), KNOWN, [1])
    assert (row.motions, row.passed, row.lost, row.failing) == (3, 1.0, 0.0, ())
    assert 0.0 < row.error_mm <= row.largest_error_mm < 10.0
    assert row.channels_mb == pytest.approx(4e-6 * sum(frames.size for frames in KNOWN.frames.values()))
    assert line(row).count("|") == 10


def test_without_phase_motions_fail():
    recipe = msgspec.structs.replace(ABLATION["no phase (W_phi = 0)"], **synthetic.SMALL_PHASE)
    assert measured("small", "no phase", recipe, KNOWN, [1]).passed < 1.0


def test_a_clip_player_is_exact():
    row = clip_row("small", KNOWN)
    assert row.largest_error_mm < 1e-3
    assert row.file_mb == channels_mb(KNOWN)


def test_fewer_keys_are_smaller_and_less_exact():
    rows = [clip_row("small", KNOWN, every) for every in (2, 4, 24)]
    sizes = [row.file_mb for row in rows]
    assert channels_mb(KNOWN) / 4 > sizes[0] > 1.5 * sizes[1] > 2 * sizes[2]
    errors = [row.error_mm for row in rows]
    assert 0.0 < errors[0] < errors[2] < 20.0
    assert all(row.passed == 1.0 for row in rows)


@pytest.mark.thorough
def test_a_network_and_a_clip_within_an_error_are_measured():
    (clip,) = fitted(ClipRecipe(tolerance_mm=2.0), KNOWN, [0])
    networks = fitted(PhaseEchoStateRecipe(tolerance_mm=2.0), KNOWN, [1, 2])
    assert all(max(errors) <= 2.0 for _, errors in (clip, *networks))
    assert max(network.stored_bytes for network, _ in networks) <= 1.1 * clip[0].stored_bytes


def test_a_mixture_is_measured_at_each_mu():
    network = synthetic.small_shared_conceptor(readout="shared")
    whole = synthetic.small_library()
    library = MotionLibrary(msgspec.structs.replace(whole.info, network=network.kind), network, whole.encoding)
    found = mixtures(library, ("march", "wave"), [0.0, 0.5])
    assert found.shape == (2, len(COLUMNS))
    # At 0 both ways play the first motion alone, the second of no weight.
    named = dict(zip(COLUMNS, found[0], strict=True))
    assert [named[name] for name in ("activity", "in step", "deck activity")] == pytest.approx([1.0] * 3, abs=0.05)
