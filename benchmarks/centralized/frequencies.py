"""Motions by their frequencies: retrieval, prediction, restyling.

python -m benchmarks frequencies similar cmu86 recordings/35_02.amc --weight arms=0
python -m benchmarks frequencies index cmu86 recordings --out all.index --jobs -1
python -m benchmarks frequencies anticipate cmu86 86_01.amc --frames 1152 1960 --plot ahead.png
python -m benchmarks frequencies restyle cmu86 walk --like run --out styled.safetensors
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from joblib import delayed

from benchmarks import command
from benchmarks.centralized.anticipation import Anticipator, foresight
from benchmarks.centralized.motion_index import MotionIndex, load_index, save_index
from benchmarks.centralized.motion_signature import part_weights, signature
from benchmarks.centralized.restyling import in_the_style, restyled
from benchmarks.papers.vakulenko_plots import draw_lines
from controller.library.motion_library import load_library, save_library
from controller.motion.canonical.canonical_body import carried
from controller.motion.canonical.clip_edits import span
from controller.motion.clip import Clip, ReadingOptions
from controller.motion.encodings.encoding import encoding_of
from controller.motion.formats.reading import read_clip, recordings_below
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.jobs import Jobs, spread
from motiondeck_base.shipped import find_library

INDEX = ".index"

# A loop is repeated for this long, s, and twice at least, as a recording of it would be.
LOOP_S = 3.0

Frames = Annotated[tuple[int, int] | None, typer.Option(help="First frame and end of the part to read.")]
Skeleton = Annotated[Path | None, typer.Option(help="The .asf of an .amc recording.")]


def similar(
    library: Annotated[str, typer.Argument(help="A library, or an index (.index).")],
    clip: Annotated[Path, typer.Argument(help="The recording to compare with.")],
    count: Annotated[int, typer.Option(min=1, help="How many motions to list.")] = 5,
    weight: Annotated[list[str] | None, typer.Option(help="legs=W, arms=W or trunk=W; 0 leaves a part out.")] = None,
    frames: Frames = None,
    skeleton: Skeleton = None,
) -> None:
    """List the motions whose legs, arms and trunk move as fast and as far as those of a recording.

    A distance of 0.1 is about 10 % faster, slower, wider or narrower (distances are differences of logarithms).
    """
    weights = part_weights({part: float(value) for part, _, value in (pair.partition("=") for pair in weight or [])})
    names, numbers = load_index(Path(library)) if library.endswith(INDEX) else library_signatures(library)
    for found in MotionIndex(names, numbers, weights).nearest(clip_signature(read(clip, frames, skeleton)), count):
        print(f"{found.distance:8.3f}  {found.name}")


def index(
    sources: Annotated[list[str], typer.Argument(help="Libraries, recordings, and folders of recordings.")],
    out: Annotated[Path, typer.Option(help="The index to write (.index).")],
    jobs: Annotated[str, typer.Option(help="Parallel processes, -1 for one per core, or dask://HOST:PORT.")] = "1",
) -> None:
    """Store the frequencies and ranges of many motions in a file that `similar` searches quickly."""
    names: list[str] = []
    rows: list[Array] = []
    for source in map(Path, sources):
        if not source.exists() or source.suffix == ".safetensors":
            motions, numbers = library_signatures(str(source))
            names += [f"{source}/{motion}" for motion in motions]
            rows += list(numbers)
            continue
        files = recordings_below(source) if source.is_dir() else [source]
        found = spread((delayed(_try_signature)(file) for file in files), Jobs.parse(jobs))
        for file, (row, reason) in zip(files, found, strict=True):
            if row is None:
                print(f"left out: {reason}", file=sys.stderr)
            else:
                names.append(str(file))
                rows.append(row)
    if not rows:
        raise MotiondeckError(f"no motion in {', '.join(sources)}; give recordings, folders or centralized libraries")
    save_index(names, np.array(rows), out)
    print(f"wrote {out} ({len(names)} motions)")


def anticipate(
    library: Annotated[str, typer.Argument(help="A centralized library.")],
    clip: Annotated[Path, typer.Argument(help="The recording to predict; not one that the library has learned.")],
    frames: Frames = None,
    skeleton: Skeleton = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the errors (.png, .svg, .pdf).")] = None,
) -> None:
    """Predict each moment of a recording up to half a second ahead; mean absolute errors of a coordinate, mm."""
    loaded = load_library(find_library(library))
    seen = carried(read(clip, frames, skeleton), loaded.skeleton)
    rows = foresight(Anticipator(loaded), loaded.encoding.encode(seen), seen.rate)
    print("ahead, s   anticipated   network alone   hold   velocity   relied on: network  velocity")
    for row in rows:
        errors = f"{row.anticipated:13.1f} {row.network:15.1f} {row.hold:6.1f} {row.velocity:10.1f}"
        print(f"{row.ahead_s:8.1f} {errors} {100 * row.trust:18.0f} % {100 * row.line:6.0f} %")
    if plot is not None:
        ahead = np.array([row.ahead_s for row in rows])
        labels = {"anticipated": "anticipated", "network": "network alone", "hold": "last pose", "velocity": "velocity"}
        curves = {label: (ahead, np.array([getattr(row, name) for row in rows])) for name, label in labels.items()}
        draw_lines(curves, ("s ahead", "mean absolute error, mm"), f"{seen.name}, from {loaded.info.name}", plot)


def restyle(
    library: Annotated[str, typer.Argument(help="A library.")],
    motion: Annotated[str, typer.Argument(help="The motion to change.")],
    like: Annotated[str, typer.Option(help="The motion whose frequencies or style it gets.")],
    out: Annotated[Path, typer.Option(help="The library to write, with one more motion.")],
    unlike: Annotated[str | None, typer.Option(help="The action of --like without its style.")] = None,
    strength: Annotated[float, typer.Option(help="Factor of the style, with --unlike.")] = 1.0,
) -> None:
    """Write a library with one more motion: MOTION with the frequencies of another, or, with --unlike, in its style.

    A style changes the mean posture (phase-driven libraries), frequencies change the centers (centralized libraries).
    """
    loaded = load_library(find_library(library))
    if unlike is not None:
        styled, distance = in_the_style(loaded, motion, like, unlike, strength)
        moved = f"joints {distance:.0f} mm from where they were in {motion} on average"
    else:
        styled, distance = restyled(loaded, motion, like)
        moved = f"joints at most {distance:.0f} mm outside of where they were in {motion}"
    save_library(styled, out)
    print(f"wrote {out}: {styled.info.motions[-1].name}, {moved}")


def read(file: Path, frames: tuple[int, int] | None = None, skeleton: Path | None = None) -> Clip:
    """A recording, or a part of it."""
    clip = read_clip(file, ReadingOptions(skeleton))
    if frames is None:
        return clip
    first, end = frames
    if not 0 <= first < end <= len(clip):
        raise MotiondeckError(f"--frames {first} {end}: {file} has frames 0 to {len(clip)}")
    return span(clip, first, end)


def clip_signature(clip: Clip) -> Array:
    """Frequencies and ranges of a recording's parts."""
    encoding = encoding_of(clip.skeleton)
    return signature(encoding, encoding.encode(clip), clip.rate)


def _try_signature(file: Path) -> tuple[Array | None, str]:
    """The signature of a recording; or None, and why there is none."""
    try:
        return clip_signature(read(file)), ""
    except MotiondeckError as error:
        return None, str(error)


def library_signatures(library: str) -> tuple[list[str], Array]:
    """The motions of a library with their frequencies and ranges."""
    loaded = load_library(find_library(library))
    rows = []
    for motion in loaded.info.motions:
        anchors = loaded.network.anchors(motion.name)
        rate = loaded.info.rate * len(anchors) / motion.frames
        rounds = max(2, int(np.ceil(LOOP_S * rate / len(anchors)))) if motion.plays == "loop" else 1
        rows.append(signature(loaded.encoding, np.tile(anchors, (rounds, 1)), rate))
    return [motion.name for motion in loaded.info.motions], np.array(rows)


if __name__ == "__main__":
    command.run("frequencies", similar, None, index, anticipate, restyle)
