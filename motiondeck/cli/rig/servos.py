"""`motiondeck rig scan`, `setup` and `import`: find servos, configure them, and write a rig file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.rig.shared import LineInput, aside
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import check_folder

if TYPE_CHECKING:
    from hardware.tools.scan import Found


def scan(
    port: Annotated[str, Argument(metavar="PORT", help="The serial port.")] = "/dev/ttyUSB0",
    baud: Annotated[list[int] | None, Option(metavar="BAUD", help="Only these baud rates.")] = None,
    out: Annotated[Path | None, Option(metavar="FILE", help="Write a rig file with joint_1, joint_2 ...")] = None,
    as_json: JsonOption = False,
) -> None:
    """List the servos on a port, and write a rig file of them.

    They answer at any baud rate and protocol. The rig file (--out) has the adapter's permanent name, each servo's whole
    turn as its range, and 2 rad/s as its speed: name the joints in an editor, then calibrate. Servos that Motiondeck
    cannot drive are left out, and a note says why.

    [bold]Examples[/]

      motiondeck rig scan /dev/ttyUSB0
      motiondeck rig scan /dev/ttyUSB0 --out my-rig.toml
    """
    from hardware.bus.port import lasting_name
    from hardware.tools.rig_writing import rig_of, save_rig

    if out is not None:
        _refuse_existing(out)
    found = _answering(port, baud)
    widest = max((len(one.identity.model) for one in found), default=0)
    if as_json:
        names = ("id", "model", "firmware", "alert")
        rows = [{"baud": b} | {n: getattr(i, n) for n in names} | {"family": i.family.name} for b, i in found]
        print(json.dumps({"port": port, "servos": rows}))
    for one in found if not as_json else []:
        servo = one.identity
        alert = "  reports a hardware problem" if servo.alert else ""
        spoken = servo.family.spoken
        print(f"id {servo.id:>3}  {servo.model:<{widest}}  firmware {servo.firmware:<3} {one.baud} baud{spoken}{alert}")
    if not found and out is None:
        raise MotiondeckError(f"no servo answers on {port}. Check power, cable and adapter.")
    if out is not None:
        rig, left_out = rig_of(found, lasting_name(port))
        save_rig(rig, out)
        for reason in left_out:
            aside(f"note: left out: {reason}")
        if not as_json:
            print(f"wrote {out}")


def setup(
    port: Annotated[str, Argument(metavar="PORT", help="The serial port with one servo on it.")],
    id: Annotated[int | None, Option(metavar="N", min=0, max=252, help="The ID it gets.")] = None,
    baud: Annotated[int, Option(metavar="BAUD", help="The baud rate it gets.")] = 1_000_000,
    rig: Annotated[Path | None, Option(metavar="FILE", help="Write the adapter's name into this rig file.")] = None,
    every: Annotated[bool, Option("--all", help="One new servo after another, as in the rig file.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Give the only servo on a port its ID and baud rate.

    With --all a bag of new servos is set up one by one. What is done is kept in a file beside the rig file, so that the
    same command goes on where it was interrupted.

    The permanent name of an adapter (/dev/serial/by-id/...) has its serial number, and stays the same when the system
    calls it ttyUSB1 the next time.

    [bold]Examples[/]

      motiondeck rig setup /dev/ttyUSB0 --id 7 --baud 4000000 --rig my-rig.toml
      motiondeck rig setup /dev/ttyUSB0 --all --rig head.toml
    """
    from hardware.bus.port import lasting_name
    from hardware.bus.servo_bus import Bus
    from hardware.rig.rig_file import BAUD_RATES, load_rig
    from hardware.tools.rig_writing import set_port
    from hardware.tools.scan import set_up, set_up_all

    if every == (id is not None) or (every and rig is None):
        raise MotiondeckError("give either --id N for one servo, or --all with --rig FILE for all of a rig")
    lasting = lasting_name(port)
    if rig is not None:
        load_rig(rig)  # a wrong file is reported before a servo is changed
    if baud not in BAUD_RATES:
        raise MotiondeckError(f"baud {baud} is not one of {', '.join(map(str, BAUD_RATES))}")
    if rig is not None and every:
        set_up_all(rig, lambda rate: Bus.open(port, rate), LineInput().ask, print)
        print(f"all are set up. Connect them, then: motiondeck rig doctor {rig} --fix")
    if id is None:
        return
    before, after = set_up(lambda rate: Bus.open(port, rate), id, baud)
    before_port = set_port(rig, lasting) if rig is not None else None
    if as_json:
        was = [before.identity.id, before.baud]
        print(json.dumps({"model": after.model, "id": after.id, "baud": baud, "was": was, "port": lasting}))
        return
    was = f"id {before.identity.id} at {before.baud} baud"
    print(f"{after.model}: {was} is now id {after.id} at {baud} baud, return delay 0")
    if before_port is not None:
        print(f"{rig}: its port is {lasting}" + (f" (was {before_port})" if before_port != lasting else ""))
    elif lasting != port:
        print(f'write port = "{lasting}" into the rig file: the adapter keeps this name when it is plugged in again')


