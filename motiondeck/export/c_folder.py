"""Writes a figure as a folder of C: the player, the words, and a self-test that replays golden traces of the deck."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from motiondeck.export.figure import Figure
from motiondeck.export.golden import EVERY, LASTS, deck_trace, golden_script, spelled
from motiondeck_base.files import write_file

_HERE = Path(__file__).parent
SOURCES = [_HERE / name for name in ("player.c", "player.h", "selftest.c", "Makefile")]
SOURCES.append(_HERE.parents[1] / "controller" / "loop" / "safety" / "envelope.c")


def write_c(figure: Figure, folder: Path) -> None:
    """Writes the folder; FileFormatError if a file cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    for source in SOURCES:
        write_file(folder / source.name, source.read_bytes())
    write_file(folder / "figure.bin", figure.words)
    write_file(folder / "figure.h", figure_header(figure))
    names = figure.library.network.motions
    script = golden_script(names)
    calls = [(tick, *spelled(command, names)) for tick, command in script]
    rows = _lines(f"{{{tick}, '{kind}', {motion}, {value}f, {other}f}}" for tick, kind, motion, value, other in calls)
    angles = _lines(f"{angle:.6f}f" for angle in deck_trace(figure, script, LASTS).targets[::EVERY].ravel())
    head = f"/* What the deck plays, rad */\n#define GOLDEN_TICKS {LASTS}\n#define GOLDEN_EVERY {EVERY}\n"
    given = f"static const golden_command golden_commands[] = {{\n{rows}"
    write_file(folder / "golden.h", f"{head}{given}static const float golden_angles[] = {{\n{angles}".encode())


def figure_header(figure: Figure) -> bytes:
    """The words of a figure as C."""
    words = _lines(f"0x{word:08x}u" for word in np.frombuffer(figure.words, "<u4"))
    head = f"/* {figure.library.info.name} */\n#define FIGURE_JOINTS {len(figure.rest)}\n#include <stdint.h>\n"
    return f"{head}static const uint32_t figure[] = {{\n{words}".encode()


def _lines(values: Iterable[str]) -> str:
    every = list(values)
    return ",\n".join(", ".join(every[at : at + 10]) for at in range(0, len(every), 10)) + "};\n"
