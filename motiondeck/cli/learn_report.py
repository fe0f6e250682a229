"""Reports of `motiondeck learn`, for people and for scripts."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from controller.deck.worst_join import Join, worst_join
from controller.learning.centralized.model_choice import mean_absolute, mean_distance, relative_accuracy
from controller.learning.learn import LearnedLibrary
from controller.learning.recipe import LibraryRecipe, warnings
from controller.learning.smallest import Candidate
from controller.learning.trainers.trainer import kind_of
from controller.learning.training_set import LearnedPart, TrainingSet
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.motion_matching import joint_features
from motiondeck.cli.common import library_report as libraries
from motiondeck.cli.common.tables import show_table
from motiondeck.cli.common.verdict_report import print_verdicts
from motiondeck_base.files import listed
from motiondeck_base.words import counted
from sim.robots.verdict import RobotVerdict

if TYPE_CHECKING:
    from sim.physical.files import StoodFile

Judge = Callable[[], Sequence[RobotVerdict]]
"""Makes the verdicts on the learned motions; none without a robot."""


def report_recipe(
    library: MotionLibrary,
    recipe: LibraryRecipe,
    training_set: TrainingSet,
    written: Path | None,
    taught: Path | None,
    judge: Judge,
    candidates: Sequence[Candidate],
    as_json: bool,
) -> None:
    """Reports a trained recipe; `taught` is the recipe that was written for clips taught by hand."""
    closeness = _compare(library, training_set, recipe.network.anchor_every)
    worst = worst_join(library)
    if as_json:
        fields = libraries.report(library)
        fields |= {"beside_the_recording": closeness, "written": str(written) if written else None}
        fields |= {"learned_from": {name: libraries.part_fields(part) for name, part in training_set.parts.items()}}
        print(json.dumps(fields | _common_fields(worst, candidates, judge)))
        return
    libraries.print_table(library)
    _print_closeness(library, training_set.parts, closeness)
    if worst is not None:
        print(libraries.join_line(worst))
    print(*map(str, candidates), sep="\n", end="\n" if candidates else "")
    if written:
        recipe_too = f" and its recipe {taught}" if taught else ""
        print(f"wrote {written} ({written.stat().st_size / 1e6:.1f} MB, seed {library.info.seed}){recipe_too}")
        _print_judged(judge)


def report_recordings(
    learned: LearnedLibrary, out: Path, recipe: Path, judge: Judge, as_json: bool, stood: Sequence[StoodFile] = ()
) -> None:
    """Reports a library of recordings: each with its part, its seam and its self-test; `stood` as of --physical."""
    worst = worst_join(learned.library)
    if as_json:
        fields = {"written": str(out), "recipe": str(recipe), "motions": _rows(learned)}
        fields |= {"actors": [asdict(actor) for actor in learned.actors], "warnings": warnings(learned.recipe)}
        fields |= {"on_its_feet": msgspec.to_builtins(stood)} if stood else {}
        print(json.dumps(fields | _common_fields(worst, learned.candidates, judge)))
        return
    if stood:
        from motiondeck.cli.robot.retarget import print_stood

        print_stood(stood, out.with_suffix(""))
    _print(learned)
    if learned.actors:
        print(f"body: that of {learned.actors[0].actor} ({counted(learned.actors[0].motions, 'motion')})")
    for other in learned.actors[1:]:
        print(
            f"body: {other.actor} ({counted(other.motions, 'motion')}) has another, which moves wrists by up to "
            f"{other.hands_mm:.0f} mm; in a library of their own they stay"
        )
    if worst is not None:
        print(libraries.join_line(worst))
    for warning in warnings(learned.recipe):
        print(f"warning: {warning} {recipe}")
    print(*map(str, learned.candidates), sep="\n", end="\n" if learned.candidates else "")
    print(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB) and its recipe {recipe}")
    _print_judged(judge)


def _common_fields(worst: Join | None, candidates: Sequence[Candidate], judge: Judge) -> dict[str, Any]:
    rows = [{"network": kind_of(one.recipe)} | asdict(one) for one in candidates]
    compared = {"candidates": [row | {"recipe": msgspec.to_builtins(row["recipe"])} for row in rows]} if rows else {}
    return {"worst_join": libraries.join_fields(worst)} | compared | {"verdicts": [one.row() for one in judge()]}


def _print_judged(judge: Judge) -> None:
    if verdicts := judge():
        print_verdicts(verdicts, "on the robot")


def _compare(library: MotionLibrary, training_set: TrainingSet, every: int) -> list[dict[str, Any]]:
    """Distance of each motion from its recording at its anchors, mm (eqs 20 to 27), and its network's sizes."""
    network, rows = library.network, []
    for name, frames in training_set.frames.items():
        anchors = network.recall(name), frames[::every]
        places = [joint_features(library.encoding, own)[:, :-1].reshape(len(own), -1, 3) for own in anchors]
        both = [one[: min(map(len, places))] for one in places]  # joints from the root, as played and as recorded, mm
        row: dict[str, Any] = {"motion": name, "mean_mm": mean_absolute(*both), "joint_mm": mean_distance(*both)}
        rows.append(row | {"relative_accuracy": float(relative_accuracy(*both).mean())} | network.sizes(name))
    return rows


