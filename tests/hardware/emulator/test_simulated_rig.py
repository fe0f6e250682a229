"""The rig without bytes behaves as the one with them."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.simulated_rig import SimulatedRig
from hardware.rig.supervision.rig import Rig


@pytest.fixture
def rig(rig_of_four):
    return SimulatedRig(rig_of_four)


def play(rig, elapse, ticks):
    seen = []
    for tick in range(ticks):
        rig.collect_state()
        seen.append(rig.positions.copy())
        rig.write(0.5 * np.sin(0.015 * tick * np.arange(1, 5)))
        elapse(0.01)
    return np.array(seen)


def test_it_moves_as_the_servos_behind_a_bus_do(rig, rig_of_four):
    port = EmulatedPort(EmulatedBus(rig_of_four))
    wired = play(Rig(rig_of_four, lambda part: Bus(port, part.baud)), port.elapse, 200)
    plain = play(rig, rig.elapse, 200)
    # The wired state is as old as its request.
    assert np.abs(wired[2:] - plain[1:-1]).max() < 0.02


def test_targets_are_clipped_and_nonsense_is_refused(rig):
    rig.write(np.array([9.0, np.nan, 0.0, 0.0]))
    assert (rig.faults.clipped.tolist(), rig.faults.refused.tolist()) == ([1, 0, 0, 0], [0, 1, 0, 0])


def test_silence_stops_it_and_a_tripped_servo_takes_no_goal(rig):
    rig.write(np.full(4, 1.0))
    rig.elapse(1.0)
    assert [device["bus_watchdog"] for device in rig.servos.devices] == [-1] * 4
    rig.write(np.full(4, -1.0))
    assert rig.faults.unsent.tolist() == [1] * 4


def test_a_dead_joint_is_counted_and_named(rig):
    rig.servos[2].dead = True
    play(rig, rig.elapse, 5)
    assert rig.faults.missed[1] > 0
    assert rig.close() == ["joint_2"]
    assert [device["torque_enable"] for device in rig.servos.devices] == [0, 1, 0, 0]
