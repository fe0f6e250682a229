"""Looking at the registers of a rig that plays, and at who is on its port; in simulated time."""

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import FaultPlan, parse_fault
from hardware.errors import RigError
from hardware.families.models import MODELS
from hardware.families.table import meaning
from hardware.rig.driving.register_reading import shown_registers
from hardware.rig.rig_file import RigJoint
from hardware.rig.supervision.rig import Rig

TICK = 0.01


@pytest.fixture
def rig_on_port(rig_of_four):
    """A rig of some servos of a bus, which has others too, and the port."""

    def make(*faults, count=4, joints=None, on_loss=rig_of_four.on_loss):
        config = msgspec.structs.replace(rig_of_four, joints=joints or rig_of_four.joints, on_loss=on_loss)
        port = EmulatedPort(EmulatedBus(config), paced=True, faults=FaultPlan([parse_fault(fault) for fault in faults]))
        own = msgspec.structs.replace(config, joints=config.joints[:count])
        rig = Rig(own, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)
        return rig, port

    return make


def play(rig, port, target, until, seconds=2.0):
    """Plays until something is so; how often nothing could be sent."""
    for _ in range(round(seconds / TICK)):
        rig.collect_state()
        rig.write(np.full(len(rig.names), target))
        port.elapse(TICK)
        if until():
            return
    raise AssertionError("waited in vain")


@pytest.mark.parametrize("model", ["XM430-W350", "XL-320", "MX-28(1.0)", "PH54-200-S500"])
def test_all_registers_are_read_while_every_goal_goes_out(rig_on_port, model):
    turn = MODELS[model].pulses_per_turn
    zero = 0 if model.startswith("P") else turn // 2
    limits = {"lower": -1.0, "upper": 1.0, "velocity": 2.0}
    joints = tuple(RigJoint(f"j{id}", id, model, 1, zero, **limits) for id in (1, 2))
    rig, port = rig_on_port(count=2, joints=joints)
    for tick in range(100):
        rig.collect_state()
        rig.write(np.full(2, 0.002 * tick))
        port.elapse(TICK)
    look = rig.registers(1)
    play(rig, port, 0.2, lambda: look.done)
    assert look.failure == ""
    held, table = port.bus[2], MODELS[model]
    still = {row.name for row in shown_registers(table)} - {"realtime_tick", "registered_instruction"}
    moving = {name for name in still if name.startswith(("present_", "velocity_traj", "position_traj", "moving"))}
    assert set(look.counts) >= still
    assert {name: look.counts[name] for name in still - moving} == {name: held[name] for name in still - moving}
    assert (rig.faults.total, rig.recoveries, rig.faults.unsent.sum()) == (0, 0, 0)
    play(rig, port, 0.2, lambda: np.abs(rig.positions - 0.2).max() < 0.02)


def test_a_register_is_written_only_without_torque_and_only_a_harmless_one(rig_on_port):
    rig, port = rig_on_port()
    play(rig, port, 0.1, lambda: rig.positions[0] > 0.05)
    with pytest.raises(RigError, match="switch it off first"):
        rig.registers(1, ("led", 1))
    rig.switch_off(1)
    play(rig, port, 0.1, lambda: not rig.states.torque[1])
    for name in ("velocity_limit", "id", "shutdown", "homing_offset", "goal_position", "torque_enable", "nonsense"):
        with pytest.raises(RigError, match="is not written here"):
            rig.registers(1, (name, 1))
    with pytest.raises(RigError, match="takes 0 to"):
        rig.registers(1, ("moving_threshold", 5000))
    look = rig.registers(1, ("moving_threshold", 25))
    play(rig, port, 0.1, lambda: look.done)
    assert (look.failure, look.counts["moving_threshold"], port.bus[2]["moving_threshold"]) == ("", 25, 25)
    rig.set_up_again(1)
    play(rig, port, 0.1, lambda: rig.states.torque[1])
    assert port.bus[2]["moving_threshold"] == 25


def test_a_joint_that_is_being_switched_off_is_written_only_when_its_torque_is_gone(rig_on_port):
    rig, port = rig_on_port()
    play(rig, port, 0.1, lambda: rig.positions[0] > 0.05)
    rig.switch_off(1)
    assert rig.states.torque[1]
    with pytest.raises(RigError, match="switch it off first"):
        rig.registers(1, ("led", 1))
    play(rig, port, 0.1, lambda: not rig.states.torque[1])
    rig.registers(1, ("led", 1))


def test_a_joint_that_lost_its_torque_by_itself_is_not_written(rig_on_port):
    rig, port = rig_on_port("alert:id=2,at=0.3,value=32", on_loss="go on")
    play(rig, port, 1.0, lambda: not rig.states.torque[1], seconds=5.0)
    with pytest.raises(RigError, match="switch it off first"):
        rig.registers(1, ("led", 1))


def test_no_more_than_eight_servos_wait_to_be_read(rig_on_port):
    rig, port = rig_on_port()
    play(rig, port, 0.1, lambda: rig.positions[0] > 0.05)
    looks = [rig.registers(joint % 4) for joint in range(8)]
    with pytest.raises(RigError, match="being read already"):
        rig.registers(0)
    play(rig, port, 0.1, lambda: all(look.done for look in looks), seconds=5.0)
    assert not rig.registers(0).done


def test_registers_of_a_servo_that_is_gone_are_not_waited_for(rig_on_port):
    rig, port = rig_on_port("dead:id=3,at=0.5")
    play(rig, port, 0.1, lambda: rig.faults.missed[2] > 3)
    with pytest.raises(RigError, match=r"joint_3 \(id 3\) does not answer"):
        rig.registers(2)


def test_a_scan_finds_strangers_and_the_rig_plays_on(rig_on_port):
    rig, port = rig_on_port(count=3)
    play(rig, port, 0.3, lambda: np.abs(rig.positions - 0.3).max() < 0.02)
    scan = rig.scan()
    assert scan.found is None
    with pytest.raises(RigError, match="busy"):
        rig.scan()
    play(rig, port, 0.3, lambda: scan.found is not None)
    assert [(name, who.id) for name, who in scan.found] == [*zip(rig.names, (1, 2, 3), strict=True), ("", 4)]
    assert scan.missing == []
    play(rig, port, 0.5, lambda: np.abs(rig.positions - 0.5).max() < 0.02)
    assert port.bus[1]["torque_enable"] == 1


def test_nobody_scans_while_a_servo_is_silent(rig_on_port):
    rig, port = rig_on_port("dead:id=3,at=0.5")
    play(rig, port, 0.1, lambda: rig.faults.missed[2] > 2)
    with pytest.raises(RigError, match="does not answer just now"):
        rig.scan()


@pytest.mark.parametrize(
    ("model", "register", "count", "words"),
    [
        ("XM430-W350", "velocity_limit", 200, "45.8 rpm"),
        ("XM430-W350", "present_position", 1024, "90.0 deg"),
        ("XM430-W350", "baud_rate", 3, "1000000 baud"),
        ("XM430-W350", "shutdown", 52, "at overheated, electrical shock, overload"),
        ("XL-320", "shutdown", 3, "at overheated, overload"),
        ("XM430-W350", "operating_mode", 3, "position"),
        ("XM430-W350", "led", 0, "off"),
        ("XM430-W350", "position_p_gain", 800, ""),
    ],
)
def test_a_count_has_a_meaning(model, register, count, words):
    table = MODELS[model]
    assert meaning(table, table[register], count) == words
