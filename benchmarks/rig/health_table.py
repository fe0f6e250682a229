"""How soon a rig of mixed models names each fault of each model.

In simulated time; the table has model, fault, s until the incident that names the joint, and what came of it. The exit
code is 1 if a fault was found after more than a second, or not named.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, NamedTuple

import numpy as np
import typer

from benchmarks import command
from benchmarks.simulated_time import EmulatedPort
from hardware.bus.servo_bus import Bus
from hardware.emulator.bus import BOOT_TIME, EmulatedBus
from hardware.emulator.faults import Fault, FaultPlan
from hardware.emulator.servos.device import Device
from hardware.errors import RigError
from hardware.families.dynamixel2.facts import P_SERIES
from hardware.families.models import MODELS as TABLES
from hardware.rig.rig_file import RigConfig, RigJoint
from hardware.rig.supervision.rig import Rig

MODELS = ("XM430-W350", "XL330-M288", "XL430-W250", "XC330-T288", "MX-64", "XW540-T260")
OLD_MODELS = ("AX-12A", "RX-64", "MX-28(1.0)", "MX-64(1.0)", "XL-320", "XM430-W350")
P_MODELS = (*(model for model in P_SERIES if model.startswith("P")), "XM430-W350")
_TICK = 0.01
_AT, _UNTIL = 1.0, 4.0  # s
_HEAT = 4
_FOLLOWS = 0.2  # rad


class Detection(NamedTuple):
    """What came of a fault.

    Attributes:
        after: s until an incident named the joint; infinite if none did.
        incident: in words.
        end: the message of the stop, or "" where the rig went on.
        follows: whether the joint follows its target in the end.
    """

    after: float
    incident: str
    end: str
    follows: bool


def _limp(device: Device, now: float) -> None:
    device["torque_enable"] = 0


def _hot(device: Device, now: float) -> None:
    device.bank.drive.temperature[device.row] = 95.0


def _jam(device: Device, now: float) -> None:
    device.bank.drive.jammed[device.row] = True


def _sag(device: Device, now: float) -> None:
    device.bank.drive.supply[device.row] *= 0.7


FAULTS: dict[str, Callable[[Device, float], None]] = {
    "restart": lambda device, now: device.reboot(now + BOOT_TIME),
    "overheat": _hot,
    "overload": lambda device, now: device.fail(32),
    "unplug": lambda device, now: setattr(device, "dead", True),
    "limp": _limp,
    "jam": _jam,
    "voltage drop": _sag,
}


def mixed_rig(rate: float = 100.0, models: Sequence[str] = MODELS) -> RigConfig:
    """One servo of each model on one port, each zero in the middle of its one turn."""
    joints = tuple(
        RigJoint(model, id, model, 1, (sum(TABLES[model].one_turn) + 1) // 2, -1.5, 1.5, 2.0)
        for id, model in enumerate(models, 1)
    )
    return RigConfig("emulated", 1_000_000, rate, joints)


def run(model: str, fault: str, in_place: bool = False, models: Sequence[str] = MODELS) -> Detection:
    """Plays sines on the mixed rig and has one servo suffer a fault after a second."""
    config = mixed_rig(models=models)
    port = EmulatedPort(EmulatedBus(config), paced=True, faults=FaultPlan([Fault("cells")] if in_place else []))
    for device in port.bus.devices:
        if device.model in P_SERIES:  # most come without heat in their shutdown mask: doctor --fix sets it
            device["shutdown"] |= _HEAT
    rig = Rig(config, lambda part: Bus(port, part.baud), beside=False, sleep=port.elapse)
    index = models.index(model)
    device = port.bus.devices[index]
    began, struck, end, target = port.now(), float("inf"), "", 0.0
    while port.now() - began < _UNTIL:
        if struck == float("inf") and port.now() - began >= _AT:
            struck = port.now()
            FAULTS[fault](device, struck)
        target = float(np.sin(1.5 * (port.now() - began)))
        try:
            rig.collect_state()
            rig.write(np.full(len(models), target))
        except RigError as error:
            end = str(error)
            break
        port.elapse(_TICK)
    joint = f"{model} (id {index + 1})"
    named = [incident for incident in rig.incidents if incident.source == joint and incident.time >= struck]
    joint = config.joints[index]
    shaft = joint.angle(device["present_position"])
    follows = not end and abs(shaft - target) < _FOLLOWS
    rig.close()
    if not named:
        return Detection(float("inf"), "", end, follows)
    return Detection(named[0].time - struck, named[0].what, end, follows)


def main(
    in_place: Annotated[
        bool, typer.Option("--in-place", help="No servo's indirect cells can be arranged: health is read in rotation.")
    ] = False,
    old: Annotated[
        bool, typer.Option("--old", help="AX, RX and MX servos of Protocol 1.0, an XL-320 and an XM430 on one bus.")
    ] = False,
    p_series: Annotated[bool, typer.Option("--p-series", help="The six P models and an XM430 on one bus.")] = False,
) -> None:
    late, models = 0, OLD_MODELS if old else P_MODELS if p_series else MODELS
    for model in models:
        for fault in FAULTS:
            found = run(model, fault, in_place, models)
            late += found.after > 1.0
            came = "stopped, named" if model in found.end else "mended" if found.follows else "does not follow"
            print(f"{model:<12} {fault:<13} {found.after:5.2f} s  {came:<16} {found.incident}")
    print(f"found after more than 1 s or not at all: {late}")
    if late:
        raise typer.Exit(1)


if __name__ == "__main__":
    command.run("health_table", main, __doc__)
