"""The facts about AX, RX, old MX, XL-320, P and PRO(A) servos against a second reading of the maker's pages.

As in `test_makers_facts` each register lists the models, "" for those that are not named; the pages were read without a
look at the product's tables. What a page leaves open ("-") is left out here, and so are measurements such as `moving`.
The pages of PH42, PM54-060 and PM54-040 were there in a version of before the newest registers of the P series alone,
and before some limits of it changed: drive mode of 0 and 1, acceleration limits of thousands.
"""

import pytest

from hardware.emulator.bus import EmulatedBus
from hardware.emulator.servos.servo_bank import ServoBank
from hardware.families.models import MODELS, TRAITS
from hardware.rig.rig_file import RigConfig, RigJoint

AX = "AX-12A AX-12W AX-18A "
RX = "RX-10 RX-24F RX-28 RX-64 "
MX = "MX-28(1.0) MX-64(1.0) MX-106(1.0) "
XL = "XL-320 "
P = "PH54-200-S500 PH54-100-S500 PH42-020-S300 PM54-060-S250 PM54-040-S250 PM42-010-S260 "
PRO = "H54-200-S500-RA H54-100-S500-RA H42-20-S300-RA M54-60-S250-RA M54-40-S250-RA M42-10-S260-RA "
OTHERS = (AX + RX + MX + XL + P + PRO).split()
BIG = "PH54-200-S500 PH54-100-S500 H54-200-S500-RA H54-100-S500-RA "  # 501 923 pulses to half a turn
MID = "PM54-060-S250 PM54-040-S250 M54-60-S250-RA M54-40-S250-RA "  # 251 417
SIZE_H42 = "PH42-020-S300 H42-20-S300-RA "  # 303 750
SIZE_M42 = "PM42-010-S260 M42-10-S260-RA "  # 263 187
# By register the addresses and sizes; None is for models without the register.
PLACES = {
    "model_number": {(0, 2): ""},
    "model_information": {(2, 4): P + PRO, None: ""},
    "firmware_version": {(6, 1): P + PRO, (2, 1): ""},
    "id": {(7, 1): P + PRO, (3, 1): ""},
    "baud_rate": {(8, 1): P + PRO, (4, 1): ""},
    "return_delay_time": {(9, 1): P + PRO, (5, 1): ""},
    "min_position_limit": {(52, 4): P + PRO, (6, 2): ""},
    "max_position_limit": {(48, 4): P + PRO, (8, 2): ""},
    "drive_mode": {(10, 1): P + PRO + "MX-106(1.0)", None: ""},
    "operating_mode": {(11, 1): P + PRO, None: ""},
    "control_mode": {(11, 1): XL, None: ""},
    "secondary_id": {(12, 1): P + PRO, None: ""},
    "protocol_type": {(13, 1): P, None: ""},
    "homing_offset": {(20, 4): P + PRO, None: ""},
    "moving_threshold": {(24, 4): P + PRO, None: ""},
    "temperature_limit": {(31, 1): P + PRO, (12, 1): XL, (11, 1): ""},
    "max_voltage_limit": {(32, 2): P + PRO, (14, 1): XL, (13, 1): ""},
    "min_voltage_limit": {(34, 2): P + PRO, (13, 1): XL, (12, 1): ""},
    "pwm_limit": {(36, 2): P + PRO, None: ""},
    "current_limit": {(38, 2): P + PRO, None: ""},
    "acceleration_limit": {(40, 4): P + PRO, None: ""},
    "velocity_limit": {(44, 4): P + PRO, None: ""},
    "external_port_mode_1": {(56, 1): P + PRO, None: ""},
    "external_port_mode_2": {(57, 1): P + PRO, None: ""},
    "external_port_mode_3": {(58, 1): P + PRO, None: ""},
    "external_port_mode_4": {(59, 1): P + PRO, None: ""},
    "startup_configuration": {(60, 1): P, None: ""},
    "max_torque": {None: P + PRO, (15, 2): XL, (14, 2): ""},
    "status_return_level": {(516, 1): P + PRO, (17, 1): XL, (16, 1): ""},
    "alarm_led": {None: P + PRO + XL, (17, 1): ""},
    "shutdown": {(63, 1): P + PRO, (18, 1): ""},
    "multi_turn_offset": {(20, 2): MX, None: ""},
    "resolution_divider": {(22, 1): MX, None: ""},
    "torque_enable": {(512, 1): P + PRO, (24, 1): ""},
    "led": {None: P + PRO, (25, 1): ""},
    "led_red": {(513, 1): P + PRO, None: ""},
    "led_green": {(514, 1): P + PRO, None: ""},
    "led_blue": {(515, 1): P + PRO, None: ""},
    "cw_compliance_margin": {(26, 1): AX + RX, None: ""},
    "ccw_compliance_margin": {(27, 1): AX + RX, None: ""},
    "cw_compliance_slope": {(28, 1): AX + RX, None: ""},
    "ccw_compliance_slope": {(29, 1): AX + RX, None: ""},
    "velocity_i_gain": {(524, 2): P + PRO, None: ""},
    "velocity_p_gain": {(526, 2): P + PRO, None: ""},
    "position_d_gain": {(528, 2): P + PRO, (27, 1): XL, (26, 1): MX, None: ""},
    "position_i_gain": {(530, 2): P + PRO, (28, 1): XL, (27, 1): MX, None: ""},
    "position_p_gain": {(532, 2): P + PRO, (29, 1): XL, (28, 1): MX, None: ""},
    "feedforward_2nd_gain": {(536, 2): P + PRO, None: ""},
    "feedforward_1st_gain": {(538, 2): P + PRO, None: ""},
    "bus_watchdog": {(546, 1): P + PRO, None: ""},
    "goal_pwm": {(548, 2): P + PRO, None: ""},
    "goal_current": {(550, 2): P + PRO, None: ""},
    "goal_velocity": {(552, 4): P + PRO, None: ""},
    "profile_acceleration": {(556, 4): P + PRO, (73, 1): MX, None: ""},
    "profile_velocity": {(560, 4): P + PRO, (32, 2): ""},
    "goal_position": {(564, 4): P + PRO, (30, 2): ""},
    "torque_limit": {None: P + PRO, (35, 2): XL, (34, 2): ""},
    "present_position": {(580, 4): P + PRO, (37, 2): XL, (36, 2): ""},
    "present_velocity": {(576, 4): P + PRO, (39, 2): XL, (38, 2): ""},
    "present_load": {None: P + PRO, (41, 2): XL, (40, 2): ""},
    "present_input_voltage": {(592, 2): P + PRO, (45, 1): XL, (42, 1): ""},
    "present_temperature": {(594, 1): P + PRO, (46, 1): XL, (43, 1): ""},
    "registered_instruction": {(517, 1): P + PRO, (47, 1): XL, (44, 1): ""},
    "moving": {(570, 1): P + PRO, (49, 1): XL, (46, 1): ""},
    "hardware_error_status": {(518, 1): P + PRO, (50, 1): XL, None: ""},
    "lock": {None: P + PRO + XL, (47, 1): ""},
    "punch": {None: P + PRO, (51, 2): XL, (48, 2): ""},
    "realtime_tick": {(568, 2): P + PRO, (50, 2): MX, None: ""},
    "current": {(68, 2): "MX-64(1.0) MX-106(1.0)", None: ""},
    "torque_control_mode": {(70, 1): "MX-64(1.0) MX-106(1.0)", None: ""},
    "goal_torque": {(71, 2): "MX-64(1.0) MX-106(1.0)", None: ""},
    "moving_status": {(571, 1): P + PRO, None: ""},
    "present_pwm": {(572, 2): P + PRO, None: ""},
    "present_current": {(574, 2): P + PRO, None: ""},
    "velocity_trajectory": {(584, 4): P + PRO, None: ""},
    "position_trajectory": {(588, 4): P + PRO, None: ""},
    "external_port_data_1": {(600, 2): P + PRO, None: ""},
    "external_port_data_2": {(602, 2): P + PRO, None: ""},
    "external_port_data_3": {(604, 2): P + PRO, None: ""},
    "external_port_data_4": {(606, 2): P + PRO, None: ""},
    "backup_ready": {(878, 1): P, None: ""},
}  # fmt: skip
DEFAULTS = {
    "model_number": {
        10: "RX-10", 12: "AX-12A", 18: "AX-18A", 24: "RX-24F", 28: "RX-28", 29: "MX-28(1.0)", 64: "RX-64",
        300: "AX-12W", 310: "MX-64(1.0)", 320: "MX-106(1.0)", 350: "XL-320", 2000: "PH42-020-S300",
        2010: "PH54-100-S500", 2020: "PH54-200-S500", 2100: "PM42-010-S260", 2110: "PM54-040-S250",
        2120: "PM54-060-S250", 43289: "M42-10-S260-RA", 46097: "M54-40-S250-RA", 46353: "M54-60-S250-RA",
        51201: "H42-20-S300-RA", 53769: "H54-100-S500-RA", 54025: "H54-200-S500-RA",
    },
    "id": {1: ""},
    # The page of AX-12A has 1 in its table and 34 in the list of rates, which all pages share.
    "baud_rate": {34: RX + MX, 3: XL, 1: AX + P + PRO},
    "return_delay_time": {250: ""},
    "drive_mode": {0: P + PRO + "MX-106(1.0)"},
    "operating_mode": {3: P + PRO},
    "control_mode": {2: XL},
    "secondary_id": {255: P + PRO},
    "protocol_type": {2: P},
    "homing_offset": {0: P + PRO},
    "moving_threshold": {
        50: "H54-100-S500-RA M54-60-S250-RA",
        20: P + "H54-200-S500-RA H42-20-S300-RA M54-40-S250-RA M42-10-S260-RA",
    },
    "min_position_limit": {-501433: BIG, -251173: MID, -303454: SIZE_H42, -262931: SIZE_M42, 0: ""},
    "max_position_limit": {501433: BIG, 251173: MID, 303454: SIZE_H42, 262931: SIZE_M42, 4095: MX, 1023: ""},
    "temperature_limit": {70: "AX-12A AX-12W", 75: "AX-18A", 65: XL, 80: ""},
    "min_voltage_limit": {150: P + PRO, 60: ""},
    "max_voltage_limit": {140: AX, 190: RX, 240: "MX-64(1.0)", 90: XL, 350: P + PRO, 160: ""},
    "pwm_limit": {2009: P + PRO},
    "current_limit": {
        22740: "PH54-200-S500 H54-200-S500-RA", 15900: "PH54-100-S500 H54-100-S500-RA", 4500: SIZE_H42,
        7980: "PM54-060-S250 M54-60-S250-RA", 4470: "PM54-040-S250 M54-40-S250-RA", 1461: SIZE_M42,
    },
    "acceleration_limit": {
        3992644: "PH54-200-S500", 4255632: "PH54-100-S500", 4346756: "PM42-010-S260", 9982: "H54-200-S500-RA",
        10639: "H54-100-S500-RA", 10765: SIZE_H42, 11145: "PM54-060-S250 M54-60-S250-RA",
        11037: "PM54-040-S250 M54-40-S250-RA", 10867: "M42-10-S260-RA",
    },
    "velocity_limit": {
        2900: "PH54-200-S500 H54-200-S500-RA", 2920: "PH54-100-S500 H54-100-S500-RA " + SIZE_H42,
        2830: "PM54-060-S250 M54-60-S250-RA", 2840: "PM54-040-S250 M54-40-S250-RA", 2600: SIZE_M42,
    },
    "external_port_mode_1": {3: P + PRO},
    "external_port_mode_2": {3: P + PRO},
    "external_port_mode_3": {3: P + PRO},
    "external_port_mode_4": {3: P + PRO},
    "startup_configuration": {0: P},
    "max_torque": {983: "AX-18A", 1023: "AX-12A AX-12W " + RX + MX + XL},
    "torque_limit": {983: "AX-18A", 1023: "AX-12A AX-12W " + RX + MX + XL},  # that of "max_torque"
    "status_return_level": {2: ""},
    "alarm_led": {36: AX + RX + MX},
    # Tables of PH54-200 and of PRO(A) have 52; the list of bits, which all P pages share, marks those of 58.
    "shutdown": {36: AX + RX + MX, 3: XL, 52: PRO + "PH54-200-S500", 58: ""},
    "multi_turn_offset": {0: MX},
    "resolution_divider": {1: MX},
    "torque_enable": {0: ""},
    "led": {0: AX + RX + MX + XL},
    "led_red": {0: P + PRO},
    "led_green": {0: P + PRO},
    "led_blue": {0: P + PRO},
    "cw_compliance_margin": {4: "AX-12W", 1: RX + "AX-12A AX-18A"},
    "ccw_compliance_margin": {4: "AX-12W", 1: RX + "AX-12A AX-18A"},
    "cw_compliance_slope": {64: "AX-12W", 32: RX + "AX-12A AX-18A"},
    "ccw_compliance_slope": {64: "AX-12W", 32: RX + "AX-12A AX-18A"},
    "velocity_i_gain": {
        2209: "PH54-200-S500", 1290: "PH54-100-S500", 502: "PH42-020-S300", 813: "PM54-060-S250",
        408: "PM54-040-S250", 6740: "PM42-010-S260",
    },
    "velocity_p_gain": {
        6153: "PH54-200-S500", 3593: "PH54-100-S500", 1332: "PH42-020-S300", 2265: "PM54-060-S250",
        1137: "PM54-040-S250", 2145: "PM42-010-S260",
    },
    "position_d_gain": {0: MX + XL + P},
    "position_i_gain": {0: MX + XL + P},
    "position_p_gain": {
        32: MX + XL, 314: "PH54-200-S500", 879: "PH42-020-S300", 1061: "PM42-010-S260",
        502: "PH54-100-S500 PM54-060-S250 PM54-040-S250",
    },
    "feedforward_2nd_gain": {0: P},
    "feedforward_1st_gain": {0: P},
    "bus_watchdog": {0: P},
    "registered_instruction": {0: ""},
    "hardware_error_status": {0: XL + P + PRO},
    "lock": {0: AX + RX + MX},
    "punch": {0: MX, 32: AX + RX + XL},
    "torque_control_mode": {0: "MX-64(1.0) MX-106(1.0)"},
    "goal_torque": {0: "MX-64(1.0) MX-106(1.0)"},
    # "current" has 0 in the tables and 2048, no current, in the text below them.
    "profile_acceleration": {0: MX},
    "external_port_data_1": {0: P + PRO},
    "external_port_data_2": {0: P + PRO},
    "external_port_data_3": {0: P + PRO},
    "external_port_data_4": {0: P + PRO},
}  # fmt: skip
CURRENTS = {(0, most): models for most, models in DEFAULTS["current_limit"].items()}
VELOCITIES = {(0, most): models for most, models in DEFAULTS["velocity_limit"].items()}
ACCELERATIONS = {
    (0, 3992644): "PH54-200-S500 H54-200-S500-RA", (0, 4255632): "PH54-100-S500 H54-100-S500-RA",
    (0, 4306173): SIZE_H42, (0, 4457932): "PM54-060-S250 M54-60-S250-RA",
    (0, 4414976): "PM54-040-S250 M54-40-S250-RA", (0, 4346756): SIZE_M42,
}  # fmt: skip
POSITIONS = {
    (-501923, 501923): BIG, (-251417, 251417): MID, (-303750, 303750): SIZE_H42, (-263187, 263187): SIZE_M42,
    (0, 4095): MX, (0, 1023): "",
}  # fmt: skip
# Tables of some PRO(A) pages begin at 0, those of others and the newest text at 150.
VOLTAGES = {(50, 160): AX + MX, (50, 250): RX + XL, (150, 350): P + PRO}
RANGES = {
    "id": {(0, 253): AX + RX + MX, (0, 252): XL + P + PRO},
    "baud_rate": {(0, 3): XL, (0, 9): P + PRO},
    "return_delay_time": {(0, 254): ""},  # PRO(A) tables have 255, the text below them 254
    "drive_mode": {(0, 3): "MX-106(1.0)", (0, 1): PRO, (0, 13): P},
    "operating_mode": {(0, 16): P + PRO},  # of which 0, 1, 3, 4 and 16
    "control_mode": {(1, 2): XL},
    "secondary_id": {(0, 255): P + PRO},
    "protocol_type": {(2, 10): P},
    "homing_offset": {(-(2**31), 2**31 - 1): P + PRO},
    "moving_threshold": VELOCITIES,
    "min_position_limit": POSITIONS,  # PRO(A) M54 pages have 241 417 as the greatest of this one alone
    "max_position_limit": POSITIONS,
    "temperature_limit": {(0, 99): "AX-12W AX-18A", (0, 150): XL, (0, 100): ""},  # XL-320: 100 in the text
    "min_voltage_limit": VOLTAGES,
    # MX-64(1.0) comes with 240, above the 160 of the text that the pages of AX and MX share.
    "max_voltage_limit": VOLTAGES | {(50, 160): AX + "MX-28(1.0) MX-106(1.0)", (50, 240): "MX-64(1.0)"},
    "pwm_limit": {(0, 2009): P + PRO},
    "current_limit": CURRENTS,
    "acceleration_limit": ACCELERATIONS,
    "velocity_limit": VELOCITIES,
    "external_port_mode_1": {(0, 3): P + PRO},
    "external_port_mode_2": {(0, 3): P + PRO},
    "external_port_mode_3": {(0, 3): P + PRO},
    "external_port_mode_4": {(0, 3): P + PRO},
    "max_torque": {(0, 1023): AX + RX + MX + XL},
    "torque_limit": {(0, 1023): AX + RX + MX + XL},
    "status_return_level": {(0, 2): ""},
    "shutdown": {(0, 7): XL, (0, 63): P, (0, 255): PRO, (0, 127): ""},  # bits 0 to 6 of the old ones
    "alarm_led": {(0, 127): AX + RX + MX},
    "multi_turn_offset": {(-24576, 24576): MX},
    "resolution_divider": {(1, 4): MX},
    "torque_enable": {(0, 1): ""},
    "led": {(0, 7): XL, (0, 1): AX + RX + MX},
    "led_red": {(0, 255): P + PRO},
    "led_green": {(0, 255): P + PRO},
    "led_blue": {(0, 255): P + PRO},
    "cw_compliance_margin": {(0, 255): AX + RX},
    "ccw_compliance_margin": {(0, 255): AX + RX},
    "cw_compliance_slope": {(0, 254): AX + RX},
    "ccw_compliance_slope": {(0, 254): AX + RX},
    "velocity_i_gain": {(0, 32767): P + PRO},
    "velocity_p_gain": {(0, 32767): P + PRO},
    "position_d_gain": {(0, 254): MX + XL, (0, 32767): P + PRO},
    "position_i_gain": {(0, 254): MX + XL, (0, 32767): P + PRO},
    "position_p_gain": {(0, 254): MX + XL, (0, 32767): P + PRO},
    "feedforward_2nd_gain": {(0, 32767): P + PRO},
    "feedforward_1st_gain": {(0, 32767): P + PRO},
    "bus_watchdog": {(-1, 127): P + PRO},  # -1 when it has expired
    "goal_pwm": {(-2009, 2009): P + PRO},
    "goal_current": {(-most, most): models for (_, most), models in CURRENTS.items()},
    "goal_velocity": {(-most, most): models for (_, most), models in VELOCITIES.items()},
    "profile_acceleration": {(0, 254): MX} | ACCELERATIONS,
    "profile_velocity": {(0, 2047): AX + RX + MX + XL} | VELOCITIES,  # 0 to 1023 as a joint, to 2047 as a wheel
    "goal_position": {(0, 1023): AX + RX + XL},  # MX: 0 to 4095, over several turns ±28 672
    "lock": {(0, 1): AX + RX + MX},
    "punch": {(32, 1023): AX + RX, (0, 1023): XL},  # MX share the text of AX, but come with 0
    "torque_control_mode": {(0, 1): "MX-64(1.0) MX-106(1.0)"},
    "goal_torque": {(0, 2047): "MX-64(1.0) MX-106(1.0)"},
    "realtime_tick": {(0, 32767): P + PRO},
    "external_port_data_1": {(0, 4095): P + PRO},
    "external_port_data_2": {(0, 4095): P + PRO},
    "external_port_data_3": {(0, 4095): P + PRO},
    "external_port_data_4": {(0, 4095): P + PRO},
}  # fmt: skip


