"""A style as a direction: what tells two motions apart on average is added to a third, and nothing else."""

import numpy as np
import pytest

import synthetic
from benchmarks.centralized.restyling import in_the_style
from controller.library.motion_library import load_library, save_library
from motiondeck_base.errors import MotiondeckError, UnknownNameError


@pytest.fixture(scope="module", params=["conceptors", "echo state"])
def library(request):
    make = synthetic.small_phase_library if request.param == "conceptors" else synthetic.small_phase_echo_state_library
    return make()


@pytest.mark.parametrize("strength", [1.0, -0.5])
def test_a_motion_gets_the_mean_difference_of_two_others_but_keeps_its_course(library, strength):
    styled, moved = in_the_style(library, "bow", "wave", "march", strength)
    network = styled.network
    wave, march, before, after = map(network.settled, ("wave", "march", "bow", "bow-like-wave"))
    wanted = strength * (wave.mean(0) - march.mean(0))
    wanted[1:4] = 0.0  # turn rate and velocities
    np.testing.assert_allclose(after - before, np.tile(wanted, (len(before), 1)), atol=1e-5)
    assert moved > 10.0
    assert np.array_equal(network.settled("march"), library.network.settled("march"))


def test_a_library_with_it_is_saved_and_played(library, tmp_path):
    styled, _ = in_the_style(library, "march", "wave", "march")
    save_library(styled, tmp_path / "styled.safetensors")
    again = load_library(tmp_path / "styled.safetensors").network
    assert np.array_equal(again.settled("march-like-wave"), styled.network.settled("march-like-wave"))


def test_what_cannot_be_given_a_style_is_refused(library):
    with pytest.raises(UnknownNameError, match="wvae"):
        in_the_style(library, "march", "wvae", "bow")
    with pytest.raises(MotiondeckError, match="nan"):
        in_the_style(library, "march", "wave", "bow", float("nan"))
    styled, _ = in_the_style(library, "march", "wave", "bow")
    with pytest.raises(MotiondeckError, match="already"):
        in_the_style(styled, "march", "wave", "bow")
    with pytest.raises(MotiondeckError, match="without a phase"):
        in_the_style(synthetic.small_library(), "march", "wave", "bow")
