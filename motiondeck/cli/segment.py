"""`motiondeck segment`: cuts a recording into its behaviours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from motiondeck.cli.common.options import JsonOption, SkeletonOption, check_plot
from motiondeck_base.errors import MotiondeckError

if TYPE_CHECKING:
    from controller.motion.clip import Clip


def segment(
    file: Annotated[Path, Argument(metavar="FILE", help="The recording, of any format.")],
    count: Annotated[int | None, Option("--segments", metavar="N", min=1, help="How many; default: detected.")] = None,
    recognizer: Annotated[Path | None, Option(metavar="FILE", help="Cut where a recognizer sees a new motion.")] = None,
    plot: Annotated[Path | None, Option(metavar="FILE", help="Draw cuts over the motion (.png, .svg, .pdf).")] = None,
    skeleton: SkeletonOption = None,
    as_json: JsonOption = False,
) -> None:
    """Cut a recording into its behaviours.

    A border lies where the distribution of poses changes, moved to a slow moment beside it. With --recognizer every
    frame is recognized instead, and segments have the names of motions. `clip convert --from --to` writes a segment.

    [bold]Examples[/]

      motiondeck segment session.bvh --plot cuts.png
      motiondeck segment session.bvh --recognizer gestures.safetensors --json
    """
    from controller.motion.clip import ReadingOptions
    from controller.motion.formats.reading import read_clip
    from controller.motion.take.segmentation import segments_of

    if not file.is_file():
        raise MotiondeckError.missing(file)
    if recognizer is not None and count is not None:
        raise MotiondeckError("--segments sets the number of segments; --recognizer finds it: give one of them")
    check_plot(plot)
    clip = read_clip(file, ReadingOptions(skeleton))
    if recognizer is None:
        method, segments = "changes", [_row(None, *ends, clip.rate) for ends in segments_of(clip, count)]
    else:
        method, segments = "experts", by_recognizer(clip, recognizer)
    report = {"file": str(file), "method": method, "frames": len(clip), "segments": segments}
    if plot is not None:
        from motiondeck.pictures.clip_plot import draw_segments

        draw_segments(clip, report, plot)
    if as_json:
        print(json.dumps(report))
        return
    for one in segments:
        print(f"{one['from_s']:8.2f} to {one['to_s']:8.2f} s  frame {one['from_frame']:6d}  {one['motion'] or ''}")


def by_recognizer(clip: Clip, file: Path) -> list[dict[str, Any]]:
    """Segments of one recognized motion each, by the most likely sequence (Viterbi); MotiondeckError if too short."""
    from controller.learning.recognition.features import features
    from controller.learning.recognition.recognizer import load_recognizer
    from controller.learning.recognition.viterbi_segmentation import CHANGE_COST, borders_of, frame_costs, viterbi

    recognizer = load_recognizer(file)
    signal = features(clip, recognizer.recipe)
    if len(signal) < 2:
        raise MotiondeckError(f"{clip.source}: too short to be cut. Give a longer one.")
    stride = clip.rate / recognizer.recipe.rate
    path = viterbi(frame_costs(recognizer.bank, signal), CHANGE_COST * recognizer.recipe.rate)
    starts = [0, *borders_of(path).tolist()]
    frames = [round(start * stride) for start in starts]
    return [
        _row(recognizer.bank.classes[int(path[start])], frame, end, clip.rate)
        for start, frame, end in zip(starts, frames, [*frames[1:], len(clip)], strict=True)
    ]


def _row(motion: str | None, first: int, end: int, rate: float) -> dict[str, Any]:
    return {"motion": motion, "from_frame": first, "from_s": first / rate, "to_s": end / rate}
