"""`motiondeck library`: what a motion library holds, in words and in pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(help="Look into motion libraries.", no_args_is_help=True)

LibraryArgument = Annotated[
    str, typer.Argument(metavar="LIBRARY", help="A library file (.safetensors), or a shipped one by its name.")
]


@app.command("show")
def show(
    library: LibraryArgument,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False,
) -> None:
    """Show the motions, the network, and the origin of a library.

    Example:  motiondeck library show thesis15
    """
    from controller.cli.fit import print_table, report
    from controller.cli.resources import find
    from controller.training.library import load_library

    loaded = load_library(find("library", library, ".safetensors"))
    if as_json:
        print(json.dumps(report(loaded)))
        return
    print_table(loaded)
    print(f"skeleton  {loaded.info.skeleton.name}, {len(loaded.skeleton)} bones")
    print(f"seed      {loaded.info.seed}")
    print(f"licence   {loaded.info.licence}")
    print(f"thanks    {loaded.info.acknowledgement}")


@app.command("sheet")
def sheet(
    library: LibraryArgument,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The picture to write (.png).")],
    robot: Annotated[str, typer.Option("--robot", help="Whose body does the motions.")] = "mannequin",
) -> None:
    """Draw a contact sheet: one row a motion, eight moments each, as the network plays them.

    Example:  motiondeck library sheet thesis15 --out sheet.png
    """
    from controller.cli.pictures import draw_sheet

    draw_sheet(library, robot, out)
