"""The facts about X and MX servos against a second reading of the maker's pages, made register by register.

The product has one row a model; here each register lists the models, so that no slip can be in both at the same place.
"""

import pytest

from hardware.emulator.bus import EmulatedBus
from hardware.families.models import MODELS, TRAITS
from hardware.rig.rig_file import RigConfig, RigJoint

ALL = [model for model, traits in TRAITS.items() if traits.series.name in ("X", "X330", "X540")]
SIZE_330 = "XL330-M077 XL330-M288 XC330-M181 XC330-M288 XC330-T181 XC330-T288 XM335-T323"
AT_24_VOLTS = "XH430-V350 XH430-V210 XH540-V270 XH540-V150 XW540-H260"
WITHOUT_CURRENT = "XL430-W250 2XL430-W250 XC430-W150 XC430-W240 2XC430-W250 MX-28"
# By register the defaults, each with its models; "" is for every model that the others do not name.
DEFAULTS = {
    "model_number": {
        30: "MX-28", 311: "MX-64", 321: "MX-106", 1000: "XH430-W350", 1010: "XH430-W210", 1011: "XD430-T210",
        1020: "XM430-W350", 1030: "XM430-W210", 1040: "XH430-V350", 1050: "XH430-V210", 1060: "XL430-W250",
        1070: "XC430-W150", 1080: "XC430-W240", 1090: "2XL430-W250", 1100: "XH540-W270", 1111: "XD540-T150",
        1130: "XM540-W150", 1140: "XH540-V270", 1150: "XH540-V150", 1160: "2XC430-W250", 1170: "XW540-T260",
        1180: "XW540-T140", 1190: "XL330-M077", 1200: "XL330-M288", 1210: "XC330-T181", 1220: "XC330-T288",
        1230: "XC330-M181", 1240: "XC330-M288", 1270: "XW430-T333", 1280: "XW430-T200", 1310: "XW540-H260",
        1710: "XM335-T323",
    },
    "id": {1: ""},
    "baud_rate": {1: ""},
    "return_delay_time": {250: ""},
    "drive_mode": {0: ""},
    "operating_mode": {3: ""},
    "secondary_id": {255: ""},
    "protocol_type": {2: ""},
    "homing_offset": {0: ""},
    "moving_threshold": {20: "XC430-W150", 10: ""},
    "temperature_limit": {70: SIZE_330, 72: "XL430-W250 2XL430-W250", 80: ""},
    "max_voltage_limit": {
        70: "XL330-M077 XL330-M288 XC330-M181 XC330-M288",
        140: "XC330-T181 XC330-T288 XM335-T323 XL430-W250 2XL430-W250",
        300: AT_24_VOLTS, 160: "",
    },
    "min_voltage_limit": {
        35: "XL330-M077 XL330-M288 XC330-M181 XC330-M288", 55: "XC330-T181 XC330-T288 XM335-T323",
        60: "XL430-W250 2XL430-W250 XC430-W150 XC430-W240 2XC430-W250", 110: AT_24_VOLTS, 95: "",
    },
    "pwm_limit": {885: ""},
    "current_limit": {
        None: WITHOUT_CURRENT, 648: "XH430-W350 XH430-W210 XD430-T350 XD430-T210", 689: "XH430-V350 XH430-V210",
        910: "XC330-T181 XC330-T288 XM335-T323", 1188: "XH540-V270 XH540-V150 XW540-H260",
        1193: "XM430-W350 XM430-W210",
        1750: "XL330-M077 XL330-M288", 1941: "MX-64", 2352: "XC330-M181 XC330-M288", 2047: "",
    },
    "velocity_limit": {
        128: "XM540-W270 XH540-V270", 130: "XH430-W350 XD430-T350", 135: "XH430-V350", 139: "XW430-T333",
        145: "XW540-H260", 167: "XH540-W270 XD540-T270 XW540-T260", 200: "XM430-W350", 210: "XH430-W210 XD430-T210",
        230: "XH430-V210 XM540-W150 XH540-V150", 235: "XW430-T200", 250: "2XL430-W250", 265: "XL430-W250",
        275: "2XC430-W250", 280: "XM335-T323", 300: "XH540-W150 XD540-T150", 304: "XW540-T140", 306: "XC430-W240",
        320: "XC330-T288",
        330: "XM430-W210", 350: "XC330-M288", 360: "MX-106", 380: "MX-28", 435: "MX-64", 445: "XL330-M288",
        460: "XC430-W150", 510: "XC330-T181", 545: "XC330-M181", 1620: "XL330-M077",
    },
    "max_position_limit": {3072: "XM335-T323", 4095: ""},
    "min_position_limit": {1024: "XM335-T323", 0: ""},
    "shutdown": {53: "XL330-M077 XL330-M288", 52: ""},
    "torque_enable": {0: ""},
    "status_return_level": {2: ""},
    "velocity_i_gain": {
        400: "XL330-M077", 1000: "XL430-W250", 1200: "XC330-T181 XC330-T288", 1400: "XC330-M181",
        1600: "XL330-M288 XC330-M288", 1800: "2XL430-W250 XM335-T323", 1920: "",
    },
    "velocity_p_gain": {
        40: "XL330-M077 XC330-T181 XC330-T288", 50: "XC330-M288 XM335-T323", 180: "XL330-M288", 100: "",
    },
    "position_d_gain": {500: "XC330-M181 XC330-M288", 2000: "2XL430-W250", 4000: "XL430-W250", 0: ""},
    "position_i_gain": {400: "XL330-M077", 0: ""},
    "position_p_gain": {
        400: "XL330-M077 XL330-M288", 460: "XC430-W150", 640: "XL430-W250 2XL430-W250",
        700: "XC430-W240 2XC430-W250", 850: "MX-28 MX-64 MX-106",
        900: "XC330-T181 XC330-T288 XH430-W350 XH430-W210 XD430-T350 XD430-T210 XW430-T200 XW430-T333",
        1100: "XC330-M288", 1200: "XC330-M181", 2000: "XM335-T323", 800: "",
    },
    "feedforward_2nd_gain": {0: ""},
    "feedforward_1st_gain": {0: ""},
    "bus_watchdog": {0: ""},
    "profile_acceleration": {0: ""},
    "profile_velocity": {0: ""},
}  # fmt: skip
VOLTAGES = {
    (31, 70): "XL330-M077 XL330-M288 XC330-M181 XC330-M288", (55, 140): "XC330-T181 XC330-T288 XM335-T323",
    (60, 140): "XL430-W250 2XL430-W250", (60, 160): "XC430-W150 XC430-W240 2XC430-W250",
    (110, 300): AT_24_VOLTS, (95, 160): "",
}  # fmt: skip
RANGES = {
    "id": {(0, 252): ""},
    "baud_rate": {(0, 6): SIZE_330, (0, 7): ""},
    "return_delay_time": {(0, 254): ""},
    "protocol_type": {(2, 22): SIZE_330, (1, 2): ""},
    "homing_offset": {(-1044479, 1044479): ""},
    "moving_threshold": {(0, 1023): ""},
    "temperature_limit": {(0, 100): ""},
    "min_voltage_limit": VOLTAGES,
    "max_voltage_limit": VOLTAGES,
    "pwm_limit": {(0, 885): ""},
    "velocity_limit": {(0, 2047): SIZE_330, (0, 1023): ""},
    "max_position_limit": {(0, 4095): ""},
    "min_position_limit": {(0, 4095): ""},
    "position_p_gain": {(0, 16383): ""},
    "position_i_gain": {(0, 16383): ""},
    "position_d_gain": {(0, 16383): ""},
    "velocity_i_gain": {(0, 16383): ""},
    "velocity_p_gain": {(0, 16383): ""},
    "profile_velocity": {(0, 32767): ""},
    "profile_acceleration": {(0, 32767): ""},
}  # fmt: skip
# The same of AX, RX and MX servos of Protocol 1.0; "" is for the others of these.
OLD = ["AX-12W", "AX-18A", "RX-10", "RX-24F", "RX-28", "RX-64", "MX-64(1.0)", "MX-106(1.0)"]
RX = "RX-10 RX-24F RX-28 RX-64"
MX = "MX-64(1.0) MX-106(1.0)"
OLD_DEFAULTS = {
    "model_number": {
        10: "RX-10", 18: "AX-18A", 24: "RX-24F", 28: "RX-28", 64: "RX-64", 300: "AX-12W", 310: "MX-64(1.0)",
        320: "MX-106(1.0)",
    },
    "id": {1: ""},
    "baud_rate": {1: "AX-12W AX-18A", 34: ""},
    "return_delay_time": {250: ""},
    "min_position_limit": {0: ""},
    "max_position_limit": {4095: MX, 1023: ""},
    "temperature_limit": {70: "AX-12W", 75: "AX-18A", 80: ""},
    "min_voltage_limit": {60: ""},
    "max_voltage_limit": {140: "AX-12W AX-18A", 160: "MX-106(1.0)", 190: RX, 240: "MX-64(1.0)"},
    "max_torque": {983: "AX-18A", 1023: ""},
    "torque_limit": {983: "AX-18A", 1023: ""},
    "status_return_level": {2: ""},
    "alarm_led": {36: ""},
    "shutdown": {36: ""},
    "torque_enable": {0: ""},
    "cw_compliance_margin": {None: MX, 4: "AX-12W", 1: ""},
    "ccw_compliance_margin": {None: MX, 4: "AX-12W", 1: ""},
    "cw_compliance_slope": {None: MX, 64: "AX-12W", 32: ""},
    "ccw_compliance_slope": {None: MX, 64: "AX-12W", 32: ""},
    "position_p_gain": {32: MX, None: ""},
    "position_i_gain": {0: MX, None: ""},
    "position_d_gain": {0: MX, None: ""},
    "lock": {0: ""},
    "punch": {0: MX, 32: ""},
    "multi_turn_offset": {0: MX, None: ""},
    "resolution_divider": {1: MX, None: ""},
}  # fmt: skip
# V, rev/min, A, N·m, of the pages' specifications.
MOTORS = {
    (5, 383, 1.47, 0.215): "XL330-M077", (5, 103, 1.47, 0.52): "XL330-M288", (5, 129, 1.8, 0.6): "XC330-M181",
    (5, 81, 1.8, 0.93): "XC330-M288", (12, 113, 0.88, 0.8): "XC330-T181", (12, 71, 0.88, 1.0): "XC330-T288",
    (24, 52, 0.7, 2.6): "XH430-V210", (24, 31, 0.7, 3.3): "XH430-V350", (12, 50, 1.3, 2.5): "XH430-W210 XD430-T210",
    (12, 30, 1.3, 3.4): "XH430-W350 XD430-T350", (12, 61, 1.4, 1.5): "XL430-W250 2XL430-W250",
    (12, 70, 1.4, 1.9): "XC430-W240", (12, 106, 1.4, 1.6): "XC430-W150", (12, 64, 1.4, 1.8): "2XC430-W250",
    (12, 77, 2.3, 3.0): "XM430-W210", (12, 46, 2.3, 4.1): "XM430-W350", (24, 34, 2.4, 9.2): "XH540-V270",
    (24, 60, 2.4, 6.4): "XH540-V150", (12, 70, 4.9, 7.1): "XH540-W150 XD540-T150",
    (12, 39, 4.9, 9.9): "XH540-W270 XD540-T270", (12, 72, 4.9, 6.9): "XW540-T140", (12, 40, 4.9, 9.5): "XW540-T260",
    (12, 53, 4.4, 7.3): "XM540-W150", (12, 30, 4.4, 10.6): "XM540-W270", (12, 31, 1.3, 3.1): "XW430-T333",
    (11.1, 53, 0.8, 1.03): "XM335-T323", (12, 54, 0.8, 1.3): "RX-10", (12, 126, 2.4, 2.6): "RX-24F",
    (18.5, 85, 1.9, 3.7): "RX-28",
    (18.5, 64, 2.6, 5.3): "RX-64", (12, 97, 2.2, 1.8): "AX-18A",
    (12, 55, 1.4, 2.5): "MX-28", (12, 63, 4.1, 6.0): "MX-64", (12, 45, 5.2, 8.4): "MX-106",
}  # fmt: skip


