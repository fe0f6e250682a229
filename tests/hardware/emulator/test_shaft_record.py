"""The record of the emulated shafts: a header, and a row of angles for each call."""

import json
import time

import numpy as np
import pytest

from hardware.emulator.bus import EmulatedBus
from hardware.emulator.pty_server import ShaftRecord
from hardware.errors import RigError


def test_each_row_has_both_times_and_the_angle_of_every_joint(rig_of_four, tmp_path):
    bus = EmulatedBus(rig_of_four)
    record = ShaftRecord(tmp_path / "shafts", rig_of_four)
    before = time.monotonic()
    for device, joint in zip(bus.devices, rig_of_four.joints, strict=True):
        device.bank.shaft[device.row] = joint.pulses(0.1 * joint.id)
    record([bus])
    bus.advance(0.5)
    record([bus])
    head, _, rows = (tmp_path / "shafts").read_bytes().partition(b"\n")
    assert json.loads(head) == {"joints": list(rig_of_four.names)}
    clock, own, *angles = np.frombuffer(rows).reshape(2, -1).T
    assert before <= clock[0] <= clock[1] <= time.monotonic()
    assert own.tolist() == [0.0, 0.5]
    assert np.allclose(np.array(angles)[:, 0], [0.1 * joint.id for joint in rig_of_four.joints])


def test_a_file_that_cannot_be_written_is_said(rig_of_four, tmp_path):
    with pytest.raises(RigError, match="cannot write the record"):
        ShaftRecord(tmp_path / "none" / "shafts", rig_of_four)
