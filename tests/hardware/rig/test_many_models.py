"""A rig of eighteen models from the box: it plays, and nothing is written that its rig file does not ask for."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.families.models import MODELS
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig

NAMES = ("XM430-W350", "XM540-W270", "XH430-V350", "XH540-W150", "XD430-T210", "XW430-T200", "XW540-T260", "XL430-W250",
         "2XL430-W250", "XC430-W150", "XL330-M077", "XC330-M288", "XM335-T323", "MX-28", "MX-106", "AX-12A", "XL-320",
         "PH54-200-S500")  # fmt: skip
# What the rig file states, what no servo moves without, and the cells by which its state is read at once.
ASKED_FOR = {"min_position_limit", "max_position_limit", "profile_velocity", "profile_acceleration", "bus_watchdog",
             "goal_position", "torque_enable"}  # fmt: skip
RATE = 50.0


def joint_of(model, id, **settings):
    table = MODELS[model]
    zero = sum(table.one_turn) // 2
    if "profile_acceleration" in table.registers:
        settings["acceleration"] = 15.0
    return RigJoint(f"joint_{id}", id, model, 1 - 2 * (id % 2), zero, -1.0, 1.0, 2.0, **settings)


class Bench:
    """The servos on one emulated port at 1 Mbps."""

    def __init__(self, *joints):
        self.config = RigConfig("emulated", 1_000_000, RATE, joints)
        self.port = EmulatedPort(EmulatedBus(self.config), True)
        self.servos = self.port.bus.devices

    def play(self, seconds):
        """Plays a sine; returns the rig, the targets and the angles of the last tick, rad."""
        rig = Rig(self.config, lambda part: Bus(self.port, part.baud), False, sleep=self.port.elapse)
        targets = np.zeros(len(self.servos))
        for tick in range(round(seconds * RATE)):
            rig.collect_state()
            targets[:] = 0.4 * np.sin(tick / RATE)
            rig.write(targets)
            self.port.elapse(1.0 / RATE)
        joints = self.config.joints
        shafts = [servo.bank.shaft[servo.row] for servo in self.servos]
        return rig, targets, np.array([joint.angle(shaft) for joint, shaft in zip(joints, shafts, strict=True)])

    def memories(self):
        """All bytes of each servo, but for what it measures and what it was asked for."""
        held = []
        for servo in self.servos:
            size = servo.bank.table.size
            memory = bytearray(servo.bank.memory[servo.row * size : (servo.row + 1) * size])
            for register in servo.bank.table.registers.values():
                if register.access == "R" or register.name in ASKED_FOR or register.name.startswith("indirect_"):
                    memory[register.address : register.address + register.length] = bytes(register.length)
            held.append(bytes(memory))
        return held


@pytest.fixture(scope="module")
def played():
    bench = Bench(*(joint_of(model, id) for id, model in enumerate(NAMES, 1)))
    before = bench.memories()
    return bench, before, bench.play(3.0)


def test_every_joint_follows(played):
    bench, _, (rig, targets, angles) = played
    assert angles == pytest.approx(targets, abs=0.06)
    assert (rig.recoveries, list(rig.incidents)) == (0, [])
    assert all(servo.torque for servo in bench.servos)


@pytest.mark.parametrize("index", range(len(NAMES)), ids=NAMES)
def test_the_whole_memory_of_a_servo_is_as_the_maker_delivered_it(played, index):
    bench, before, _ = played
    now = bench.memories()[index]
    changed = [place for place, (old, new) in enumerate(zip(before[index], now, strict=True)) if old != new]
    registers = bench.servos[index].bank.table.registers.values()
    names = {row.name for row in registers for place in changed if row.address <= place < row.address + row.length}
    assert (names, changed) == (set(), [])


def test_what_the_rig_file_asks_for_is_all_that_is_written_besides():
    bench = Bench(joint_of("XM430-W350", 1, current=0.6, position_p_gain=500), joint_of("XL330-M077", 2))
    before = bench.memories()
    bench.play(1.0)
    changed = [old != new for old, new in zip(before, bench.memories(), strict=True)]
    assert changed == [True, False]
    asked, other = bench.servos
    names = ("operating_mode", "current_limit", "goal_current", "position_p_gain", "position_i_gain")
    assert [asked[name] for name in names] == [5, 223, 223, 500, 0]
    assert [other[name] for name in ("operating_mode", "position_p_gain", "position_i_gain")] == [3, 400, 400]