def by_model(listed, models=ALL):
    """What a page says of each model: its own entry, or that without names."""
    named = {model: stated for stated, names in listed.items() for model in names.split()}
    others = [stated for stated, names in listed.items() if not names]
    return named | {model: others[0] for model in models if others and model not in named}


@pytest.mark.parametrize("register", DEFAULTS)
def test_a_register_comes_with_what_the_makers_page_says(register):
    stated = by_model(DEFAULTS[register])
    assert set(stated) >= set(ALL) - {"XD430-T350", "XD540-T270", "XM540-W270", "XH540-W150"}
    for model, default in stated.items():
        row = MODELS[model].registers.get(register)
        assert (None if row is None else row.default) == default, model


@pytest.mark.parametrize("register", OLD_DEFAULTS)
def test_a_register_of_an_old_servo_comes_with_what_the_makers_page_says(register):
    stated = by_model(OLD_DEFAULTS[register], OLD)
    assert set(stated) == set(OLD)
    for model, default in stated.items():
        row = MODELS[model].registers.get(register)
        assert (None if row is None else row.default) == default, model


@pytest.mark.parametrize("register", RANGES)
def test_a_register_takes_what_the_makers_page_says(register):
    for model, limits in by_model(RANGES[register]).items():
        row = MODELS[model][register]
        assert (row.minimum, row.maximum) == limits, model


