"""`motiondeck segment`: cuts a recording into its behaviours, and scores the cuts against marked ones."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from motiondeck.cli.common.options import JsonOption

if TYPE_CHECKING:
    from controller.learning.recognition.segmentation.labels import Labels
    from controller.motion.clip import Clip


class SegmentMethod(StrEnum):
    """How a recording is cut."""

    EXPERTS = "experts"
    CHANGE_POINTS = "change-points"
    CROSS_PREDICTION = "cross-prediction"
    PLANES = "planes"


def segment(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The recording, of any format.")],
    method: Annotated[SegmentMethod, typer.Option("--method", help="How to cut.")] = SegmentMethod.PLANES,
    labels: Annotated[
        Path | None,
        typer.Option(
            "--labels", metavar="FILE", help="Marked borders to score against (and for experts to learn from)."
        ),
    ] = None,
    recognizer: Annotated[
        Path | None,
        typer.Option("--recognizer", metavar="FILE", help="For experts: a trained recognizer instead of the labels."),
    ] = None,
    count: Annotated[
        int | None,
        typer.Option("--segments", metavar="N", min=1, help="For planes: the number of segments; default: found."),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE", help="Draw the cuts over the motion (.png, .svg, .pdf).")
    ] = None,
    skeleton: Annotated[
        Path | None, typer.Option("--skeleton", metavar="FILE", help="The .asf of an .amc recording.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Cut a recording into its behaviours.

    planes: segments nearest to planes of four dimensions, the best of all segmentations; --segments sets their number.
    change-points: segments that vary least within themselves. cross-prediction: borders across which prediction fails.
    experts: every frame is recognized, by a trained recognizer, or by experts that learn the first occurrence of each
    behaviour from --labels; these are scored on borders between frames that they did not learn.

    Labels have the format of Barbic et al. 2004: earliest, best and latest acceptable frame of each border.

    [bold]Examples[/]

      motiondeck segment 86_01.amc --method experts --labels barbic_01_ground_truth.txt
      motiondeck segment 86_01.amc --segments 7 --plot cuts.png
    """
    from controller.learning.recognition.segmentation.labels import read_labels
    from controller.motion.formats.reading import read_clip
    from controller.motion.reading_options import ReadingOptions
    from motiondeck_base.errors import MotiondeckError

    if not file.is_file():
        raise MotiondeckError.missing(file)
    if recognizer is not None and method is not SegmentMethod.EXPERTS:
        raise MotiondeckError(f"--recognizer goes with --method experts, not with {method.value}")
    if count is not None and method is not SegmentMethod.PLANES:
        raise MotiondeckError(f"--segments goes with --method planes, not with {method.value}")
    if plot is not None:
        from motiondeck.pictures.figures import check_picture

        check_picture(plot)
    clip = read_clip(file, ReadingOptions(skeleton))
    marked = read_labels(labels) if labels else None
    if marked is not None and abs(marked.frames - len(clip)) > 0.05 * len(clip):
        raise MotiondeckError(f"{labels}: speaks of {marked.frames} frames, but {file} has {len(clip)}. Wrong trial?")
    cut = (
        _by_experts(clip, marked, recognizer) if method is SegmentMethod.EXPERTS else _unsupervised(clip, method, count)
    )
    learned: bool = cut.pop("learned", False)
    said: dict[str, Any] = {"file": str(file), "method": method.value, "frames": len(clip), **cut}
    if marked is not None:
        learned_from_labels = method is SegmentMethod.EXPERTS and recognizer is None
        said["score"] = _score(cut["segments"], marked, learned_from_labels=learned_from_labels) | {"learned": learned}
    if plot is not None:
        from motiondeck.pictures.curve_plots import draw_segments

        draw_segments(clip, said, marked, plot)
    if as_json:
        print(json.dumps(said))
        return
    _print_words(said, file.name)


def _score(segments: list[dict[str, Any]], marked: Labels, *, learned_from_labels: bool) -> dict[str, Any]:
    """How many of the marked borders were found; of labels that were learned from only those that were not."""
    import numpy as np

    from controller.learning.recognition.segmentation.border_score import score_borders
    from controller.learning.recognition.segmentation.by_experts import not_learned

    borders = np.array([one["from_frame"] for one in segments[1:]], dtype=np.int64)
    borders, accepted = not_learned(borders, marked) if learned_from_labels else (borders, marked.borders)
    score = score_borders(borders, accepted)
    return {
        "found": score.found,
        "marked": score.marked,
        "hits": score.hits,
        "precision": score.precision,
        "recall": score.recall,
        "f1": score.f1,
    }


