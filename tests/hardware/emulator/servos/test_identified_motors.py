"""Motors identified on real servos, against the model's equations in SI units, integrated in much smaller steps."""

import math

import numpy as np
import pytest

from hardware.emulator.bus import EmulatedBus
from hardware.emulator.servos.drive import MotorDrive, makers_motor, motor_of, motors_said
from hardware.families.models import IDENTIFIED
from hardware.rig.rig_file import RigConfig, RigJoint

PULSES = 4096 / (2 * math.pi)


def simulated(found, volts, loads, q, seconds):
    """The shaft, rad, after each interval of `seconds` under a voltage and a load, N·m against positive turning."""
    v, h, shaft = 0.0, 2e-5, []
    for voltage, load in zip(volts, loads, strict=True):
        for _ in range(round(seconds / h)):
            motor = found.torque_constant * (voltage - found.torque_constant * v) / found.resistance
            external = -load
            still = math.exp(-(abs(v / found.slow) ** found.alpha))
            friction = found.base + abs(found.external * external - found.motor * motor) + found.viscous * abs(v)
            friction += still * (
                found.stribeck + abs(found.external_stribeck * external - found.motor_stribeck * motor)
            )
            if motor * external < 0:
                friction += still * (
                    found.external_quad * external**2 if abs(external) < abs(motor) else found.motor_quad * motor**2
                )
            pushed = v + h * (motor + external) / found.armature
            v = math.copysign(max(0.0, abs(pushed) - h * friction / found.armature), pushed)
            q += h * v
        shaft.append(q)
    return np.array(shaft)


def driven(model, volts, loads, seconds):
    """The same by the emulator's motor, in PWM mode."""
    motor = motor_of(model)
    drive = MotorDrive(motor, 4096, np.zeros(1))
    drive.on[:], drive.mode[:], drive.most_pwm[:] = True, 16, motor.full_pwm
    drive.plan()
    shaft = []
    for voltage, load in zip(volts, loads, strict=True):
        drive.goal_pwm[:], drive.load[:] = voltage / motor.voltage * motor.full_pwm, load / motor.stall_torque
        drive.advance(seconds)
        shaft.append(drive.shaft[0] / PULSES)
    return np.array(shaft)


@pytest.mark.parametrize("model", ["XL330-M288", "MX-64", "MX-106"])
def test_it_turns_as_its_equations_say(model):
    found, motor = IDENTIFIED[model], motor_of(model)
    rng = np.random.default_rng(7)
    volts = motor.voltage * found.duty * rng.uniform(-1, 1, 12)
    loads = motor.stall_torque * rng.uniform(-0.2, 0.2, 12)
    expected = simulated(found, volts, loads, 0.0, 0.15)
    assert np.ptp(expected) > 1.0
    assert driven(model, volts, loads, 0.15) == pytest.approx(expected, abs=0.02 * np.ptp(expected))


@pytest.mark.parametrize("model", IDENTIFIED)
def test_it_is_about_as_strong_and_fast_as_its_maker_says(model):
    motor, maker = motor_of(model), makers_motor(model)
    fastest = driven(model, [motor.voltage] * 2, [0.0] * 2, 0.5)
    assert (fastest[1] - fastest[0]) / 0.5 / (2 * math.pi) * 60 == pytest.approx(maker.no_load_speed, rel=0.12)
    assert motor.stall_torque == pytest.approx(maker.stall_torque, rel=0.6)  # before friction


def test_its_position_loop_rests_in_the_dead_zone_of_its_friction_and_costs_nothing_there():
    joint = RigJoint("a", 1, "MX-64", 1, 2048, -1.0, 1.0, 4.0)
    bus = EmulatedBus(RigConfig("emulated", 1_000_000, 100.0, (joint,)))
    servo, drive = bus.devices[0], bus.devices[0].bank.drive
    servo.write(servo.bank.table["torque_enable"].address, b"\1")
    servo.write(servo.bank.table["goal_position"].address, (2500).to_bytes(4, "little"))
    bus.feed(0.0)
    bus.advance(2.0)
    shaft = float(drive.shaft[0])
    assert 1.0 < 2500 - shaft < 6.0
    drive._run = None  # nothing is computed while friction holds it
    bus.advance(4.0)
    assert (float(drive.shaft[0]), float(drive.speed[0])) == (shaft, 0.0)


def test_without_torque_friction_holds_a_small_load_and_not_a_large_one():
    drive = MotorDrive(motor_of("XL330-M288"), 4096, np.zeros(2))
    drive.load[:] = [0.01, 0.1]
    drive.advance(0.5)
    assert drive.shaft[0] == 0.0
    assert drive.shaft[1] < -50.0


def test_a_model_that_was_not_identified_keeps_its_makers_figures():
    assert motor_of("XM430-W350") == makers_motor("XM430-W350")
    assert motor_of("XM430-W350").friction is None


def test_the_emulator_says_where_its_motors_come_from():
    said = motors_said(["XM430-W350", "MX-64", "MX-64"])
    assert said == "motors: MX-64 as identified on real servos; XM430-W350 by the maker's figures, without friction"
