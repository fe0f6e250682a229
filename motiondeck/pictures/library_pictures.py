"""Films of the motions of a library."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary
from controller.loop.commands.commanded_run import CommandedRun
from controller.loop.stop_requests import StopRequest
from controller.motion.rotations import Array
from controller.wire.messages.arguments import CommandError
from controller.wire.messages.replies import Refused
from motiondeck.run.spec.program import Program, Timed
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from sim.robots.catalogue import find_robot

if TYPE_CHECKING:
    from motiondeck.pictures.offscreen import Camera
    from motiondeck.pictures.video import Shot
    from sim.robots.robot import Robot

# Frames per second and size, pixels; a GIF is small enough for a web page.
FILM = {".mp4": (30.0, (1920, 1080)), ".gif": (20.0, (400, 300))}
SHORTEST, AFTER_LAST = 6.0, 4.0  # s: a film without a given length, and its rest after the last command
STEPS_A_SECOND = 200
PRINTS = 24  # of the latest footprints are shown


@dataclass(frozen=True)
class FilmLook:
    """Size (pixels), frames per second, camera and additions of a film."""

    size: tuple[int, int]
    fps: float
    camera: Camera
    ghost: bool = False
    footprints: bool = False


def film_look(
    out: Path, size: str | None, fps: float | None, camera: str, ghost: bool = False, footprints: bool = False
) -> FilmLook:
    """The look from options; defaults follow from the ending of the file.

    MotiondeckError for a size that is not WIDTHxHEIGHT, or another rate than 1 to 240 Hz. UnknownNameError for a camera
    that does not exist.
    """
    from motiondeck.pictures.offscreen import CAMERAS

    usual_fps, usual_size = FILM.get(out.suffix.lower(), FILM[".mp4"])
    numbers = re.fullmatch(r"(\d{1,5})x(\d{1,5})", size or f"{usual_size[0]}x{usual_size[1]}")
    if numbers is None:
        raise MotiondeckError(f"--size '{size}' is not WIDTHxHEIGHT, such as 1920x1080")
    if fps is not None and not 1.0 <= fps <= 240.0:
        raise MotiondeckError(f"--fps {fps:g} is not between 1 and 240 pictures a second")
    if camera not in CAMERAS:
        raise UnknownNameError.among("camera", camera, CAMERAS)
    return FilmLook((int(numbers[1]), int(numbers[2])), fps or usual_fps, camera, ghost, footprints)


def film_run(spec: RunSpec, program: Program, video: Path, look: FilmLook) -> tuple[dict[str, Any], str]:
    """Films a run, by default all its timeline: report and line for the terminal. MotiondeckError by its commands."""
    from sim.models.robot_file import solver_named
    from sim.robots.robot import load_robot

    for timed in program.timeline:
        try:
            timed.message.row.check_use("film")
        except CommandError as error:
            raise MotiondeckError(f"at {timed.at:g} s: {error}") from None
    seconds = program.seconds
    if seconds is None:
        seconds = max(SHORTEST, max((one.at for one in program.timeline), default=0) + AFTER_LAST)
    library = program.source
    assert isinstance(library, MotionLibrary), "a clip is for a rig, and a film has none"
    file = find_robot(spec.robot or "mannequin")
    body = load_robot(file, library.skeleton, solver_named(spec.solver), 1.0 / STEPS_A_SECOND)
    if spec.walk:
        from motiondeck.run.robots.walk_choice import able_to_walk

        body = able_to_walk(body, file)
    total = max(1, round(seconds * look.fps))
    deck = Deck(library, body.retarget, program.first, direct=spec.direct, joining=spec.join)
    frames = _shots(deck, body, program.timeline, total, look, spec)
    report = film_frames(body.drawn, frames, total, video, look) | {"fell_back": deck.fell_back}
    fell_back = f"; {deck.fell_back}" if deck.fell_back else ""
    return report, f"wrote {video} ({seconds:g} s, {video.stat().st_size / 1e6:.1f} MB){fell_back}"


def film_frames(model: Any, frames: Iterable[Array | Shot], total: int, out: Path, look: FilmLook) -> dict[str, object]:
    """Films `total` frames of a MuJoCo model."""
    from motiondeck.pictures.video import render
    from motiondeck_base.progress import progress

    with progress("filming", total) as tick:
        count = render(model, frames, out, look.fps, look.size, True, lambda _: tick(), look.camera)
    return {"video": str(out), "frames": count, "fps": look.fps, "size": look.size, "bytes": out.stat().st_size}


def _shots(
    deck: Deck, body: Robot, timeline: Sequence[Timed], total: int, look: FilmLook, spec: RunSpec
) -> Iterator[Shot]:
    """The frames of the film; between them the deck plays in ticks, as `play` does."""
    from controller.loop.safety.safety_envelope import SafetyEnvelope
    from motiondeck.page.body.footprints import StepWatch
    from motiondeck.pictures.video import Shot
    from sim.models.scenery import body_height
    from sim.physics.kinematic_playback import KinematicPlayback
    from sim.physics.physics_model import feet_of
    from sim.physics.playback import PhysicsPlayback

    dt = 1.0 / STEPS_A_SECOND
    run, envelope = CommandedRun(deck), SafetyEnvelope(body.limits, dt)
    stage = KinematicPlayback(body)
    if spec.physics:
        stage = PhysicsPlayback(body, dt, spec.root, spec.balance, spec.walk)
    watch = StepWatch(feet_of(body), body_height(body.model)) if look.footprints else None
    waiting, prints, ghost = deque(timeline), deque[Array](maxlen=PRINTS), body.model.qpos0.copy()
    started, done = False, 0
    for picture in range(total):
        ticks = round((picture + 1) * STEPS_A_SECOND / look.fps)
        while done < ticks:
            while waiting and waiting[0].at <= deck.time:
                timed = waiting.popleft()
                reply = run.carry_out(timed.message, StopRequest(), remote=False).reply
                if isinstance(reply, Refused):
                    raise MotiondeckError(f"the command at {timed.at:g} s was refused: {reply.reason}")
            targets, pose = deck.update(dt)
            targets = np.clip(targets, body.limits.lower, body.limits.upper)
            if not started:
                envelope.start(targets)
                started = True
            stage.write(envelope(targets), pose)
            done += 1
            if look.ghost and done == ticks:
                body.layout.place(targets, ghost)
                ghost[:7] = stage.placed
                if isinstance(stage, PhysicsPlayback):
                    ghost[:] = stage.wanted
            if watch is not None:
                prints += watch(stage.data, dt)
        yield Shot(stage.qpos, ghost if look.ghost else None, prints)
