"""`motiondeck rig identify`: measures how late, how far and how hard each joint follows, and writes it down."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer
from typer import Option

from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.rig.shared import PortOption, RigArgument, aside, handled, load
from motiondeck_base.errors import MotiondeckError, UnknownNameError

if TYPE_CHECKING:
    from hardware.rig.rig_file import RigConfig
    from hardware.tools.identify import Response


def identify(
    rig: RigArgument,
    joint: Annotated[list[str] | None, Option(metavar="JOINT", help="One joint; repeatable. Default: all.")] = None,
    port: PortOption = None,
    out: Annotated[Path | None, Option(metavar="FILE", help="Write here instead of into the rig file itself.")] = None,
    dry_run: Annotated[bool, Option("--dry-run", help="Measure and print; write nothing.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Measure how late each joint is, and write it into the rig file.

    One joint after the other swings by at most 0.2 rad for 8 s, ever faster up to 2 Hz, within half of its speed limit
    and within its limits, around where it stands; the others hold. Support what would fall at the end, when the torque
    goes off (`on_exit`). Heat, a servo's error, much current or a shaft that does not follow stop it, and Ctrl-C does:
    the joint is braked, and nothing is written.

    `lag` (s) and `friction` (A) of each joint are put into the file, and all else in it stays; FILE.bak keeps what was
    there. With `lag` the deck leads: shafts are then where the motion is.

    [bold]Examples[/]

      motiondeck rig identify my-rig.toml
      motiondeck rig identify my-rig.toml --joint pan --dry-run
    """
    from hardware.tools.rig_writing import set_in_joints
    from motiondeck_base.shipped import find_rig

    config, source = load(rig), Path(find_rig(rig))
    if not dry_run and out is None and not Path(rig).is_file():
        raise MotiondeckError(f"{rig} is a shipped rig, which stays as it is: give a file with --out, or --dry-run")
    for name in joint or ():
        UnknownNameError.check("joint of this rig", name, config.names)
    found = _measure(config, joint or config.names, port or [], aside if as_json else print)
    target = None if dry_run else out or source
    kept = None
    if target is not None:
        values = {name: {"lag": round(one.lag, 4), "friction": round(one.friction, 3)} for name, one in found.items()}
        kept = set_in_joints(source, values, target)
    if as_json:
        joints = [{"name": name, **one._asdict()} for name, one in found.items()]
        print(json.dumps({"written": target and str(target), "joints": joints}))
    elif target is not None:
        print(f"wrote {target}" + (f"; {kept} is what was there" if kept else ""))


def _measure(
    config: RigConfig, joints: Sequence[str], ports: list[str], say: Callable[[str], None]
) -> dict[str, Response]:
    """Identifies these joints and tells each result; exit code 130 (143) if a signal has stopped it."""
    from hardware.rig.supervision.rig import Rig
    from hardware.tools.identify import JointTrials, Stopped

    found: dict[str, Response] = {}
    config = msgspec.structs.replace(config, read_hz=0.0, on_loss="stop")
    received: list[int] = []
    end = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
    with handled(lambda number, frame: received.append(number), *end):
        rig = Rig.connect(config, ports)
        try:
            run = JointTrials(rig, now=time.monotonic, sleep=time.sleep, asked=lambda: bool(received))
            say(f"{'joint':<18} {'lag':>6} {'gain':>5} {'friction':>9}   off its targets, mrad RMS: now, one lag ahead")
            for name in joints:
                found[name] = one = run.joint(config.names.index(name))
                say(
                    f"{name:<18} {one.lag * 1e3:>3.0f} ms {one.gain:>5.2f} {one.friction:>7.3f} A   "
                    f"{one.before * 1e3:.1f}, {one.after * 1e3:.1f}"
                )
        except Stopped:
            aside("motiondeck: the joint was braked; nothing is written.")
            raise typer.Exit(128 + received[0]) from None
        finally:
            if unconfirmed := rig.close():
                aside(f"motiondeck: torque may still be on: {', '.join(unconfirmed)}. Cut the power.")
    return found
