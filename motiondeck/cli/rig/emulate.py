"""`motiondeck rig emulate`: servos without hardware, for any client."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from typer import Option

from motiondeck.cli.rig.shared import LineInput, RigArgument, ended_by_sigterm, in_foreground, load
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.words import counted

if TYPE_CHECKING:
    from hardware.emulator.bus import EmulatedBus
    from hardware.rig.rig_file import RigConfig


def emulate(
    rig: RigArgument,
    fault: Annotated[list[str] | None, Option(metavar="FAULT", help="KIND[:key=value,...]; `help` lists them.")] = None,
    link: Annotated[Path | None, Option(metavar="FILE", help="A link to the port that outlives replugging.")] = None,
    robot: Annotated[str | None, Option(metavar="ROBOT", help="The body that servos turn: a file or a name.")] = None,
    root: Annotated[Literal["fixed", "free"] | None, Option(help="With --robot: fixed (default), or free.")] = None,
    record: Annotated[Path | None, Option(metavar="FILE", help="Record where the shafts really are.")] = None,
    fresh: Annotated[bool, Option("--fresh", help="Only the first servo, as new: id 1, 57600 baud.")] = False,
) -> None:
    """Emulate a rig for any client, without hardware.

    The port to open is printed; Ctrl-C or SIGTERM ends it. In the background (&) it outlives its shell, and with nohup
    its terminal.

    Type to move joints without torque by hand: `swing pan 0.5 every 2`, `move pan 1 tilt 0 in 1.5` (rad and s),
    `rest`; `where` prints their angles. `pull pan` takes a servo's cable out, `plug pan` puts it back,
    `warm pan 70` heats it up (degC).

    With --robot the servos turn a simulated body with masses, so load, stall and falls show as current, heat and sag.

    [bold]Examples[/]

      motiondeck rig emulate servo20 --fault dead:id=3,at=5,for=1
      motiondeck rig emulate servo20 --robot servo20 --root free
    """
    from hardware.emulator.faults import KINDS, parse_fault
    from hardware.emulator.pty_server import ShaftRecord, serve
    from hardware.emulator.servos.drive import motors_said

    if fault and "help" in fault:
        for kind, meaning in KINDS.items():
            print(f"{kind:<10} {meaning}")
        print("keys: id, at (s), for (s), chance (0 to 1), value")
        return
    if root is not None and robot is None:
        raise MotiondeckError(f"--root {root} needs a body: name one with --robot")
    config = load(rig)
    if fresh:
        one = msgspec.structs.replace(config.joints[0], id=1)
        config = msgspec.structs.replace(config, joints=(one,), baud=57600)
    plant = None
    if robot is not None:
        from controller.motion.encodings.joint_angles import JointBody
        from sim.physics.rig_plant import RigPlant
        from sim.robots.catalogue import find_robot
        from sim.robots.robot import load_robot

        turned = load_robot(find_robot(robot), JointBody.of(config.names))
        plant = RigPlant(turned, config.names, root or "fixed")
    faults = [parse_fault(text) for text in fault or []]
    servos = counted(len(config.joints), "servo")
    print(f"{servos} at {config.baud} baud; clients of another speed get no answer", file=sys.stderr, flush=True)
    print(motors_said(joint.model for joint in config.joints), file=sys.stderr, flush=True)
    called = [_hands(config)] + ([ShaftRecord(record, config)] if record is not None else [])

    def between(buses: Sequence[EmulatedBus]) -> None:
        for each in called:
            each(buses)

    with ended_by_sigterm():
        serve(config, lambda port: print(port, flush=True), faults, link=link, plant=plant, between=between)


def _hands(config: RigConfig) -> Callable[[Sequence[EmulatedBus]], None]:
    """Moves joints by the lines of standard input, until it ends."""
    from hardware.emulator.handling import HELP, Handling, HandlingError

    hands = Handling(config)
    typed: LineInput | None = LineInput()
    if sys.stdin.isatty():
        print(HELP, file=sys.stderr)

    def between(buses: Sequence[EmulatedBus]) -> None:
        nonlocal typed
        try:
            # Reading the terminal would stop a process in the background.
            if typed is not None and in_foreground() and (words := typed.take()):
                if words == "where":
                    print(hands.where(buses), flush=True)
                else:
                    hands.command(words)
        except HandlingError as error:
            print(error, file=sys.stderr, flush=True)
        except MotiondeckError:
            typed = None
        hands.move(buses, time.monotonic())

    return between
