"""Calibrations of LeRobot as joints of a rig: a JSON file with a name for each motor, and

    id, drive_mode, homing_offset     as in the servo's registers
    range_min, range_max              its present position at both ends

LeRobot sees present = sign * actual + homing_offset, where sign is -1 for an odd drive_mode, and its angles grow with
it. A rig here wants homing offset and drive mode 0, so everything is carried back to the actual position. Servos whose
count begins anew after a turn (present = actual - homing_offset) keep their offset, which the rig file then has. Angle
0 is in the middle of the range, as in LeRobot's degrees. As there, a range may lie anywhere (extended position), a
gripper holds with a limit of current, and a motor NAME_shadow turns the joint NAME too.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec

from hardware.errors import RigError
from hardware.families.models import TRAITS
from hardware.families.register import Counts
from hardware.rig.rig_file import RigConfig
from hardware.rig.rig_joint import RigJoint, SecondServo
from hardware.tools.calibration import measured_joint
from hardware.tools.rig_writing import assembled, new_joint
from hardware.tools.scan import Found

_REVERSED = 1
_SHADOW, _GRIPPER = "_shadow", "gripper"  # how LeRobot names the second motor of a joint, and the jaw
_HOLDS = 0.5  # of the stall current


class MotorCalibration(msgspec.Struct, frozen=True):
    """One motor of a LeRobot calibration, in pulses."""

    id: int
    drive_mode: int
    homing_offset: Counts
    range_min: Counts
    range_max: Counts


def read_calibration(path: Path) -> dict[str, MotorCalibration]:
    """The motors of a calibration file, by name; raises RigError if it cannot be read, or is not one."""
    try:
        motors = msgspec.json.decode(path.read_bytes(), type=dict[str, MotorCalibration])
    except OSError as error:
        raise RigError(f"cannot read {path}: {error.strerror}.") from error
    except msgspec.DecodeError as error:
        raise RigError(
            f"{path} is not a calibration file of LeRobot ({error}): it has id, drive_mode, homing_offset, range_min "
            "and range_max for each motor."
        ) from error
    for name, motor in motors.items():
        if motor.range_min >= motor.range_max:
            raise RigError(f"{path}: {name} has range_min {motor.range_min}, not below range_max {motor.range_max}.")
    return motors


def imported(motors: Mapping[str, MotorCalibration], found: Sequence[Found], port: str) -> tuple[RigConfig, list[str]]:
    """The rig of the servos that answered a scan, as a calibration says; and what to know about it.

    RigError if a motor of the calibration does not answer, or is not fit for a rig; it names them.
    """
    servos = {one.identity.id: one for one in found}
    missing = [f"{name} (id {motor.id})" for name, motor in motors.items() if motor.id not in servos]
    if missing:
        raise RigError(f"no answer on {port} from {', '.join(missing)}. Check power and cables.")
    joints: list[RigJoint] = []
    notes: list[str] = []
    for name, motor in motors.items():
        if name.endswith(_SHADOW) and name.removesuffix(_SHADOW) in motors:
            continue
        joint, given_up = _joint(new_joint(name, motor.id, servos[motor.id].identity.model), motor)
        if (shadow := motors.get(name + _SHADOW)) is not None:
            other, _ = _joint(new_joint(name, shadow.id, servos[shadow.id].identity.model), shadow)
            joint = msgspec.structs.replace(joint, second=SecondServo(other.id, other.direction, other.zero))
        if name == _GRIPPER and "current_limit" in joint.table.registers:
            current = round(_HOLDS * TRAITS[joint.model].stall_current, 2)
            joint = msgspec.structs.replace(joint, current=current, grip=True)
            given_up.append(f"{name} grips with {current:g} A, half what its motor takes: change current as you need")
        joints.append(joint)
        notes += given_up
    return assembled(joints, port, (servos[motor.id].baud for motor in motors.values())), notes


def _joint(joint: RigJoint, motor: MotorCalibration) -> tuple[RigJoint, list[str]]:
    sign = -1 if motor.drive_mode & _REVERSED else 1
    if joint.table.series.wraps:  # its offset is kept, and it has no drive mode
        joint = msgspec.structs.replace(joint, homing_offset=motor.homing_offset)
        middle = (motor.range_min + motor.range_max) // 2
        return measured_joint(joint, sign, middle, motor.range_min, motor.range_max, margin=0.0)
    low, high = sorted(sign * (present - motor.homing_offset) for present in (motor.range_min, motor.range_max))
    return measured_joint(joint, sign, (low + high) // 2, low, high, margin=0.0)
