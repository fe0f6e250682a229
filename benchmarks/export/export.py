"""Whether the C player plays random commands as the deck, within limits.

Each sequence is played by the deck in virtual time and by the C player: once with limits so wide that all targets pass,
where angles are compared; once with the joints' own limits, where a judge of its own looks for broken ones. Where
limits hold joints back, the way back to the target depends on the last bit of it (for the deck too, which is measured
with targets rounded to 32 bits), so there the mean distance from the target is compared instead.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from pathlib import Path
from random import Random
from typing import Annotated

import numpy as np
import typer

from benchmarks.command import run
from benchmarks.export._c_player import (
    SANITIZED,
    CPlayer,
    beyond_limits,
    deck_plays,
    in_fixed_point,
    random_script,
    wide,
)
from controller.motion.rotations import Array
from motiondeck import learn
from motiondeck.export.figure import Figure
from motiondeck.export.golden import Trace
from motiondeck.export.source import open_figure

SAME = {False: 1e-3, True: 3e-3}  # rad, in floats and in fixed point
EXAMPLES = Path(__file__).parents[2] / "examples"


def figure_of(name: str) -> Figure:
    """A baked library on a robot, as thesis15:servo20, or all motions of an example on its rig, as head."""
    library, _, robot = name.partition(":")
    if robot:
        return open_figure(library, robot, None)
    folder, rig = EXAMPLES / name, EXAMPLES / name / f"{name}.toml"
    with tempfile.TemporaryDirectory() as place:
        learned = learn([file for file in sorted(folder.glob("*.toml")) if file != rig], name=name)
        learned.save(file := Path(place) / f"{name}.safetensors")
        return open_figure(str(file), None, str(rig))


def measured(figure: Figure, rng: Random) -> Array:
    """Joint angles near the rest pose, rad, as 32 bits hold them."""
    limits = figure.limits
    near = np.clip([angle + rng.uniform(-0.3, 0.3) for angle in figure.rest], limits.lower + 1e-3, limits.upper - 1e-3)
    return near.astype(np.float32).astype(float)


def played(figure: Figure, player: CPlayer, seed: int, ticks: int, *, layered: bool) -> tuple[Array, Trace, Trace]:
    """Where the joints start, rad, and what the deck and the C player play of the random commands of a seed."""
    rng = Random(seed)
    start, script = measured(figure, rng), random_script(figure, ticks, rng, layered=layered)
    return start, deck_plays(figure, script, ticks, start), player.trace(figure, script, ticks, start)


def parted(
    figure: Figure, player: CPlayer, seeds: Iterable[int], ticks: int, *, layered: bool
) -> tuple[list[int], list[float]]:
    """The sequences in which angles part by SAME, or commands are not taken alike, and how far angles part in all."""
    found, off = list[int](), list[float]()
    for seed in seeds:
        _, deck, ours = played(figure, player, seed, ticks, layered=layered)
        off.append(float(np.abs(deck.safe - ours.safe).max()))
        if off[-1] >= SAME[figure.fixed] or deck.accepted != ours.accepted:
            found.append(seed)
    return found, off


def within_limits(
    figure: Figure, player: CPlayer, seeds: Iterable[int], ticks: int, *, layered: bool
) -> tuple[float, float, float]:
    """The largest excess over a limit, as a share of it, and how far from targets C and deck are, rad (rms)."""
    worst, squares = -1.0, list[tuple[float, float]]()
    for seed in seeds:
        start, deck, ours = played(figure, player, seed, ticks, layered=layered)
        worst = max(worst, beyond_limits(figure, start, ours.safe))
        squares.append(
            (float(np.square(ours.safe - ours.targets).mean()), float(np.square(deck.safe - deck.targets).mean()))
        )
    mean = np.sqrt(np.mean(squares, axis=0))
    return worst, float(mean[0]), float(mean[1])


def main(
    libraries: Annotated[
        list[str] | None, typer.Argument(help="Libraries and robots, as thesis15:servo20, or examples, as head.")
    ] = None,
    sequences: Annotated[int, typer.Option(help="Of each library.")] = 300,
    seconds: Annotated[float, typer.Option(help="Of each sequence.")] = 6.0,
    first: Annotated[int, typer.Option(help="The seed of the first one.")] = 0,
    limited: Annotated[int, typer.Option(help="One in so many is played with the robot's own limits, too.")] = 3,
    layered: Annotated[bool, typer.Option(help="With layers and live values.")] = False,
    sanitized: Annotated[bool, typer.Option(help="With the sanitizers of the compiler.")] = False,
    fixed: Annotated[bool, typer.Option(help="In fixed-point numbers.")] = False,
) -> None:
    """Plays random commands on the deck and on the C player."""
    with tempfile.TemporaryDirectory() as folder:
        player = CPlayer(Path(folder), ("-DMD_MOST_LAYERS=16", *(SANITIZED if sanitized else ())), fixed=fixed)
        for name in libraries or ["thesis15:servo20", "cmu86:servo20", "head", "arm", "hexapod"]:
            figure = in_fixed_point(figure_of(name)) if fixed else figure_of(name)
            ticks = round(seconds * figure.rate)
            found, off = parted(wide(figure), player, range(first, first + sequences), ticks, layered=layered)
            print(f"{name}: {sequences} sequences, {len(found)} part by {1e3 * SAME[fixed]:g} mrad {found[:8]}")
            print(
                f"  largest difference: median {1e3 * np.median(off):.3f} mrad, 99 % {1e3 * np.quantile(off, 0.99):.3f}"
            )
            excess, ours, deck = within_limits(
                figure, player, range(first, first + max(1, sequences // limited)), ticks, layered=layered
            )
            print(f"  limits: largest excess {excess:.1e} (none below 0)")
            print(f"  from the targets, rms: {1e3 * ours:.2f} mrad (C), {1e3 * deck:.2f} (deck)")


if __name__ == "__main__":
    run("export", main)
