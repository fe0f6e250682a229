"""`motiondeck evaluate RECORDING ...`: what centralized networks make of one recording (Vakulenko et al. 2017)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from controller.evaluation.tables import Table, Value
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from controller.mocap.clip import Clip

Draw = Callable[[Table, Path], None]

TABLE1 = "centralized-table1"
RECORDINGS = (".amc", ".bvh", ".mat", ".c3d")

SEGMENT_SATELLITES = (16, 49, 100)
SHOWN_SATELLITES = (25, 50, 100)
CENTERS = 2

# The paper cuts CMU 86 trial 1 into eleven segments; other recordings into what is worth a border.
PAPER_SEGMENTS = {"86_01": 11}
SHOWN_SECONDS = 12.0
GAPS_S = (0.25, 0.5, 1.0)


def is_recording(subject: str) -> bool:
    """Whether what is to be evaluated is a recording, by its name."""
    return Path(subject).suffix.lower() in RECORDINGS


def measure_recording(subject: str, what: str | None, data: Path | None) -> tuple[Table, Draw]:
    """A table, and how it is drawn.

    Raises:
        MotiondeckError: if the recording cannot be read, or this is not measured of recordings.
    """
    from controller.mocap.formats.reading import read_clip, skeleton_of

    if subject == TABLE1:
        if what is not None or data is None:
            raise MotiondeckError(f"{TABLE1} is a table of its own: leave out '{what}'")
        from controller.cli.pictures.centralized_plots import draw_table1

        return table1(data), draw_table1
    measures = {"segments": segments, "models": models, "coordinates": coordinates, "reconstruction": reconstruction}
    if what not in measures:
        raise MotiondeckError(f"of a recording is measured: {', '.join(measures)}")
    path = Path(subject)
    if not path.is_file():
        raise MotiondeckError(f"{path}: there is no such file")
    return measures[what](read_clip(path, skeleton_of(path, path.parent.parent)))


def table1(data: Path) -> Table:
    """Table 1 of the paper: its figures, ours with its method, ours with learned satellites."""
    from benchmarks.papers.centralized_table1 import PAPER, centralized_table1
    from controller.cli.common.progress import progress
    from controller.mocap.formats.reading import read_clip
    from controller.training.fit import find_recording

    with progress("networks", 4 * len(PAPER)) as tick:
        entries = list(centralized_table1(read_clip(find_recording(data, "86/86_01.amc")), progress=lambda _: tick()))
    rows: list[dict[str, Value]] = [
        {
            "centers, satellites, segment": f"{e.centers}, {e.satellites}, {e.segment}",
            "paper": e.paper,
            "its method": e.fixed,
            "learned": e.learned,
            "its method mm": e.fixed_mm,
            "learned mm": e.learned_mm,
        }
        for e in entries
    ]
    won = sum(e.learned < e.paper for e in entries)
    notes = [
        "integral relative accuracy (eq. 26) of feet and wrists, and mean absolute error of a coordinate in mm",
        f"learned satellites are more accurate than the paper's figure in {won} of {len(entries)} cells",
    ]
    return Table("table 1, CMU 86 trial 1", rows, ("paper", "its method", "learned"), notes)


def segments(clip: Clip) -> tuple[Table, Draw]:
    """Errors of all joints in each segment (figures 14 to 16)."""
    from controller.cli.common.progress import progress
    from controller.mocap.segmentation import body_features, find_segments
    from controller.training.centralized.model_choice import mean_absolute, mean_distance, relative_accuracy
    from controller.training.centralized.segment_network import say_segment

    places = 1e3 * clip.joints()
    names = ("root", *clip.skeleton.bones)
    cuts = find_segments(body_features(clip), clip.rate, PAPER_SEGMENTS.get(clip.name))
    rows: list[dict[str, Value]] = []
    details: list[dict[str, Value]] = []
    with progress("networks", len(cuts) * len(SEGMENT_SATELLITES)) as tick:
        for number, (first, end) in enumerate(cuts, 1):
            part = places[first:end]
            row: dict[str, Value] = {"segment": str(number), "seconds": (end - first) / clip.rate}
            for satellites in SEGMENT_SATELLITES:
                said = say_segment(part, clip.rate, satellites)
                row[f"{satellites} satellites"] = mean_absolute(said, part)
                row[f"{satellites}, joint"] = mean_distance(said, part)
                tick()
                if satellites == SEGMENT_SATELLITES[1]:
                    apart, shares = np.abs(said - part).mean((0, 2)), relative_accuracy(said, part)
                    details += [
                        {"segment": number, "joint": name, "mm": float(mm), "relative": float(share)}
                        for name, mm, share in zip(names, apart, shares, strict=True)
                    ]
            rows.append(row)
    mean: dict[str, Value] = {"segment": "mean"}
    mean |= {name: float(np.mean([row[name] for row in rows])) for name in rows[0] if name != "segment"}  # pyright: ignore
    rows.append(mean)
    notes = [
        "mm with so many satellites: mean absolute error of a coordinate, and mean distance of a joint",
        "details: each joint with 49 satellites, mm a coordinate and relative (eq. 26)",
    ]
    table = Table(
        f"{clip.name}: {len(cuts)} segments, {len(names)} joints, {CENTERS} centers, errors in mm",
        rows,
        tuple(f"{m} satellites" for m in SEGMENT_SATELLITES),
        notes,
        details,
    )

    def draw(table: Table, path: Path) -> None:
        from controller.cli.pictures.centralized_plots import draw_segment_errors

        draw_segment_errors(table, path)

    return table, draw


def models(clip: Clip) -> tuple[Table, Draw]:
    """Akaike's criterion over centers and satellites (figure 13), summed over the segments that are long enough."""
    from controller.cli.common.progress import progress
    from controller.mocap.segmentation import body_features, find_segments
    from controller.training.centralized.model_choice import hands_and_feet
    from controller.training.centralized.model_search import CENTERS as CHOICES
    from controller.training.centralized.model_search import RATE, SATELLITES, score_models

    bones = [0, *(bone + 1 for bone in hands_and_feet(clip.skeleton))]
    places = clip.joints()[:, bones].reshape(len(clip), -1)
    cuts = [cut for cut in find_segments(body_features(clip), clip.rate) if _frames(cut, clip) > 1.2 * SATELLITES[-1]]
    if not cuts:
        raise MotiondeckError(
            f"{clip.source or clip.name}: no segment lasts longer than {1.2 * SATELLITES[-1] / RATE} s"
        )
    found: dict[tuple[int, int], list[float]] = {}
    with progress("segments", len(cuts)) as tick:
        for first, end in cuts:
            for one in score_models(places[first:end], clip.rate, loop=False, centers=(*CHOICES, 4)):
                found.setdefault((one.centers, one.satellites), []).append(one.aicc)
            tick()
    # A choice that failed in one segment cannot be compared with those that had to say them all.
    sums = {key: sum(values) for key, values in found.items() if len(values) == len(cuts)}
    if not sums:
        raise MotiondeckError(f"{clip.source or clip.name}: no choice of sizes suits all of its segments")
    best = min(sums, key=lambda key: sums[key])
    rows: list[dict[str, Value]] = [
        {"satellites": str(m)} | {f"{n} centers": sums.get((n, m)) for n in (*CHOICES, 4)} for m in SATELLITES
    ]
    title = f"{clip.name}: AICc at {RATE:g} Hz, {len(cuts)} segments, {places.shape[1]} coordinates"
    notes = [f"the least: {best[0]} centers, {best[1]} satellites. A higher rate favours more satellites."]
    table = Table(title, rows, tuple(name for name in rows[0] if name != "satellites"), notes)

    def draw(table: Table, path: Path) -> None:
        from controller.cli.pictures.centralized_plots import draw_lines

        curves: dict[str, Any] = {}
        for name in table.draws:
            points = [(float(str(row["satellites"])), row[name]) for row in table.rows if row[name] is not None]
            if points:
                curves[name] = tuple(np.array(points, dtype=np.float64).T)
        # Far too many satellites score so high that the least would not be seen.
        least = min(float(y.min()) for _, y in curves.values())
        first = max(float(y[0]) for _, y in curves.values())
        room = 0.05 * (first - least)
        draw_lines(curves, ("satellites", "AICc"), table.title, path, ylim=(least - room, first + room))

    return table, draw


