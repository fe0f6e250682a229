"""`motiondeck library similar, index, anticipate, restyle`: what uses the frequencies of motions."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from motiondeck.cli.common.options import JobsOption, JsonOption, check_ending
from motiondeck.cli.library.commands import LibraryArgument, app
from motiondeck_base.counted import counted
from motiondeck_base.files import check_folder
from motiondeck_base.progress import progress

if TYPE_CHECKING:
    from controller.motion.clip import Clip
    from controller.motion.rotations import Array

INDEX = ".index"

# A loop is heard for so long, s, and twice at least, as a recording of it would be.
HEARD_S = 3.0


@app.command("similar")
def similar(
    library: Annotated[
        str, typer.Argument(metavar="LIBRARY", help="A library, or a file of `motiondeck library index` (.index).")
    ],
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="The recording to compare with.")],
    count: Annotated[int, typer.Option("--count", metavar="N", min=1, help="How many to list.")] = 5,
    weight: Annotated[
        list[str] | None,
        typer.Option("--weight", metavar="PART=W", help="Weight of legs, arms or trunk; 0 leaves one out. Repeatable."),
    ] = None,
    frames: Annotated[
        tuple[int, int] | None, typer.Option("--frames", metavar="FIRST END", help="Only this part of the recording.")
    ] = None,
    skeleton: Annotated[
        Path | None, typer.Option("--skeleton", metavar="FILE", help="The .asf of an .amc recording.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """List the motions whose legs, arms and trunk move as fast and as far as those of a recording.

    A distance of 0.1 is about 10 % faster, slower, wider or narrower (distances are differences of logarithms).

    [bold]Example[/]

      motiondeck library similar cmu86 recordings/35_02.amc --weight arms=0
    """
    from controller.library.motion_index import MotionIndex, load_index
    from controller.library.motion_signature import part_weights, signature
    from controller.motion.encodings.encoding import encoding_of

    weights = part_weights(dict(_weight(given) for given in weight or []))
    names, numbers = load_index(Path(library)) if library.endswith(INDEX) else _of_library(library)
    seen = _cut(clip, frames, skeleton)
    encoding = encoding_of(seen.skeleton)
    asked = signature(encoding, encoding.encode(seen), seen.rate)
    found = MotionIndex(names, numbers, weights).nearest(asked, count)
    if as_json:
        print(json.dumps({"clip": str(clip), "similar": [{"motion": f.name, "distance": f.distance} for f in found]}))
        return
    for one in found:
        print(f"{one.distance:8.3f}  {one.name}")


@app.command("index")
def index(
    sources: Annotated[
        list[str], typer.Argument(metavar="SOURCE...", help="Libraries, recordings, and folders of recordings.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The index to write (.index).")],
    jobs: JobsOption = "1",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Store the frequencies and ranges of many motions in a file that `similar` searches quickly.

    Recordings that cannot be read or are too short are named and skipped.

    Example:  motiondeck library index cmu86 recordings --out all.index --jobs -1
    """
    import numpy as np
    from joblib import delayed

    from controller.library.motion_index import save_index
    from motiondeck_base.errors import MotiondeckError
    from motiondeck_base.jobs import Jobs, spread

    if out.suffix != INDEX:
        raise MotiondeckError(f"{out}: an index is called something{INDEX}; try --out {out.with_suffix(INDEX)}")
    where = Jobs.parse(jobs)
    names: list[str] = []
    rows: list[Array] = []
    left_out: dict[str, str] = {}
    for source in sources:
        files = _recordings(Path(source))
        tasks = (delayed(_signature_of)(file) for file in files)
        with progress("reading", len(files)) as tick:
            for file, (found, reason) in zip(files, spread(tasks, where, ordered=True), strict=True):
                if found is not None:
                    names.append(str(file))
                    rows.append(found)
                else:
                    left_out[str(file)] = reason
                    print(f"motiondeck: left out: {reason}", file=sys.stderr)
                tick()
        if not files and not Path(source).is_dir():
            more, numbers = _of_library(source)
            names += [f"{source}/{name}" for name in more]
            rows += list(numbers)
    if not rows:
        where = ", ".join(map(str, sources))
        raise MotiondeckError(f"{where}: no motion found. Give recordings, folders of them, or centralized libraries.")
    save_index(names, np.array(rows), out)
    if as_json:
        print(json.dumps({"written": str(out), "motions": len(names), "left_out": left_out}))
    else:
        print(f"wrote {out} ({counted(len(names), 'motion')})")