@pytest.mark.parametrize("model", ALL)
def test_current_is_limited_to_what_the_model_takes(model):
    most, table = by_model(DEFAULTS["current_limit"])[model], MODELS[model].registers
    unit = {"XH430-V350": 1.34, "XH430-V210": 1.34, "MX-64": 3.36, "MX-106": 3.36}.get(model, 2.69)
    for name, least in (("current_limit", 0), ("goal_current", -1), ("present_current", -1)):
        assert (name in table) == (most is not None)
        if most is not None:
            assert (table[name].minimum, table[name].maximum) == (least * most, most)
            assert table[name].scale == (1.0 if model in SIZE_330 else unit)


def test_motors_are_as_the_specifications_say():
    for figures, models in MOTORS.items():
        for model in models.split():
            traits = TRAITS[model]
            stated = (traits.voltage, traits.no_load_speed, traits.stall_current, traits.stall_torque)
            assert stated == figures, model


@pytest.mark.parametrize("model", ALL)
def test_an_emulated_servo_is_as_the_maker_delivers_it(model):
    joint = RigJoint("joint", 1, model, 1, 2048, -1.0, 1.0, 1.0)
    servo = EmulatedBus(RigConfig("emulated", 1_000_000, 100.0, (joint,))).devices[0]
    for register, listed in DEFAULTS.items():
        stated = by_model(listed).get(model)
        if stated is not None and register != "baud_rate":  # that of the rig's file
            assert servo[register] == stated, register
    assert not servo.alert
