"""Motors that others have identified on real servos: their parameters as published, one row a servo.

Most are of model M6 of BAM (Better Actuator Models, github.com/Rhoban/bam, files `m6` of `bam/params`; Duclusaud,
Passault et al. 2024), fitted to pendulums of several masses and lengths at several gains; rounded to four digits. The
share of its supply that a servo uses at most was measured there with an oscilloscope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class IdentifiedMotor:
    """A geared direct-current motor, seen from the horn.

    Attributes:
        torque_constant: N·m/A, or V/(rad/s).
        resistance: ohm.
        armature: inertia of rotor and gears, kg m^2.
        duty: the most of its supply that the servo gives to the motor, as a part.
        base, stribeck: friction in motion, and more of it at rest, N·m.
        motor, external: more friction for each N·m of the motor, and of the load.
        motor_stribeck, external_stribeck: the same at rest.
        motor_quad, external_quad: the same for the square of the torque, 1/(N·m).
        slow, alpha: at which speed (rad/s), and how abruptly, the part at rest ends.
        viscous: N·m/(rad/s).
    """

    torque_constant: float
    resistance: float
    armature: float
    duty: float
    base: float
    stribeck: float
    motor: float
    external: float
    motor_stribeck: float
    external_stribeck: float
    motor_quad: float
    external_quad: float
    slow: float
    alpha: float
    viscous: float


def parse_motors(rows: str) -> Mapping[str, IdentifiedMotor]:
    """The motors of a table by model name: a row each, with the attributes in their order; # begins a comment."""
    lines = [row for line in rows.splitlines() if (row := line.partition("#")[0].split())]
    return {model: IdentifiedMotor(*map(float, figures)) for model, *figures in lines}
