"""The 2012 proposal, our experts and every peer in the same folds."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
import typer

from benchmarks import command
from benchmarks.recognition.contenders import (
    COMMITTEE,
    OURS,
    WITH_VELOCITY,
    contenders,
    doubters,
    learned_stretched,
    ours,
)
from benchmarks.recognition.first_check import checks
from benchmarks.recognition.folds import STRETCHES, dimension_curves, measure, warp_curve
from benchmarks.recognition.recognition_cost import cost
from benchmarks.recognition.recognition_plots import draw
from benchmarks.recognition.unknown import Doubter, nested_unknown_auc, unknown_auc
from controller.learning.recognition.experts import ExpertRecipe
from controller.learning.recognition.labelled_recordings import PROTOCOLS, Dataset, Protocol
from motiondeck.cli.common.options import JsonOption
from motiondeck.cli.common.tables import show_table
from motiondeck.cli.recognize import DataArgument, leave, read
from motiondeck.pictures.figures import need_matplotlib
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.progress import progress


def main(
    data: DataArgument,
    protocol: Annotated[
        list[str] | None,
        typer.Option("--protocol", help="actor-out, one-actor or half; may be given more than once. Default: all."),
    ] = None,
    method: Annotated[
        list[str] | None, typer.Option("--method", help="Only methods with this in their name; more than once.")
    ] = None,
    seeds: Annotated[int, typer.Option("--seeds", help="How many reservoirs are drawn.", min=1, max=100)] = 1,
    curves: Annotated[
        bool,
        typer.Option("--curves", help="Also time warp, dimensions, unknown motions, cost, and the proposal's check."),
    ] = False,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="DIR", help="Draw it all into this folder (.png); implies --curves."),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure recognition on labelled recordings: the 2012 proposal, ours, and every peer, in the same folds.

    actor-out learns all actors but one, one-actor learns one and asks the others, half learns a random half. The
    nested row chooses its settings anew in each fold, from what it has learned alone. With --seeds 8 and all methods
    this takes some minutes.

    Example:  python -m benchmarks recognition hdm05 --protocol actor-out --seeds 8 --plot pictures
    """
    asked: list[Protocol] = [one for one in PROTOCOLS if not protocol or one in protocol]
    for name in protocol or ():
        if name not in asked:
            raise UnknownNameError.among("protocol", name, PROTOCOLS)
    wanted = {
        name: found
        for name, found in contenders().items()
        if not method or any(part.lower() in name.lower() for part in method)
    }
    if not wanted:
        raise MotiondeckError(
            f"no method has '{' or '.join(method or [])}' in its name; there are: {', '.join(contenders())}"
        )
    if plot is not None:
        need_matplotlib()
    dataset = read(data)
    results = []
    unable: dict[str, str] = {}
    with progress("", len(wanted) * len(asked)) as done:
        for name, (candidates, seeded) in wanted.items():
            for one in asked:
                done(f"{name}, {one}")
                if name in unable:
                    continue
                try:
                    drawn = range(1, seeds + 1) if seeded else (1,)
                    results.append(measure(name, candidates, dataset, one, drawn))
                except MotiondeckError as error:
                    unable[name] = str(error)
    more = _more(dataset, asked, seeds) if curves or plot is not None else {}
    report: dict[str, Any] = {
        "clips": len(dataset.examples),
        "classes": dataset.classes,
        "actors": sorted({example.actor for example in dataset.examples}),
        "seeds": seeds,
        "results": [msgspec.to_builtins(result) for result in results],
        "unable": unable,
        "skipped": dataset.skipped,
        **more,
    }
    if plot is not None:
        report["pictures"] = [str(path) for path in draw(report, plot)]
    if as_json:
        print(json.dumps(report))
    else:
        _print(report, asked)
    leave(dataset)


def _more(dataset: Dataset, protocols: list[Any], seeds: int) -> dict[str, Any]:
    """The curves and figures beyond the table, for our experts with their standing settings."""
    out: dict[str, Any] = {"time_warp": {}, "dimensions": {}, "unknown_auc": {}}
    with progress("", 3 * len(protocols) + 2) as done:
        for protocol in protocols:
            done(f"time warp, {protocol}")
            out["time_warp"][protocol] = msgspec.to_builtins(warp_curve(ours(1)[0], dataset, protocol))
            taught = warp_curve(learned_stretched(1), dataset, protocol, taught=STRETCHES)
            out["time_warp"][f"{protocol}, learned at three stretches"] = msgspec.to_builtins(taught)
            done(f"dimensions, {protocol}")
            out["dimensions"][protocol] = msgspec.to_builtins(dimension_curves(dataset, protocol, ExpertRecipe()))
            done(f"unknown motions, {protocol}")
            out["unknown_auc"][protocol] = _unknown(dataset, protocol, seeds)
        done("cost")
        out["cost"] = msgspec.to_builtins(cost(dataset, WITH_VELOCITY, ExpertRecipe()))
        done("sine and Henon")
        out["first_check"] = msgspec.to_builtins(checks())
    return out


