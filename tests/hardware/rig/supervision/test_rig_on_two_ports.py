"""A rig on two ports: who is where, targets and measurements in their places, and one part's end is the end of all."""

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.emulator.faults import Fault, FaultPlan
from hardware.errors import RigError, SerialPortError
from hardware.rig.supervision.recovery import PortRecovery
from hardware.rig.supervision.rig import Rig


@pytest.fixture
def config(rig_of_four):
    """joint_1 and joint_3 on a port of their own, with the ids of the other two."""
    joints = [
        msgspec.structs.replace(joint, id=1 + index // 2, port="second" if index % 2 == 0 else "")
        for index, joint in enumerate(rig_of_four.joints)
    ]
    return msgspec.structs.replace(rig_of_four, joints=tuple(joints))


class Bench:
    """The parts of a rig on emulated ports in simulated time."""

    def __init__(self, config, faults=()):
        plans = [FaultPlan(faults), FaultPlan()]
        self.ports = [
            EmulatedPort(EmulatedBus(part), paced=True, faults=plan)
            for part, plan in zip(config.parts, plans, strict=True)
        ]
        ports = dict(zip(config.ports, self.ports, strict=True))
        self.rig = Rig(config, lambda part: Bus(ports[part.port], part.baud), beside=False, sleep=self.elapse)

    def elapse(self, seconds):
        for port in self.ports:
            port.elapse(seconds)

    def tick(self, targets):
        self.rig.collect_state()
        self.rig.write(targets)
        self.elapse(0.01)

    def play(self, ticks):
        for tick in range(ticks):
            self.tick(np.full(4, 0.3 * np.sin(0.05 * tick)))


def test_the_parts_of_a_rig_are_those_of_its_ports(config):
    assert config.ports == ("second", "emulated")
    assert [part.names for part in config.parts] == [("joint_1", "joint_3"), ("joint_2", "joint_4")]
    assert [part.port for part in config.on_ports(("a", "b"))] == ["a", "b"]
    with pytest.raises(RigError, match=r"has 2 ports \(second, emulated\), 1 were given"):
        config.on_ports(("a",))
    with pytest.raises(ValueError, match="id 1 is used more than once: joint 1"):
        msgspec.structs.replace(config, joints=(config.joints[0], config.joints[2], config.joints[0]))


def test_each_target_and_each_measurement_has_its_place(config):
    bench = Bench(config)
    targets = np.array([0.1, -0.2, 0.3, -0.4])
    for _ in range(100):
        bench.tick(targets)
    assert bench.rig.positions == pytest.approx(targets, abs=0.02)
    assert bench.rig.velocities == pytest.approx(np.zeros(4), abs=0.1)
    assert bench.rig.temperatures == pytest.approx(np.full(4, 32.0))
    assert (bench.rig.currents.shape, bench.rig.recoveries, bench.rig.faults.total) == ((4,), 0, 0)
    bench.rig.write(np.array([0.0, 9.0, 0.0, 0.0]))
    assert bench.rig.faults.clipped.tolist() == [0, 1, 0, 0]
    assert bench.rig.close() == []
    assert not any(device["torque_enable"] for port in bench.ports for device in port.bus.devices)


def test_when_one_part_stops_the_whole_rig_stands_still(config):
    bench = Bench(config, [Fault("alert", id=2, at=0.5, value=32.0)])
    with pytest.raises(RigError, match="joint_3"):
        bench.play(300)
    sent = [len(port.sent) for port in bench.ports]
    bench.tick(np.ones(4))  # raises nothing more, and writes nothing
    assert [len(port.sent) for port in bench.ports] == sent
    bench.elapse(0.4)
    for device in bench.ports[1].bus.devices:
        assert device["bus_watchdog"] == -1
        assert device["present_velocity"] == 0
    bench.rig.close()


def test_a_port_that_raises_while_it_closes_keeps_no_other_one_on(config, monkeypatch):
    bench = Bench(config)

    def fail():
        raise RuntimeError("a bug")

    monkeypatch.setattr(bench.ports[0], "close", fail)
    assert bench.rig.close() == ["joint_1", "joint_3"]
    assert not any(device["torque_enable"] for device in bench.ports[1].bus.devices)


def test_a_second_port_that_fails_leaves_no_torque_on_the_first_or_says_so(config, monkeypatch):
    first = EmulatedPort(EmulatedBus(config.parts[0]))

    def open_bus(name, baud):
        if name == "second":
            return Bus(first, baud)
        first.bus[1].dead = True
        raise SerialPortError(f"cannot open the port {name}.")

    monkeypatch.setattr(Bus, "open", open_bus)
    with pytest.raises(SerialPortError, match=r"port emulated\. And torque may still be on: joint_1\. Switch"):
        Rig.connect(config)
    assert [device["torque_enable"] for device in first.bus.devices] == [1, 0]


def test_a_rig_that_cannot_be_switched_on_names_who_may_still_have_torque(rig_of_four):
    port = EmulatedPort(EmulatedBus(rig_of_four))
    port.bus[2].dead = True
    with pytest.raises(RigError, match=r"no answer .* joint_2 \(id 2\).* torque may still be on: joint_2\."):
        Rig(rig_of_four, lambda part: Bus(port, part.baud))


def test_ctrl_c_while_the_second_port_opens_leaves_no_torque_on_the_first(config, monkeypatch):
    first = EmulatedPort(EmulatedBus(config.parts[0]))

    def open_bus(name, baud):
        if name == "second":
            return Bus(first, baud)
        assert [device["torque_enable"] for device in first.bus.devices] == [1, 1]
        raise KeyboardInterrupt

    monkeypatch.setattr(Bus, "open", open_bus)
    with pytest.raises(KeyboardInterrupt):
        Rig.connect(config)
    assert [device["torque_enable"] for device in first.bus.devices] == [0, 0]


def test_a_loss_on_one_port_does_not_stop_a_rig_whose_other_joints_are_switched_off(config):
    bench = Bench(msgspec.structs.replace(config, on_loss="go on"), [Fault("alert", id=2, at=0.5, value=32.0)])
    bench.play(10)
    for joint in (1, 3):
        bench.rig.switch_off(joint)
    bench.play(200)
    assert bench.rig.health.lost.tolist() == [False, True, True, True]


def test_ctrl_c_while_the_end_waits_for_a_recovery_leaves_no_torque_on(config, monkeypatch):
    bench = Bench(config)

    def interrupted(recovery):
        raise KeyboardInterrupt

    monkeypatch.setattr(PortRecovery, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        bench.rig.close()
    assert not any(device["torque_enable"] for port in bench.ports for device in port.bus.devices)
