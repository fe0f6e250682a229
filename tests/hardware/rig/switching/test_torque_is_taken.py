"""A servo that does not take torque on is named, and none keeps it."""

import pytest

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.torque import switch_on


@pytest.fixture
def stubborn(servos, monkeypatch):
    """The third servo, which answers everything and never takes torque on."""
    address, write = servos[3].bank.public["torque_enable"].address, servos[3].write

    def swallow(start, data, *rest):
        return 0 if (start, bytes(data)) == (address, b"\1") else write(start, data, *rest)

    monkeypatch.setattr(servos[3], "write", swallow)


def test_a_servo_that_takes_no_torque_is_named(stubborn, rig_of_four, bus):
    with pytest.raises(RigError, match=r"^joint_3 \(id 3\) did not take torque on\. Try again\.$"):
        switch_on(rig_of_four, bus, None)


def test_a_rig_of_which_one_servo_takes_no_torque_is_off(stubborn, rig_of_four, port, servos):
    with pytest.raises(RigError, match="did not take torque on"):
        Rig(rig_of_four, lambda part: Bus(port, part.baud), sleep=port.elapse)
    assert [device["torque_enable"] for device in servos.devices] == [0] * 4
