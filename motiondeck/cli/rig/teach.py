"""`motiondeck rig teach`: records joints that are moved by hand as clips; or keyframes, on a page."""

from __future__ import annotations

import contextlib
import json
import math
import sys
import time
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Option

from hardware.errors import RigError, SerialPortError
from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.rig.shared import LineInput, PortOption, RigArgument, aside, ended_by_sigterm, load, open_buses
from motiondeck_base.errors import FileFormatError, MotiondeckError
from motiondeck_base.files import check_folder
from motiondeck_base.shipped import find_rig

if TYPE_CHECKING:
    from controller.motion.clip import Plays
    from controller.motion.rotations import Array
    from hardware.bus.servo_bus import Bus
    from hardware.rig.rig_file import RigConfig
    from hardware.tools.teaching import Taught

_CHOICES = "Enter saves it. Or: again, take (save it and record another take), whole, trim, once, loop, drop"


def teach(
    rig: RigArgument,
    out: Annotated[Path, Option(metavar="FILE|DIR", help="A .clip, a folder for several, or keyframes (.toml).")],
    port: PortOption = None,
    seconds: Annotated[float | None, Option(metavar="SECONDS", help="Record at once, for this long.")] = None,
    once: Annotated[
        bool | None,
        Option(
            "--once/--loop",
            help="Learn it as a one-shot or as a loop; default: a loop if it ends where it began.",
            show_default=False,
        ),
    ] = None,
    trim: Annotated[bool, Option("--trim/--no-trim", help="Leave out the time before and after all movement.")] = True,
    as_json: JsonOption = False,
) -> None:
    """Record a motion by hand, or write it as keys on a page.

    Hold what would fall before the torque goes off. After each recording, save it, record it again, undo the trim, or
    record another take: takes of one motion (wave.clip, wave.2.clip ...) are averaged when they are learned. With a
    folder as --out, motions are named and recorded one after the other.

    With --out NAME.toml a page opens, where you pose the joints with sliders or by hand, set keys over the time, see
    what the limits of the rig make of them, save the keyframes, learn them and play them, emulated or on the rig.
    Nothing moves until then, and no servo is needed.

    The clip can be played as it is, or learned, so that it loops and switches like any other motion.

    [bold]Examples[/]

      motiondeck rig teach my-rig.toml --out wave.clip
      motiondeck rig teach my-rig.toml --out gestures/
      motiondeck rig teach my-rig.toml --out wave.toml
      motiondeck play wave.clip --rig my-rig.toml
      motiondeck learn wave.clip nod.clip --out gestures.safetensors
    """
    plays = None if once is None else "once" if once else "loop"
    if out.suffix == ".toml":
        _write_keys(rig, out, port, plays)
        return
    # Slow to import: done before a joint has to be held.
    import controller.learning.recipe  # noqa: F401
    import hardware.tools.teaching  # noqa: F401
    from hardware.tools.loose_joints import loosen

    session = _Session(load(rig), rig, plays, trim, as_json, LineInput())
    folder = out.is_dir() or not out.suffix
    if out.suffix != ".clip" and not folder:
        raise MotiondeckError(f"{out}: give a name that ends in .clip or .toml, or a folder for several clips")
    check_folder(out)
    if seconds is not None and folder:
        raise MotiondeckError(f"--seconds records one motion: give it a file, not the folder {out}")
    if seconds is not None and not 0.0 < seconds < 3600.0:
        raise MotiondeckError(f"--seconds {seconds:g} is not between 0 and 3600")
    if folder:
        out.mkdir(exist_ok=True)
    with ended_by_sigterm(), open_buses(session.config, port) as parts:
        if seconds is None:
            session.typed.ask("The torque goes off: hold what would fall, then press Enter ")
        for part, bus in parts:
            loosen(part, bus)
        if seconds is not None:
            session.save(session.recorded(parts, seconds), out, shown=False)
        elif folder:
            session.record_motions(parts, out)
        else:
            session.record_takes(parts, out, out)
    session.report()


