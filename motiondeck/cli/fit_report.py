"""The report of `motiondeck fit`, for people and for scripts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from controller.deck.worst_join import worst_join
from controller.learning.centralized.model_choice import (
    hands_and_feet,
    mean_absolute,
    mean_distance,
    relative_accuracy,
)
from controller.learning.recipe import LibraryRecipe
from controller.learning.training_set import LearnedPart, TrainingSet
from controller.library.motion_library import MotionLibrary
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array
from motiondeck.cli.common.library_report import (
    join_fields,
    join_line,
    part_fields,
    part_of,
    print_table,
    report,
    seam_of,
)
from motiondeck.cli.common.tables import show_table
from motiondeck.pictures.curve_plots import draw_coordinates


def print_json(
    library: MotionLibrary,
    training_set: TrainingSet,
    closeness: list[dict[str, Any]],
    learned: list[dict[str, Any]] | None,
    written: Path | None,
) -> None:
    """The report as one JSON object."""
    fields = report(library) | {"beside_the_recording": closeness, "written": str(written) if written else None}
    fields |= {"learned_from": {name: part_fields(part) for name, part in training_set.parts.items()}}
    fields |= {"learned": learned} if learned is not None else {}
    print(json.dumps(fields | {"worst_join": join_fields(worst_join(library))}))


def print_words(
    library: MotionLibrary,
    training_set: TrainingSet,
    closeness: list[dict[str, Any]],
    learned: list[dict[str, Any]] | None,
) -> None:
    """The report as tables and lines."""
    print_table(library)
    print_closeness(library, training_set.parts if learned is None else {}, closeness)
    for part in learned or ():
        print(described(part))
    if (worst := worst_join(library)) is not None:
        print(join_line(worst))


def compare(library: MotionLibrary, training_set: TrainingSet, every: int) -> list[dict[str, Any]]:
    """How far each motion is from its recording at its anchors, mm (eqs 20 to 27), and a centralized network's size."""
    network, rows = library.network, []
    for name in training_set.frames:
        played, recorded = _places(library, training_set, name, every)
        row: dict[str, Any] = {"motion": name, "mean_mm": mean_absolute(played, recorded)}
        row |= {"joint_mm": mean_distance(played, recorded)}
        row |= {"relative_accuracy": float(relative_accuracy(played, recorded).mean())}
        rows.append(row | network.sizes(name))
    return rows


def plot_closeness(library: MotionLibrary, training_set: TrainingSet, every: int, folder: Path) -> None:
    """Plots feet and hands of each motion as recorded and as played, into a picture of its own."""
    which = hands_and_feet(library.skeleton)
    names = [library.skeleton.bones[bone] for bone in which]
    for name in training_set.frames:
        played, recorded = (places[:, which] for places in _places(library, training_set, name, every))
        rate, title = library.info.rate / every, f"{library.info.name}: {name}"
        draw_coordinates(recorded, {"network": played}, names, rate, title, folder / f"{name}.png")


def _places(library: MotionLibrary, training_set: TrainingSet, motion: str, every: int) -> tuple[Array, Array]:
    """Joints relative to the root at the anchors of a motion, as played and as recorded, shape (A, J, 3) each, mm."""
    anchors = library.network.recall(motion), training_set.frames[motion][::every]
    places = [joint_features(library.encoding, channels)[:, :-1].reshape(len(channels), -1, 3) for channels in anchors]
    played, recorded = (one[: min(map(len, places))] for one in places)
    return played, recorded


def print_closeness(library: MotionLibrary, parts: dict[str, LearnedPart], rows: list[dict[str, Any]]) -> None:
    """One row a motion: what was learned of its recording, where its loop is closed, its network and its errors."""
    unit = "mrad" if library.info.encoding == "joint angles" else "mm"
    headings = [name.replace("_mm", f", {unit}").replace("_", " ") for name in rows[0]]
    cells = [[f"{value:.4g}" if isinstance(value, float) else str(value) for value in row.values()] for row in rows]
    if parts:
        headings[1:1] = ["of the recording", "seam"]
        for row in cells:
            row[1:1] = [part_of(parts[row[0]]), seam_of(parts[row[0]])]
    show_table(headings, cells, title="joints beside the recording, seen from the root")


def learned_parts(plan: LibraryRecipe, training_set: TrainingSet) -> list[dict[str, Any]]:
    """Which part of each taught clip was learned, s: of a loop what comes back best, of a one-shot all of it."""
    rows: list[dict[str, Any]] = []
    for motion in plan.motions:
        part = training_set.parts[motion.name]
        row = {"motion": motion.name, "plays": motion.plays, "takes": 1 + len(motion.takes)}
        rows.append(row | {"from": part.first, "to": part.end, "recorded": part.recorded})
    return rows


def described(row: dict[str, Any]) -> str:
    """One of `learned_parts` in words."""
    if row["takes"] > 1:
        of = f"{row['takes']} takes, averaged"
    else:
        of = f"{row['from']:.1f} to {row['to']:.1f} s of {row['recorded']:.1f} s"
    if row["plays"] == "once":
        return f"{row['motion']}: once, {of}; it comes to rest in its last pose"
    left_out = row["takes"] == 1 and row["to"] - row["from"] < row["recorded"] - 0.1
    return f"{row['motion']}: a loop of {row['to'] - row['from']:.1f} s, {of}" + (
        "; --no-trim learns all of it" if left_out else ""
    )
