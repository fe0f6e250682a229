"""`motiondeck export`: a library as a folder of C for a microcontroller, or as a page for a browser."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from typer import Option

from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.library import LibraryArgument
from motiondeck_base.errors import MotiondeckError


def export(
    library: LibraryArgument,
    out: Annotated[Path, Option(metavar="FOLDER", help="The folder to write.")],
    robot: Annotated[str | None, Option(metavar="ROBOT", help="The robot whose joints and limits it has.")] = None,
    rig: Annotated[str | None, Option(metavar="RIG", help="The rig whose joints and limits it has.")] = None,
    motions: Annotated[str, Option(metavar="NAME,NAME", help="The motions; the first one begins; default: all.")] = "",
    target: Annotated[
        Literal["c", "arduino", "web"],
        Option("--for", help="C99 without heap or operating system, an Arduino library, or a page for any browser."),
    ] = "c",
    board: Annotated[
        str,
        Option(metavar="CORE:MHZ:RAM:FLASH", help="M4F, M3 or M0+, MHz and kB that are there; refused if too little."),
    ] = "M4F",
    networks: Annotated[
        bool, Option("--networks", help="Hold centralized networks, which take less flash and more time than keys.")
    ] = False,
    fixed: Annotated[bool, Option("--fixed", help="Without floating point, for a core that has none.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Write a player in C, an Arduino library or a page with motions.

    The library is baked for the robot, or was taught to the rig. The player switches, fades, keeps tempo, limits and
    the emergency stop as the deck does. The folder builds as it is: `make` replays a golden trace of the deck. A page
    shows the robot; any file server serves it.

    Example:  motiondeck export thesis15 --robot servo20 --motions walk,jog,waltz --for c --out figure
    """
    from motiondeck.cli.common.tables import show_table
    from motiondeck.cli.rig.shared import load
    from motiondeck.export.c_folder import write_arduino, write_c
    from motiondeck.export.cost import cost_on
    from motiondeck.export.source import open_figure

    if target == "arduino" and rig is None:
        raise MotiondeckError("--for arduino drives the servos of a rig: name its file with --rig, not --robot")
    if target == "web" and fixed:
        raise MotiondeckError("--fixed is for microcontrollers; a browser has floating point")
    names = [name.strip() for name in motions.split(",") if name.strip()]
    figure = open_figure(library, robot, rig, names, out if target == "web" else None, networks=networks, fixed=fixed)
    cost = cost_on(figure, board) if target != "web" else {}
    if target == "arduino" and rig is not None:
        write_arduino(figure, load(rig), out)
    elif target == "c":
        write_c(figure, out)
    rows = [(name, figure.held[name], size, *figure.error[name]) for name, size in figure.bytes_of.items()]
    if as_json:
        sizes = [dict(zip(("motion", "as", "bytes", "rms_rad", "largest_rad"), row, strict=True)) for row in rows]
        summary = {"target": target, "folder": str(out), "bytes": len(figure.words), "motions": sizes}
        print(json.dumps(summary | {"cost": cost}))
        return
    show_table(
        ("motion", "as", "bytes", "off by (rms)", "at most"),
        [(*row[:2], str(row[2]), *(f"{1e3 * off:.2f} mrad" for off in row[3:])) for row in rows],
    )
    if cost:
        bytes_of = f"{1e-3 * cost['flash']:.0f} kB of flash, {1e-3 * cost['ram']:.1f} kB of RAM"
        worst = f"{1e-3 * cost['instructions']:.0f}k instructions a tick, {1e-3 * cost['layer']:.1f}k more with a layer"
        print(f"On an {board.split(':')[0]}: {bytes_of}, at most {worst}.")
    then = {"c": f"`make -C {out}` replays a trace of the deck", "web": f"open {out / 'index.html'}"}
    print(f"{out}: {len(figure.words)} bytes of motions; {then.get(target, 'put it among the libraries of Arduino')}.")
