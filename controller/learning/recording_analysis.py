"""Analyses a recording for training: the frames to learn, and whether they are a loop.

Still ends, and parts beyond a jump, are trimmed; `preparation/kind` decides whether a motion is a loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

from controller.learning.preparation.kind import FoundKind, Plays, kind_of
from controller.learning.preparation.loops import SLOPE_SECONDS
from controller.learning.preparation.takes import read_takes
from controller.learning.recipe import MotionRecipe
from controller.learning.training_set import COMMON_RATE, SHORTEST_SECONDS, seam_error
from controller.motion.canonical.body_doubts import anatomy_doubts, other_doubts
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.canonical.clip_edits import STILL_SPEED, breaks, moving_part, resampled, span
from controller.motion.clip import Clip
from controller.motion.decision import Decision
from controller.motion.encodings.encoding import encoding_of
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.markers.marker_fit import misplaced
from controller.motion.formats.reading import FittedClip, read_fitted
from controller.motion.reading_options import AS_FOUND, ReadingOptions
from motiondeck_base.errors import FileFormatError

LONGEST_SECONDS = 120.0
Given = float | Literal["auto", "none"] | None


@dataclass(frozen=True)
class AnalysedRecording:
    """A recording that can be learned."""

    motion: MotionRecipe
    clip: Clip  # all of its frames
    take: DecidedTake


def analyse_recording(
    file: Path,
    name: str,
    options: ReadingOptions = AS_FOUND,
    within: tuple[float, float] | None = None,
    takes: Sequence[Path] = (),
    plays: Plays | None = None,
) -> AnalysedRecording:
    """Reads a recording and determines its frames to learn and whether they are a loop.

    Args:
        options: override the file.
        within: part to use, from and to, s; by default all.
        takes: further takes of a motion taught to a rig.
        plays: overrules what is found, not what was taught.

    Raises:
        MotiondeckError: if it cannot be read, is too short or too long, or nothing moves in it.
    """
    own = with_steps(replace(options, skeleton=find_skeleton(file, options)))
    recording = read_fitted(file, own)
    taught = None
    if file.suffix.lower() == ".clip":
        clip, taught = read_takes([file, *takes])
        recording = replace(recording, clip=clip)
    found = decided(recording, file, within, taught, plays)
    motion = MotionRecipe(
        name=name,
        file=str(file.absolute()),
        plays="loop" if found.loop else "once",
        frames=found.frames,
        skeleton=None if own.skeleton is None else str(own.skeleton.absolute()),
        unit=own.unit,
        up=own.up,
        rename=dict(own.rename),
        person=own.person,
        rate=_to_repeat("rate", options.rate, found.decisions),
        ground=_to_repeat("ground", options.ground, found.decisions),
        takes=tuple(str(take.absolute()) for take in takes),
    )
    return AnalysedRecording(motion, recording.clip, found)


@dataclass(frozen=True)
class DecidedTake:
    """What is learned of a recording, and why."""

    frames: tuple[int, int]
    loop: bool
    seam_mm: float  # mean distance of joints at the best seam
    seam_degrees: float  # largest angle of a bone there
    doubts: list[str]  # warnings about the body
    decisions: list[Decision]  # in the order of the steps
    anatomy: list[str]  # those of the doubts that touch the anatomy


def decided(
    recording: FittedClip,
    file: Path,
    within: tuple[float, float] | None = None,
    taught: str | None = None,
    plays: Plays | None = None,
) -> DecidedTake:
    """Runs the steps of a take in their order: the part to learn, and whether it is a loop.

    `within` is the part to use, s, `taught` how a taught clip plays, and `plays` how any other plays. Raises
    FileFormatError if the recording is too short or too long, or nothing moves in it.
    """
    clip = recording.clip
    decisions = list(clip.decisions)
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
    loop, seam_mm, seam_degrees = (taught == "loop", 0.0, 0.0)
    if taught is None:
        kind, seam_mm, seam_degrees = _kind(span(clip, first, end), plays)
        loop = kind.plays == "loop"
        if kind.one_round:
            first, end = _one_round(clip, first, end, kind)
        whole = ["one round returns better than several"] if kind.one_round else []
        decisions += [_part_decision(clip, first, end, [*jumped, *whole]), kind.decision]
    else:
        decisions.append(_part_decision(clip, first, end, jumped))
    anatomy = [] if clip.skeleton.is_rig else anatomy_doubts(clip)
    body = [] if clip.skeleton.is_rig else [*anatomy, *other_doubts(clip)]
    body += [] if recording.fit is None else misplaced(recording.fit)
    cut = [f"{what}: only {first / clip.rate:.2f} to {end / clip.rate:.2f} s were learned." for what in jumped]
    return DecidedTake((first, end), loop, seam_mm, seam_degrees, [*cut, *body], decisions, anatomy)


def _part_decision(clip: Clip, first: int, end: int, jumped: list[str]) -> Decision:
    what = f"{first / clip.rate:.2f} to {end / clip.rate:.2f} s of {clip.duration:.2f} s"
    why = ", ".join(jumped) or f"joints are slower than {STILL_SPEED:g} m/s before and after, or the recording ends"
    return Decision("cuts", what, why, "frames in the recipe", notable=bool(jumped))


def _one_round(clip: Clip, first: int, end: int, kind: FoundKind) -> tuple[int, int]:
    """The frames from `first` to `end` in which a loop finds one round, with those that show its slopes."""
    begin, until = (at / COMMON_RATE * clip.rate for at in kind.seam)
    margin = 1.0 + SLOPE_SECONDS * clip.rate
    return max(first, int(first + begin - margin)), min(end, int(first + until + margin) + 1)


def with_steps(options: ReadingOptions) -> ReadingOptions:
    """Options by which a recording is corrected as far as it needs it, unless they overrule that."""
    return replace(options, rate=options.rate or "auto", ground="auto" if options.ground is None else options.ground)


def _to_repeat(step: str, given: Given, decisions: list[Decision]) -> Given:
    """What a recipe says for a step to repeat what was decided: nothing, where nothing was changed."""
    steps = ("ground", "unit") if step == "ground" else (step,)  # the path's unit is found with the ground
    changed = any(decision.step in steps and decision.notable for decision in decisions)
    return (given or "auto") if changed else None


def find_skeleton(file: Path, options: ReadingOptions) -> Path | None:
    """The skeleton of a recording: the given one if it fits files of this format, or the .asf nearby."""
    unfit = {".amc": ".npz", ".npz": ".asf"}.get(file.suffix.lower())
    if options.skeleton is not None and unfit and options.skeleton.suffix.lower() != unfit:
        return options.skeleton
    return skeleton_of(file, file.parent.parent)


def _kind(clip: Clip, plays: Plays | None) -> tuple[FoundKind, float, float]:
    """How a clip plays, and the error at its best seam (see `seam_error`)."""
    one = resampled(clip if clip.skeleton.is_rig else to_canonical(clip), COMMON_RATE)
    encoding = encoding_of(one.skeleton)
    channels = encoding.encode(one)
    features = joint_features(encoding, channels)
    kind = kind_of(features, one.rate, plays)
    return kind, *seam_error(encoding, channels, features, kind.seam)
