"""What libraries play against the files that they were learned from.

Every recording below a folder is learned with no option, in libraries of one actor, and each motion runs free for three
lengths. A reader and a measure that share no code with the product compare it with its file: seen from the hips,
heights as they are, scaled by the leg. Of each motion, over all frames, joints (mm) and limbs (degrees):

    p95         95 % of the errors are smaller; and the median, and the worst with its joint and its time in the run
    held        the largest angle of a limb between the pose that a one-shot holds and the last recorded one
    hand        the largest 95 % angle of the hands
    floor       how much higher than recorded feet are that stand (95 %), mm
    slide       how far feet that stand are from their mean place (95 %), recorded and played, mm
    path        the length of the played path over that of the recorded one
    delay       by how much it is late, ms; below 0, its first frames are left out
    said        p95 as the library itself has it, mm and degrees, and how far that is from p95 here
    own body    p95 in mm as if the played limbs were as long as in the file: what is not here is the library's body
    seam        the same as p95 within 0.4 s of a loop's seam, where its recording does not return to itself exactly
    gap         half of what the recording's ends differ by there (95 % of the joints): no loop can deviate less

    end         the same over the 0.5 s after the end of a one-shot, in which it comes to rest

A motion is faithful if p95 is at most 10 mm and 2 degrees, at its end too, the held pose the last one to 0.5 degrees,
and the floor within 10 mm; `with seams`, if the seam is too. From 0.5 s before its end a one-shot may be 0.35 s late.

With --deck the same is measured of what a deck plays: its poses on the body that it shows, instead of clips.

    python -m benchmarks faithful ../shared/data --most 60
    python -m benchmarks faithful ../shared/data --source HDM05 --mixed --json --keep rows.jsonl
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from joblib import Parallel, delayed

import motiondeck
from benchmarks import command
from benchmarks.recordings.faithful_files import recorded, source_and_actor
from benchmarks.recordings.faithful_measure import Part, Played, measure
from controller.deck.deck import Deck
from controller.motion.canonical.canonical_body import root_height
from motiondeck_base.errors import MotiondeckError

ENDINGS = (".amc", ".bvh", ".mat", ".c3d")
MARKERS = ".c3d"  # listed, and not judged: joints are not in the file
LENGTHS = 3  # of a motion, in a free run
HELD_FOR = 2.0  # s after a one-shot, at least
BOUND_MM, BOUND_DEGREES, BOUND_HELD, BOUND_FLOOR = 10.0, 2.0, 0.5, 10.0

Row = dict[str, Any]
Group = tuple[str, str]  # source and actor
Runs = Callable[[motiondeck.Library, str, float], Played]


def grouped(data: Path, source: str | None, most: int | None, seed: int, *, mixed: bool) -> dict[Group, list[Path]]:
    """The recordings to learn, by library; with `most`, about as many of each source."""
    by_source: dict[str, list[tuple[str, Path]]] = defaultdict(list)
    for path in sorted(data.rglob("*")):
        known = source_and_actor(path, data) if path.suffix.lower() in ENDINGS else None
        if known is not None and source in (None, known[0]):
            by_source[known[0]].append((known[1], path))
    if not by_source:
        raise MotiondeckError(f"{data}: no recording of a known source below it")
    rng = np.random.default_rng(seed)
    shuffled = {name: [files[n] for n in rng.permutation(len(files))] for name, files in by_source.items()}
    taken = [
        (name, *files[turn])
        for turn in range(max(map(len, shuffled.values())))
        for name, files in shuffled.items()
        if turn < len(files)
    ]
    groups: dict[Group, list[Path]] = defaultdict(list)
    for name, actor, path in taken[:most]:
        groups[name, "all" if mixed else actor].append(path)
    return {group: sorted(groups[group]) for group in sorted(groups)}


def judged(group: Group, files: list[Path], data: Path, run: Runs | None = None) -> list[Row]:
    """A row for each motion of a library of some recordings, and for each recording that was left out."""
    if all(file.suffix.lower() == MARKERS for file in files):
        return [_row(group, file, data, {}) | {"not_judged": "markers, no joints"} for file in files]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "library.safetensors"
        learn = [sys.executable, "-m", "motiondeck", "learn", *map(str, files), "--out", str(out), "--json"]
        done = subprocess.run(learn, capture_output=True, text=True)
        if done.returncode and not out.exists():
            reason = done.stderr.strip()
            return [_row(group, file, data, {"remedy": reason}) | {"left_out": reason} for file in files]
        library = motiondeck.load_library(out)
        told = json.loads(done.stdout)["motions"]
    return [judge(library, one, _row(group, Path(one["file"]), data, one), run) for one in told]


def _row(group: Group, file: Path, data: Path, told: Row) -> Row:
    kept = ("name", "plays", "from_s", "to_s", "passed", "error_mm", "remedy")
    below = file.relative_to(data).as_posix()
    return {"source": group[0], "actor": group[1], "file": below} | {name: told.get(name) for name in kept}


def judge(library: motiondeck.Library, told: Row, row: Row, run: Runs | None = None) -> Row:
    """The row of a motion with its figures, or with the reason why it was not judged; `told` is what `learn` said."""
    if not told["plays"]:
        return row | {"left_out": told["remedy"]}
    try:
        file = recorded(Path(told["file"]))
    except ValueError as error:
        return row | {"not_judged": str(error)}
    part = Part(told["from_s"], told["to_s"], told["plays"])
    duration = part.end - part.begin
    seconds = LENGTHS * duration if part.plays == "loop" else max(LENGTHS * duration, duration + HELD_FOR)
    return (
        row
        | _said(library, told["name"])
        | measure(file, (run or run_of)(library, told["name"], seconds), part, LENGTHS)
    )


def _said(library: motiondeck.Library, motion: str) -> Row:
    """What the library itself says of its errors against the recording."""
    info = next(info for info in library.model.info.motions if info.name == motion)
    said = info.against_recording
    if said is None:
        return {}
    return {"said_mm": said.own_body_mm, "said_degrees": said.degrees.p95, "said_held": said.held_degrees}


def run_of(library: motiondeck.Library, motion: str, seconds: float) -> Played:
    """Where the landmarks are that a library plays in a free run."""
    clip = library.generate_clip(motion, seconds=seconds + 2.0 / library.rate)
    joints = clip.joints()
    bones = ("root", *clip.skeleton.bones)
    return Played({bone: joints[:, index] for index, bone in enumerate(bones)}, clip.rate)


def deck_run_of(library: motiondeck.Library, motion: str, seconds: float) -> Played:
    """Where the landmarks are that a deck plays, on the body that it shows."""
    skeleton, dt = library.skeleton, 1.0 / library.rate
    deck, places = Deck(library.model, lambda pose: np.zeros(0), motion), []
    for _ in range(round(seconds * library.rate) + 2):
        pose = deck.pose
        assert pose.offsets is not None
        own = skeleton.with_offsets(pose.offsets)
        place = np.append(pose.root_position[:2], root_height(pose, skeleton, own))
        places.append(own.joints(place, pose.rotation))
        deck.update(dt)
    joints = np.array(places)
    bones = ("root", *skeleton.bones)
    return Played({bone: joints[:, index] for index, bone in enumerate(bones)}, library.rate)


def faithful(row: Row) -> bool:
    """Whether a motion is within all bounds."""
    return (
        max(row["mm_p95"], row.get("end_mm_p95", 0.0)) <= BOUND_MM
        and max(row["degrees_p95"], row.get("end_degrees_p95", 0.0)) <= BOUND_DEGREES
        and row.get("held_degrees", 0.0) <= BOUND_HELD
        and abs(row["floor_mm"] or 0.0) <= BOUND_FLOOR
    )


def with_seam(row: Row) -> bool:
    """Whether a motion is within all bounds at its seam too."""
    return (
        faithful(row) and row.get("seam_mm_p95", 0.0) <= BOUND_MM and row.get("seam_degrees_p95", 0.0) <= BOUND_DEGREES
    )


def summary(rows: list[Row]) -> Row:
    """The figures of a source: of each 50 and 95 % over its motions."""
    own = [row for row in rows if "mm_p95" in row]
    figures: Row = {
        "recordings": len({row["file"] for row in rows}),
        "motions": len(own),
        "faithful": sum(map(faithful, own)),
        "with_seams": sum(map(with_seam, own)),
        "left_out": sum("left_out" in row for row in rows),
        "not_judged": sum("not_judged" in row for row in rows),
    }
    taken = {
        "mm_p95": [row["mm_p95"] for row in own],
        "mm_worst": [row["mm_worst"] for row in own],
        "degrees_p95": [row["degrees_p95"] for row in own],
        "degrees_worst": [row["degrees_worst"] for row in own],
        **{
            name: [row[name] for row in own if name in row]
            for name in (
                *("own_body_mm", "seam_mm_p95", "seam_degrees_p95", "gap_mm", "gap_degrees"),
                *("end_mm_p95", "end_degrees_p95"),
            )
        },
        "hand_degrees": [hand for row in own if (hand := _hand(row)) is not None],
        "held_degrees": [row["held_degrees"] for row in own if "held_degrees" in row],
        "floor_mm": [abs(row["floor_mm"]) for row in own if row["floor_mm"] is not None],
        "slide_recorded_mm": [row["slide_recorded_mm"] for row in own if row["slide_recorded_mm"] is not None],
        "slide_played_mm": [row["slide_played_mm"] for row in own if row["slide_played_mm"] is not None],
        "path_off": [abs(row["path_ratio"] - 1.0) for row in own if row["path_ratio"] is not None],
        "delay_ms": [abs(row["delay_ms"]) for row in own if row["delay_ms"] is not None],
        "said_off_mm": [abs(row["said_mm"] - row["mm_p95"]) for row in own if "said_mm" in row],
        "said_off_degrees": [abs(row["said_degrees"] - row["degrees_p95"]) for row in own if "said_degrees" in row],
        "error_mm": [row["error_mm"] for row in own if row["error_mm"] is not None],
    }
    for name, values in taken.items():
        figures[name] = [float(np.quantile(values, share)) for share in (0.5, 0.95)] if values else None
    return figures


def _hand(row: Row) -> float | None:
    return max((row["degrees_of"][hand] for hand in ("lhan", "rhan") if hand in row["degrees_of"]), default=None)


def _print(rows: list[Row]) -> None:
    for source in sorted({row["source"] for row in rows}):
        own = [row for row in rows if row["source"] == source]
        figures = summary(own)
        counts = ", ".join(f"{name.replace('_', ' ')} {figures.pop(name)}" for name in list(figures)[:6])
        print(f"\n{source}: {counts}")
        print(
            "    50 and 95 % over motions: "
            + ", ".join(f"{name} {values[0]:.3g} {values[1]:.3g}" for name, values in figures.items() if values)
        )
        for row in sorted((row for row in own if "mm_p95" in row), key=lambda row: -row["mm_p95"]):
            held = f"{row['held_degrees']:5.1f}" if "held_degrees" in row else "    -"
            floor, delay = (
                f"{row[name]:6.1f}" if row[name] is not None else "     -" for name in ("floor_mm", "delay_ms")
            )
            print(
                f"  {'ok' if faithful(row) else '--'} {row['name']:<40} {row['plays']:<5}"
                f"mm {row['mm_median']:5.1f} {row['mm_p95']:6.1f} {row['mm_worst']:6.1f} ({row['mm_joint']}"
                f" {row['mm_time']:.2f} s)  deg {row['degrees_median']:4.1f} {row['degrees_p95']:5.1f}"
                f" {row['degrees_worst']:5.1f} ({row['degrees_joint']} {row['degrees_time']:.2f} s)"
                f"  held {held}  floor {floor}  delay {delay}"
                f"  said {row.get('said_mm', np.nan):.1f} {row.get('said_degrees', np.nan):.1f}"
                f"  own body {row['own_body_mm']:.1f}"
                + (
                    f"  seam {row['seam_mm_p95']:.1f} {row['seam_degrees_p95']:.1f}"
                    f" (gap {row['gap_mm']:.1f} {row['gap_degrees']:.1f})"
                    if "gap_mm" in row
                    else ""
                )
            )
        for reason in ("left_out", "not_judged"):
            for row in own:
                if reason in row:
                    print(f"  {reason.replace('_', ' ')}: {row['file']}: {row[reason]}")


def _kept(keep: Path | None) -> list[Row]:
    if keep is None or not keep.exists():
        return []
    return [json.loads(line) for line in keep.read_text().splitlines()]


def _work(
    groups: dict[Group, list[Path]], data: Path, keep: Path | None, jobs: int, run: Runs | None
) -> Iterable[tuple[Group, list[Row]]]:
    found = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(judged)(group, files, data, run) for group, files in groups.items()
    )
    for group, rows in zip(groups, found, strict=True):
        if keep is not None:
            with keep.open("a") as lines:
                lines.writelines(json.dumps(row) + "\n" for row in rows)
        print(f"{' '.join(group)}: {len(rows)}", file=sys.stderr)
        yield group, rows


def main(
    data: Path,
    source: Annotated[str | None, typer.Option(help="HDM05, CMU, Bandai, BVH, thesis or C3D; default: all.")] = None,
    most: Annotated[int | None, typer.Option(help="Recordings, sampled evenly over the sources.")] = None,
    seed: Annotated[int, typer.Option(help="Of the sample.")] = 0,
    mixed: Annotated[bool, typer.Option("--mixed", help="One library for all actors of a source.")] = False,
    deck: Annotated[bool, typer.Option("--deck", help="What a deck plays.")] = False,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 1,
    keep: Annotated[
        Path | None, typer.Option(help="Rows found (JSON lines); those in it are not computed again.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    data = data.absolute()
    groups = grouped(data, source, most, seed, mixed=mixed)
    wanted = {(*group, path.relative_to(data).as_posix()) for group, files in groups.items() for path in files}
    rows = [row for row in _kept(keep) if (row["source"], row["actor"], row["file"]) in wanted]
    known = {(row["source"], row["actor"], row["file"]) for row in rows}
    missing = {
        group: files
        for group, files in groups.items()
        if any((*group, path.relative_to(data).as_posix()) not in known for path in files)
    }
    rows = [row for row in rows if (row["source"], row["actor"]) not in missing]
    for _, found in _work(missing, data, keep, jobs, deck_run_of if deck else None):
        rows += found
    if as_json:
        sources = {
            name: summary([row for row in rows if row["source"] == name]) for name in {r["source"] for r in rows}
        }
        print(json.dumps({"sources": sources, "motions": rows}))
    else:
        _print(rows)


if __name__ == "__main__":
    command.run("faithful", main, __doc__)
