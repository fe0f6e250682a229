"""Pictures of what a library plays: contact sheets and films, drawn off screen and as fast as the machine can."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.cli.session.script import Cue
from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary, load_library
from controller.rotations import Array
from motiondeck_base.shipped import find_library, find_robot

if TYPE_CHECKING:
    from sim.physics.playback import KinematicPlayback
    from sim.robots.robot import Robot

# Pictures a second, and their size: a GIF has to be small to be shown on a page.
FILM = {".mp4": (30.0, (640, 480)), ".gif": (20.0, (400, 300))}
STEPS_A_SECOND = 120
MOMENTS = 8
SHEET_SECONDS = {"loop": 1.0, "once": 0.6}


def draw_sheet(library: str, robot: str, out: Path) -> None:
    """One row a motion, MOMENTS pictures each, spread over one period of a loop or the moving part of a single act."""
    from sim.physics.playback import KinematicPlayback
    from sim.pictures.video import contact_sheet
    from sim.robots.robot import load_robot

    loaded = load_library(find_library(library))
    body = load_robot(find_robot(robot), loaded.skeleton)
    rows: list[tuple[str, list[Array]]] = []
    for motion in loaded.info.motions:
        deck = Deck(loaded, body.retarget, motion.name)
        stage = KinematicPlayback(body)
        # A third of what a single act was learned from is the pose that it holds in the end.
        seconds = motion.frames / loaded.info.rate * SHEET_SECONDS[motion.plays]
        moments: list[Array] = []
        for _ in range(MOMENTS):
            _play_on(deck, stage, body, seconds / MOMENTS)
            moments.append(stage.qpos.copy())
        rows.append((motion.name, moments))
    contact_sheet(body.model, rows, out)
    print(f"wrote {out} ({len(rows)} motions)", file=sys.stderr)


def film(
    library: MotionLibrary, robot: str, cues: list[Cue], seconds: float, out: Path, solver: str | None = None
) -> dict[str, object]:
    """Films a script and returns what `play --video --json` says.

    Args:
        library: what is played.
        robot: whose body plays it.
        cues: what is played when.
        seconds: how long.
        out: the film, .mp4 or .gif.
        solver: how motions are carried onto the robot, in place of what its file says.
    """
    from sim.models.robot_file import solver_named
    from sim.robots.robot import load_robot

    body = load_robot(find_robot(robot), library.skeleton, solver_named(solver), 1.0 / STEPS_A_SECOND)
    hz, _ = FILM.get(out.suffix.lower(), FILM[".mp4"])
    total = max(1, round(seconds * hz))
    return film_frames(body.model, _frames(library, body, cues, total, hz), total, out)


def film_frames(model: Any, frames: Iterable[Array], total: int, out: Path) -> dict[str, object]:
    """Films so many qpos (nq,) of a MuJoCo model, at the rate that FILM gives the ending of the file."""
    from controller.cli.common.progress import progress
    from sim.pictures.video import render

    hz, size = FILM.get(out.suffix.lower(), FILM[".mp4"])
    with progress("filming", total) as tick:
        count = render(model, frames, out, hz, size, True, lambda _: tick())
    return {"video": str(out), "frames": count, "fps": hz, "bytes": out.stat().st_size}


def _frames(library: MotionLibrary, body: Robot, cues: list[Cue], total: int, hz: float) -> Iterator[Array]:
    """One qpos a picture."""
    from sim.physics.playback import KinematicPlayback

    deck = Deck(library, body.retarget, cues[0].motion)
    stage = KinematicPlayback(body)
    waiting = list(cues[1:])
    for _ in range(total):
        while waiting and waiting[0].at <= deck.time:
            deck.switch(waiting.pop(0).motion)
        _play_on(deck, stage, body, 1.0 / hz)
        yield stage.qpos


def _play_on(deck: Deck, stage: KinematicPlayback, body: Robot, seconds: float) -> None:
    """Lets the deck play for so long, in steps of about a tick, and shows where that ends."""
    steps = max(1, round(seconds * STEPS_A_SECOND))
    for _ in range(steps - 1):
        deck.update(seconds / steps)
    targets, pose = deck.update(seconds / steps)
    stage.write(np.clip(targets, body.limits.lower, body.limits.upper), pose)
