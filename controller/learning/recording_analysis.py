"""Analyses a recording for training: its motions (`take/segmentation`), frames, and loops (`preparation/kind`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import msgspec

from controller.learning.preparation.kind import FoundKind, kind_of
from controller.learning.preparation.loops import SLOPE_SECONDS
from controller.learning.preparation.takes import read_takes
from controller.learning.recipe import MOST_LETTERS, MotionRecipe
from controller.learning.training_set import COMMON_RATE, SHORTEST_SECONDS, seam_error
from controller.motion.canonical.body_doubts import anatomy_doubts, other_doubts
from controller.motion.canonical.canonical_body import to_canonical
from controller.motion.canonical.clip_edits import moving_part, resampled, span
from controller.motion.clip import AS_FOUND, Clip, Decision, Plays, ReadingOptions
from controller.motion.encodings.encoding import encoding_of
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.markers.marker_fit import misplaced
from controller.motion.formats.reading import FittedClip, read_fitted
from controller.motion.take.segmentation import cuts_of
from controller.motion.upper_body import RESTS
from motiondeck_base.arrays_on_disk import release
from motiondeck_base.errors import FileFormatError

# A motion that is cut out may turn into the next one for so long, s; a loop without that lasts as long as the other, s.
CHANGE_SECONDS, SHORTEST_LOOP = 0.5, 1.0
Given = float | Literal["auto", "none"] | None
Within = tuple[float, float] | None
"""The part of a recording to use, from and to, s; None is all."""


@dataclass(frozen=True)
class AnalysedRecording:
    """A motion of a recording that can be learned."""

    name: str  # of the recording; that of a motion has a number behind it where there are several
    motion: MotionRecipe
    clip: Clip  # all of its frames
    take: DecidedTake


def analyse_recording(
    file: Path,
    name: str,
    options: ReadingOptions = AS_FOUND,
    within: Within = None,
    takes: Sequence[Path] = (),
    plays: Plays | None = None,
    *,
    whole: bool = False,
) -> list[AnalysedRecording]:
    """Reads a recording and finds its motions, the frames to learn of each, and whether they are a loop.

    `takes` are further ones of a motion taught to a rig. `plays` overrules what is found, not what was taught; with
    `whole` the recording is one motion. MotiondeckError if it cannot be read, is too short, or nothing moves in it.
    """
    own = with_steps(replace(options, skeleton=find_skeleton(file, options)))
    recording = read_fitted(file, own)
    if takes:
        recording = replace(recording, clip=read_takes([file, *takes]))
    found = decided(recording, file, within, plays, whole=whole)
    release()
    motion = MotionRecipe(
        name=name,
        file=str(file.absolute()),
        skeleton=None if own.skeleton is None else str(own.skeleton.absolute()),
        unit=own.unit,
        up=own.up,
        rename=dict(own.rename),
        person=own.person,
        rate=_to_repeat("rate", options.rate, found[0].decisions),
        ground=_to_repeat("ground", options.ground, found[0].decisions),
        upper_body=RESTS in found[0].decisions,
        takes=tuple(str(take.absolute()) for take in takes),
    )
    analysed: list[AnalysedRecording] = []
    for number, take in enumerate(found, 1):
        own = numbered(name, number) if len(found) > 1 else name
        plan = msgspec.structs.replace(motion, name=own, plays="loop" if take.loop else "once", frames=take.frames)
        analysed.append(AnalysedRecording(name, plan, recording.clip, take))
    return analysed


def numbered(name: str, number: int) -> str:
    """The name with a number, short enough to be typed."""
    return f"{name[: MOST_LETTERS - 4]}-{number}"


@dataclass(frozen=True)
class DecidedTake:
    """What is learned of a recording as one motion, and why."""

    frames: tuple[int, int]
    loop: bool
    seam_mm: float  # mean distance of joints at the best seam
    seam_degrees: float  # largest angle of a bone there
    doubts: list[str]  # warnings about the body
    decisions: list[Decision]  # in the order of the steps
    anatomy: list[str]  # those of the doubts that touch the anatomy


def decided(
    recording: FittedClip, file: Path, within: Within = None, plays: Plays | None = None, *, whole: bool = False
) -> list[DecidedTake]:
    """Runs the steps of a take in their order: its motions, and whether each is a loop.

    A clip that says how it plays is one motion; `plays` is how any other plays. FileFormatError if the recording is too
    short, or nothing moves in it.
    """
    clip, taught = recording.clip, recording.clip.plays
    first, end = moving_part(clip)
    if within is not None and end:
        first, end = max(first, round(within[0] * clip.rate)), min(end, round(within[1] * clip.rate))
    if end == 0:
        raise FileFormatError(f"{file}: nothing moves in it. Give a recording with a motion.")
    cuts = cuts_of(clip, first, end, whole=whole or taught is not None)
    first, end = cuts.motions[0]
    if (seconds := (end - first) / clip.rate) < SHORTEST_SECONDS:
        between = f"{', '.join(cuts.jumps)}; the longest piece between, " if cuts.jumps else ""
        raise FileFormatError(f"{file}: {between}{seconds:.2f} s are too short; {SHORTEST_SECONDS:g} s are the least.")
    anatomy = [] if clip.skeleton.is_rig else anatomy_doubts(clip)
    body = [] if clip.skeleton.is_rig else [*anatomy, *other_doubts(clip)]
    body += [] if recording.fit is None else misplaced(recording.fit)
    found: list[DecidedTake] = []
    several = len(cuts.motions) > 1
    for frames in cuts.motions:
        loop, seam_mm, seam_degrees = (taught == "loop", 0.0, 0.0)
        decisions = [*clip.decisions, replace(cuts.decision, notable=cuts.decision.notable and not found)]
        if taught is None:
            frames, (kind, seam_mm, seam_degrees) = _kind_within(clip, frames, plays, cut_out=several)
            loop = kind.plays == "loop"
            words = kind.decision.decided + (", one round" if kind.one_round else "")
            words += f" from {_times(clip, frames)}" if several or kind.one_round else ""
            decisions.append(replace(kind.decision, decided=words, notable=kind.one_round))
        times = f"only {_times(clip, frames)} were learned."
        doubts = [*(what if several else f"{what}: {times}" for what in cuts.jumps), *body]
        found.append(DecidedTake(frames, loop, seam_mm, seam_degrees, doubts, decisions, anatomy))
    return found


def _times(clip: Clip, frames: tuple[int, int]) -> str:
    return f"{frames[0] / clip.rate:.2f} to {frames[1] / clip.rate:.2f} s"


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


def _kind_within(
    clip: Clip, frames: tuple[int, int], plays: Plays | None, *, cut_out: bool
) -> tuple[tuple[int, int], tuple[FoundKind, float, float]]:
    """How some frames of a clip play, and those to learn: of a loop one round, if that returns better."""
    # The changes at both ends of a motion that was cut out may hide a loop.
    found = frames, _kind(span(clip, *frames), plays)
    change = round(CHANGE_SECONDS * clip.rate)
    inner = frames[0] + change, frames[1] - change
    if cut_out and plays is None and found[1][0].plays == "once" and inner[1] - inner[0] >= SHORTEST_LOOP * clip.rate:
        loop = _kind(span(clip, *inner), None)
        found = (inner, loop) if loop[0].plays == "loop" else found
    (first, end), kind = found[0], found[1][0]
    if kind.one_round:  # with the frames that show its slopes
        begin, until = (at / COMMON_RATE * clip.rate for at in kind.seam)
        margin = 1.0 + SLOPE_SECONDS * clip.rate
        first, end = max(first, int(first + begin - margin)), min(end, int(first + until + margin) + 1)
    return (first, end), found[1]


def _kind(clip: Clip, plays: Plays | None) -> tuple[FoundKind, float, float]:
    """How a clip plays, and the error at its best seam (see `seam_error`)."""
    one = resampled(clip if clip.skeleton.is_rig else to_canonical(clip), COMMON_RATE)
    encoding = encoding_of(one.skeleton)
    channels = encoding.encode(one)
    features = joint_features(encoding, channels)
    kind = kind_of(features, one.rate, plays)
    return kind, *seam_error(encoding, channels, features, kind.seam)