def _print_closeness(library: MotionLibrary, parts: dict[str, LearnedPart], rows: list[dict[str, Any]]) -> None:
    unit = "mrad" if library.info.encoding == "joint angles" else "mm"
    headings = [name.replace("_mm", f", {unit}").replace("_", " ") for name in rows[0]]
    cells = [[f"{value:.4g}" if isinstance(value, float) else str(value) for value in row.values()] for row in rows]
    if parts:
        headings[1:1] = ["of the recording", "seam"]
        for row in cells:
            row[1:1] = [libraries.part_of(parts[row[0]]), libraries.seam_of(parts[row[0]])]
    show_table(headings, cells, title="anchors beside the frames that were trained, seen from the root")


def _rows(learned: LearnedLibrary) -> list[dict[str, Any]]:
    return [
        {
            "name": motion.name,
            "file": str(motion.file),
            "plays": motion.plays or None,
            "seconds": motion.seconds if motion.part else None,
            **libraries.part_fields(motion.part),
            "error_mm": motion.info.error_mm if motion.info else None,
            "against_recording": motion.info and msgspec.to_builtins(motion.info.against_recording),
            "passed": motion.passed,
            "remedy": motion.remedy,
            "doubts": motion.doubts,
            "decisions": [asdict(decision) for decision in motion.decisions],
        }
        for motion in learned.motions
    ]


def _print(learned: LearnedLibrary) -> None:
    rows: list[tuple[str, ...]] = []
    for motion in learned.motions:
        verdict = "[green]passed[/]" if motion.passed else "[red]failed[/]" if motion.plays else "[red]left out[/]"
        places = (libraries.part_of(motion.part), libraries.seam_of(motion.part)) if motion.part else ()
        figures = (motion.plays, f"{motion.seconds:.2f}", *places) if places else ("", "", "", "")
        rows.append((motion.name, *figures, verdict))
    show_table(
        ("motion", "plays", "seconds", "of the recording", "best seam", "verdict"),
        rows,
        title=f"{learned.library.info.name}: {counted(len(learned.library.info.motions), 'motion')}",
        left=("plays", "verdict"),
    )
    libraries.print_errors(motion.info for motion in learned.motions if motion.info is not None)
    for motion in learned.motions:
        if motion.plays and not motion.file.stem.isascii():  # the name is unlike the file's
            print(f"{motion.name}: learned from {motion.file.name}")
    for motion in learned.failed:
        print(f"{motion.name} ({motion.file.name}): {motion.remedy}")
    said: dict[tuple[str, str], list[str]] = {}  # each once, with the motions that it is about
    for motion in learned.motions:
        for decision in (decision for decision in motion.decisions if decision.notable):
            said.setdefault(("", str(decision)), []).append(motion.name)
    for motion in learned.motions:
        for doubt in motion.doubts:
            said.setdefault(("doubt: ", doubt), []).append(motion.name)
    for (kind, words), names in said.items():
        print(f"{kind}{listed(names)}: {words}")