def by_model(listed):
    """What a page says of each model: its own entry, or that without names."""
    named = {model: stated for stated, names in listed.items() for model in names.split()}
    others = [stated for stated, names in listed.items() if not names]
    return named | {model: others[0] for model in OTHERS if others and model not in named}


def test_no_model_and_no_register_is_left_out():
    assert set(OTHERS) == {
        model for model, traits in TRAITS.items() if traits.series.name in ("AX", "RX", "MX1", "XL320", "P")
    }
    for model in OTHERS:
        numbered = {f"indirect_{kind}_{count}" for kind in ("address", "data") for count in range(1, 129)}
        assert set(MODELS[model].registers) - numbered <= set(PLACES), model


@pytest.mark.parametrize("register", PLACES)
def test_a_register_is_where_the_makers_page_has_it(register):
    for model, place in by_model(PLACES[register]).items():
        row = MODELS[model].registers.get(register)
        assert (None if row is None else (row.address, row.length)) == place, model


@pytest.mark.parametrize("register", DEFAULTS)
def test_a_register_of_these_comes_with_what_the_makers_page_says(register):
    for model, default in by_model(DEFAULTS[register]).items():
        assert MODELS[model][register].default == default, model


@pytest.mark.parametrize("register", RANGES)
def test_a_register_of_these_takes_what_the_makers_page_says(register):
    for model, limits in by_model(RANGES[register]).items():
        row = MODELS[model][register]
        assert (row.minimum, row.maximum) == limits, model


