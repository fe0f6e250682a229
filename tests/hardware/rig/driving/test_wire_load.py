"""Rigs whose wire is too slow for their rate, judged by an emulated wire that counts who speaks into an answer."""

import re
from contextlib import closing

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.tools.doctor import fix_settings

RIGS = {
    "8 XM430": (57_600, ["XM430-W350"] * 8),
    "20 XM430": (1_000_000, ["XM430-W350"] * 20),
    "mixed": (57_600, ["XM430-W350", "XL-320", "MX-64"]),
    "read in place": (115_200, ["PH54-200-S500", "PM42-010-S260"]),
    "both protocols": (115_200, ["XM430-W350", "MX-28(1.0)", "MX-64(1.0)", "AX-12A"]),
}


def rig_file(name, rate):
    baud, models = RIGS[name]
    joints = tuple(
        RigJoint(f"joint_{id}", id, model, 1, 0 if model.startswith("P") else 512, -0.5, 0.5, velocity=1.0)
        for id, model in enumerate(models, 1)
    )
    return RigConfig("emulated", baud, rate, joints, watchdog_ms=2000)


def collisions(config, delay=250, seconds=1.5):
    """How often the rig speaks into an answer while it plays; the servos stand at 0 and wait 2 us a count."""
    servos = EmulatedBus(config)
    port = EmulatedPort(servos, paced=True)
    bus = Bus(port, config.baud)
    for joint in config.joints:
        device = servos[joint.id]
        device.bank.shaft[device.row] = joint.zero
    bus.families = config.families
    fix_settings(config, bus)
    for joint in config.joints:
        servos[joint.id]["return_delay_time"] = delay
    port.elapse(0.1)
    with closing(Rig(config, lambda part: bus)) as rig:
        before = port.wire.collisions
        for tick in range(round(seconds * config.rate_hz)):
            rig.collect_state()
            rig.write(np.full(len(config.joints), 0.2 * np.sin(2.0 * tick / config.rate_hz)))
            port.elapse(1.0 / config.rate_hz)
        return port.wire.collisions - before


def possible_rate(name, delay=250):
    with pytest.raises(RigError) as refused:
        collisions(rig_file(name, 1000.0), delay)
    return float(re.findall(r"ower rate_hz to (\d+)", str(refused.value))[0])


@pytest.mark.thorough
@pytest.mark.parametrize("name", RIGS)
def test_at_the_rate_that_a_refusal_names_no_goal_meets_an_answer(name):
    rate = possible_rate(name)
    assert collisions(rig_file(name, rate)) == 0
    with pytest.raises(RigError, match="the wire is too slow"):
        collisions(rig_file(name, rate + 1.0))


@pytest.mark.thorough
@pytest.mark.parametrize("name", RIGS)
def test_a_rig_that_is_refused_would_have_met_them(name, monkeypatch):
    rate = possible_rate(name)
    monkeypatch.setattr("hardware.rig.driving.servo_port.refuse_slow_wire", lambda *_: None)
    assert collisions(rig_file(name, 1.4 * rate)) > 0


def test_a_refusal_names_the_way_out():
    with pytest.raises(RigError) as refused:
        collisions(msgspec.structs.replace(rig_file("20 XM430", 200.0), baud=57_600), delay=0)
    assert str(refused.value) == (
        "the wire is too slow for rate_hz 200: goals and answers of 20 servos take 122.2 ms at 57600 baud, "
        "a tick is 5.0 ms. Lower rate_hz to 8, or raise baud."
    )
    with pytest.raises(RigError, match="doctor --fix shortens their return delay; or lower rate_hz to"):
        collisions(rig_file("mixed", 200.0))
