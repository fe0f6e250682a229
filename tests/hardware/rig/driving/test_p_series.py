"""The P series (e-Manual, PH54-200-S500-R and its sisters): tables, emulated servos, and a rig of them."""

import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError, ServoError
from hardware.families.dynamixel2.facts import P_SERIES
from hardware.families.dynamixel2.sdk_models import model_file, model_numbers
from hardware.families.models import MODELS
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.rig.switching.audit import in_counts
from hardware.tools.doctor import fix_settings

LIMIT, DATA_RANGE = 6, 4


def rig_of(*models, acceleration=0.0):
    joints = tuple(
        RigJoint(f"joint_{id}", id, model, 1, (sum(MODELS[model].one_turn) + 1) // 2, -1.5, 1.5, 2.0, acceleration)
        for id, model in enumerate(models, 1)
    )
    return RigConfig("emulated", 1_000_000, 100.0, joints)


def emulated(config):
    port = EmulatedPort(EmulatedBus(config), paced=True)
    return port, lambda: Bus(port, config.baud)


@pytest.fixture
def servo():
    """A PH54-200-S500 in its fresh state: what it answers when a register is written."""
    port, open_bus = emulated(rig_of("PH54-200-S500"))
    table, bus = P_SERIES["PH54-200-S500"], open_bus()

    def put(name, value):
        register = table[name]
        data = value.to_bytes(register.length, "little", signed=register.signed)
        try:
            bus.write(1, register.address, data)
        except ServoError as error:
            return int(str(error).partition("error ")[2].partition(",")[0])
        port.elapse(0.01)
        return 0

    return put, port.bus[1]


@pytest.mark.parametrize("model", P_SERIES)
def test_registers_are_where_the_makers_file_has_them(model):
    table, file = MODELS[model], model_file(model)
    assert table.number == model_numbers()[model]
    assert table.pulses_per_turn == pytest.approx(file.pulses_per_turn, abs=2)
    rows = {row.name: (row.address, row.length) for row in file.rows if not row.name.endswith(("_write", "_read"))}
    assert rows == {name: (table[name].address, table[name].length) for name in rows}


@pytest.mark.parametrize("model", ["H54-200-S500-RA", "H54-100-S500-RA", "H42-20-S300-RA", "M42-10-S260-RA"])
def test_pro_a_models_count_as_their_pages_say(model):
    table = MODELS[model]
    joint = RigJoint("joint_1", 1, model, 1, 0, -1.5, 1.5, 2.0, 1.0, 0.5)
    assert in_counts(joint, "current_limit", joint.current) == 500  # mA
    assert in_counts(joint, "profile_acceleration", joint.acceleration) == 573  # rev/min^2
    assert in_counts(joint, "profile_velocity", joint.velocity) == 1910  # 0.01 rev/min
    assert table.registers.keys().isdisjoint({"protocol_type", "startup_configuration", "backup_ready"})


def test_a_profile_beyond_a_limit_is_refused(servo):
    put, device = servo
    put("velocity_limit", 1000)
    assert put("profile_velocity", 1001) == LIMIT
    assert put("profile_velocity", 1000) == 0
    device["acceleration_limit"] = 5000
    assert put("profile_acceleration", 5001) == LIMIT


def test_there_is_no_current_based_position_mode(servo):
    put, _ = servo
    assert [put("operating_mode", mode) for mode in (0, 1, 4, 5, 16)] == [0, 0, 0, DATA_RANGE, 0]


def test_one_turn_reaches_from_minus_half_to_half(servo):
    put, device = servo
    device.bank.shaft[device.row] = -300_000 - 1_003_846
    assert put("torque_enable", 1) == 0
    assert device["present_position"] == pytest.approx(-300_000, abs=5_000)  # and on its way to its old goal


@pytest.mark.parametrize(("offset", "shown"), [(200_000, 200_000), (300_000, 0)])
def test_position_mode_ignores_an_offset_of_more_than_a_quarter_turn(servo, offset, shown):
    put, device = servo
    assert put("homing_offset", offset) == 0
    assert device["present_position"] == pytest.approx(shown, abs=2)


def test_one_as_it_comes_is_refused_until_it_protects_itself_from_heat():
    config = rig_of("PM54-060-S250")
    port, open_bus = emulated(config)
    with pytest.raises(RigError, match="shutdown is 58, the rig needs 62"):
        Rig(config, lambda part: open_bus(), beside=False, sleep=port.elapse)
    fix_settings(config, open_bus())
    assert Rig(config, lambda part: open_bus(), beside=False, sleep=port.elapse).close() == []


def test_a_rig_of_pro_a_moves_as_they_come():
    config = rig_of("H54-200-S500-RA", "H54-100-S500-RA", "H42-20-S300-RA", "M54-60-S250-RA", "M54-40-S250-RA",
                    "M42-10-S260-RA", "AX-12A", acceleration=0.0)  # fmt: skip
    port, open_bus = emulated(config)
    rig = Rig(config, lambda part: open_bus(), beside=False, sleep=port.elapse)
    for _ in range(200):
        rig.collect_state()
        rig.write(np.full(7, 1.2))
        port.elapse(0.01)
    assert rig.positions == pytest.approx(np.full(7, 1.2), abs=0.02)
    assert rig.close() == []


def test_one_that_would_refuse_the_rigs_profile_is_refused_by_name():
    config = rig_of("PH54-200-S500", acceleration=10.0)
    port, open_bus = emulated(config)
    port.bus[1]["acceleration_limit"] = 5000
    with pytest.raises(RigError, match="acceleration_limit is 5000, the rig needs 5730"):
        Rig(config, lambda part: open_bus(), beside=False, sleep=port.elapse)


def test_a_mixed_rig_drives_them_and_none_is_too_fast():
    config = rig_of("PH54-200-S500", "XM430-W350", "PH54-200-S500", acceleration=10.0)
    port, open_bus = emulated(config)
    rig = Rig(config, lambda part: open_bus(), beside=False, sleep=port.elapse)
    fastest = np.zeros(3)
    for target in (-1.4, 1.4):
        for _ in range(200):
            rig.collect_state()
            rig.write(np.full(3, target))
            port.elapse(0.01)
            banks = [(device.bank, device.row) for device in port.bus.devices]
            speeds = [2.0 * np.pi * bank.drive.speed[row] / bank.table.pulses_per_turn for bank, row in banks]
            fastest = np.maximum(fastest, np.abs(speeds))
        assert rig.positions == pytest.approx(np.full(3, target), abs=0.02)
    assert (fastest > 1.9).all()
    assert (fastest < 1.1 * 2.0).all()
    assert rig.voltages == pytest.approx([24.0, 12.0, 24.0])
    assert rig.close() == []