def _signature_of(file: Path) -> tuple[Array | None, str]:
    """What a recording is known by; or None, and why it is left out."""
    from controller.library.motion_signature import signature
    from controller.motion.encodings.encoding import encoding_of
    from motiondeck_base.errors import MotiondeckError

    try:
        clip = _cut(file, None, None)
        encoding = encoding_of(clip.skeleton)
        return signature(encoding, encoding.encode(clip), clip.rate), ""
    except MotiondeckError as error:
        return None, str(error)


@app.command("anticipate")
def anticipate(
    library: LibraryArgument,
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="The recording to predict.")],
    frames: Annotated[
        tuple[int, int] | None, typer.Option("--frames", metavar="FIRST END", help="Only this part of the recording.")
    ] = None,
    skeleton: Annotated[
        Path | None, typer.Option("--skeleton", metavar="FILE", help="The .asf of an .amc recording.")
    ] = None,
    plot: Annotated[Path | None, typer.Option("--plot", metavar="FILE", help="Draw it (.png, .svg, .pdf).")] = None,
    as_json: JsonOption = False,
) -> None:
    """Predict each moment of a recording half a second ahead, and print the errors.

    A centralized network's motions are matched to the last 0.4 s and continued, as far as they are trusted: where no
    motion matches, or predictions were bad so far, the last velocity and pose predict. For comparison: the network
    alone, the last pose held, and the last velocity. A recording that the network has learned is no test; give other
    --frames.

    Example:  motiondeck library anticipate cmu86 86_01.amc --frames 1152 1960
    """
    from dataclasses import asdict

    import numpy as np

    from controller.library.anticipation import Anticipator, foresight
    from controller.library.motion_library import load_library
    from controller.motion.canonical.canonical_body import carried
    from motiondeck.pictures.curve_plots import draw_lines
    from motiondeck.pictures.figures import check_picture
    from motiondeck_base.shipped import find_library

    if plot is not None:
        check_picture(plot)
    loaded = load_library(find_library(library))
    seen = carried(_cut(clip, frames, skeleton), loaded.skeleton)
    rows = [asdict(row) for row in foresight(Anticipator(loaded), loaded.encoding.encode(seen), seen.rate)]
    if plot is not None:
        ahead = np.array([row["ahead_s"] for row in rows])
        labels = {
            "anticipated": "anticipated",
            "network": "the network's motions alone",
            "hold": "last pose held",
            "velocity": "last velocity",
        }
        curves = {label: (ahead, np.array([row[name] for row in rows])) for name, label in labels.items()}
        draw_lines(curves, ("s ahead", "mean absolute error, mm"), f"{seen.name}, from {loaded.info.name}", plot)
    if as_json:
        print(json.dumps({"library": library, "clip": str(clip), "ahead": rows}))
        return
    print(
        "ahead, s   anticipated   network alone   hold   velocity   relied on: network  velocity   "
        "(mean absolute error of a coordinate, mm)"
    )
    for row in rows:
        alone = f"{row['network']:15.1f} {row['hold']:6.1f} {row['velocity']:10.1f}"
        relied = f"{100 * row['trust']:18.0f} % {100 * row['line']:6.0f} %"
        print(f"{row['ahead_s']:8.1f} {row['anticipated']:13.1f} {alone} {relied}")
    worse = [f"{row['ahead_s']:.1f}" for row in rows if row["anticipated"] > min(row["hold"], row["velocity"])]
    if worse:
        print(f"{', '.join(worse)} s ahead the better of last pose and last velocity was nearer in this recording")
    if rows[2]["trust"] < 0.5:
        print("the recording is unlike what the library knows: mostly its last pose and velocity are relied on")


