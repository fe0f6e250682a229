"""LeRobot's own Feetech bus on a port: run by `feetech_clients` in an environment that has it. Prints one JSON object.

Only LeRobot's helpers for a terminal are replaced, which need PyTorch.
"""

from __future__ import annotations

import json
import sys
import time
from types import ModuleType

_RETRIES = 20  # LeRobot gives up soon, and this machine may be busy
NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


def main(port: str) -> None:
    """Finds, configures, moves and calibrates the arm as LeRobot does; each step by its name and what it gave."""
    terminal = ModuleType("lerobot.utils.utils")
    terminal.enter_pressed = terminal.move_cursor_up = lambda *_: False  # type: ignore[attr-defined]
    sys.modules[terminal.__name__] = terminal
    from lerobot.motors import Motor, MotorNormMode  # type: ignore[import-not-found]
    from lerobot.motors.feetech import FeetechMotorsBus, OperatingMode  # type: ignore[import-not-found]

    motors = {name: Motor(id, "sts3215", MotorNormMode.DEGREES) for id, name in enumerate(NAMES, 1)}
    bus = FeetechMotorsBus(port, motors)
    found: dict[str, object] = {}
    bus.connect()  # pings each, and compares its model number
    found["connect"] = bus.is_connected
    found["ping"] = bus.ping("gripper")
    found["broadcast_ping"] = {str(id): number for id, number in (bus.broadcast_ping() or {}).items()}
    bus.disable_torque(num_retry=_RETRIES)
    bus.configure_motors()
    for name in NAMES:
        bus.write("Operating_Mode", name, OperatingMode.POSITION.value, num_retry=_RETRIES)
        bus.write("P_Coefficient", name, 16, num_retry=_RETRIES)
    found["configured"] = [bus.read("P_Coefficient", name, num_retry=_RETRIES) for name in NAMES]
    bus.reset_calibration()
    found["homing"] = bus.set_half_turn_homings()
    found["centred"] = bus.sync_read("Present_Position", normalize=False, num_retry=_RETRIES)
    bus.enable_torque(num_retry=_RETRIES)
    bus.sync_write("Goal_Position", dict.fromkeys(NAMES, 2300), normalize=False, num_retry=_RETRIES)
    time.sleep(1.5)
    found["moved"] = bus.sync_read("Present_Position", normalize=False, num_retry=_RETRIES)
    found["velocity"] = bus.sync_read("Present_Velocity", normalize=False, num_retry=_RETRIES)
    bus.disconnect()  # takes the torque off
    print(json.dumps(found))