def _write_keys(rig: str, out: Path, port: list[str] | None, plays: Plays | None) -> None:
    from controller.motion.encodings.joint_angles import JointBody
    from hardware.tools.teaching import watch_hands
    from motiondeck.page.keys.draft import Draft
    from motiondeck.page.keys.keys_page import Rehearsal, show_keys
    from motiondeck.run.beside.child_process import free_port
    from motiondeck.run.robots.rig_on_deck import robot_of

    check_folder(out)
    config, file = load(rig), find_rig(rig)
    robot = robot_of(file, JointBody.of(config.names))
    draft = Draft(out, robot, plays or "once")

    def read_rig() -> dict[str, float]:
        with open_buses(config, port) as parts:
            angles = next(watch_hands(config, parts, time.sleep)).angles
        if silent := [name for name, angle in zip(config.names, angles, strict=True) if math.isnan(angle)]:
            raise RigError(f"{', '.join(silent)} does not answer. Check the cable and the power.")
        return {name: math.degrees(angle) for name, angle in zip(config.names, angles, strict=True)}

    page = free_port(0)
    print(f"page: http://127.0.0.1:{page}", flush=True)
    with ended_by_sigterm(), contextlib.suppress(KeyboardInterrupt):
        show_keys(draft, robot, read_rig, Rehearsal(out, str(file)), page)
    if draft.unsaved:
        print(f"motiondeck: the keys were not saved to {out}", file=sys.stderr)


@dataclass
class _Recording:
    """A recorded movement, and how to save it."""

    taught: Taught
    plays: Plays
    trim: bool
    cut_short: str  # why it broke off; "" if it did not

    @property
    def angles(self) -> Array:
        """The angles to save, shape (T, J), rad."""
        return self.taught.moving if self.trim else self.taught.whole

    def describe(self, rate: float) -> str:
        """Its length, the trimmed ends, and how it plays."""
        whole, first, end = len(self.taught.whole) / rate, self.taught.first / rate, self.taught.end / rate
        left = ", ".join(
            f"{seconds:.1f} s {where}"
            for seconds, where in ((first, "before the first movement"), (whole - end, "after the last"))
            if seconds >= 0.05
        )
        trimmed = f" (left out: {left}; `whole` or --no-trim keeps it)" if self.trim and left else ""
        return f"{len(self.angles) / rate:.1f} s of {whole:.1f} s{trimmed}, {self.plays}"


