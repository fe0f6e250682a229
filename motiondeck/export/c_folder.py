"""Writes a figure as C: a folder with a self-test that replays golden traces of the deck, or an Arduino library."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from hardware.rig.rig_file import RigConfig
from hardware.rig.supervision.board_rig import identity
from motiondeck.export.figure import UNIT, Figure
from motiondeck.export.golden import EVERY, LASTS, deck_trace, golden_script, spelled
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.files import write_file

_HERE = Path(__file__).parent
SKETCHES = _HERE / "arduino"
_ENVELOPE = _HERE.parents[1] / "controller" / "loop" / "safety" / "envelope.c"
PLAYER = [_HERE / "player.c", _HERE / "player.h", _HERE / "fixed.h", _ENVELOPE]
REGISTERS = {"SERVO_GOAL": "goal_position", "SERVO_PRESENT": "present_position", "SERVO_WATCHDOG": "bus_watchdog"}


def write_c(figure: Figure, folder: Path) -> None:
    """Writes the folder; FileFormatError if a file cannot be written."""
    names = figure.library.network.motions
    script = golden_script(names)
    calls = [(tick, *spelled(command, names)) for tick, command in script]
    rows = _lines(f"{{{tick}, '{kind}', {motion}, {value}f, {other}f}}" for tick, kind, motion, value, other in calls)
    played = deck_trace(figure, script, LASTS).targets[::EVERY].ravel()
    angles = _lines(str(round(angle / UNIT)) if figure.fixed else f"{angle:.6f}f" for angle in played)
    head = f"/* What the deck plays, rad */\n#define GOLDEN_TICKS {LASTS}\n#define GOLDEN_EVERY {EVERY}\n"
    given = f"static const golden_command golden_commands[] = {{\n{rows}"
    golden = f"{head}{given}static const md_number golden_angles[] = {{\n{angles}".encode()
    files = {name: (_HERE / name).read_bytes() for name in ("selftest.c", "Makefile")} | _player(figure)
    if figure.fixed:  # classes of C++; a compiler tells the languages by the names
        files["player.cpp"] = files.pop("player.c")
        files["Makefile"] = files["Makefile"].replace(b"-std=c99 ", b"").replace(b"player.c ", b"player.cpp ")
    write_folder(folder, files | {"figure.bin": figure.words, "golden.h": golden})


def write_arduino(figure: Figure, rig: RigConfig, folder: Path) -> None:
    """Writes the library for the servos of a rig; MotiondeckError if they are not Dynamixel servos of one kind."""
    servos = [(joint, *one) for joint, row in enumerate(rig.joints) for one in enumerate(row.servos)]
    tables = {tuple(one.table.registers.get(name) for name in REGISTERS.values()) for _, _, one in servos}
    if len(tables) > 1 or None in (registers := tables.pop()):
        raise MotiondeckError("the sketch drives Dynamixel servos with a bus watchdog, whose registers are alike")
    defined: dict[str, object] = {name: row.address for name, row in zip(REGISTERS, registers, strict=True) if row}
    defined |= {"SERVOS": len(servos), "SERVO_BAUD": rig.baud, "SERVO_WATCHDOG": -(-rig.watchdog_ms // 20)}
    defined["RIG"] = f'"{identity(rig)}"'
    lines = [*(f"#define {name} {value}" for name, value in defined.items()), "static const md_servo servos[] = {"]
    for joint, second, one in servos:
        scale = f"{one.zero}, {one.pulses_per_radian:.5f}f"
        lines.append(f"{{{joint}, {second}, {one.id}, {one.mode}, {scale}}}, /* {one.name} */")
    files = {str(file.relative_to(SKETCHES)): file.read_bytes() for file in SKETCHES.rglob("*.*") if file.is_file()}
    for name, content in _player(figure).items():  # a board compiles each .c file
        files["src/" + name.replace(".c", ".inc")] = content.replace(b'envelope.c"', b'envelope.inc"')
    if figure.fixed:
        files["src/motiondeck.cpp"] = files.pop("src/motiondeck.c")
    write_folder(folder, files | {"src/servos.h": "\n".join([*lines, "};\n"]).encode()})


def _player(figure: Figure) -> dict[str, bytes]:
    """The player with what the joints and motions of a figure need, and its words as C."""
    words = _lines(f"0x{word:08x}u" for word in np.frombuffer(figure.words, "<u4"))
    head = f"/* {figure.library.info.name} */\n#define FIGURE_JOINTS {len(figure.rest)}\n#include <stdint.h>\n"
    files = {file.name: file.read_bytes() for file in PLAYER}
    size, networks = b"#define MD_MOST_JOINTS %d" % len(figure.rest), "network" in figure.held.values()
    header = files["player.h"].replace(b"#define MD_MOST_JOINTS 32", size)
    files["player.h"] = header if networks else header.replace(b"#define MD_NETWORKS 1", b"#define MD_NETWORKS 0")
    if figure.fixed:
        files["player.h"] = files["player.h"].replace(b"stdint.h>", b"stdint.h>\n#define MD_FIXED", 1)
    else:
        del files["fixed.h"]
    return files | {"figure.h": f"{head}static const uint32_t figure[] = {{\n{words}".encode()}


def _lines(values: Iterable[str]) -> str:
    every = list(values)
    return ",\n".join(", ".join(every[at : at + 10]) for at in range(0, len(every), 10)) + "};\n"


def write_folder(folder: Path, files: Mapping[str, bytes]) -> None:
    """Writes files by their places in a folder; FileFormatError if one cannot be written."""
    for name, content in files.items():
        file = folder / name
        with FileFormatError.writing(file):
            file.parent.mkdir(parents=True, exist_ok=True)
        write_file(file, content)
