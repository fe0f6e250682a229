"""`motiondeck fit`: trains a motion library from a recipe and recordings."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from motiondeck.cli.common.options import JsonOption


def fit(
    what: Annotated[
        list[Path],
        typer.Argument(
            metavar="RECIPE | CLIP...",
            help="A recipe (TOML), such as configs/libraries/thesis15.toml, or clips from `motiondeck rig teach`.",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="The library to write (.safetensors); default: here, by the recipe's name."
        ),
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option(
            "--data", metavar="DIR", help="The folder with the recipe's recordings; default: the recipe's own."
        ),
    ] = None,
    centers: Annotated[
        str | None,
        typer.Option(
            "--centers", metavar="N|auto", help="Number of centers of a centralized network; default: the recipe's."
        ),
    ] = None,
    satellites: Annotated[
        str | None, typer.Option("--satellites", metavar="N|auto", help="Number of satellites; auto: chosen by AICc.")
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            metavar="MM",
            min=0.01,
            help="The smallest phase-driven network whose mean error of every motion is at most this.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="DIR", help="Plot feet and hands of each motion as recorded and as played."),
    ] = None,
    trim: Annotated[
        bool,
        typer.Option(
            "--trim/--no-trim", help="Learn the part of a taught loop that closes best; --no-trim: all of it."
        ),
    ] = True,
    allow_failing: Annotated[
        bool, typer.Option("--allow-failing", help="Write the library even if a motion fails its self-test.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Train a motion library: read the recordings, close their loops, train the network, and test every motion.

    In the self-test each motion runs free for three times its length and is compared with all recordings. If a
    motion fails, the library is only written with --allow-failing.

    Clips recorded by `motiondeck rig teach` need no recipe: each becomes a motion with the name of its file, a loop or
    a one-shot as it was taught. Clips named NAME.clip, NAME.2.clip and so on are takes of one motion and are averaged.
    Of a loop the part that returns best to its start is learned; what is left out is printed.

    [bold]Examples[/]

      motiondeck fit configs/libraries/thesis15.toml --data recordings --out my.safetensors
      motiondeck fit wave.clip nod.clip --out gestures.safetensors
      motiondeck fit configs/libraries/cmu86.toml --data cmu --centers auto --satellites auto --out small.safetensors
    """
    from controller.learning import fit as training
    from controller.learning.recipe import warnings
    from controller.learning.training_set import prepare
    from controller.library.motion_library import save_library
    from motiondeck.cli.common.options import check_ending
    from motiondeck.cli.fit_plan import new_library, plan_of, sized
    from motiondeck.cli.fit_report import compare, learned_parts, plot_closeness, print_json, print_words
    from motiondeck_base.errors import MotiondeckError
    from motiondeck_base.files import check_folder
    from motiondeck_base.progress import progress

    if out is not None:
        check_ending(out, "a library")
    plan, folder, taught = plan_of(what, data, out, trim=trim)
    out = new_library(plan.name) if out is None else out
    check_folder(out)
    plan = sized(plan, centers, satellites, tolerance)
    if plot is not None:
        from motiondeck.pictures.figures import check_picture

        check_picture(plot / "motion.png")
    for warning in warnings(plan):
        print(f"motiondeck: warning: {what[0]}: {warning}", file=sys.stderr)
    with progress("", training.steps(plan)) as tick:
        training_set = prepare(plan, folder, tick)
        library = training.fit_prepared(plan, training_set, tick)
    closeness = compare(library, training_set, plan.network.anchor_every)
    if plot is not None:
        plot_closeness(library, training_set, plan.network.anchor_every, plot)
    failing = [motion.name for motion in library.info.motions if not motion.passed]
    written = not failing or allow_failing
    if written:
        save_library(library, out)
    learned = learned_parts(plan, training_set) if taught else None
    if as_json:
        print_json(library, training_set, closeness, learned, out if written else None)
    else:
        print_words(library, training_set, closeness, learned)
    if not written:
        raise MotiondeckError(
            f"{', '.join(failing)} failed the self-test, so {out} was not written. "
            "Give the recipe more seeds, or write it all the same with --allow-failing."
        )
    if not as_json:
        print(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB, seed {library.info.seed})")
