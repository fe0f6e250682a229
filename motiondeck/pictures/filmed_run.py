"""`play --video FILE`: films a run instead of playing it live."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from controller.deck.deck import Deck
from controller.library.motion_library import MotionLibrary
from controller.wire.messages.commands import CommandError
from motiondeck.pictures.library_pictures import FilmLook, Staging, film
from motiondeck.run.spec.script import Timed
from motiondeck_base.errors import MotiondeckError

SHORTEST, AFTER_LAST = 6.0, 4.0  # s: a film without a given length, and what it shows after the last command


def film_run(
    library: MotionLibrary,
    robot: str,
    deck_for: Callable[[Callable[..., Any]], Deck],
    timeline: Sequence[Timed],
    seconds: float | None,
    video: Path,
    look: FilmLook,
    staging: Staging,
) -> tuple[dict[str, Any], str]:
    """Films a run, by default as long as its timeline; its report, and a line for the terminal.

    Raises:
        MotiondeckError: if a command of the timeline is not for a film.
    """
    for timed in timeline:
        try:
            timed.message.row.check_use("film")
        except CommandError as error:
            raise MotiondeckError(f"at {timed.at:g} s: {error}") from None
    length = (
        seconds if seconds is not None else max(SHORTEST, max((one.at for one in timeline), default=0) + AFTER_LAST)
    )
    report = film(library, robot, deck_for, timeline, length, video, look, staging)
    fell_back = f"; {report['fell_back']}" if report["fell_back"] else ""
    return report, f"wrote {video} ({length:g} s, {video.stat().st_size / 1e6:.1f} MB){fell_back}"
