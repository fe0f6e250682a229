"""What a servo keeps of its own when a rig switches it on, and that the rig goes by it."""

import msgspec
import numpy as np
import pytest

from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import EmulatedBus
from hardware.errors import RigError
from hardware.families.models import TRAITS
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig
from hardware.tools.doctor import examine, fix_settings

# What the rig file states, or a rig needs to drive a servo at all.
ASKED_FOR = {
    "min_position_limit", "max_position_limit", "profile_velocity", "profile_acceleration", "bus_watchdog",
    "goal_position", "torque_enable", "operating_mode", "status_return_level",
}  # fmt: skip
GAINS = ("position_p_gain", "position_i_gain", "position_d_gain", "velocity_p_gain", "velocity_i_gain",
         "feedforward_1st_gain", "feedforward_2nd_gain", "cw_compliance_slope", "ccw_compliance_slope")  # fmt: skip


class Bench:
    """One emulated servo, and the rig that drives it."""

    def __init__(self, model, **settings):
        table = RigJoint("joint", 1, model, 1, 512, -0.1, 0.1, 1.0).table
        zero = 0 if table.one_turn[0] < 0 else table.pulses_per_turn * 5 // 12
        limits = {"acceleration": 15.0} if "profile_acceleration" in table.registers else {}
        joint = RigJoint("joint", 1, model, 1, zero, -1.0, 1.0, 2.0, **(limits | settings))
        self.config = RigConfig("emulated", 1_000_000, 100.0, (joint,))
        self.port = EmulatedPort(EmulatedBus(self.config), True)
        self.servo = self.port.bus.devices[0]

    def bus(self):
        bus = Bus(self.port, self.config.baud)
        bus.families = self.config.families
        return bus

    def rig(self):
        return Rig(self.config, lambda part: self.bus(), False, sleep=self.port.elapse)

    def play(self, rig, seconds=1.0):
        for tick in range(round(seconds * 100)):
            rig.collect_state()
            rig.write(np.array([0.5 * np.sin(0.02 * tick)]))
            self.port.elapse(0.01)

    def written(self):
        """The registers that are not measured, with their counts."""
        rows = self.servo.bank.public.registers.items()
        return {name: self.servo[name] for name, row in rows if row.access == "RW" and "indirect" not in name}


@pytest.mark.parametrize("model", TRAITS)
def test_a_servo_from_the_box_switches_on_and_keeps_all_that_the_rig_file_does_not_ask_for(model):
    bench = Bench(model)
    if TRAITS[model].series.name == "P":
        bench.servo["shutdown"] = 52  # most of them come without protection against heat, and are refused
    before = bench.written()
    bench.play(bench.rig(), 0.1)
    after = bench.written()
    assert {name for name in before if before[name] != after[name]} <= ASKED_FOR
    assert bench.servo.torque


@pytest.mark.parametrize("model", ["XM430-W350", "XL330-M077", "MX-28(1.0)", "AX-12A", "PH54-200-S500"])
def test_gains_that_another_program_has_set_are_kept_and_named(model):
    bench = Bench(model)
    own = {name: bench.servo[name] + 3 for name in GAINS if name in bench.servo.bank.public.registers}
    for name, gain in own.items():
        bench.servo[name] = gain
    notes = "\n".join(examine(bench.config, bench.bus()).notes)
    assert fix_settings(bench.config, bench.bus()).refused == []
    bench.play(bench.rig(), 0.1)
    assert {name: bench.servo[name] for name in own} == own
    named = [name for name in own if not name.startswith("velocity")]
    for name in named:
        assert f"{name} is {own[name]}, as delivered it is {own[name] - 3}: kept" in notes


def test_gains_of_the_rig_file_are_set_also_where_the_mode_changes_and_after_a_restart():
    bench = Bench("XL330-M288", position_p_gain=250, position_d_gain=30)
    bench.servo["operating_mode"], bench.servo["position_p_gain"] = 4, 250

    def gains():
        return [bench.servo[name] for name in ("position_p_gain", "position_i_gain", "position_d_gain")]

    rig = bench.rig()
    assert gains() == [250, 0, 30]
    bench.servo.reboot(bench.port.now() + 0.1)
    assert gains() == [400, 0, 0]
    bench.play(rig, 2.0)
    assert (rig.recoveries, gains()) == (1, [250, 0, 30])


@pytest.mark.parametrize(
    ("model", "gains", "said"),
    [
        ("XM430-W350", {"position_p_gain": 16384}, "the most that model 'XM430-W350' takes is 16383"),
        ("AX-12A", {"position_d_gain": 1}, "model 'AX-12A' has no position_d_gain"),
    ],
)
def test_a_gain_that_a_model_does_not_take_is_refused(model, gains, said):
    with pytest.raises(ValueError, match=said):
        Bench(model, **gains)


