"""The health of every servo of a rig of mixed models: what is noticed, how soon, and what follows.

All models and faults:  python -m benchmarks health_table [--in-place]
"""

import msgspec
import numpy as np
import pytest

from benchmarks.rig.health_table import MODELS, mixed_rig, run
from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import BOOT_TIME, EmulatedBus
from hardware.errors import RigError
from hardware.families.dynamixel2.frames import Parser
from hardware.rig.state_block import arrange_state
from hardware.rig.supervision.rig import Rig

TICK = 0.01
NONE_HIDDEN, ALL_HIDDEN = (), tuple(range(len(MODELS)))


def build(hidden=(), **settings):
    """A supervised rig of six models, the indirect cells of the `hidden` ones not where their table has them."""
    config = msgspec.structs.replace(mixed_rig(), **settings)
    port = EmulatedPort(EmulatedBus(config))
    for index in hidden:
        port.bus.devices[index].hide_cells()
    return Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse), port


def play(rig, port, seconds, target=0.0):
    for _ in range(round(seconds / TICK)):
        rig.collect_state()
        rig.write(np.full(len(MODELS), target))
        port.elapse(TICK)


def named(rig):
    return {(incident.source.partition(" ")[0], incident.what.partition(":")[0]) for incident in rig.incidents}


@pytest.mark.parametrize(
    ("model", "fault", "in_place"),
    [("XL330-M288", "restart", True), ("XM430-W350", "overheat", True), ("XL430-W250", "jam", False)],
)
def test_a_fault_of_any_model_is_named_within_a_second(model, fault, in_place):
    found = run(model, fault, in_place)
    assert found.after <= 1.0
    assert found.follows == (fault == "restart")
    assert (model in found.end) == (fault == "overheat")


@pytest.mark.thorough
@pytest.mark.parametrize("hidden", [NONE_HIDDEN, (1,), (0, 1, 3), ALL_HIDDEN])
def test_position_comes_every_tick_and_health_at_least_once_a_second(hidden):
    rig, port = build(hidden)
    play(rig, port, 0.05)
    oldest, since = 0.0, np.full(len(MODELS), port.now())
    for tick in range(60):
        before = [device.bank.shaft[device.row] for device in port.bus.devices]
        play(rig, port, TICK, target=0.002 * tick)
        since[np.isfinite(rig.temperatures)] = port.now()
        rig.temperatures[:] = np.nan
        oldest = max(oldest, float((port.now() - since).max()))
        seen = 2048 + rig.positions * 2048 / np.pi
        assert np.abs(seen - before).max() < 12.0  # pulses: what one or two ticks make
    assert oldest < 0.2
    play(rig, port, 0.2)
    assert rig.temperatures == pytest.approx(np.full(6, 32.0), abs=1.0)
    assert rig.voltages == pytest.approx([12.0, 5.0, 12.0, 12.0, 12.0, 12.0])


def test_an_alert_is_answered_by_asking_what_it_means_in_the_next_request():
    config = mixed_rig()
    port = EmulatedPort(EmulatedBus(config))
    for device in port.bus.devices:
        device.hide_cells()
    rig = Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)

    def tick():
        port.sent.clear()
        rig.collect_state()
        rig.write(np.zeros(6))
        (asked,) = [frame for frame in Parser().feed(b"".join(port.sent)) if frame.instruction in (0x92, 0x9A)]
        return {asked.params[at] for at in range(0, len(asked.params), 5) if asked.params[at + 3] > 80}

    while tick() != {1}:
        pass
    port.bus[5].fail(1)
    assert tick() == {2}
    assert tick() == {3, 5}
    tick()
    assert rig.measured.errors.tolist() == [0, 0, 0, 0, 1, 0]


def test_cells_that_show_something_else_are_not_believed():
    """An XL330 with another firmware: its pointers are taken, and its data cells are elsewhere."""
    config = mixed_rig()
    bus = Bus(EmulatedPort(EmulatedBus(config)), config.baud)
    bus.port.bus.devices[1].hide_cells()
    lengths = [block.length for block in arrange_state(config, bus)]
    assert lengths == [15, 10, 15, 15, 15, 15]


