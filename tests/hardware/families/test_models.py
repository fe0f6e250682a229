"""The control tables of all models, from the maker's files and what they lack."""

import msgspec
import pytest

from hardware.families.dynamixel2.sdk_models import model_file, model_numbers
from hardware.families.models import MODELS, TRAITS, model_name
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.state_block import arranged
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.words import near_names


def test_every_model_that_the_maker_numbers_has_a_table():
    assert set(model_numbers()) <= set(MODELS)
    assert len(MODELS) >= 61
    assert model_name(1280) == "XW430-T200"
    for model in MODELS:
        end = 0
        for register in MODELS[model].registers.values():
            assert register.address >= end, (model, register.name)
            assert register.length in (1, 2, 4)
            if register.default is not None:
                assert register.minimum <= register.default <= register.maximum, (model, register.name)
            end = register.address + register.length


@pytest.mark.parametrize(
    ("model", "name", "address", "length", "signed"),
    [
        ("XL430-W250", "present_load", 126, 2, True),
        ("XL430-W250", "goal_position", 116, 4, True),
        ("XM540-W270", "external_port_mode_1", 56, 1, False),
        ("PH54-200-S500", "torque_enable", 512, 1, False),
        ("PH54-200-S500", "present_position", 580, 4, True),
        ("PH54-200-S500", "min_position_limit", 52, 4, True),
        ("MX-106", "bus_watchdog", 98, 1, True),
        ("XL-320", "goal_position", 30, 2, False),
        ("RH-P12-RN", "present_velocity", 576, 4, True),
    ],
)
def test_a_register_is_where_the_manual_has_it(model, name, address, length, signed):
    register = MODELS[model][name]
    assert (register.address, register.length, register.signed) == (address, length, signed)


def test_units_and_turns_are_the_models_own():
    assert MODELS["XM540-W270"]["present_velocity"].scale == 0.229
    assert MODELS["PH54-200-S500"]["present_velocity"].scale == 0.01
    assert MODELS["XL330-M288"]["present_current"].scale == 1.0
    assert MODELS["PH54-200-S500"].pulses_per_turn == pytest.approx(1_003_846, abs=2)
    assert MODELS["PH54-200-S500"].one_turn[0] < 0 < MODELS["PH54-200-S500"].one_turn[1]
    assert MODELS["XL430-W250"].one_turn == (0, 4095)


def test_a_measurement_takes_no_write():
    for model in TRAITS:
        assert {MODELS[model][name].access for name in ("present_position", "moving", "present_temperature")} == {"R"}
        assert MODELS[model]["torque_enable"].access == "RW"
        assert MODELS[model]["max_position_limit"].memory == "EEPROM"


def test_models_are_known_by_number():
    assert model_name(1060) == "XL430-W250"
    assert model_name(9) == "model number 9"
    assert [model_name(number) for number in (1700, 622, 6025)] == ["XM335-T332", "FFW-SG2-STEER-3", "HX5-D20 part 25"]
    assert "XM430-W350" in near_names("xm430w350", MODELS)


@pytest.mark.parametrize(
    "text", ["", "[type info]\nname\tvalue\n", "[control table]\nAddress\tSize\tData Name\n0\tx\tID\n"]
)
def test_a_model_file_of_another_form_is_refused(tmp_path, text):
    (tmp_path / "xl430_w250.model").write_text(text)
    with pytest.raises(MotiondeckError, match="not of the form"):
        model_file("XL430-W250", tmp_path)
    with pytest.raises(MotiondeckError, match="cannot be read"):
        model_numbers(tmp_path)


def joint(number, model, **settings):
    return RigJoint(f"joint_{number}", number, model, 1, 2048, -1.0, 1.0, 4.0, **settings)


def test_models_with_the_same_places_may_share_a_rig():
    config = RigConfig("port", 1_000_000, 100.0, (joint(1, "XM430-W350"), joint(2, "XL430-W250")))
    plans = [arranged(each.table, 46) for each in config.joints]
    assert [(plan.block.address, plan.block.length, len(plan.pointers)) for plan in plans] == [(224, 15, 30)] * 2


