"""Friction of a geared motor: Coulomb and viscous, with the Stribeck effect and the load on the gears (BAM, model M6).

Duclusaud, Passault et al., "Extended friction models for the physics simulation of servo actuators" (2024), with motor
torque m, external torque e and speed v; s is 1 at rest and 0 in motion:

    s  = exp(-|v / slow| ^ alpha)
    f  = base + |external e - motor m| + viscous |v|
         + s (stribeck + |external_stribeck e - motor_stribeck m|)
         + s quad,  if m and e point to different sides: external_quad e^2 if |e| < |m|, motor_quad m^2 if |e| > |m|

Torques are parts of the stall torque and speeds of the no-load speed. Friction brings a motor to rest, never beyond.
"""

from dataclasses import astuple, replace

import numpy as np
from numpy.typing import NDArray

from hardware.families.facts import IdentifiedMotor

Array = NDArray[np.float64]


class Friction(IdentifiedMotor):
    """The friction of a motor, torques in parts of its stall torque and speeds in parts of its no-load speed."""

    @property
    def dead(self) -> float:
        """The torque below which a motor without a load stays at rest, as a part of the stall torque."""
        return (self.base + self.stribeck) / (1.0 - self.motor - self.motor_stribeck)

    def most(self, motor: Array, external: Array, speed: Array) -> Array:
        """The most that friction takes, as a part of the stall torque, shape (n,)."""
        s = np.exp(-np.power(np.abs(speed) / self.slow, self.alpha))
        m, e = np.abs(motor), np.abs(external)
        quad = np.where(e < m, self.external_quad * e * e, self.motor_quad * m * m * (e > m))
        still = self.stribeck + np.abs(self.external_stribeck * external - self.motor_stribeck * motor)
        moving = self.base + np.abs(self.external * external - self.motor * motor) + self.viscous * np.abs(speed)
        return moving + s * (still + quad * (np.sign(motor) != np.sign(external)))


def friction_of(motor: IdentifiedMotor, voltage: float) -> Friction:
    """The friction of a motor whose stall torque and no-load speed hold at this voltage."""
    torque, speed = motor.torque_constant * voltage / motor.resistance, voltage / motor.torque_constant
    scaled = replace(
        motor,
        base=motor.base / torque,
        stribeck=motor.stribeck / torque,
        motor_quad=motor.motor_quad * torque,
        external_quad=motor.external_quad * torque,
        slow=motor.slow / speed,
        viscous=motor.viscous * speed / torque,
    )
    return Friction(*astuple(scaled))
