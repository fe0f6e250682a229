"""What weighs on the joints of a fault schedule, and what they may take: loads, limits of current, own gains, poses.

And what they are: some have two servos, go through several turns of their horns, or grip.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.rig.jams import PAGES
from hardware.emulator.faults import Fault
from hardware.emulator.servos.device import Device
from hardware.emulator.servos.drive import Motor, motor_of
from hardware.rig.rig_joint import EXTENDED_MODE, RigJoint, SecondServo
from hardware.rig.scale import Array

_WITH_FEETECH = 0.2  # part of the schedules that have a port with Feetech servos alone
_HEAVIEST = 0.2  # of the stall torque
_LEAST_CURRENT, _MOST_CURRENT = 0.6, 0.8  # of the stall current
_LEAST_SMALL, _MOST_SMALL = 0.15, 0.4  # of the stall current, for a small limit of it
_TAKES = 0.5  # of a small limit: what weight and friction may take together, so that nothing yields to them
_WITH_SECOND, _WITH_TURNS, _WITH_GRIP, _WITH_SMALL = 0.12, 0.3, 0.84, 0.2  # of joints; see `_actuator`
_SECOND = 10  # above the ID of a joint's first servo is that of its second
_LIKE = {
    "XM430-W350": ("XM540-W270", "XH430-V350", "MX-106", "XD430-T210", "XW430-T333"),
    "XL330-M288": ("XC330-M288", "XL330-M077"),
    "XL430-W250": ("XC430-W150", "2XL430-W250"),
    "XC330-T288": ("XC330-T181",),
}
"""By model those that a schedule may have in its place."""
GAINS = ("position_p_gain", "position_i_gain", "position_d_gain")


@dataclass
class Burdens:
    """Of J joints.

    Attributes:
        weight: of an arm that hangs on each horn, in parts of the stall torque, shape (J,); 0 for none.
        hanging: where that arm hangs down, shape (J,), rad.
        poses: joints whose target stands still, shape (J,).
        gains_left: joints whose servos another program has left with a lower gain, shape (J,).
        servos: that turn each joint, shape (J,).
    """

    weight: Array
    hanging: Array
    poses: NDArray[np.bool_]
    gains_left: NDArray[np.bool_]
    servos: NDArray[np.int64]

    def of(self, places: NDArray[np.int64]) -> Burdens:
        """Those of some joints, by index."""
        own = (self.weight, self.hanging, self.poses, self.gains_left, self.servos)
        return Burdens(*(values[places] for values in own))

    def press(self, devices: list[Device], angles: Array, per_radian: Array) -> None:
        """Puts the weights on the horns of J servos whose joints stand at these angles, rad; two share one weight."""
        loads = self.weight / self.servos * np.sin(angles - self.hanging) * np.sign(per_radian)
        for device, load in zip(devices, loads.tolist(), strict=True):
            device.bank.drive.load[device.row] = load


def actuated(seed: int, joints: tuple[RigJoint, ...]) -> tuple[RigJoint, ...]:
    """These joints, some of which have two servos, go through several turns, grip, or have a small limit of current."""
    rng = random.Random(f"actuators of {seed}")
    return tuple(_actuator(rng, joint) for joint in joints)


def _actuator(rng: random.Random, joint: RigJoint) -> RigJoint:
    kind, small = rng.random(), rng.random() < _WITH_SMALL
    page, settings = PAGES.get(joint.model), dict[str, object]()
    if kind < _WITH_SECOND:
        off = round(rng.uniform(-0.05, 0.05) * joint.table.pulses_per_turn)
        settings["second"] = SecondServo(joint.id + _SECOND, rng.choice((-1, 1)), joint.zero + off)
    elif kind < _WITH_TURNS and EXTENDED_MODE in joint.modes:
        gear = rng.choice((1.0, 3.0))
        settings |= {"lower": -rng.uniform(3.6, 5.5) / gear, "upper": rng.uniform(3.6, 5.5) / gear, "gear": gear}
        settings["velocity"] = joint.velocity if gear == 1.0 else min(joint.velocity, 0.8)
    elif kind > _WITH_GRIP and page is not None:
        settings["grip"] = small = True
    if small and page is not None:
        motor = motor_of(joint.model)
        least = _friction(joint) * motor.stall_current * 1e-3 / (0.8 * _TAKES)
        settings["current"] = max(rng.uniform(_LEAST_SMALL, _MOST_SMALL) * page.stall, least)
        # A shaft that its current cannot get up to speed as quickly as its path would swing past it.
        settings["acceleration"] = joint.acceleration or 20.0
    return msgspec.structs.replace(joint, **settings)


def has_small_limit(joint: RigJoint) -> bool:
    """Whether a joint that is no gripper may draw much less than its motor at stall."""
    return bool(joint.current and not joint.grip and joint.current < 1.1 * _MOST_SMALL * PAGES[joint.model].stall)


def _friction(joint: RigJoint) -> float:
    """What friction takes of the motor's stall torque, at rest and at the joint's speed, without a weight."""
    return _taken(joint, dead_torque(motor_of(joint.model)), 0.0)


def dead_torque(motor: Motor) -> float:
    """The torque below which a motor without a load stays at rest, as a part of the stall torque."""
    one = motor.friction
    return 0.0 if one is None else (one.base + one.stribeck) / (1.0 - one.motor - one.motor_stribeck)


def _taken(joint: RigJoint, torque: float, weight: float) -> float:
    """What friction takes of a torque that lifts a weight, all in parts of the stall torque: at rest or in motion."""
    motor = motor_of(joint.model)
    if motor.friction is None:
        return 0.0
    fastest = motor.no_load_speed / 60.0 * 2.0 * np.pi
    speeds = np.array([0.0, joint.velocity * joint.gear / fastest])
    return float(motor.friction.most(np.full(2, torque), np.full(2, -weight), speeds).max())


def _bearable(joint: RigJoint, weight: float) -> float:
    """The weight that a joint can hold and lift: none on one that grips, or may be turned by it into another turn."""
    if joint.grip or joint.several_turns:
        return 0.0
    if not joint.current or weight == 0.0:
        return weight
    torque = _TAKES * joint.current / (motor_of(joint.model).stall_current * 1e-3)
    # Gears rub the harder the more torque goes through them: a weight takes more than it weighs.
    return min(weight, max(0.0, torque - _taken(joint, torque, weight)))


def burdened(
    seed: int, joints: tuple[RigJoint, ...], until: float
) -> tuple[tuple[RigJoint, ...], Burdens, list[Fault]]:
    """The joints of a schedule with the limits and gains that this seed gives them, their burdens, and more faults.

    The faults, which end by the time `until`, s, are those that burdens are about: a joint with a limit of current is
    jammed, and another servo restarts while a joint holds its weight.
    """
    rng = random.Random(f"burdens of {seed}")
    port = rng.choice(joints).port if rng.random() < _WITH_FEETECH else None
    joints = tuple(_feetech(joint) if joint.port == port else _with_settings(rng, joint) for joint in joints)
    joints = actuated(seed, joints)
    weight = np.array([_bearable(joint, rng.choice((0.0, rng.uniform(0.05, _HEAVIEST)))) for joint in joints])
    hanging = np.array([rng.uniform(0.6 * joint.lower, 0.6 * joint.upper) for joint in joints])
    poses = np.array([rng.random() < 0.35 and not joint.grip for joint in joints])
    left = np.array([rng.random() < 0.3 and not joint.gains for joint in joints])
    faults = [
        Fault("jam", joint.id, rng.uniform(1.0, until - 1.0), rng.uniform(0.2, 0.8))
        for joint in joints
        if joint.current and rng.random() < 0.6 and not joint.grip
    ]
    for holder in np.flatnonzero(poses & (weight > 0.0)).tolist():
        others = [joint.id for joint in joints if joint.port == joints[holder].port and joint is not joints[holder]]
        if others:
            faults.append(Fault("reboot", rng.choice(others), rng.uniform(3.0, until - 1.0), 0.1))
    what_is_gripped = random.Random(f"grips of {seed}")
    for joint in joints:
        if joint.grip:
            at, lasts = what_is_gripped.uniform(1.0, until - 2.5), what_is_gripped.uniform(1.0, 2.5)
            faults.append(Fault("jam", joint.id, at, lasts))
            others = [other.id for other in joints if other.port == joint.port and other is not joint]
            if others and what_is_gripped.random() < 0.5:
                faults.append(Fault("reboot", what_is_gripped.choice(others), at + 0.6 * lasts, 0.1))
    servos = np.array([len(joint.servos) for joint in joints])
    return joints, Burdens(weight, hanging, poses, left, servos), faults


def _feetech(joint: RigJoint) -> RigJoint:
    """The same joint with a servo of this family, around the middle of its turn."""
    return msgspec.structs.replace(joint, model="STS3215", zero=2048)


def leave_gains(joint: RigJoint, device: Device) -> None:
    """Lowers a servo's gain as another program would have; compliance slopes stay."""
    if "position_p_gain" in joint.table.registers:
        device["position_p_gain"] = round(0.8 * device["position_p_gain"])


def _with_settings(rng: random.Random, joint: RigJoint) -> RigJoint:
    model = rng.choice((joint.model, *_LIKE.get(joint.model, ())))
    settings: dict[str, object] = {"model": model}
    if model in PAGES and rng.random() < 0.6:
        settings["current"] = rng.uniform(_LEAST_CURRENT, _MOST_CURRENT) * PAGES[model].stall
    like = msgspec.structs.replace(joint, model=model)
    if rng.random() < 0.25 and EXTENDED_MODE in like.modes:
        settings["zero"] = like.table.one_turn[rng.choice((0, 1))] + rng.randint(-300, 300)
    if rng.random() < 0.25 and (gain := like.table.registers.get("position_p_gain")) is not None and gain.default:
        settings["position_p_gain"] = round(rng.uniform(0.8, 1.1) * gain.default)
    return msgspec.structs.replace(joint, **settings)
