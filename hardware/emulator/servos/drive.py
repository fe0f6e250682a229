"""The motors of a bank: from settings and goals to the turning of the horns, for all servos at once.

In steps of at most 2 ms, with e = path - shaft:

    path     position modes (3, 4, 5): trapezoidal profile to the target, within top speed and acceleration
             velocity mode (1): the goal speed, within the acceleration
    u        position   P e + I sum(e) + D de/dt + FF path speed
             velocity   what holds the path's speed, and its error once more
             current    what the goal current needs at this speed     PWM (16): the goal itself
             in mode 5 (or `current_limited`) so that the current after the step is within +- goal current
             and never beyond +- goal PWM
    settled  = u / full_pwm * no_load_speed * supply / nominal - load * no_load_speed
    speed   += (settled - speed) * (1 - exp(-dt / lag))
    friction where the motor was identified (see `Friction`): it brings the speed towards 0, never beyond
    shaft   += speed * dt
    current  = u / full_pwm * supply / nominal - speed / no_load_speed    of the stall current
    temperature  += (warming * current^2 - (temperature - room) / cooling) * dt

An identified motor also closes its loop over whole pulses. Velocity gains and the second feed-forward gain have no
effect; warming and cooling are estimates, and lag where no motor was identified.
"""

import math
from collections.abc import Iterable
from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hardware.families.facts import IdentifiedMotor
from hardware.families.models import IDENTIFIED, TRAITS

CURRENT, VELOCITY, PWM = 0, 1, 16
POSITION_MODES = (3, 4, 5)
_LONGEST_STEP = 0.002
_LEAST_SUPPLY = 0.01  # of the nominal voltage: below, a servo is off
_ROOM = 25.0
_WARM = 32.0  # degC, a servo that has been on for a while

_GEARS = 0.7  # share of an ideal motor's torque that is left behind the gears; an estimate

Array = NDArray[np.float64]


class Friction(IdentifiedMotor):
    """The friction of a motor: Coulomb and viscous, with the Stribeck effect and the load on the gears (BAM, model M6).

    Duclusaud, Passault et al., "Extended friction models for the physics simulation of servo actuators" (2024), with
    motor torque m, external torque e and speed v; s is 1 at rest and 0 in motion:

        s  = exp(-|v / slow| ^ alpha)
        f  = base + |external e - motor m| + viscous |v|
             + s (stribeck + |external_stribeck e - motor_stribeck m|)
             + s quad,  if m and e point to different sides: external_quad e^2 if |e| < |m|, motor_quad m^2 if |e| > |m|

    Torques are parts of the stall torque, speeds of the no-load speed. Friction brings a motor to rest, never beyond.
    """

    def most(self, motor: Array, external: Array, speed: Array) -> Array:
        """The most that friction takes, as a part of the stall torque, shape (n,)."""
        s = np.exp(-np.power(np.abs(speed) / self.slow, self.alpha))
        m, e = np.abs(motor), np.abs(external)
        quad = np.where(e < m, self.external_quad * e * e, self.motor_quad * m * m * (e > m))
        still = self.stribeck + np.abs(self.external_stribeck * external - self.motor_stribeck * motor)
        moving = self.base + np.abs(self.external * external - self.motor * motor) + self.viscous * np.abs(speed)
        return moving + s * (still + quad * (np.sign(motor) != np.sign(external)))


@dataclass(frozen=True, slots=True)
class Motor:
    """A geared direct-current motor."""

    no_load_speed: float  # of the horn at full voltage, rev/min
    stall_current: float  # mA
    voltage: float = 12.0  # at which these hold, V
    full_pwm: float = 885.0  # the PWM count that means full voltage
    specified_torque: float = 0.0  # the stall torque that the maker specifies, N·m; 0 for none
    lag: float = 0.015  # time constant with which the speed follows the voltage, s; an estimate without a load
    current_limited: tuple[int, ...] = (5,)  # the modes in which the goal current limits the current
    warming: float = 1.5  # how fast the stall current heats it, K/s; an estimate, as the next
    cooling: float = 240.0  # time constant with which it cools to the temperature of the room, s
    duty: float = 1.0  # the most of its supply that the servo gives to the motor, as a part
    friction: Friction | None = None  # as identified on a real servo; None for the maker's motor, which has none

    @property
    def stall_torque(self) -> float:
        """Of the horn at full voltage, N·m; unless specified, stall power over no-load speed, less the gears' part."""
        power = self.voltage * self.stall_current * 1e-3
        return self.specified_torque or _GEARS * power / (self.no_load_speed * 2.0 * math.pi / 60.0)


