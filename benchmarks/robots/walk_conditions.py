"""Walk conditions: ground, servos and sensors that differ from a robot's files."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import msgspec
import mujoco
import numpy as np

from motiondeck_base.errors import MotiondeckError
from sim.models.gravity import GRAVITY
from sim.models.servo_motor import ServoMotor
from sim.physics.physics_model import FLOOR_BIT, Alteration
from sim.physics.walking.state_estimate import Sensors
from sim.robots.robot import Robot

# Raised strips of the floor: height, width and length, m, and their number.
STRIP, WIDE, LONG, COUNT = 0.005, 0.25, 40.0, 40


@dataclass(frozen=True)
class Condition:
    """A difference from the robot's files.

    Attributes:
        alter: changes to the world and the body that the controller does not know.
        servo: changes to the servos, if any.
        sensors: None for the exact state.
    """

    alter: Alteration | None = None
    servo: Callable[[ServoMotor], ServoMotor] | None = None
    sensors: Sensors | None = None

    def applied(self, robot: Robot) -> Robot:
        """The robot with these servos; MotiondeckError if its file has no data of servos."""
        if self.servo is None:
            return robot
        if robot.servo is None:
            raise MotiondeckError(
                f"robot '{robot.name}' has no table [servo] in its file: other servos would change nothing"
            )
        return replace(robot, servo=self.servo(robot.servo))


def _slope(spec: mujoco.MjSpec) -> None:
    """The floor rises by 3 degrees along y: seen from the floor, gravity leans."""
    angle = np.radians(3.0)
    spec.option.gravity = GRAVITY * np.array([0.0, -np.sin(angle), -np.cos(angle)])


def _steps(spec: mujoco.MjSpec) -> None:
    for across in (False, True):
        for number in range(COUNT):
            # Where the robot starts, there is none.
            place, size = [(2 * number + 1 - COUNT) * WIDE, 0.0], [0.5 * WIDE, 0.5 * LONG]
            spec.worldbody.add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX,
                pos=[*(place[::-1] if across else place), 0.0],
                size=[*(size[::-1] if across else size), STRIP],
                contype=FLOOR_BIT,
                conaffinity=0,
            )


def _slippery(spec: mujoco.MjSpec) -> None:
    for geom in spec.geoms:
        geom.friction = (0.4, *geom.friction[1:])


def _loaded(spec: mujoco.MjSpec) -> None:
    root = next(body for body in spec.worldbody.bodies if body.joints)
    model = spec.copy().compile()
    height = 0.3 * float(model.body(root.name).pos[2])
    mass = 0.1 * float(model.body(root.name).subtreemass[0])
    # A separate body: one with a given inertia ignores the mass of another geom.
    root.add_body(pos=[0, 0, height]).add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.02, 0, 0], mass=mass, contype=0, conaffinity=0
    )


AS_MODELLED = "as modelled"
CONDITIONS: dict[str, Condition] = {
    AS_MODELLED: Condition(),
    "slope 3 deg": Condition(alter=_slope),
    "steps 5 mm": Condition(alter=_steps),
    "friction 0.4": Condition(alter=_slippery),
    "payload 10 %": Condition(alter=_loaded),
    "servos 20 % weaker": Condition(servo=lambda servo: msgspec.structs.replace(servo, torque=0.8 * servo.torque)),
    "backlash 1 deg": Condition(servo=lambda servo: msgspec.structs.replace(servo, backlash=float(np.radians(1.0)))),
    "bus 20 ms": Condition(servo=lambda servo: msgspec.structs.replace(servo, latency=0.02)),
    "sensors 0 ms": Condition(sensors=Sensors(delay=0.0)),
    "sensors 10 ms": Condition(sensors=Sensors(delay=0.01)),
    "sensors 20 ms": Condition(sensors=Sensors(delay=0.02)),
}