def test_a_rig_knows_how_stiff_its_servos_are():
    slack = {}
    for gain in (None, 400, 1600):
        bench = Bench("XM430-W350", **({} if gain is None else {"position_p_gain": gain}))
        slack[gain] = bench.rig().measured.slack[0]
    assert slack[None] == pytest.approx(885 * 128 / 800 * 2 * np.pi / 4096)
    assert (slack[400], slack[1600]) == (pytest.approx(2 * slack[None]), pytest.approx(0.5 * slack[None]))


def test_a_servo_is_hot_at_the_limit_that_it_keeps():
    """By the maker 80 degC; 60 in this servo."""
    bench = Bench("XC430-W150")
    bench.servo["temperature_limit"] = 60
    rig = bench.rig()
    bench.servo.bank.drive.temperature[0] = 55.0
    bench.play(rig)
    assert rig.pace.part[0] < 0.7
    assert rig.incidents[-1].what == "is getting hot: 55 degC, its limit is 60"
    bench.servo.bank.drive.temperature[0] = 62.0
    with pytest.raises(RigError, match=r"joint \(id 1\) is too hot: 62 degC, its limit is 60"):
        bench.play(rig)


def test_a_servo_below_the_limit_of_its_own_model_is_not_hot():
    bench = Bench("XC430-W150")
    rig = bench.rig()
    bench.servo.bank.drive.temperature[0] = 75.0
    bench.play(rig, 2.0)
    assert [one.what for one in rig.incidents] == ["is getting hot: 75 degC, its limit is 80"]


@pytest.mark.parametrize(
    ("model", "supply", "too_low"), [("XL430-W250", 7.4, 5.8), ("XC330-T288", 11.1, 8.8), ("XM430-W350", 14.8, 11.5)]
)
def test_a_supply_that_the_maker_allows_is_not_low_until_it_falls(model, supply, too_low):
    bench = Bench(model)
    bench.servo.bank.drive.supply[0] = supply
    bench.port.elapse(0.01)
    rig = bench.rig()
    bench.play(rig)
    assert list(rig.incidents) == []
    bench.servo.bank.drive.supply[0] = too_low
    bench.play(rig)
    assert [one.what for one in rig.incidents] == [f"has a low supply voltage: {too_low:.1f} V"]


def test_a_supply_below_the_servos_own_limit_is_low_from_the_start():
    bench = Bench("XM430-W350")
    bench.servo.bank.drive.supply[0] = 9.0
    bench.port.elapse(0.01)
    rig = bench.rig()
    bench.play(rig, 0.2)
    assert [one.what for one in rig.incidents] == ["has a low supply voltage: 9.0 V"]


@pytest.mark.parametrize(("model", "supply"), [("XM430-W350", 9.0), ("XL-320", 5.0), ("AX-12A", 8.0), ("STS3215", 3.8)])
def test_a_restart_at_a_low_supply_is_no_shutdown_for_it(model, supply):
    """A servo reports the voltage, also without torque; the rig was stopped for it."""
    bench = Bench(model)
    bench.servo.bank.drive.supply[0] = supply
    bench.port.elapse(0.01)
    rig = bench.rig()
    bench.play(rig, 0.3)
    bench.servo.reboot(bench.port.now() + 0.1)
    bench.play(rig, 2.0)
    assert bench.servo.torque
    assert rig.recoveries == 1
    assert "has lost its torque or restarted" in [one.what for one in rig.incidents]


@pytest.mark.parametrize(("model", "supply"), [("XM430-W350", 9.0), ("XL-320", 5.0)])
def test_a_servo_that_shuts_down_at_a_low_supply_is_lost(model, supply):
    bench = Bench(model)
    bench.servo["shutdown"] |= bench.servo.series.own_problems(1)
    rig = bench.rig()
    bench.play(rig, 0.3)
    bench.servo.bank.drive.supply[0] = supply
    with pytest.raises(RigError, match="has shut down: input voltage"):
        bench.play(rig)


def test_a_rig_file_with_gains_is_read():
    joint = msgspec.toml.decode(
        'name = "jaw"\nid = 1\nmodel = "XL330-M288"\ndirection = 1\nzero = 2048\nlower = -1.0\nupper = 1.0\n'
        "velocity = 1.0\nposition_p_gain = 250",
        type=RigJoint,
    )
    assert joint.gains == {"position_p_gain": 250}