def import_calibration(
    calibration: Annotated[Path, Argument(metavar="FILE", help="A calibration of LeRobot (.json).")],
    port: Annotated[str, Option(metavar="PORT", help="The serial port with its servos.")],
    out: Annotated[Path, Option(metavar="FILE", help="The rig file to write.")],
    as_json: JsonOption = False,
) -> None:
    """Write a rig file from a calibration of LeRobot.

    Nothing in the servos is changed. Names, directions and ranges are LeRobot's, models and baud rate are read from the
    servos. A reversed motor stays reversed: its angle grows as LeRobot's does. Angle 0 is in the middle of the range.
    LeRobot's homing offsets and drive modes are still in the servos: `motiondeck rig doctor RIG --fix` sets them right.

    [bold]Example[/]

      motiondeck rig import koch_follower.json --port /dev/ttyUSB0 --out arm.toml
    """
    from hardware.bus.port import lasting_name
    from hardware.tools.lerobot import imported, read_calibration
    from hardware.tools.rig_writing import save_rig

    _refuse_existing(out)
    config, notes = imported(read_calibration(calibration), _answering(port), lasting_name(port))
    save_rig(config, out)
    if as_json:
        print(json.dumps({"written": str(out), "joints": list(config.names), "notes": notes}))
        return
    for joint in config.joints:
        turned = " reversed" if joint.direction < 0 else ""
        print(
            f"id {joint.id:>3}  {joint.name:<18} {joint.model:<12} {joint.lower:+.2f} to {joint.upper:+.2f} rad{turned}"
        )
    for note in notes:
        print(f"note: {note}.")
    print(f"wrote {out}. Next: motiondeck rig doctor {out} --fix")


def _answering(port: str, bauds: list[int] | None = None) -> list[Found]:
    from hardware.bus.servo_bus import Bus
    from hardware.rig.rig_file import BAUD_RATES
    from hardware.tools.scan import scan as scan_port

    wrong = [rate for rate in bauds or [] if rate not in BAUD_RATES]
    if wrong:
        raise MotiondeckError(f"baud {wrong[0]} is not one of {', '.join(map(str, BAUD_RATES))}")

    def warn(baud: int) -> None:
        twice = "two servos may have the same id. Connect one at a time, and give each its own ID with"
        aside(f"note: garbled answers at {baud} baud: {twice} motiondeck rig setup.")

    return scan_port(lambda rate: Bus.open(port, rate), *([bauds] if bauds else []), on_garbled=warn)


def _refuse_existing(out: Path) -> None:
    if out.exists():
        raise MotiondeckError(f"{out} exists already: remove it, or give another name")
    check_folder(out)
