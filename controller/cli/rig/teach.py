"""`motiondeck rig teach`: joints moved by hand become a clip."""

from __future__ import annotations

import json
import sys
import threading
import time
from pathlib import Path
from typing import Annotated

import typer

from controller.cli.rig.rig_port import JsonOption, PortOption, RigArgument, ended_by_sigterm, load, open_buses
from motiondeck_base.errors import MotiondeckError


def teach(
    rig: RigArgument,
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="Where the clip goes (.clip).")],
    port: PortOption = None,
    seconds: Annotated[
        float | None, typer.Option("--seconds", help="Begin at once and record for so long, without asking.")
    ] = None,
    trim: Annotated[
        bool, typer.Option("--trim/--no-trim", help="Leave out the time before the first and after the last movement.")
    ] = True,
    as_json: JsonOption = False,
) -> None:
    """Teach a rig by hand: torque off, you move the joints, and what they did becomes a clip.

    Hold what would fall before the torque goes off. The clip can be played as it is, or learned, so that it loops
    and switches like any other motion.

    [bold]Examples[/]

      motiondeck rig teach my-rig.toml --out wave.clip

      motiondeck rig play my-rig.toml wave.clip

      motiondeck fit wave.clip nod.clip --out gestures.safetensors
    """
    from controller.mocap.encodings.joint_angles import save_taught_clip, taught_clip
    from hardware.errors import RigError, SerialPortError
    from hardware.tools.teaching import beyond_limits, loosen, taught, watch_hands

    if out.suffix != ".clip":
        raise MotiondeckError(f"{out}: give the clip a name that ends in .clip")
    if not out.parent.is_dir():
        raise MotiondeckError(f"{out.parent}: there is no such folder to write the clip to")
    if seconds is not None and not 0.0 < seconds < 3600.0:
        raise MotiondeckError(f"--seconds {seconds:g} is not between 0 and 3600")
    config = load(rig)
    moments = []
    cut_short = ""
    with ended_by_sigterm(), open_buses(config, port) as parts:
        if seconds is None:
            _ask("The torque goes off: hold what would fall, then press Enter ")
        for part, bus in parts:
            loosen(part, bus)
        if seconds is None:
            _ask("Torque is off. Press Enter to begin ")
        done = threading.Event()
        if seconds is None:
            threading.Thread(target=_wait_for_enter, args=(done,), daemon=True).start()
        try:
            for moment in watch_hands(config, parts, time.sleep):
                moments.append(moment)
                if done.is_set() or (seconds is not None and moment.time >= seconds):
                    break
        except KeyboardInterrupt:
            print(file=sys.stderr)
        except (RigError, SerialPortError) as error:
            cut_short = str(error)
        except SystemExit:
            cut_short = "the recording was ended by SIGTERM."
    try:
        angles = taught(moments, config.rate_hz, trim)
    except RigError as error:
        if not cut_short:
            raise
        raise RigError(f"{cut_short} Nothing is saved: {error}") from error
    clip = taught_clip(out.stem, config.names, config.rate_hz, angles, rig)
    save_taught_clip(clip, out)
    warnings = beyond_limits(config, angles, config.rate_hz)
    if as_json:
        report = {"written": str(out), "joints": list(config.names), "frames": len(clip), "seconds": clip.duration}
        print(json.dumps(report | {"beyond_limits": warnings, "cut_short": cut_short or None}))
    else:
        for warning in warnings:
            print(f"note: {warning}; played, it will be held back")
        print(f"wrote {out}: {clip.duration:.1f} s of {len(config.names)} joints at {config.rate_hz:g} Hz")
    if cut_short:
        print(f"motiondeck: {cut_short} What was recorded before is saved.", file=sys.stderr)
        raise typer.Exit(1)


def _ask(what: str) -> None:
    """Waits for Enter; the prompt goes to stderr, because stdout carries the result."""
    print(what, end="", file=sys.stderr, flush=True)
    try:
        input()
    except EOFError:
        raise MotiondeckError("there is no terminal in which to press Enter: give --seconds") from None


def _wait_for_enter(done: threading.Event) -> None:
    try:
        _ask("Recording. Press Enter to end ")
    except MotiondeckError:
        pass
    finally:
        done.set()