def coordinates(clip: Clip) -> tuple[Table, Draw]:
    """Feet and wrists over time as networks say them (figures 3 to 12): the first segments, each by its own network."""
    from controller.cli.common.progress import progress
    from controller.mocap.segmentation import body_features, find_segments
    from controller.training.centralized.model_choice import hands_and_feet, mean_absolute
    from controller.training.centralized.segment_network import say_segment

    bones = hands_and_feet(clip.skeleton)
    names = [clip.skeleton.bones[bone] for bone in bones]
    places = 1e3 * clip.joints()[:, [bone + 1 for bone in bones]]
    cuts = find_segments(body_features(clip), clip.rate)
    shown = [cut for cut in cuts if cut[1] <= max(SHOWN_SECONDS * clip.rate, cuts[0][1])]
    end = shown[-1][1]
    said = {}
    with progress("networks", len(SHOWN_SATELLITES)) as tick:
        for satellites in SHOWN_SATELLITES:
            parts = [say_segment(places[a:b], clip.rate, satellites) for a, b in shown]
            said[f"{satellites} satellites"] = np.concatenate(parts)
            tick()
    rows: list[dict[str, Value]] = [
        dict[str, Value](joint=name)
        | {f"{label} mm": mean_absolute(path[:, i : i + 1], places[:end, i : i + 1]) for label, path in said.items()}
        for i, name in enumerate(names)
    ]
    title = f"{clip.name}: the first {end / clip.rate:.1f} s, {len(shown)} segments, {CENTERS} centers"
    table = Table(title, rows, tuple(f"{label} mm" for label in said), ["mean absolute error of a coordinate"])

    def draw(table: Table, path: Path) -> None:
        from controller.cli.pictures.centralized_plots import draw_coordinates

        draw_coordinates(places[:end], said, names, clip.rate, table.title, path)

    return table, draw


