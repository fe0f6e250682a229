"""What weighs on the joints of a fault schedule, and what they may take: loads, limits of current, own gains, poses."""

from __future__ import annotations

import random
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.rig.jams import PAGES
from hardware.emulator.faults import Fault
from hardware.emulator.servos.device import Device
from hardware.rig.rig_joint import EXTENDED_MODE, RigJoint
from hardware.rig.scale import Array

_WITH_FEETECH = 0.2  # part of the schedules that have a port with Feetech servos alone
_HEAVIEST = 0.2  # of the stall torque
_LEAST_CURRENT, _MOST_CURRENT = 0.6, 0.8  # of the stall current; friction needs some besides the weight
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
    """

    weight: Array
    hanging: Array
    poses: NDArray[np.bool_]
    gains_left: NDArray[np.bool_]

    def of(self, places: NDArray[np.int64]) -> Burdens:
        """Those of some joints, by index."""
        return Burdens(self.weight[places], self.hanging[places], self.poses[places], self.gains_left[places])

    def press(self, devices: list[Device], angles: Array, per_radian: Array) -> None:
        """Puts the weights on the horns of J servos whose joints stand at these angles, rad."""
        loads = self.weight * np.sin(angles - self.hanging) * np.sign(per_radian)
        for device, load in zip(devices, loads.tolist(), strict=True):
            device.bank.drive.load[device.row] = load


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
    weight = np.array([rng.choice((0.0, rng.uniform(0.05, _HEAVIEST))) for _ in joints])
    hanging = np.array([rng.uniform(0.6 * joint.lower, 0.6 * joint.upper) for joint in joints])
    poses = np.array([rng.random() < 0.35 for _ in joints])
    left = np.array([rng.random() < 0.3 and not joint.gains for joint in joints])
    faults = [
        Fault("jam", joint.id, rng.uniform(1.0, until - 1.0), rng.uniform(0.2, 0.8))
        for joint in joints
        if joint.current and rng.random() < 0.6
    ]
    for holder in np.flatnonzero(poses & (weight > 0.0)).tolist():
        others = [joint.id for joint in joints if joint.port == joints[holder].port and joint is not joints[holder]]
        if others:
            faults.append(Fault("reboot", rng.choice(others), rng.uniform(3.0, until - 1.0), 0.1))
    return joints, Burdens(weight, hanging, poses, left), faults


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