def test_models_with_other_places_and_another_protocol_may_too():
    arm = RigJoint("arm", 2, "PH54-200-S500", 1, 0, -1.0, 1.0, 1.0)
    leg = RigJoint("leg", 3, "AX-12A", 1, 512, -1.0, 1.0, 1.0)
    config = RigConfig("port", 1_000_000, 100.0, (joint(1, "XM430-W350"), arm, leg))
    assert [id for id, family in config.families.items() if family.spoken] == [3]


@pytest.mark.parametrize(("model", "baud"), [("AX-12A", 4_000_000), ("AX-12A", 3_000_000), ("XL-320", 2_000_000)])
def test_a_baud_rate_that_a_model_cannot_do_is_refused(model, baud):
    leg = RigJoint("leg", 3, model, 1, 512, -1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match=rf"joint 2 \(leg\): model '{model}' cannot do {baud} baud"):
        RigConfig("port", baud, 100.0, (joint(1, "XM430-W350"), leg))


@pytest.mark.parametrize(
    ("model", "number", "baud", "ends"),
    [("AX-12A", 12, 1, (0, 1023)), ("MX-64(1.0)", 310, 34, (0, 4095)), ("XL-320", 350, 3, (0, 1023))],
)
def test_ax_mx_and_xl_320_are_as_in_their_manuals(model, number, baud, ends):
    table = MODELS[model]
    assert (table.number, table["baud_rate"].default, table.one_turn) == (number, baud, ends)
    assert model_name(number, table.family) == model
    speed = table["present_velocity"]
    assert [speed.decode(count.to_bytes(2, "little")) for count in (0, 300, 1024, 1324)] == [0, 300, 0, -300]


def test_their_counts_are_the_degrees_of_its_manual():
    assert 1023 / MODELS["AX-12A"].pulses_per_turn * 360.0 == pytest.approx(300.0, abs=0.2)
    assert MODELS["MX-28(1.0)"].pulses_per_turn == 4096


def test_the_bits_of_an_xl_320_mean_what_they_mean_elsewhere():
    """In its manual: 1 overload, 2 heat, 4 voltage."""
    series = MODELS["XL-320"].series
    assert [series.usual_problems(bits) for bits in (1, 2, 4, 7)] == [32, 4, 1, 37]
    assert series.own_problems(4 | 32) == 3
    assert MODELS["AX-12A"].series.usual_problems(36) == 36


def test_cells_that_move_with_the_firmware_are_found_where_they_are():
    """The maker's tables for firmware 52 of the XL330 and XC330 have indirect data 1 at 208."""
    assert [arranged(MODELS["XL330-M288"], firmware).block.address for firmware in (51, 52)] == [224, 208]
    assert arranged(MODELS["XM430-W350"], 52).block.address == 224


def test_every_model_that_can_be_a_joint_has_its_health_in_one_block():
    for model, table in MODELS.items():
        if "hardware_error_status" in table.registers and "indirect_data_1" in table.registers:
            plan = arranged(table, 46)
            assert plan is not None, model
            assert plan.block.healthy


@pytest.mark.parametrize(
    ("model", "settings", "said"),
    [
        ("AX-12A", {"acceleration": 5.0}, "has no limit of acceleration"),
        ("YM070-210-M001", {}, "cannot be a joint of a rig"),
        ("XM335-T332", {}, "cannot be a joint of a rig: of it the maker has published where its registers are"),
        ("XL430-W250", {"current": 1.0}, "measures no current"),
        ("XM430-W350", {"gear": float("inf")}, "finite"),
        ("MX-64(1.0)", {"gear": 3.5}, "outside the servo's one turn"),
    ],
)
def test_a_joint_that_cannot_be_is_refused(model, settings, said):
    with pytest.raises(ValueError, match=said):
        joint(1, model, **settings)


def test_a_gear_turns_the_servo_further_than_the_joint():
    assert joint(1, "XM430-W350", gear=2.0).pulses(0.5) == pytest.approx(2048 + 2 * 0.5 * 4096 / 6.283185, abs=0.01)
    assert msgspec.structs.replace(joint(1, "XM430-W350"), direction=-1).pulses(0.5) < 2048
