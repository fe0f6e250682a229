# pyright: strict
"""Starts a live deck: its process, with what it is to play and on which robot."""

from __future__ import annotations

import contextlib
import math
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import msgspec

from controller.wire.run_folder import run_folder
from motiondeck.deck_process import DeckProcess
from motiondeck.libraries import Library
from motiondeck.live import LiveDeck
from motiondeck.run.live_deck import LiveRequest, with_right_types
from motiondeck_base.errors import MotiondeckError

__all__ = ["play"]


def play(
    library: str | Path | Library = "thesis15",
    motion: str | None = None,
    *,
    robot: str | Path = "mannequin",
    rig: str | Path | None = None,
    page: bool | int = False,
    seconds: float | None = None,
    record: str | Path | None = None,
    outputs: Sequence[str] = (),
    rate: float = 200.0,
    physics: bool = True,
    root: Literal["gantry", "fixed", "free"] = "gantry",
    balance: bool = False,
    walk: bool = False,
    command_port: int = 0,
    lock_to: str | int | LiveDeck | None = None,
) -> LiveDeck:
    """Starts a live deck and returns when it plays.

    The deck ends with its `with` block, after `seconds`, or with the program that started it, even if that is killed.

    Args:
        library: a shipped one by its name, a file, or one in memory.
        motion: the first motion; by default `walk`, or the library's first.
        robot: a shipped one by its name ("mannequin", "servo20"), or a robot file.
        rig: its servos: "emulated", a shipped rig or a rig file; None for none.
        page: whether there is a page in the browser, on a free port or on this one; see `LiveDeck.page`.
        seconds: how long to play; None until it is closed.
        record: the file in which every tick is recorded, for `motiondeck replay` and `plot`.
        outputs: outputs of other packages that get the joint targets, each NAME or NAME:ARGUMENT.
        rate: ticks of the loop a second, Hz.
        physics: whether servos and masses are simulated; without them the robot is exactly at its targets.
        root: what holds the simulated robot: a gantry, a fixed stand, or nothing.
        balance: whether a free robot keeps its balance.
        walk: whether a free robot walks where the motion goes.
        command_port: where commands come in; 0 for a free port.
        lock_to: "beat", "body", another deck or its command port: what the phase is locked to from the start.

    Raises:
        MotiondeckError: if a name does not exist (it names the nearest), or a file, port or rig cannot be used.
    """
    with contextlib.ExitStack() as opening:
        if isinstance(library, Library):
            file = opening.enter_context(run_folder()) / "played.safetensors"
            library.save(file)
            library = file
        request = LiveRequest(
            library=str(library),
            motion=motion,
            robot=str(robot),
            rig=str(rig) if rig is not None else None,
            rate=rate,
            physics=physics,
            root=root,
            balance=balance,
            walk=walk,
            page_port=None if page is False else 0 if page is True else page,
            command_port=command_port,
            seconds=seconds,
            record=str(record) if record is not None else None,
            outputs=tuple(outputs),
            lock_to=str(lock_to.command_port if isinstance(lock_to, LiveDeck) else lock_to) if lock_to else None,
        )
        request = with_right_types(request)
        for name, value in (("rate", request.rate), ("seconds", request.seconds)):
            if value is not None and not math.isfinite(value):
                raise MotiondeckError(f"{name} is {value}, not a finite number")
        module = "motiondeck.run.live_deck"
        # In a session of its own: Ctrl-C is for the program, whose `with` block then ends the deck.
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", module, msgspec.json.encode(request).decode()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        return LiveDeck(DeckProcess(process, opening.pop_all()))
