"""Reports on libraries: tables for people, plain values for scripts."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import msgspec

from controller.deck.joins.join_limits import FASTEST, HARDEST
from controller.library.motion_library import MotionLibrary
from motiondeck.cli.common.tables import show_table

if TYPE_CHECKING:
    from collections.abc import Iterable

    from controller.deck.worst_join import Join
    from controller.learning.training_set import LearnedPart
    from controller.library.motion_library import MotionInfo


def report(library: MotionLibrary) -> dict[str, object]:
    """The facts of a library, for scripts."""
    info = library.info
    return {
        "name": info.name,
        "network": info.network,
        "neurons": library.network.neurons,
        "rate_hz": info.rate,
        "seed": info.seed,
        "skeleton": info.skeleton.name,
        "bones": len(info.skeleton.bones),
        "motions": [msgspec.to_builtins(motion) for motion in info.motions],
        "licence": info.licence,
        "acknowledgement": info.acknowledgement,
    }


def print_table(library: MotionLibrary) -> None:
    """Prints a row for each motion: its length, errors in training, and verdict; then `print_errors`."""
    info = library.info
    error = "self-test, mrad" if info.encoding == "joint angles" else "self-test, mm"
    rows = [
        (
            motion.name,
            motion.plays,
            f"{motion.frames / info.rate:.2f}",
            f"{motion.nrmse:.4f}",
            f"{motion.error_mm:.1f}",
            "[green]passed[/]" if motion.passed else f"[red]failed[/]: {motion.reason}",
        )
        for motion in info.motions
    ]
    show_table(
        ("motion", "plays", "seconds", "NRMSE", error, "verdict"),
        rows,
        title=f"{info.name}: {info.network}, {library.network.neurons} neurons, {info.rate:g} Hz",
        left=("plays", "verdict"),
    )
    print_errors(info.motions)


def print_errors(motions: Iterable[MotionInfo]) -> None:
    """Prints a row for each motion that was compared with its recording."""
    rows = []
    for motion in motions:
        if (error := motion.against_recording) is None:
            continue
        spread = (f"{one.median:.1f} / {one.p95:.1f} / {one.worst:.1f}" for one in (error.mm, error.degrees))
        worst = error.mm.where.replace(" at ", ", ")
        held = "" if error.held_degrees is None else f"{error.held_degrees:.1f}"
        feet = ("", "")
        if error.slide_mm is not None:
            feet = (f"{error.slide_mm:.0f} ({error.recorded_slide_mm:.0f})", f"{error.floor_mm:z.0f}")
        rows.append((motion.name, *spread, worst, f"{error.own_body_mm:.1f}", held, *feet))
    if not rows:
        return
    headings = ("motion", "mm", "degrees", "worst at", "own body, mm", "held pose, °", "feet slide, mm", "floor, mm")
    title = "free run against the recording: median / 95 % / worst"
    show_table(headings, rows, title=title, left=("worst at",))


def join_fields(join: Join | None) -> dict[str, Any] | None:
    """The worst join, for scripts; null where nothing can be joined."""
    return join and asdict(join) | {"passes": join.passes}


def join_line(join: Join) -> str:
    """The worst join as a line of text."""
    verdict = "" if join.passes else ": too fast, so a robot may lag there"
    return (
        f"worst join found: {join.source} to {join.target} at phase {join.phase:.2f}, {join.speed:.2f} x speed and "
        f"{join.acceleration:.2f} x acceleration of the motions (limits {FASTEST:g} and {HARDEST:g}){verdict}"
    )


def part_fields(part: LearnedPart | None) -> dict[str, float | None]:
    """The learned part of a recording and its seam, for scripts; null where unknown."""
    return {
        "from_s": part and part.first,
        "to_s": part and part.end,
        "recorded_s": part and part.recorded,
        "seam_mm": part and part.seam_mm,
        "seam_degrees": part and part.seam_degrees,
    }


def part_of(part: LearnedPart) -> str:
    """The learned part of a recording as text."""
    return f"{part.first:.2f} to {part.end:.2f} of {part.recorded:.2f} s"


def seam_of(part: LearnedPart) -> str:
    """The seam of a loop, or the best one of a one-shot, as text."""
    return "" if part.seam_mm is None else f"{part.seam_mm:.0f} mm, {part.seam_degrees:.0f}°"
