"""The switching module has the states that Lemma 1 promises, and every command reaches every one of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import expit

from controller.networks.centralized.switching_design import SwitchingModuleError, design_module
from controller.networks.centralized.switching_module import (
    SwitchingModule,
    advance_state,
    clamp,
    collapse_and_kick,
    excite,
)

betas = st.floats(0.02, 0.98)


@pytest.mark.thorough
@settings(max_examples=40)
@given(st.integers(1, 30), betas, st.floats(8.0, 40.0), st.floats(0.001, 10.0))
def test_lemma_1(motions, beta, slope, kappa):
    design = design_module(motions, beta, slope, kappa)
    stable = [point for point in design.rest_points if point.stable]
    assert len(stable) == motions
    assert len(design.rest_points) == 2 * motions - 1
    for k, point in enumerate(stable, start=1):
        assert k - 1 + beta < point.z < k + beta
        assert point.z == pytest.approx(design.targets[k - 1], abs=1e-9)
        # Cooperative: the eigenvalue that decides is real, so nothing oscillates.
        leading = point.eigenvalues[point.eigenvalues.real.argmax()]
        assert abs(leading.imag) < 1e-9


@pytest.mark.thorough
@pytest.mark.parametrize(("motions", "low", "high"), [(3, 0.862, 1.126), (5, 0.928, 1.072), (15, 0.978, 1.022)])
def test_the_window_of_xi_is_where_the_states_are(motions, low, high):
    design = design_module(motions)
    window = design.window
    assert window.low == pytest.approx(low, abs=2e-3)
    assert window.high == pytest.approx(high, abs=2e-3)

    def stable_states(xi):
        grid = np.linspace(0, 1.5 / (design.decay * min(xi, 1.0)), 200_000)
        excess = design.staircase(grid) - xi * design.decay * grid
        return int(((excess[:-1] > 0) & (excess[1:] <= 0)).sum())

    assert stable_states(window.low + 1e-3) == motions
    assert stable_states(window.high - 1e-3) == motions
    assert stable_states(window.high + 1e-3) == motions - 1
    assert stable_states(window.single + 1e-3) == 1
    assert stable_states(window.single - 1e-3) > 1


def reached(design, command_of, dt):
    """The state in which a module ends up for every ordered pair of motions, with the target of each."""
    m = len(design)
    z, w, targets = np.empty(0), np.empty((0, m)), []
    for target in range(m):
        starts = [start for start in range(m) if start != target]
        driven_z = design.targets[starts]
        driven_w = design.kappa * design.satellites(driven_z)
        command = command_of(design, target)
        elapsed = 0.0
        while elapsed < command.lasts:
            for span, drive in command.spans(elapsed, dt):
                driven_z, driven_w = advance_state(design, driven_z, driven_w, span, drive)
            elapsed += dt
        z, w, targets = np.append(z, driven_z), np.vstack([w, driven_w]), targets + [target] * len(starts)
    for _ in range(round(14.0 / dt)):  # no command drives them any more, so all relax side by side
        z, w = advance_state(design, z, w, dt)
    assert len(targets) == m * (m - 1)
    return list(zip(np.floor(z - design.beta).astype(int), targets, strict=True))


@pytest.mark.thorough
@pytest.mark.parametrize("motions", [3, 5, 10, 15])
@pytest.mark.parametrize("command_of", [clamp, excite, collapse_and_kick])
@pytest.mark.parametrize("dt", [0.01, 0.05])
def test_every_ordered_pair_is_reached(motions, command_of, dt):
    ends = reached(design_module(motions), command_of, dt)
    assert all(end == target for end, target in ends)


def test_steps_follow_the_differential_equations():
    design = design_module(4)

    def slope(_, y):
        z, w = y[0], y[1:]
        drift = expit(design.weights @ w / design.kappa - design.threshold) - design.decay * z
        return np.append(drift, expit(design.slope * z - design.thresholds) - w / design.kappa)

    start = np.append(2.63, design.kappa * design.satellites(2.63))
    run = solve_ivp(slope, (0, 8), start, method="LSODA", rtol=1e-9, atol=1e-11)
    z, w = np.array(start[0]), start[1:]
    for _ in range(8000):
        z, w = advance_state(design, z, w, 0.001)
    assert float(z) == pytest.approx(run.y[0, -1], abs=5e-3)
    assert w == pytest.approx(run.y[1:, -1], abs=5e-4)


@given(st.floats(-5.0, 40.0), st.floats(0.001, 50.0), st.integers(2, 15))
def test_no_step_is_too_long(z, dt, motions):
    design = design_module(motions)
    state, w = np.array(z), np.zeros(motions)
    for _ in range(300):
        state, w = advance_state(design, state, w, dt)
    assert min(0.0, z) <= float(state) <= max(1.0 / design.decay, z)
    assert (w >= 0.0).all()
    assert (w <= design.kappa).all()


@given(st.integers(1, 20), betas, st.floats(-2.0, 25.0))
def test_memberships_are_a_partition_of_unity(motions, beta, z):
    design = design_module(motions, beta)
    share = design.memberships(z)
    assert share.shape == (motions,)
    assert share.sum() == pytest.approx(1.0)
    assert (share >= -1e-15).all()
    assert np.allclose(design.memberships(design.targets), np.eye(motions), atol=2e-5)


def test_small_noise_on_the_center_leaves_every_state_where_it_is():
    design, rng = design_module(5), np.random.default_rng(1)
    for state in range(5):
        module = SwitchingModule(design, state)
        for push in 0.05 * np.sqrt(0.02) * rng.standard_normal(3000):
            module.advance(0.02, push)
        assert module.state == state
        assert design.memberships(module.z)[state] > 0.99


def test_a_module_obeys_a_command_and_repeats_itself_from_a_snapshot():
    design = design_module(4)
    module = SwitchingModule(design, 3, time_scale=0.5)
    module.command(clamp(design, 1))
    before = module.snapshot()
    seen = []
    for _ in range(2):
        module.restore(before)
        path = []
        for _ in range(400):
            module.advance(0.005)
            path.append(module.z)
        seen.append(path)
    assert seen[0] == seen[1]
    assert module.state == 1
    assert not module.commanded
    module.reset(2)
    assert module.z == design.targets[2]


def test_impossible_modules_are_refused():
    with pytest.raises(SwitchingModuleError, match="0 motions"):
        design_module(0)
    with pytest.raises(SwitchingModuleError, match="beta"):
        design_module(3, beta=1.0)
    with pytest.raises(SwitchingModuleError, match="slope"):
        design_module(3, slope=1.0)
    with pytest.raises(SwitchingModuleError, match="kappa"):
        design_module(3, kappa=0.0)
