"""How an emulated servo moves, and when it stops."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RefusedError
from hardware.families.models import MODELS

XM430 = MODELS["XM430-W350"]
VELOCITY_UNIT = 0.229 / 60 * 4096  # pulses/s


def put(bus, name, value, id=1):
    register = XM430[name]
    bus.write(id, register.address, register.encode(value))


def journey(port, name, seconds, id=1):
    """A register's values, every 10 ms."""
    values = []
    for _ in range(round(seconds * 100)):
        port.elapse(0.01)
        values.append(port.bus[id][name])
    return np.array(values)


@pytest.fixture
def servo(port, bus):
    """Servo 1 with torque on, and its bus."""
    put(bus, "torque_enable", 1)
    return port.bus[1]


def test_a_servo_goes_to_its_goal_and_stays(port, bus, servo):
    put(bus, "goal_position", 3000)
    journey(port, "present_position", 1.5)
    assert abs(servo["present_position"] - 3000) <= 1
    assert servo["present_velocity"] == 0
    assert servo["moving"] == 0


def test_without_torque_nothing_moves(port, bus):
    put(bus, "goal_position", 3000)
    assert set(journey(port, "present_position", 0.5)) == {2048}


def test_with_a_stale_goal_torque_on_makes_it_lunge(port, bus):
    put(bus, "goal_position", 3000)
    put(bus, "torque_enable", 1)
    assert journey(port, "present_position", 1.0)[-1] > 2900


def test_it_is_never_faster_than_its_motor(port, bus, servo):
    put(bus, "goal_position", 4095)
    velocity = journey(port, "present_velocity", 1.0)
    assert 150 < velocity.max() <= 46 / 0.229 + 1


def test_profile_velocity_and_acceleration_are_kept(port, bus, servo):
    put(bus, "profile_acceleration", 4)  # 4 * 214.577 rev/min^2 = 977 pulses/s^2
    put(bus, "profile_velocity", 50)
    put(bus, "goal_position", 3000)
    velocity = journey(port, "velocity_trajectory", 4.0)
    position = journey(port, "position_trajectory", 0.01)
    assert velocity.max() == 50
    assert np.abs(np.diff(velocity)).max() <= 977 * 0.01 / VELOCITY_UNIT + 1
    # Up, cruise and down: the trapezoid's own time, 952 / v + v / a with v = 782 pulses/s.
    assert np.count_nonzero(velocity) * 0.01 == pytest.approx(952 / 781.7 + 781.7 / 976.6, abs=0.1)
    assert position[-1] == 3000


def test_a_profile_never_leads_past_the_goal(port, bus, servo):
    put(bus, "profile_acceleration", 20)
    put(bus, "profile_velocity", 100)
    put(bus, "goal_position", 2500)
    assert journey(port, "position_trajectory", 3.0).max() <= 2501


def test_homing_offset_and_reverse_mode_shift_and_turn_what_is_seen(port, bus):
    put(bus, "homing_offset", 100)
    port.elapse(0.01)
    assert port.bus[1]["present_position"] == 2148
    put(bus, "homing_offset", 0)
    put(bus, "drive_mode", 1)
    port.elapse(0.01)
    assert port.bus[1]["present_position"] == -2048


def test_silence_trips_the_watchdog_and_the_servo_stops(port, bus, servo):
    put(bus, "profile_velocity", 50)
    put(bus, "goal_position", 4000)
    put(bus, "bus_watchdog", 10)  # 200 ms
    way = journey(port, "present_position", 1.0)
    assert servo["bus_watchdog"] == -1
    assert (servo["profile_velocity"], servo["torque_enable"]) == (0, 1)
    assert way[15] > way[10] > 2048
    assert np.ptp(way[25:]) <= 2
    assert np.ptp(way[50:]) == 0
    assert way[-1] < 2048 + 781.7 * 0.3


def test_any_word_on_the_bus_feeds_the_watchdog(port, bus, servo):
    put(bus, "bus_watchdog", 10)
    for _ in range(20):
        port.elapse(0.15)
        bus.ping(2)
    assert servo["bus_watchdog"] == 10


def test_the_watchdog_counts_only_with_torque_on(port, bus):
    put(bus, "bus_watchdog", 10)
    port.elapse(5.0)
    assert port.bus[1]["bus_watchdog"] == 10


def test_a_tripped_servo_takes_no_goal_until_the_watchdog_is_cleared(port, bus, servo):
    put(bus, "bus_watchdog", 1)
    port.elapse(0.1)
    for name in ("goal_position", "goal_velocity", "goal_current", "goal_pwm", "bus_watchdog"):
        with pytest.raises(RefusedError, match="error 4"):
            put(bus, name, 10)
    put(bus, "bus_watchdog", 0)
    port.elapse(1.0)
    assert servo["present_position"] == 2048
    put(bus, "goal_position", 2500)
    assert journey(port, "present_position", 1.0)[-1] == pytest.approx(2500, abs=1)


def test_torque_on_in_position_mode_forgets_whole_turns(port, bus):
    port.bus[1].bank.shaft[0] = 4096 * 3 + 1000.0
    port.elapse(0.01)
    assert port.bus[1]["present_position"] == 4096 * 3 + 1000
    put(bus, "goal_position", 1000)
    put(bus, "torque_enable", 1)
    port.elapse(0.5)
    assert port.bus[1]["present_position"] == 1000


def test_the_same_words_at_the_same_times_give_the_same_motion(rig_of_four):
    ways = []
    for _ in range(2):
        port = EmulatedPort(EmulatedBus(rig_of_four))
        bus = Bus(port, 1_000_000)
        put(bus, "torque_enable", 1)
        put(bus, "goal_position", 3210)
        ways.append(journey(port, "present_position", 0.5).tolist())
    assert ways[0] == ways[1]


def test_an_integral_gain_asks_for_no_more_than_full_voltage(port, bus, servo):
    """Held up for long, and free again, the horn is not driven beyond its goal for as long as it was held up."""
    put(bus, "position_i_gain", 400)
    put(bus, "goal_pwm", 400)  # so that it does not report an overload
    servo.bank.drive.jammed[0] = True
    put(bus, "goal_position", 2148)
    journey(port, "present_position", 20.0)
    servo.bank.drive.jammed[0] = False
    assert journey(port, "present_position", 1.0).max() < 2400