@dataclass
class _Session:
    """Recordings of one rig, one after the other."""

    config: RigConfig
    source: str
    plays: Plays | None
    trim: bool
    as_json: bool
    typed: LineInput
    written: list[dict[str, object]] = field(default_factory=list)
    cut_short: str = ""

    def record_motions(self, parts: list[tuple[RigConfig, Bus]], folder: Path) -> None:
        """Prompts for names and records a motion for each, or another take of one that exists."""
        from controller.learning.recipe import check_name

        while not self.cut_short and (name := self.typed.ask("Name of the next motion (Enter ends) ")):
            try:
                check_name(name, folder)
            except FileFormatError as error:
                aside(str(error).removeprefix(f"{folder}: "))
                continue
            out = folder / f"{name}.clip"
            if out.exists():
                aside(f"{out.name} exists already: this will be another take of it, {_next_take(out).name}")
            self.record_takes(parts, out, _next_take(out) if out.exists() else out)

    def record_takes(self, parts: list[tuple[RigConfig, Bus]], out: Path, file: Path) -> None:
        """Records takes of the motion `out`, the first into `file`, until the last one is saved or dropped."""
        from controller.motion.formats.taught_clip import read_taught_clip

        while True:
            self.typed.ask(f"{file.stem}: torque is off. Press Enter to begin ")
            try:
                recording = self.recorded(parts, None)
            except RigError as error:
                if self.cut_short:
                    raise
                aside(f"{error} Once more.")
                continue
            if file != out and self.plays is None:
                recording.plays = read_taught_clip(out).plays or "loop"  # takes of a motion are learned alike
            choice = "" if recording.cut_short else self._choose(recording, file)
            if choice == "drop":
                return
            if choice == "again":
                continue
            self.save(recording, file, shown=not recording.cut_short)
            if choice != "take":
                return
            file = _next_take(out)

    def report(self) -> None:
        """Reports what was written; exit code 1 if the last recording was cut short."""
        if self.as_json:
            last = self.written[-1] if self.written else {"written": None}
            print(json.dumps(last if len(self.written) < 2 else {"clips": self.written}))
        if self.cut_short:
            print(f"motiondeck: {self.cut_short} What was recorded before is saved.", file=sys.stderr)
            raise typer.Exit(1)

    def _choose(self, recording: _Recording, file: Path) -> str:
        """Describes a recording and prompts for what to do: "" (save), "take", "again" or "drop"."""
        rate = self.config.rate_hz
        while True:
            aside(f"{file.stem}: {recording.describe(rate)}")
            for line in self._doubts(recording, file):
                aside(f"note: {line}")
            choice = self.typed.ask(f"{_CHOICES}: ")
            match choice:
                case "" | "take" | "again" | "drop":
                    return choice
                case "whole" | "trim":
                    recording.trim = choice == "trim"
                case "once" | "loop":
                    recording.plays = choice
                case _:
                    aside(f"unknown choice '{choice}'")

    def _doubts(self, recording: _Recording, file: Path) -> list[str]:
        from controller.learning.preparation.takes import join_takes, motion_of
        from controller.motion.encodings.joint_angles import angles_of
        from controller.motion.formats.taught_clip import read_taught_clip
        from hardware.tools.teaching import beyond_limits

        rate = self.config.rate_hz
        doubts = [f"{one}; played, it will be held back" for one in beyond_limits(self.config, recording.angles, rate)]
        written = [Path(str(one["written"])) for one in self.written]
        takes = [one for one in written if motion_of(one) == motion_of(file) and one != file]
        if takes:
            angles = [angles_of(read_taught_clip(take).rotation[:, 1:]) for take in takes]
            names = [*(take.name for take in takes), "this take"]
            try:
                joined = join_takes([*angles, recording.angles], names, rate, loop=recording.plays == "loop")
                doubts.append(f"it is {joined.apart[-1]:.2f} rad from the average of {len(names)} takes")
            except FileFormatError as error:
                doubts.append(str(error))
        return doubts

    def recorded(self, parts: list[tuple[RigConfig, Bus]], seconds: float | None) -> _Recording:
        """Records for some seconds, or until Enter; what was recorded when it is cut short, too."""
        from controller.learning.preparation.takes import is_periodic
        from hardware.tools.teaching import taught, watch_hands

        moments = []
        if seconds is None:
            aside("Recording. Press Enter to end ")
        try:
            for moment in watch_hands(self.config, parts, time.sleep):
                moments.append(moment)
                if moment.time >= seconds if seconds is not None else self.typed.take() is not None:
                    break
        except KeyboardInterrupt:
            aside("")
        except (RigError, SerialPortError) as error:
            self.cut_short = str(error)
        except SystemExit:
            self.cut_short = "the recording was ended by SIGTERM."
        rate = self.config.rate_hz
        try:
            found = taught(moments, rate)
        except RigError as error:
            if not self.cut_short:
                raise
            raise RigError(f"{self.cut_short} Nothing is saved: {error}") from error
        plays = self.plays or ("loop" if is_periodic(found.moving, rate, at_least=0.5) else "once")
        return _Recording(found, plays, self.trim, self.cut_short)

    def save(self, recording: _Recording, out: Path, shown: bool) -> None:
        """Writes a recording and adds it to the report; prints its doubts unless they were shown before."""
        from controller.motion.formats.taught_clip import save_taught_clip, taught_clip
        from hardware.tools.teaching import beyond_limits

        config, rate = self.config, self.config.rate_hz
        clip = taught_clip(out.stem, config.names, rate, recording.angles, self.source)
        save_taught_clip(clip, out, recording.plays)
        warnings = beyond_limits(config, recording.angles, rate)
        self.written.append(
            {
                "written": str(out),
                "joints": list(config.names),
                "frames": len(clip),
                "seconds": clip.duration,
                "recorded_seconds": len(recording.taught.whole) / rate,
                "plays": recording.plays,
                "beyond_limits": warnings,
                "cut_short": recording.cut_short or None,
            }
        )
        if self.as_json:
            return
        for warning in [] if shown else warnings:
            print(f"note: {warning}; played, it will be held back")
        print(f"wrote {out}: {recording.describe(rate)}, {len(config.names)} joints at {rate:g} Hz", flush=True)


def _next_take(out: Path) -> Path:
    return next(file for n in count(2) if not (file := out.with_name(f"{out.stem}.{n}.clip")).exists())
