"""Writes a figure as a folder of C: the player, the words, and a self-test that replays golden traces of the deck."""

from collections.abc import Iterable
from pathlib import Path

from controller.wire.messages.commands import DeckCommand, EmergencyStop, Jump, Pause, Queue, Resume, SetTempo, Switch
from motiondeck.export.figure import Figure
from motiondeck.export.golden import EVERY, LASTS, deck_trace, golden_script
from motiondeck_base.files import write_file

_HERE = Path(__file__).parent
SOURCES = [*(_HERE / name for name in ("player.c", "player.h", "selftest.c", "Makefile"))]
SOURCES += [_HERE.parents[1] / "controller" / "loop" / "safety" / "envelope.c"]


def write_c(figure: Figure, folder: Path) -> None:
    """Writes the folder; FileFormatError if a file cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    for source in SOURCES:
        write_file(folder / source.name, source.read_bytes())
    write_file(folder / "figure.bin", figure.words)
    words = (int.from_bytes(figure.words[at : at + 4], "little") for at in range(0, len(figure.words), 4))
    joints = f"#define FIGURE_JOINTS {len(figure.rest)}\n"
    declared = "#include <stdint.h>\nstatic const uint32_t figure[] = {\n" + _lines(f"0x{word:08x}u" for word in words)
    write_file(folder / "figure.h", f"/* {figure.library.info.name}: see player.h */\n{joints}{declared}".encode())
    write_file(folder / "golden.h", _golden(figure).encode())


def _golden(figure: Figure) -> str:
    names = list(figure.library.network.motions)
    script = golden_script(names)
    targets = deck_trace(figure, script, LASTS).targets[::EVERY]
    rows = [f"{{{tick}, {_call(command, names)}}}" for tick, command in script]
    return (
        f"/* What the deck plays: angles before the limits, rad. */\n#define GOLDEN_TICKS {LASTS}\n"
        f"#define GOLDEN_EVERY {EVERY}\nstatic const golden_command golden_commands[] = {{\n{_lines(rows)}"
        f"static const float golden_angles[] = {{\n{_lines(f'{value:.6f}f' for value in targets.ravel())}"
    )


def _call(command: DeckCommand, names: list[str]) -> str:
    match command:
        case Switch(to=to, direct=direct):
            return f"GOLDEN_SWITCH, {names.index(to)}, {float(direct)}f"
        case Queue(to=to):
            return f"GOLDEN_QUEUE, {names.index(to)}, 0.0f"
        case SetTempo(factor=factor, over=over):
            return f"GOLDEN_TEMPO, {round(1000 * over)}, {factor:.6f}f"
        case Jump(phase=phase):
            return f"GOLDEN_JUMP, 0, {phase:.6f}f"
        case Pause() | Resume() | EmergencyStop():
            return f"GOLDEN_{type(command).__name__.upper()}, 0, 0.0f"
        case _:
            raise ValueError(f"no golden trace has {command}")


def _lines(values: Iterable[str]) -> str:
    every = list(values)
    return ",\n".join(", ".join(every[at : at + 10]) for at in range(0, len(every), 10)) + "};\n"
