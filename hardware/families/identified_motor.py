"""Motors that others have identified on real servos: their parameters as published, one row a servo.

Most are of model M6 of BAM (Better Actuator Models, github.com/Rhoban/bam, files `m6` of `bam/params`; Duclusaud,
Passault et al. 2024), fitted to pendulums of several masses and lengths at several gains; rounded to four digits. The
share of its supply that a servo uses at most was measured there with an oscilloscope.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from hardware.families.rows import rows_of


@dataclass(frozen=True, slots=True)
class IdentifiedMotor:
    """A geared direct-current motor, seen from the horn."""

    torque_constant: float  # N·m/A, or V/(rad/s)
    resistance: float  # ohm
    armature: float  # inertia of rotor and gears, kg m^2
    duty: float  # the most of its supply that the servo gives to the motor, as a part
    base: float  # friction in motion, N·m
    stribeck: float  # more of it at rest, N·m
    motor: float  # more for each N·m of the motor
    external: float  # more for each N·m of the load
    motor_stribeck: float  # both again at rest
    external_stribeck: float
    motor_quad: float  # at rest, for the square of the torque, 1/(N·m)
    external_quad: float
    slow: float  # speed at which the part at rest ends, rad/s
    alpha: float  # how abruptly
    viscous: float  # N·m/(rad/s)


def parse_motors(text: str) -> Mapping[str, IdentifiedMotor]:
    """The motors of a table by model name: a row each, with the attributes in their order; # begins a comment."""
    return {model: IdentifiedMotor(*map(float, figures)) for model, *figures in rows_of(text)}
