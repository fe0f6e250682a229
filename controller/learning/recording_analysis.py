"""Analyses a recording for training: the frames to learn, and whether they are a loop.

Still ends, and parts beyond a jump, are trimmed; the best seam decides whether a motion is a loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from controller.learning.preparation.loops import best_seam, largest_omission, with_velocities
from controller.learning.preparation.takes import read_takes, spread_of
from controller.learning.recipe import MotionRecipe
from controller.learning.training_set import COMMON_RATE, SHORTEST_SECONDS, seam_error
from controller.motion.canonical.body_doubts import doubts
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.canonical.clip_edits import breaks, moving_part, resampled, span
from controller.motion.clip import Clip
from controller.motion.encodings.encoding import encoding_of
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.markers.marker_fit import misplaced
from controller.motion.formats.reading import read_fitted
from controller.motion.reading_options import AS_FOUND, ReadingOptions
from motiondeck_base.errors import FileFormatError

LONGEST_SECONDS = 120.0
LOOP_KEEPS = 0.5  # a loop keeps at least this share of its recording
# Largest mismatch at the seam of a loop: of joints, mm, and with velocities, relative to the spread of the motion; and
# largest distance of omitted frames from the loop, relative to the spread.
SEAM_MM, SEAM_SHARE, LEFT_OUT_SHARE = 50.0, 0.5, 0.6


@dataclass(frozen=True)
class AnalysedRecording:
    """A recording that can be learned."""

    motion: MotionRecipe
    clip: Clip  # all of its frames
    seam_mm: float  # mean distance of joints at the best seam
    seam_degrees: float  # largest angle of a bone there
    doubts: list[str]  # warnings about the body


def analyse_recording(
    file: Path,
    name: str,
    options: ReadingOptions = AS_FOUND,
    within: tuple[float, float] | None = None,
    takes: Sequence[Path] = (),
) -> AnalysedRecording:
    """Reads a recording and determines its frames to learn and whether they are a loop.

    Args:
        options: override the file.
        within: part to use, from and to, s; by default all.
        takes: further takes of a motion taught to a rig.

    Raises:
        MotiondeckError: if it cannot be read, is too short or too long, or nothing moves in it.
    """
    own = replace(options, skeleton=_skeleton(file, options))
    recording = read_fitted(file, own)
    clip, taught = recording.clip, None
    if clip.skeleton.is_rig:
        clip, taught = read_takes([file, *takes])
    first, end = moving_part(clip)
    if within is not None and end:
        first, end = max(first, round(within[0] * clip.rate)), min(end, round(within[1] * clip.rate))
    if end == 0:
        raise FileFormatError(f"{file}: nothing moves in it. Give a recording with a motion.")
    at, jumped = breaks(clip, first, end)
    first, end = max(pairwise([first, *at, end]), key=lambda part: part[1] - part[0])
    seconds = (end - first) / clip.rate
    if seconds < SHORTEST_SECONDS:
        between = f"{', '.join(jumped)}; the longest piece between, " if jumped else ""
        raise FileFormatError(f"{file}: {between}{seconds:.2f} s are too short; {SHORTEST_SECONDS:g} s are the least.")
    if seconds > LONGEST_SECONDS:
        raise FileFormatError(
            f"{file}: {seconds:.0f} s are more than one motion ({LONGEST_SECONDS:g} s are the most). "
            "Cut a piece out with `motiondeck clip convert FILE PIECE.bvh --from SECONDS --to SECONDS`."
        )
    loop, seam_mm, seam_degrees = _loops(span(clip, first, end)) if taught is None else (taught == "loop", 0.0, 0.0)
    motion = MotionRecipe(
        name=name,
        file=str(file.absolute()),
        plays="loop" if loop else "once",
        frames=(first, end),
        skeleton=None if own.skeleton is None else str(own.skeleton.absolute()),
        unit=own.unit,
        up=own.up,
        rename=dict(own.rename),
        takes=tuple(str(take.absolute()) for take in takes),
    )
    body = [] if clip.skeleton.is_rig else doubts(clip)
    body += [] if recording.fit is None else misplaced(recording.fit)
    cut = [f"{what}: only {first / clip.rate:.2f} to {end / clip.rate:.2f} s were learned." for what in jumped]
    return AnalysedRecording(motion, clip, seam_mm, seam_degrees, [*cut, *body])


def _skeleton(file: Path, options: ReadingOptions) -> Path | None:
    """The skeleton of a recording: the given one if it fits files of this format, or the .asf nearby."""
    unfit = {".amc": ".npz", ".npz": ".asf"}.get(file.suffix.lower())
    if options.skeleton is not None and unfit and options.skeleton.suffix.lower() != unfit:
        return options.skeleton
    return skeleton_of(file, file.parent.parent)


def _loops(clip: Clip) -> tuple[bool, float, float]:
    """Whether a clip is a loop, and the error at its best seam; see `seam_error`."""
    one = resampled(to_canonical(clip), COMMON_RATE)
    encoding = encoding_of(one.skeleton)
    channels = encoding.encode(one)
    features = joint_features(encoding, channels)
    seam = best_seam(features, one.rate, at_least=LOOP_KEEPS)
    apart, degrees = seam_error(encoding, channels, features, seam)
    seen = with_velocities(features, one.rate)
    spread = spread_of(seen)
    close = apart < SEAM_MM and seam.mismatch < SEAM_SHARE * spread
    return close and largest_omission(seen, seam) < LEFT_OUT_SHARE * spread, apart, degrees
