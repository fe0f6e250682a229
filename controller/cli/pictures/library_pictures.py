"""Pictures of what a library plays: contact sheets and films, drawn off screen and as fast as the machine can."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.cli.session.script import Timed
from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.command_desk import CommandDesk
from controller.loop.stop_requests import StopRequest
from controller.rotations import Array
from controller.wire.messages import Blend, Refused
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_library, find_robot

if TYPE_CHECKING:
    from sim.physics.playback import KinematicPlayback
    from sim.robots.robot import Robot

# Pictures a second, and their size: a GIF has to be small to be shown on a page.
FILM = {".mp4": (30.0, (640, 480)), ".gif": (20.0, (400, 300))}
STEPS_A_SECOND = 120
MOMENTS = 8
SHEET_SECONDS = {"loop": 1.0, "once": 0.6}


def draw_sheet(library: str, robot: str, out: Path, blends: Sequence[Blend] = ()) -> None:
    """One row a motion, MOMENTS pictures each, spread over one period of a loop or the moving part of a single act.

    With blends, one row each of them instead, over one period of the longer of its motions.

    Raises:
        MotiondeckError: if there is no such motion, or two cannot be blended.
    """
    from sim.physics.playback import KinematicPlayback
    from sim.pictures.video import contact_sheet
    from sim.robots.robot import load_robot

    loaded = load_library(find_library(library))
    body = load_robot(find_robot(robot), loaded.skeleton)
    lasts = {motion.name: motion.frames / loaded.info.rate for motion in loaded.info.motions}
    rows: list[tuple[str, list[Array]]] = []

    def draw(label: str, deck: Deck, seconds: float) -> None:
        stage = KinematicPlayback(body)
        moments: list[Array] = []
        for _ in range(MOMENTS):
            _play_on(deck, stage, body, seconds / MOMENTS)
            moments.append(stage.qpos.copy())
        rows.append((label, moments))

    for blend in blends:
        deck = _blended(loaded, body, blend)
        label = f"{blend.first} + {blend.weight:g} {blend.second}"
        draw(
            f"{label}: {deck.fell_back}" if deck.fell_back else label,
            deck,
            max(lasts[blend.first], lasts[blend.second]),
        )
    for motion in () if blends else loaded.info.motions:
        # A third of what a single act was learned from is the pose that it holds in the end.
        seconds = lasts[motion.name] * SHEET_SECONDS[motion.plays]
        draw(motion.name, Deck(loaded, body.retarget, motion.name), seconds)
    contact_sheet(body.model, rows, out)
    print(f"wrote {out} ({len(rows)} {'blends' if blends else 'motions'})", file=sys.stderr)


def _blended(library: MotionLibrary, body: Robot, blend: Blend) -> Deck:
    """A deck that plays a blend, or what it has fallen back to."""
    if blend.first not in library.network.motions:
        raise UnknownNameError.among("motion", blend.first, library.network.motions)
    deck = Deck(library, body.retarget, blend.first)
    switch = deck.blend_in(blend.first, blend.second, blend.weight)
    while switch.settled_s is None and not deck.fell_back:
        deck.update(1.0 / STEPS_A_SECOND)
    return deck


def film(
    library: MotionLibrary,
    robot: str,
    deck_for: Callable[[Callable[..., Any]], Deck],
    timeline: Sequence[Timed],
    seconds: float,
    out: Path,
    solver: str | None = None,
) -> dict[str, object]:
    """Films a run and returns what `play --video --json` says.

    Args:
        library: what is played.
        robot: whose body plays it.
        deck_for: the deck of that body's retargeting.
        timeline: what is commanded when.
        seconds: how long.
        out: the film, .mp4 or .gif.
        solver: how motions are carried onto the robot, in place of what its file says.

    Raises:
        MotiondeckError: if a command is refused; it says when.
    """
    from sim.models.robot_file import solver_named
    from sim.robots.robot import load_robot

    body = load_robot(find_robot(robot), library.skeleton, solver_named(solver), 1.0 / STEPS_A_SECOND)
    hz, _ = FILM.get(out.suffix.lower(), FILM[".mp4"])
    total = max(1, round(seconds * hz))
    deck = deck_for(body.retarget)
    report = film_frames(body.model, _frames(deck, body, timeline, total, hz), total, out)
    return report | {"fell_back": deck.fell_back}


def film_frames(model: Any, frames: Iterable[Array], total: int, out: Path) -> dict[str, object]:
    """Films so many qpos (nq,) of a MuJoCo model, at the rate that FILM gives the ending of the file."""
    from controller.cli.common.progress import progress
    from sim.pictures.video import render

    hz, size = FILM.get(out.suffix.lower(), FILM[".mp4"])
    with progress("filming", total) as tick:
        count = render(model, frames, out, hz, size, True, lambda _: tick())
    return {"video": str(out), "frames": count, "fps": hz, "bytes": out.stat().st_size}


def _frames(deck: Deck, body: Robot, timeline: Sequence[Timed], total: int, hz: float) -> Iterator[Array]:
    """One qpos a picture."""
    from sim.physics.playback import KinematicPlayback

    stage, desk = KinematicPlayback(body), CommandDesk(deck, ())
    waiting = deque(timeline)
    for _ in range(total):
        while waiting and waiting[0].at <= deck.time:
            timed = waiting.popleft()
            reply, _ = desk.carry_out(timed.message, StopRequest())
            if isinstance(reply, Refused):
                raise MotiondeckError(f"the command at {timed.at:g} s was refused: {reply.reason}")
        _play_on(deck, stage, body, 1.0 / hz)
        yield stage.qpos


def _play_on(deck: Deck, stage: KinematicPlayback, body: Robot, seconds: float) -> None:
    """Lets the deck play for so long, in steps of about a tick, and shows where that ends."""
    steps = max(1, round(seconds * STEPS_A_SECOND))
    for _ in range(steps - 1):
        deck.update(seconds / steps)
    targets, pose = deck.update(seconds / steps)
    stage.write(np.clip(targets, body.limits.lower, body.limits.upper), pose)
