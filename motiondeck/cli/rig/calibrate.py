"""`motiondeck rig calibrate`: measures the ranges of all joints while they are moved by hand."""

from __future__ import annotations

import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from hardware.errors import RigError, SerialPortError, ServoError
from motiondeck.cli.rig.shared import LineInput, PortOption, RigArgument, ended_by_sigterm, load, open_buses
from motiondeck_base.files import check_folder

if TYPE_CHECKING:
    from hardware.bus.servo_bus import Bus
    from hardware.rig.rig_file import RigConfig
    from hardware.tools.calibration import Sweep

READ_S, DRAW_S, SAVE_S = 0.02, 0.1, 0.5  # between two readings, two tables, two writings of FILE.part
_HOW = (
    "Move every joint to both ends, in any order. Enter ends. Or type: zero JOINT (its angle is 0 here), "
    "reverse JOINT (its angle grows the other way), again JOINT (its range anew)"
)


def calibrate(
    rig: RigArgument, out: Annotated[Path, Option(metavar="FILE", help="The rig file.")], port: PortOption = None
) -> None:
    """Measure joint ranges by hand, and write a rig file.

    Move the joints with torque off, and set their zeros and directions. The file RIG is not changed. Measurements
    are kept in FILE.part; after an error or Ctrl-C the same command continues from there. A homing offset and drive
    mode of another program in the servos are set to 0.

    Example:  motiondeck rig calibrate servo20 --out my-rig.toml
    """
    from hardware.rig.turn_file import TurnFile
    from hardware.tools.calibration import Sweep, load_progress, rejoined
    from hardware.tools.loose_joints import keep_turns
    from hardware.tools.rig_writing import save_rig

    config = load(rig)
    check_folder(out)
    part = out.with_name(f"{out.name}.part")
    typed = LineInput()
    servos = config.servos
    sweep = load_progress(servos, part) if part.exists() else Sweep(servos)
    if part.exists():
        done = sum(not sweep.lacking(name) for name in servos.names)
        print(f"continuing from {part}: {done} of {len(servos.joints)} joints are measured. Remove it to start again.")
    try:
        with ended_by_sigterm(), open_buses(config, port) as parts:
            _measure(sweep, parts, part, typed)
            found, notes = sweep.result()
            found = rejoined(config, found)
            for new, (own, bus) in zip(found.parts, parts, strict=True):
                if new.through_turns:
                    keep_turns(new, bus, TurnFile.of_port(own.port), sweep.turns)
    except KeyboardInterrupt:
        print(f"\nmotiondeck: ended by Ctrl-C.{_continues(part)}", file=sys.stderr)
        raise typer.Exit(130) from None
    except (SerialPortError, ServoError) as error:
        raise type(error)(f"{error}{_continues(part)}") from error
    save_rig(found, out)
    part.unlink(missing_ok=True)
    for note in notes:
        print(f"note: {note}.")
    print(f"wrote {out}")


def _continues(part: Path) -> str:
    return f" Measurements are kept in {part}: the same command continues from there." if part.exists() else ""


def _measure(sweep: Sweep, parts: list[tuple[RigConfig, Bus]], part: Path, typed: LineInput) -> None:
    from hardware.tools.calibration import clear_offsets, save_progress
    from hardware.tools.loose_joints import loosen

    names = sweep.config.names
    typed.ask("The torque goes off: hold what would fall, then press Enter ")
    for own, bus in parts:
        loosen(own, bus)
        for line in clear_offsets(own, bus):
            print(line)
    if all(sweep.measured[name].zero is None for name in names):
        typed.ask("Put every joint where its angle is 0, then press Enter ")
        _read(sweep, parts)
        for name in names:
            sweep.forget(name)
            sweep.zero_here(name)
    table = _Table(names)
    print(_HOW)
    drawn = saved = 0.0
    while True:
        silent = _read(sweep, parts)
        now = time.monotonic()
        if now - saved > SAVE_S:
            save_progress(sweep, part)
            saved = now
        if now - drawn > DRAW_S:
            table.draw(sweep, silent)
            drawn = now
        line = typed.take(READ_S)
        if line is None:
            continue
        lacking = [f"{name} {lack}" for name in names if (lack := sweep.lacking(name))]
        if line == "keep" or not (line or lacking):
            save_progress(sweep, part)
            table.close(sweep, silent)
            return
        reply = f"{'; '.join(lacking)}. Type `keep` to leave {'it' if len(lacking) == 1 else 'them'} as before."
        if line:
            try:
                reply = _carry_out(line, sweep)
            except RigError as error:
                reply = str(error)
        table.interrupt(reply)


def _read(sweep: Sweep, parts: list[tuple[RigConfig, Bus]]) -> set[str]:
    """Reads every joint, and returns the names of those that did not answer."""
    from hardware.tools.loose_joints import positions

    silent = set(sweep.config.names)
    for own, bus in parts:
        for joint, pulses in positions(own.servos, bus):
            sweep.see(joint.name, pulses)
            silent.discard(joint.name)
    return silent


def _carry_out(line: str, sweep: Sweep) -> str:
    word, _, name = line.partition(" ")
    name = name.strip()
    actions = {"zero": sweep.zero_here, "reverse": sweep.reverse, "again": sweep.forget}
    if word not in actions:
        return f"unknown command '{line}': Enter, zero JOINT, reverse JOINT, again JOINT or keep."
    if name not in sweep.config.names:
        return f"there is no joint '{name}': {', '.join(sweep.config.names)}."
    actions[word](name)
    return {"zero": f"{name} is at 0 here.", "reverse": f"{name} is reversed.", "again": f"{name} starts again."}[word]


class _Table:
    """A row for each joint, redrawn in place above the line being typed; without a terminal printed once."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names
        self._width = max(len(name) for name in names)
        self._live = sys.stdout.isatty()
        self._moved = True

    def draw(self, sweep: Sweep, silent: set[str]) -> None:
        """Draws the present ranges."""
        if not self._live:
            return
        rows = self._rows(sweep, silent)
        if self._moved:
            print("\n".join(rows), end="\n> ", flush=True)
            self._moved = False
        else:
            # The cursor returns to the line being typed below the table.
            print(f"\x1b7\x1b[{len(rows)}A\r" + "\x1b[K\r\n".join(rows) + "\x1b[K\x1b8", end="", flush=True)

    def interrupt(self, line: str) -> None:
        """Prints a line below the table; the next table is drawn below that."""
        print(line, flush=True)
        self._moved = True

    def close(self, sweep: Sweep, silent: set[str]) -> None:
        """Prints the final table where there is no terminal."""
        if not self._live:
            print("\n".join(self._rows(sweep, silent)))

    def _rows(self, sweep: Sweep, silent: set[str]) -> list[str]:
        rows = [f"{'joint':<{self._width}}  {'lowest':>7}  {'now':>7}  {'highest':>7}  rad"]
        for name in self._names:
            one = sweep.range_of(name)
            state = "does not answer" if name in silent else sweep.lacking(name) or "ok"
            rows.append(f"{name:<{self._width}}  {one.lowest:>+7.2f}  {one.now:>+7.2f}  {one.highest:>+7.2f}  {state}")
        room = max(3, shutil.get_terminal_size().lines - 2) if self._live else len(rows)
        unfinished_first = sorted(rows[1:], key=lambda row: row.endswith("  ok"))
        return rows if len(rows) <= room else [rows[0], *unfinished_first[: room - 1]]