@app.command("restyle")
def restyle(
    library: LibraryArgument,
    motion: Annotated[str, typer.Argument(metavar="MOTION", help="The motion to change.")],
    like: Annotated[
        str, typer.Option("--like", metavar="OTHER", help="The motion whose frequencies or style it gets.")
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The library to write, with one more motion.")],
    unlike: Annotated[
        str | None, typer.Option("--unlike", metavar="NEUTRAL", help="The same action as OTHER without its style.")
    ] = None,
    strength: Annotated[
        float, typer.Option("--strength", metavar="S", help="How much of the style, with --unlike; 1 is all of it.")
    ] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Write a library with one more motion: MOTION with the frequencies of OTHER, or in its style.

    With --unlike, in a phase-driven library, the mean posture of MOTION is changed by the difference of OTHER and
    NEUTRAL, and how far that moves joints is printed. Without it, in a centralized library, satellites and weights
    stay and centers turn as in OTHER, so tempo and rhythm change. The network may be driven outside its training, so
    the distance of joints from their places in MOTION is printed.

    [bold]Example[/]

      motiondeck library restyle cmu86 walk --like run --out styled.safetensors
    """
    from controller.library.motion_library import load_library, save_library
    from controller.library.restyling import in_the_style, restyled
    from motiondeck_base.shipped import find_library

    check_ending(out, "a library")
    check_folder(out)
    loaded = load_library(find_library(library))
    if unlike is not None:
        styled, distance = in_the_style(loaded, motion, like, unlike, strength)
        field, words = "moved_mm", f"joints {distance:.0f} mm from where they were in {motion} on average"
    else:
        styled, distance = restyled(loaded, motion, like)
        field, words = "outside_mm", f"joints at most {distance:.0f} mm outside of where they were in {motion}"
    save_library(styled, out)
    name = styled.info.motions[-1].name
    if as_json:
        print(json.dumps({"written": str(out), "motion": name, field: distance}))
    else:
        print(f"wrote {out}: {name}, {words}")


def _weight(given: str) -> tuple[str, float]:
    from motiondeck_base.errors import MotiondeckError

    part, _, value = given.partition("=")
    try:
        return part, float(value)
    except ValueError:
        raise MotiondeckError(f"--weight {given}: give a part and a number, such as arms=0.5") from None


def _recordings(source: Path) -> list[Path]:
    """The recordings below a folder, or a single one."""
    from controller.motion.formats.reading import RECORDINGS, recordings_below

    if source.is_dir():
        return recordings_below(source)
    return [source] if source.suffix.lower() in RECORDINGS else []


def _cut(file: Path, frames: tuple[int, int] | None, skeleton: Path | None) -> Clip:
    """A recording, or some frames of it."""
    from dataclasses import replace

    from controller.motion.formats.reading import read_clip
    from controller.motion.reading_options import ReadingOptions
    from motiondeck_base.errors import MotiondeckError

    if not file.is_file():
        raise MotiondeckError.missing(file)
    clip = read_clip(file, ReadingOptions(skeleton))
    if frames is None:
        return clip
    first, end = frames
    if not 0 <= first < end <= len(clip):
        raise MotiondeckError(f"--frames {first} {end}: {file} has frames 0 to {len(clip)}")
    return replace(clip, root_position=clip.root_position[first:end], rotation=clip.rotation[first:end])


def _of_library(library: str) -> tuple[list[str], Array]:
    """The motions of a library with their frequencies and ranges."""
    import numpy as np

    from controller.library.motion_library import load_library
    from controller.library.motion_signature import signature
    from motiondeck_base.shipped import find_library

    loaded = load_library(find_library(library))
    names, rows = [], []
    for motion in loaded.info.motions:
        anchors = loaded.network.anchors(motion.name)
        rate = loaded.info.rate * len(anchors) / motion.frames
        rounds = max(2, int(np.ceil(HEARD_S * rate / len(anchors)))) if motion.plays == "loop" else 1
        names.append(motion.name)
        rows.append(signature(loaded.encoding, np.tile(anchors, (rounds, 1)), rate))
    return names, np.array(rows)
