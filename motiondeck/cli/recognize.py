"""`motiondeck recognize`: trains recognizers, and names the motions of recordings."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument, Option

from motiondeck.cli.common.options import JsonOption, SkeletonOption, check_ending
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.progress import progress
from motiondeck_base.words import counted

if TYPE_CHECKING:
    from controller.learning.recognition.labelled_recordings import Dataset
    from controller.learning.recognition.recognizer import Recognizer

# A committee of 8 groups of 25 neurons (docs/recognition.md#unknown-motions), and frames per second, Hz.
NEURONS, GROUPS, RATE = 200, 8, 30.0

SKIPPED_EXIT = 3  # exit code: some files could not be used

app = typer.Typer(help="Train a recognizer, and name the motions of recordings.", no_args_is_help=True)

DataArgument = Annotated[Path, Argument(metavar="DATA", help="A folder with one folder of recordings for each motion.")]


@app.command("train")
def train(
    data: DataArgument,
    out: Annotated[Path, Option(metavar="FILE", help="The recognizer to write (.safetensors).")],
    joints: Annotated[str, Option(metavar="NAMES", help="Joints to compare, with commas; default: 14 joints.")] = "",
    licence: Annotated[str, Option(metavar="TEXT", help="Licence of the recordings, kept in the file.")] = "",
    as_json: JsonOption = False,
) -> None:
    """Train a recognizer from labelled recordings.

    The folder has one folder per motion, with recordings of any format. Skeletons (.asf) lie beside the recordings or
    above them; the name of a recording begins with the name of its skeleton. A file that cannot be used is named and
    skipped; the exit code is then 3. Every recording is also learned faster and slower, so that motions are recognized
    at half and at twice their tempo.

    Example:  motiondeck recognize train hdm05 --out hdm05.safetensors
    """
    from controller.learning.recognition.experts import STRETCHES, committee_recipe
    from controller.learning.recognition.features import FeatureRecipe
    from controller.learning.recognition.recognizer import save_recognizer, train_recognizer

    check_ending(out, "a recognizer")
    look = FeatureRecipe(rate=RATE, joints=tuple(name.strip() for name in joints.split(",") if name.strip()))
    dataset = read(data)
    experts = committee_recipe(STRETCHES, neurons=NEURONS, groups=GROUPS, seed=1)
    recognizer = train_recognizer(dataset, look, experts, STRETCHES)
    save_recognizer(recognizer, out, licence)
    if as_json:
        facts = {
            "motions": list(recognizer.bank.classes),
            "clips": recognizer.clips,
            "neurons": recognizer.bank.recipe.neurons,
            "groups": recognizer.bank.recipe.groups,
            "leak": recognizer.bank.recipe.leak,
            "channels": recognizer.bank.readouts.shape[2],
            "joints": list(recognizer.recipe.joints),
            "rate_hz": recognizer.recipe.rate,
            "threshold": recognizer.threshold,
        }
        print(json.dumps(facts | {"written": str(out), "skipped": dataset.skipped}))
    else:
        of = counted(len(recognizer.bank.classes), "motion")
        print(f"{counted(recognizer.clips, 'clip')} of {of}: {', '.join(recognizer.bank.classes)}")
        print(f"a motion is unknown below a confidence of {recognizer.threshold:.3f}")
        print(f"wrote {out} ({out.stat().st_size / 1e6:.1f} MB)")
    leave(dataset)


@app.command("run")
def run(
    recognizer: Annotated[Path, Argument(metavar="RECOGNIZER", help="A recognizer file (.safetensors).")],
    clips: Annotated[list[Path], Argument(metavar="FILE_OR_FOLDER...", help="Recordings of any format, or folders.")],
    skeleton: SkeletonOption = None,
    stream: Annotated[bool, Option("--stream", help="Recognize frame by frame, as on a robot.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Name the motion of each recording.

    Its margin over the next best motion, and whether it is known at all, are printed too. With --stream the recognizer
    sees one frame after the other, as on a robot, and spans of equal motion are printed.

    [bold]Example[/]

      motiondeck recognize run hdm05.safetensors squat.amc --skeleton HDM_bd.asf
    """
    from controller.learning.recognition.recognizer import load_recognizer
    from controller.motion.clip import ReadingOptions
    from controller.motion.formats.reading import read_clip, recordings_below

    options = ReadingOptions(skeleton)
    loaded = load_recognizer(recognizer)
    files = [file for path in clips for file in (recordings_below(path) if path.is_dir() else [path])]
    if not files:
        where = ", ".join(map(str, clips))
        raise MotiondeckError(f"{where}: no recording found. Give a folder with recordings, or a recording.")
    out: list[dict[str, Any]] = []
    failed: list[str] = []
    for path in files:
        try:
            if not path.is_file():
                raise MotiondeckError.missing(path)
            clip = read_clip(path, options)
            found = _streamed(loaded, clip) if stream else asdict(loaded.recognize(clip))
            out.append({"file": str(path)} | found)
        except MotiondeckError as error:
            if len(files) == 1:
                raise
            failed.append(str(error))
            print(f"skipped: {error}", file=sys.stderr)
    if as_json:
        print(json.dumps({"results": out, "skipped": failed}))
    else:
        for one in out:
            if stream:
                print(f"{one['file']}: {one['frames']} frames, {one['frame_us_median']:.0f} us each (median)")
                for span in one["spans"]:
                    print(f"  {span['from_s']:7.2f} to {span['to_s']:7.2f} s  {span['motion'] or '(nothing sure)'}")
            else:
                doubt = "" if one["known"] else " (unknown: too close to the next best)"
                print(f"{one['file']}: {one['motion']}, margin {one['margin']:.2f}{doubt}")
    if failed:
        raise typer.Exit(SKIPPED_EXIT)


def _streamed(recognizer: Recognizer, clip: Any) -> dict[str, Any]:
    import time

    import numpy as np

    from controller.learning.recognition.online_recognizer import OnlineRecognizer

    online = OnlineRecognizer(recognizer.bank, recognizer.threshold, recognizer.recipe.rate)
    spans: list[dict[str, Any]] = []
    took: list[float] = []
    for number, frame in enumerate(recognizer.features(clip)):
        start = time.perf_counter()
        online.update(frame)
        seen = online.motion if online.known else None
        took.append(time.perf_counter() - start)
        at = number / recognizer.recipe.rate
        if not spans or spans[-1]["motion"] != seen:
            spans.append({"from_s": at, "to_s": at, "motion": seen})
        spans[-1]["to_s"] = at + 1.0 / recognizer.recipe.rate
    return {"frames": online.frames, "frame_us_median": float(np.median(took)) * 1e6, "spans": spans}


def read(data: Path) -> Dataset:
    """Reads the dataset of a folder with a progress bar, and names unusable files on stderr."""
    from controller.learning.recognition.labelled_recordings import read_dataset

    with progress("reading", None) as tick:
        dataset = read_dataset(data, lambda count, total: tick(f"reading {count} of {total}"))
    for line in dataset.skipped:
        print(f"skipped: {line}", file=sys.stderr)
    return dataset


def leave(dataset: Dataset) -> None:
    """Ends the command, with exit code 3 if files were skipped."""
    if dataset.skipped:
        raise typer.Exit(SKIPPED_EXIT)
