"""Calibrating a rig by hand: where each joint's zero is, which way it turns, and how far it goes.

With torque off a servo counts its position through whole turns, so a sweep across its own zero is seen as one way; it
is refused afterwards, because with torque on only one turn is left (0 to 4095 on most models).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from hardware.bus.servo_bus import Bus
from hardware.errors import RigError
from hardware.rig.rig_file import RigConfig, RigJoint

_LEAST_NUDGE = 0.05  # rad


def calibrated(joint: RigJoint, zero: int, nudged: int, sweep: Sequence[int], margin: float = 0.02) -> RigJoint:
    """The joint as three measurements say, in pulses.

    Args:
        joint: as it was.
        zero: where it stood at angle 0.
        nudged: where it stood after it was turned in the positive direction.
        sweep: where it stood while it was moved from one end to the other.
        margin: kept away from both ends, rad.

    Raises:
        RigError: if the nudge was too small, the sweep does not pass zero, or needs more than the servo's one turn.
    """
    per_radian = abs(joint.pulses_per_radian)
    if abs(nudged - zero) < _LEAST_NUDGE * per_radian:
        raise RigError(f"{joint.name} was turned too little to tell its direction. Turn it by 5 degrees or more.")
    direction = 1 if nudged > zero else -1
    turn = joint.table.pulses_per_turn
    bottom, top = joint.table.one_turn
    whole = (zero - bottom) // turn * turn
    low, high = min(sweep) - whole, max(sweep) - whole
    zero -= whole
    if not low < zero < high:
        raise RigError(f"{joint.name} was not moved past its zero while its range was recorded. Sweep to both ends.")
    if low < bottom or high > top:
        raise RigError(
            f"{joint.name} needs positions {low} to {high}, but with torque on it has {bottom} to {top}. "
            "Take the horn off and put it back so that the joint's zero is near the middle."
        )
    ends = sorted(((low - zero) / (direction * per_radian), (high - zero) / (direction * per_radian)))
    return msgspec.structs.replace(
        joint,
        direction=direction,
        zero=zero,
        lower=round(ends[0] + margin, 3),
        upper=round(ends[1] - margin, 3),
    )


def calibrate(
    config: RigConfig, bus: Bus, ask: Callable[[str], None], sweep: Callable[[str, Callable[[], int]], list[int]]
) -> RigConfig:
    """Guides through every joint of a rig: its torque off, three measurements, and again where they cannot be used.

    Args:
        config: the rig as it was.
        bus: open.
        ask: says what to do and returns when it is done.
        sweep: says what to do and collects positions, which the function it is given reads, until it is done.

    Raises:
        ServoError: if a servo does not answer.
        SerialPortError: if the port vanishes.
    """
    joints: list[RigJoint] = []
    for joint in config.joints:
        who = f"{joint.name} (id {joint.id})"
        torque, position = joint.table["torque_enable"], joint.table["present_position"]
        ask(f"{who}: its torque goes off next, so hold it")
        bus.write(joint.id, torque.address, b"\0")

        def read(id: int = joint.id, register=position) -> int:
            return register.decode(bus.read(id, register.address, register.length).params)

        said = ""
        while True:
            ask(f"{said}{who}: put it where its angle is 0")
            zero = read()
            ask(f"{joint.name}: turn it a little in its positive direction")
            nudged = read()
            seen = sweep(f"{joint.name}: move it slowly to both ends", read)
            try:
                joints.append(calibrated(joint, zero, nudged, seen))
                break
            except RigError as error:
                said = f"{error} Once more.\n"
    return msgspec.structs.replace(config, joints=tuple(joints))


def save_rig(config: RigConfig, path: Path) -> None:
    """Writes a rig file, whole or not at all.

    Raises:
        RigError: if it cannot be written.
    """
    settings = msgspec.structs.asdict(config)
    lines = [f"{key} = {_toml(value)}" for key, value in settings.items() if key != "joints"]
    lines += ["", "# zero in pulses, lower and upper in rad, velocity in rad/s", "joints = ["]
    for joint in config.joints:
        own = {key: value for key, value in msgspec.structs.asdict(joint).items() if key != "port" or value}
        row = ", ".join(f"{key} = {_toml(value)}" for key, value in own.items())
        lines.append(f"  {{ {row} }},")
    draft = path.with_name(f".{path.name}.draft")
    try:
        draft.write_text("\n".join([*lines, "]", ""]))
        draft.replace(path)
    except OSError as error:
        raise RigError(f"cannot write the rig file {path}: {error.strerror}.") from error


def _toml(value: object) -> str:
    return msgspec.json.encode(value).decode() if isinstance(value, str) else str(value)