@pytest.mark.parametrize("model", (P + PRO).split())
def test_indirect_registers_follow_each_other(model):
    for count in range(128):
        address, data = (MODELS[model][f"indirect_{kind}_{count + 1}"] for kind in ("address", "data"))
        assert (address.address, address.length, address.default) == (168 + 2 * count, 2, 634 + count)
        assert (address.minimum, address.maximum) == (512, 1023)
        assert (data.address, data.length, data.default, data.minimum, data.maximum) == (634 + count, 1, 0, 0, 255)


@pytest.mark.parametrize("model", OTHERS)
def test_an_emulated_servo_of_these_is_as_the_maker_delivers_it(model):
    zero = 0 if model in P + PRO else 2048 if model in MX else 512
    joint = RigJoint("joint", 1, model, 1, zero, -1.0, 1.0, 1.0)
    servo = EmulatedBus(RigConfig("emulated", 1_000_000, 100.0, (joint,))).devices[0]
    for register, listed in DEFAULTS.items():
        stated = by_model(listed).get(model)
        if stated is not None and register != "baud_rate":  # that of the rig's file
            assert servo[register] == stated, register


@pytest.mark.parametrize("model", (P + PRO).split())
def test_an_emulated_servo_is_by_default_as_stiff_as_its_model(model):
    bank = ServoBank(MODELS[model], [1], [0.0])
    usual = TRAITS[model].stiffness / TRAITS[model].series.gain_unit
    assert bank.drive.p_gain[0] == pytest.approx(usual)
    bank.registers["position_p_gain"] *= 2
    bank.settle()
    assert bank.drive.p_gain[0] == pytest.approx(2.0 * usual)


def test_the_least_compliance_slope_counts_as_2():
    bank = ServoBank(MODELS["AX-12A"], [1], [512.0])
    gains = []
    for slope in (0, 2, 4):
        for way in ("cw", "ccw"):
            bank.registers[f"{way}_compliance_slope"] = slope
        bank.settle()
        gains.append(float(bank.drive.p_gain[0]))
    assert gains[0] == gains[1] == pytest.approx(2.0 * gains[2])