def makers_motor(model: str) -> Motor:
    """The motor of a model that can be a joint of a rig, by the maker's figures; it is in no control table."""
    traits = TRAITS[model]
    stall, volts, full = traits.stall_current * 1e3, traits.voltage, traits.series.full_pwm
    limited = traits.series.current_limited
    return Motor(traits.no_load_speed, stall, volts, full, traits.stall_torque, current_limited=limited)


def motor_of(model: str) -> Motor:
    """The motor of a model as identified on a real servo, or as the maker describes it."""
    motor, found = makers_motor(model), IDENTIFIED.get(model)
    if found is None:
        return motor
    stall = motor.voltage / found.resistance  # A
    torque, speed = found.torque_constant * stall, motor.voltage / found.torque_constant
    scaled = replace(
        found,
        base=found.base / torque,
        stribeck=found.stribeck / torque,
        motor_quad=found.motor_quad * torque,
        external_quad=found.external_quad * torque,
        slow=found.slow / speed,
        viscous=found.viscous * speed / torque,
    )
    return replace(
        motor,
        no_load_speed=speed * 60.0 / (2.0 * math.pi),
        stall_current=stall * 1e3,
        specified_torque=torque,
        lag=found.armature * found.resistance / found.torque_constant**2,
        duty=found.duty,
        friction=Friction(*astuple(scaled)),
    )


def motors_said(models: Iterable[str]) -> str:
    """Which of these models have motors that were identified on real servos, and which those of the maker's figures."""
    known = dict.fromkeys(models)
    found, makers = ([model for model in known if (model in IDENTIFIED) == one] for one in (True, False))
    parts = [f"{', '.join(found)} as identified on real servos"] * bool(found)
    parts += [f"{', '.join(makers)} by the maker's figures, without friction"] * bool(makers)
    return f"motors: {'; '.join(parts)}"


