"""A deck with a rig that is killed, stopped and stalled, as seen on its wire; and cells of the fault matrix."""

import pytest

from benchmarks.stop import fault_matrix, kills
from benchmarks.stop.fault_matrix import Stage


def test_joints_of_a_deck_that_is_stopped_stalled_and_killed_brake_within_their_limits():
    found = kills.strike([("walk", "kill", [0.3, 0.012])], seed=5)
    assert found.undisturbed <= kills.MOST
    for strike in found.strikes:  # on a machine that is far too busy, none
        assert strike.within, strike
        assert not strike.outside, strike
        if strike.kind != "stall":
            assert strike.braking_after is None or strike.braking_after <= fault_matrix.BRAKES_WITHIN, strike
            assert strike.still_after is not None, strike


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("fault", "sources"),
    [
        ("nothing", ("door", "network", "wired")),
        ("stopped", ("door",)),
        ("raising", ("door",)),
        ("cut", ("door",)),
        ("1000", ("door",)),
        ("nothing", ("signal",)),
        ("page", ("death",)),
    ],
)
def test_stops_beside_broken_parts(fault, sources):
    trials, failures = fault_matrix.run(Stage(fault, sources), repetitions=1, seed=1)
    assert not [failure for failure in failures if "too busy" not in failure]
    for trial in trials:
        assert trial.at_rest, trial
        assert trial.in_time, trial