def _print_words(said: dict[str, Any], name: str) -> None:
    """The segments of a recording of this name, and how well they were found."""
    for one in said["segments"]:
        print(f"{one['from_s']:8.2f} to {one['to_s']:8.2f} s  frame {one['from_frame']:6d}  {one['motion'] or ''}")
    if score := said.get("score"):
        where = " between frames that were not learned" if "accuracy" in said else ""
        if score["marked"]:
            given = f"{score['found']} given, F1 {score['f1']:.2f}"
            print(f"borders{where}: {score['hits']} of {score['marked']} found, {given}")
            if score["learned"]:
                print(f"the recognizer has learned a recording called {name}: if it is this one, that is no test")
        else:
            print(f"no border{where} is marked")
    if "accuracy" in said:
        print(
            f"frames that were not learned ({100 * said['asked_share']:.0f} %): {said['accuracy']:.3f} right, "
            f"{said['accuracy_smoothed']:.3f} with smoothing instead of Viterbi"
        )


def _by_experts(clip: Clip, marked: Labels | None, recognizer: Path | None) -> dict[str, Any]:
    from controller.learning.recognition.features import features
    from controller.learning.recognition.recognizer_file import load_recognizer
    from controller.learning.recognition.segmentation.by_experts import (
        CHANGE_COST,
        LOOK,
        bank_of_first_occurrences,
        first_occurrences,
        frame_costs,
        smoothed,
        viterbi,
    )
    from motiondeck_base.errors import MotiondeckError

    learned = False
    if recognizer is not None:
        loaded = load_recognizer(recognizer)
        learned = clip.source in loaded.sources
        look, bank = loaded.recipe, loaded.bank
        signal = features(clip, look)
    elif marked is not None:
        look = LOOK
        signal = features(clip, look)
        bank = bank_of_first_occurrences(signal, marked, clip.rate / look.rate)
    else:
        raise MotiondeckError("--method experts needs --recognizer FILE, or --labels FILE to learn from")
    if len(signal) < 2:
        raise MotiondeckError(f"{clip.source}: too short to be cut. Give a longer one.")
    stride = clip.rate / look.rate
    costs = frame_costs(bank, signal)
    path = viterbi(costs, CHANGE_COST * look.rate)
    said: dict[str, Any] = {"segments": _segments(path, stride, clip, bank.classes)}
    if learned:
        said["learned"] = True
    if marked is not None:
        truth = marked.of_frames(stride)[: len(signal)]
        ask = ~first_occurrences(marked, stride)[: len(truth)]
        right = path[: len(truth)] == truth
        by_smoothing = smoothed(costs, look.rate).argmin(1)[: len(truth)] == truth
        said |= {
            "asked_share": float(ask.mean()),
            "accuracy": float(right[ask].mean()),
            "accuracy_smoothed": float(by_smoothing[ask].mean()),
        }
    return said


def _unsupervised(clip: Clip, method: SegmentMethod, count: int | None) -> dict[str, Any]:
    import numpy as np

    from controller.learning.recognition.features import FeatureRecipe, features
    from controller.learning.recognition.segmentation import change_points

    if method is SegmentMethod.PLANES:
        from controller.motion.segmentation import body_features, find_segments

        ends = find_segments(body_features(clip), clip.rate, count)
        return {"segments": [_segment(None, first, end, clip.rate) for first, end in ends]}
    by_kernel = method is SegmentMethod.CHANGE_POINTS
    rate = change_points.KERNEL_RATE if by_kernel else change_points.PREDICTION_RATE
    signal = features(clip, FeatureRecipe(height=True, rate=rate))
    cut = change_points.kernel_change_points if by_kernel else change_points.cross_prediction
    found = cut(signal, rate)
    path = np.zeros(len(signal), dtype=np.int64)
    path[found] = 1
    return {"segments": _segments(np.cumsum(path), clip.rate / rate, clip, None)}


def _segments(path: Any, stride: float, clip: Clip, classes: tuple[str, ...] | None) -> list[dict[str, Any]]:
    """The runs of equal classes in a path of every `stride`-th frame."""
    from controller.learning.recognition.segmentation.by_experts import borders_of

    starts = [0, *borders_of(path).tolist()]
    frames = [round(start * stride) for start in starts]
    ends = [*frames[1:], len(clip)]
    return [
        _segment(classes[int(path[start])] if classes else None, frame, end, clip.rate)
        for start, frame, end in zip(starts, frames, ends, strict=True)
    ]


def _segment(motion: str | None, first: int, end: int, rate: float) -> dict[str, Any]:
    return {"motion": motion, "from_frame": first, "from_s": first / rate, "to_s": end / rate}