class MotorDrive:
    """n motors; every array has the shape (n,), in pulses and seconds, currents as parts of the stall current.

    Settings, which `ServoBank.settle` copies from the registers: mode, sign, offset, on, p_gain, i_gain,
    d_gain, ff_gain, most_pwm, goal_pwm, goal_speed, goal_current; and by `pursue`: target, top_speed, acceleration.
    """

    def __init__(self, motor: Motor, pulses_per_turn: int, shaft: Array) -> None:
        count = len(shaft)
        self._pulses_per_turn = pulses_per_turn
        self.use(motor)
        self.shaft = shaft  # of each horn
        self.speed = np.zeros(count)  # of each horn
        self.forgotten = np.zeros(count)  # the whole turns of each that its servo no longer counts
        # Pairs of motors on one shaft, and whether they turn the same way (1) or not (-1), shape (3, pairs).
        self.joined = np.zeros((3, 0), dtype=np.int64)
        self.path = shaft.copy()  # where the profile has led so far, and how fast it leads there
        self.path_speed = np.zeros(count)
        self.target = shaft.copy()
        self.top_speed = np.full(count, math.inf)
        self.acceleration = np.full(count, math.inf)
        self.load = np.zeros(count)  # torque against the horn's positive direction, as a part of the stall torque
        self.jammed = np.zeros(count, dtype=bool)
        self.supply = np.full(count, motor.voltage)  # V
        self.temperature = np.full(count, _WARM)  # degC
        self.pwm = np.zeros(count)  # at the end of the last step
        self.current = np.zeros(count)  # at the end of the last step
        self.mode = np.full(count, 3)
        self.sign = np.ones(count)
        self.offset = np.zeros(count)
        self.on = np.zeros(count, dtype=bool)
        self.p_gain, self.i_gain, self.d_gain, self.ff_gain = (np.zeros(count) for _ in range(4))
        self.most_pwm, self.goal_pwm, self.goal_speed, self.goal_current = (np.zeros(count) for _ in range(4))
        self._sum = np.zeros(count)
        self.coupled = False  # whether a plant moves the horns by this motor; friction is then the joints' own
        self.plan()

    def use(self, motor: Motor) -> None:
        """Turns the horns with this motor from now on."""
        self.motor, self._no_load = motor, motor.no_load_speed / 60.0 * self._pulses_per_turn

    def plan(self) -> None:
        """Updates which terms of the law are needed, after a setting has changed."""
        self._positional = (self.mode >= 3) & (self.mode <= 5)
        self._all_positional = bool(self._positional.all())
        self._extra_gains = bool((self.i_gain + self.d_gain + self.ff_gain).any())
        self._current_based = np.isin(self.mode, self.motor.current_limited) & self.on
        self.pwm = self.pwm * self.on
        self.current = self.current * self.on

    def halt(self, row: int) -> None:
        """Makes one motor stay where it comes to rest."""
        self.path[row] = self.target[row] = self.shaft[row] + self.speed[row] * self.motor.lag
        self.path_speed[row] = 0.0
        self._sum[row] = 0.0

    def advance(self, seconds: float) -> None:
        """Advances them by `seconds`."""
        if self.coupled or not self._at_rest():
            steps = math.ceil(seconds / _LONGEST_STEP)
            self._run(steps, seconds / steps)
        warmer = self.motor.warming * np.square(self.current) - (self.temperature - _ROOM) / self.motor.cooling
        self.temperature += warmer * seconds

    def torque(self, row: int) -> float:
        """The present torque of a motor at its horn, N·m; 0 without power."""
        if not self.on[row]:
            return 0.0
        given = self.pwm[row] / self.motor.full_pwm * self.supply[row] / self.motor.voltage
        return self.motor.stall_torque * float(given - self.speed[row] / self._no_load - self.load[row])

    def _at_rest(self) -> bool:
        """Whether advancing would change nothing observable."""
        unsettled = (np.abs(self.target - self.shaft) > 0.05) | ~self._positional
        moved = (unsettled & self.on) | (np.abs(self.speed) > 0.05) | (self.load != 0.0)
        if self.motor.friction is not None and moved.any():
            moved &= ~self._stuck(self.motor.friction)
        return not moved.any()

    def _stuck(self, friction: Friction) -> NDArray[np.bool_]:
        """Which motors friction holds still for as long as nothing changes."""
        most = np.minimum(self.most_pwm, self.motor.duty * self.motor.full_pwm) * self.on
        drive = _within(self.p_gain * (self.path - np.rint(self.shaft)), -most, most)
        torque = drive / self.motor.full_pwm * (self.supply / self.motor.voltage)
        held = np.abs(torque - self.load) <= friction.most(torque, -self.load, self.speed)
        arrived = (np.abs(self.target - self.path) <= 0.05) & self._positional & (self.i_gain == 0.0)
        return held & (self.speed == 0.0) & (arrived | ~self.on)

    def _run(self, steps: int, dt: float) -> None:
        full, no_load = self.motor.full_pwm, self._no_load
        powered = np.maximum(self.supply / self.motor.voltage, _LEAST_SUPPLY)
        speed_per_pwm = no_load / full * powered
        approach = -math.expm1(-dt / self.motor.lag)
        friction = self.motor.friction
        on, most = self.on, np.minimum(self.most_pwm, self.motor.duty * full) * self.on
        self.path = np.where(on, self.path, self.shaft)
        self.path_speed = np.where(on, self.path_speed, 0.0)
        target = np.where(on, self.target, self.shaft)
        sag = self.load * no_load if self.load.any() else None
        jammed = self.jammed if self.jammed.any() else None
        limited = self._current_based if self._current_based.any() else None
        one, other, same = self.joined
        stiff_shaft = self.jammed.copy()
        stiff_shaft[self.joined[:2]] = True
        free = np.where(stiff_shaft, 0.0, 0.0 if self.coupled else approach)  # how far speed follows voltage in a step
        stiff = (1.0 - free) * powered
        most_current = np.abs(self.goal_current)
        change = self.acceleration * dt
        twice_slower = 2.0 / self.acceleration
        most_sum = full / np.maximum(self.i_gain, 1.0)  # which asks for full voltage, or less
        drive = self.pwm
        for _ in range(steps):
            left = target - self.path
            distance = np.abs(left)
            # From this speed, braking in steps of dt ends at the goal; it is sqrt(2 a d) for small dt.
            braking = 2.0 * distance / (np.sqrt(0.25 * dt * dt + twice_slower * distance) + 0.5 * dt)
            wanted = np.copysign(np.minimum(np.minimum(self.top_speed, braking), distance / dt), left)
            if not self._all_positional:
                wanted = np.where(self._positional, wanted, self.goal_speed * on)
            self.path_speed += _within(wanted - self.path_speed, -change, change)
            self.path += self.path_speed * dt
            error = self.path - (self.shaft if friction is None else np.rint(self.shaft))
            drive = self.p_gain * error
            if self._extra_gains:
                self._sum = _within(self._sum + error * dt, -most_sum, most_sum) * on
                drive += self.i_gain * self._sum
                drive += self.d_gain * (self.path_speed - self.speed) + self.ff_gain * self.path_speed
            if not self._all_positional:
                drive = self._other_modes(drive, powered)
            if limited is not None:
                back = np.where(self.jammed, 0.0, (1.0 - free) * self.speed / no_load) - free * self.load
                low, high = ((back + top) / stiff * full for top in (-most_current, most_current))
                drive = np.where(limited, _within(drive, low, high), drive)
            drive = _within(drive, -most, most)
            if self.coupled:
                continue
            settled = drive * speed_per_pwm
            if sag is not None:
                settled = settled - sag
            before = self.speed
            self.speed = before + (settled - before) * approach
            if friction is not None:
                torque = drive * speed_per_pwm / no_load - before / no_load
                braked = friction.most(torque, -self.load, before / no_load) * (no_load * approach)
                self.speed -= np.copysign(np.minimum(braked, np.abs(self.speed)), self.speed)
            if jammed is not None:
                self.speed[jammed] = 0.0
            if len(one):
                self.speed[one] = 0.5 * (self.speed[one] + same * self.speed[other])
                self.speed[other] = same * self.speed[one]
            if limited is not None and friction is not None:
                back = self.speed / no_load
                low, high = ((back + top) / powered * full for top in (-most_current, most_current))
                drive = np.where(limited, _within(drive, low, high), drive)
            self.shaft += self.speed * dt
        self.pwm = drive
        self.current = (drive / full * powered - self.speed / no_load) * on
        if not self._all_positional:
            # A motor without a target is always where it should be.
            elsewhere = ~self._positional
            self.path[elsewhere] = self.target[elsewhere] = self.shaft[elsewhere]

    def _other_modes(self, drive: Array, powered: Array) -> Array:
        """The drive with that of velocity, current and PWM mode in its place where a motor is in one."""
        full, no_load = self.motor.full_pwm, self._no_load
        velocity = (2.0 * self.path_speed - self.speed) * full / no_load
        current = (self.goal_current + self.speed / no_load) * full / powered
        return np.select(
            [self.mode == VELOCITY, self.mode == CURRENT, self.mode == PWM], [velocity, current, self.goal_pwm], drive
        )


def _within(values: Array, lower: Array | float, upper: Array | float) -> Array:
    """The values between two limits; `np.clip` takes three times as long for a few servos."""
    return np.minimum(np.maximum(values, lower), upper)