def _unknown(dataset: Dataset, protocol: Any, seeds: int) -> dict[str, dict[str, float]]:
    """Area under the ROC curve for unknown motions: our experts, a committee, and what each fold chooses nested."""
    found: dict[str, list[float]] = {}
    labels, actors = dataset.labels, dataset.actors
    for seed in range(1, seeds + 1):
        [standing] = ours(seed)
        signals = [standing.look(example, 1.0) for example in dataset.examples]
        single = Doubter(standing.prepare(signals, labels, len(dataset.classes)))
        several = doubters(dataset, seed)
        found.setdefault(OURS, []).append(unknown_auc(single, labels, actors, protocol))
        found.setdefault(COMMITTEE, []).append(unknown_auc(several[-1], labels, actors, protocol))
        if protocol != "half":
            try:
                area = nested_unknown_auc(several, labels, actors, protocol)
            except MotiondeckError:
                continue  # two actors, or two classes, cannot do without one
            found.setdefault("nested choice", []).append(area)
    return {name: {"mean": float(np.mean(own)), "spread": float(np.std(own))} for name, own in found.items()}


def _print(report: dict[str, Any], protocols: Sequence[str]) -> None:
    by_name: dict[str, dict[str, Any]] = {}
    for result in report["results"]:
        by_name.setdefault(result["method"], {})[result["protocol"]] = result
    rows = [[name, *(_share(own.get(one), report["seeds"]) for one in protocols)] for name, own in by_name.items()]
    title = f"{report['clips']} clips, {len(report['classes'])} motions, {len(report['actors'])} actors"
    show_table(["method", *protocols], rows, title=title)
    for name, reason in report["unable"].items():
        print(f"{name}: not measured. {reason}")
    ours = [r for r in report["results"] if r["method"] == "experts (ours)"]
    for result in ours:
        worst = sorted(result["per_class"].items(), key=lambda item: item[1])
        print(f"ours by class, {result['protocol']}: " + ", ".join(f"{name} {share:.3f}" for name, share in worst))
    if "time_warp" in report:
        _print_more(report)


def _share(result: dict[str, Any] | None, seeds: int) -> str:
    if result is None:
        return ""
    return f"{result['accuracy']:.3f}" + (f" ± {result['spread']:.3f}" if seeds > 1 and result["spread"] else "")


def _print_more(report: dict[str, Any]) -> None:
    for protocol, points in report["time_warp"].items():
        print(f"time warp, {protocol}: " + ", ".join(f"x{p['x']:g} {p['accuracy']:.3f}" for p in points))
    for protocol, ways in report["dimensions"].items():
        for way, points in ways.items():
            line = ", ".join(f"{p['x']:g}: {p['accuracy']:.3f}" for p in points)
            print(f"dimensions by {way}, {protocol}: {line}")
    for protocol, areas in report["unknown_auc"].items():
        line = ", ".join(f"{name} {area['mean']:.3f} ± {area['spread']:.3f}" for name, area in areas.items())
        print(f"unknown motions (each class left out in turn), {protocol}: AUC {line}")
    cost = report["cost"]
    print(
        f"cost: training on all {report['clips']} clips {cost['train_ms']:.0f} ms, "
        f"{cost['frame_us']:.0f} us a frame for {cost['classes']} classes, {cost['frame_us_15']:.0f} us for 15 "
        "(plain NumPy, processor time of one thread, median)"
    )
    for check in report["first_check"]:
        print(
            f"first check, {check['neurons']} neurons, {'bias' if check['bias'] else 'no bias (as proposed)'}: "
            f"NRMSE sine running free {check['sine_free_run']:.2g}, Henon one step {check['henon_one_step']:.2g}"
        )
    for path in report.get("pictures", ()):
        print(f"wrote {path}")


if __name__ == "__main__":
    command.run("recognition", main)