def test_a_servo_that_takes_no_goals_is_named_and_set_up_again():
    """Its own watchdog has tripped unseen: torque is on, no error, no current, and it stays where it is."""
    rig, port = build()
    play(rig, port, 0.3)
    device = port.bus.devices[2]
    device["bus_watchdog"] = -1
    play(rig, port, 1.5, target=0.8)
    assert ("XL430-W250", "does not follow its target") in named(rig)
    assert rig.recoveries == 1
    play(rig, port, 2.0, target=0.8)
    assert rig.positions == pytest.approx(np.full(6, 0.8), abs=0.02)


def test_a_servo_that_does_not_follow_although_it_was_set_up_again_stops_the_rig():
    rig, port = build()
    play(rig, port, 0.3)
    device = port.bus.devices[4]
    device.bank.drive.advance = lambda seconds: None  # the motor is cut off; the electronics go on
    with pytest.raises(RigError, match=r"MX-64 \(id 5\) does not follow its target, although it was set up anew"):
        play(rig, port, 6.0, target=0.8)


def test_a_servo_that_keeps_restarting_stops_the_rig():
    rig, port = build()

    def restart_every_so_often():
        for _ in range(12):
            play(rig, port, 0.4)
            port.bus[4].reboot(port.now() + BOOT_TIME)

    with pytest.raises(RigError, match=r"XC330-T288 \(id 4\) keeps restarting"):
        restart_every_so_often()


def test_heat_is_a_reason_to_stop_even_where_the_servo_does_not_shut_down():
    """The shutdown mask of a used servo may lack it."""
    rig, port = build()
    play(rig, port, 0.2)
    port.bus[1]["shutdown"] = 0
    port.bus.devices[0].bank.drive.temperature[0] = 83.0
    with pytest.raises(RigError, match=r"XM430-W350 \(id 1\) is too hot: 83 degC"):
        play(rig, port, 1.0)


@pytest.mark.thorough
def test_going_on_survives_the_next_hiccup_a_restart_and_a_second_loss():
    rig, port = build(on_loss="go on")
    play(rig, port, 0.3)
    port.bus[2].dead = True
    play(rig, port, 2.5, target=0.1)
    assert rig.health.lost.tolist() == [False, True, False, False, False, False]
    port.elapse(0.5)  # the loop stalls
    play(rig, port, 1.5, target=0.2)
    assert rig.recoveries == 1
    port.bus[3].reboot(port.now() + BOOT_TIME)
    play(rig, port, 1.5, target=0.3)
    assert rig.recoveries == 2
    port.bus[5].fail(32)
    play(rig, port, 2.0, target=0.4)
    assert rig.health.lost.tolist() == [False, True, False, False, True, False]
    assert rig.positions[[0, 2, 3, 5]] == pytest.approx(np.full(4, 0.4), abs=0.02)


@pytest.mark.thorough
def test_a_lost_servo_that_answers_again_is_set_up_again():
    rig, port = build(on_loss="go on")
    play(rig, port, 0.3)
    port.bus[2].dead = True
    play(rig, port, 2.5)
    port.bus[2].dead = False
    play(rig, port, 4.0, target=0.3)
    assert not rig.health.lost.any()
    assert rig.positions == pytest.approx(np.full(6, 0.3), abs=0.02)


def test_a_rig_that_has_lost_every_joint_stops():
    rig, port = build(on_loss="go on")
    play(rig, port, 0.3)
    for device in port.bus.devices:
        device.fail(32)
    with pytest.raises(RigError, match="has shut down: overload"):
        play(rig, port, 2.0)


@pytest.mark.thorough
def test_a_servo_that_keeps_restarting_is_given_up_and_not_set_up_again():
    rig, port = build(on_loss="go on")
    for _ in range(10):
        play(rig, port, 0.4)
        port.bus[4].reboot(port.now() + BOOT_TIME)
    play(rig, port, 1.0, target=0.2)
    assert rig.health.lost.tolist() == [False, False, False, True, False, False]
    assert rig.recoveries == 5
    assert rig.positions[[0, 1, 2, 4, 5]] == pytest.approx(np.full(5, 0.2), abs=0.02)