def reconstruction(clip: Clip) -> tuple[Table, Draw]:
    """How far off joints are that were hidden for a while and filled in from the others."""
    from benchmarks.papers.hidden_joints import fill_hidden
    from controller.cli.common.progress import progress
    from controller.cli.pictures.centralized_plots import draw_hidden
    from controller.mocap.segmentation import body_features, find_segments
    from controller.training.centralized.model_choice import hands_and_feet

    bones = hands_and_feet(clip.skeleton)
    places = 1e3 * clip.joints()
    cuts = find_segments(body_features(clip), clip.rate)
    rows: list[dict[str, Value]] = []
    with progress("gaps", len(bones) * len(GAPS_S)) as tick:
        for bone in bones:
            for gap_s in GAPS_S:
                gap = round(gap_s * clip.rate)
                starts = [(a + b - gap) // 2 for a, b in cuts if b - a >= gap + clip.rate]
                if starts:
                    found = fill_hidden(places, bone + 1, starts, gap, clip.rate)
                    label = f"{clip.skeleton.bones[bone]}, {gap_s:g} s"
                    rows.append({"hidden": label} | {f"{name} mm": missed for name, missed in asdict(found).items()})
                tick()
    if not rows:
        raise MotiondeckError(f"{clip.source or clip.name}: too short to hide anything in it")
    notes = [
        "mean absolute error of a coordinate, one gap in the middle of each segment that is long enough",
        "cubic, line: over the gap from the joint's own path; mean: its mean place, seen from the middle of the others",
    ]
    columns = tuple(name for name in rows[0] if name != "hidden")
    return Table(f"{clip.name}: hidden joints", rows, columns, notes), draw_hidden


def _frames(cut: tuple[int, int], clip: Clip) -> float:
    """How many frames a segment has at the rate that models are compared at."""
    from controller.training.centralized.model_search import RATE

    return (cut[1] - cut[0]) * RATE / clip.rate
