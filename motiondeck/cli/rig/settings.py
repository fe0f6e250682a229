"""`motiondeck rig backup` and `rig restore`: the servos' control tables in a file, and back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from motiondeck.cli.rig.rig_port import PortOption, RigArgument, ended_by_sigterm, load, open_buses
from motiondeck_base.counted import counted
from motiondeck_base.errors import MotiondeckError


def backup(
    rig: RigArgument,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The file to write (JSON).")],
    port: PortOption = None,
) -> None:
    """Save the whole control table of every servo in a new file; moves and changes nothing.

    Example:  motiondeck rig backup my-rig.toml --out servos.json
    """
    from hardware.tools.backup import back_up, save_backups
    from motiondeck_base.files import check_folder

    if out.exists():
        raise MotiondeckError(f"{out} is there already, perhaps with the settings from before: give another --out")
    check_folder(out)
    with ended_by_sigterm(), open_buses(load(rig), port) as parts:
        backups = [one for part, bus in parts for one in back_up(part, bus)]
    save_backups(backups, out)
    print(f"wrote {out}: {counted(len(backups), 'servo')}")


def restore(
    rig: RigArgument,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="What `rig backup` wrote.")],
    port: PortOption = None,
) -> None:
    """Write the EEPROM registers of a backup into the servos, except IDs and baud rates; torque must be off.

    Example:  motiondeck rig restore my-rig.toml servos.json
    """
    from hardware.tools.backup import load_backups
    from hardware.tools.backup import restore as write_back

    backups = load_backups(file)
    with ended_by_sigterm(), open_buses(load(rig), port) as parts:
        written = [line for part, bus in parts for line in write_back(part, backups, bus)]
    print("\n".join(written) if written else "nothing differs")
