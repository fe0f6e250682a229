"""Inspects or learns a recording for the page, in a separate process, so that neither page nor deck waits for it.

The request is one JSON object on the command line; the answers are JSON lines on standard output: any number of steps,
then what was seen or learned, or why not and what to do.
"""

import os
import sys
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from motiondeck.page.learning import learning_process as messages
from motiondeck.page.learning.learning_process import HAND, Learned, LearningStep, LearnRequest, NotLearned, Seen
from motiondeck_base.errors import MotiondeckError

FIGURES, POINTS = 8, 120  # poses, or angles of each joint, of a recording that are shown
MARKERS = (".c3d", ".trc")
_OFTEN = "Give a part without pauses or whole cycles of it, and learn it again."


def inspect(request: LearnRequest) -> Seen:
    """Reads a recording; MotiondeckError if it cannot be read."""
    from controller.learning.recording_analysis import analyse_recording
    from controller.motion.encodings.joint_angles import angles_of
    from controller.motion.formats.writing import bvh_text

    file = Path(request.file)
    if file.suffix == HAND:
        return _inspect_hands(file)
    if file.suffix.lower() in MARKERS:
        send(LearningStep(f"reading {file.name}: a body is fitted to its markers, which takes some seconds"))
    (recording,) = analyse_recording(file, "recording", whole=True)
    motion, clip = recording.motion, recording.clip
    if file.suffix.lower() in MARKERS:
        # The fit takes long and is not repeated: read from BVH it is the same clip.
        file = file.with_suffix(".bvh")
        file.write_text(bvh_text(clip), encoding="utf-8")
    first, end = motion.frames or (0, len(clip))
    moving = first / clip.rate, end / clip.rate
    if clip.skeleton.is_rig:
        return Seen(clip.duration, moving, str(file), angles=_curves(angles_of(clip.rotation[:, 1:])))
    joints = clip.joints()[_places(len(clip), FIGURES)]
    figures = (joints - joints[:, :1]).round(3).tolist()
    return Seen(clip.duration, moving, str(file), figures, clip.skeleton.parent.tolist())


def _inspect_hands(file: Path) -> Seen:
    """Makes a taught clip of what the page has recorded of a rig moved by hand."""
    from controller.motion.formats.taught_clip import save_taught_clip, taught_clip
    from hardware.tools.teaching import Moment, taught

    hands = msgspec.json.decode(file.read_bytes(), type=messages.HandRecording)
    moments = [Moment(at, np.array(angles)) for at, angles in zip(hands.times, hands.angles, strict=True)]
    found, clip_file = taught(moments, hands.rate), file.with_suffix(".clip")
    save_taught_clip(taught_clip(file.stem, hands.joints, hands.rate, found.whole, "the page"), clip_file)
    moving = found.first / hands.rate, found.end / hands.rate
    return Seen(len(found.whole) / hands.rate, moving, str(clip_file), angles=_curves(found.whole))


def _places(count: int, wanted: int) -> NDArray[np.int64]:
    return np.linspace(0, count - 1, wanted).round().astype(np.int64)


def _curves(angles: NDArray[np.float64]) -> list[list[float]]:
    """The angles (T, J) of the joints, thinned out, a row a joint."""
    return angles[_places(len(angles), POINTS)].T.round(3).tolist()


def learn(request: LearnRequest) -> Learned | NotLearned:
    """Learns a recording as one more motion of a library, or else as a new library; MotiondeckError if it cannot be."""
    from controller.learning.adding import add_motion
    from controller.learning.learn import learn as learn_library
    from controller.learning.recording_analysis import analyse_recording
    from controller.library.motion_library import load_library, save_library

    library, file, within = Path(request.library), Path(request.file), request.within
    send(LearningStep(f"reading {file.name}"))
    if file.suffix == ".clip" and within is not None:
        file, within = _cut(file, request.name, within), None
    (recording,) = analyse_recording(file, request.name, within=within, whole=True)
    motion, clip = recording.motion, recording.clip
    deck = load_library(library)
    out = _free_name(f"{library.stem}-{request.name}")
    send(LearningStep(f"learning {request.name} beside the {len(deck.network.motions)} motions of {deck.info.name}"))
    note = ""
    try:
        if clip.skeleton.is_rig != deck.skeleton.is_rig:
            raise MotiondeckError("joints taught to a rig and bodies do not share one.")
        added = add_motion(deck, library, clip, motion)
        grown, passed, reason = added.library, added.motion.passed, added.motion.reason
    except MotiondeckError as error:
        if request.name in deck.network.motions:
            raise
        note = f" It is in a new library, because {error}"
        send(LearningStep("learning it as a new library"))
        out = _free_name(request.name)
        alone = learn_library([file], request.name, within=within, whole=True)
        grown, passed, reason = alone.library, not alone.failed, alone.motions[0].remedy
        motion = msgspec.structs.replace(motion, name=alone.motions[0].name)
    if not passed:
        return NotLearned(f"{request.name} did not pass its self-test: {reason}. {_OFTEN}")
    save_library(grown, out)
    plays = "a loop" if motion.plays == "loop" else "a one-shot"
    error = next(info.against_recording for info in grown.info.motions if info.name == motion.name)
    near = "" if error is None else f", {error.words}"
    return Learned(str(out.absolute()), motion.name, f"{motion.name} is {plays}{near}; written to {out.name}.{note}")


def _cut(file: Path, name: str, within: tuple[float, float]) -> Path:
    """A part of a taught clip as a clip of this name; a loop if it ends where it began."""
    from controller.learning.preparation.takes import with_kind
    from controller.motion.canonical.clip_edits import seconds_of
    from controller.motion.formats.reading import read_clip
    from controller.motion.formats.taught_clip import save_taught_clip

    clip = read_clip(file)
    part = with_kind(seconds_of(clip, within[0], min(within[1], clip.duration)))
    save_taught_clip(part, out := file.with_name(f"{name}.clip"))
    return out


def _free_name(stem: str) -> Path:
    number, out = 2, Path(f"{stem}.safetensors")
    while out.exists():
        number, out = number + 1, Path(f"{stem}-{number}.safetensors")
    return out


def send(news: messages.News) -> None:
    """Writes one line."""
    sys.stdout.buffer.write(msgspec.json.encode(news) + b"\n")
    sys.stdout.buffer.flush()


def main() -> int:
    """Carries out the request on the command line."""
    os.nice(3)  # the deck comes first
    try:
        request = msgspec.json.decode(sys.argv[1], type=LearnRequest)
        send(learn(request) if request.name else inspect(request))
    except MotiondeckError as error:
        send(NotLearned(str(error)))
    except Exception as error:  # the page shows any failure on a recording
        send(NotLearned(f"{type(error).__name__}: {error}"))
    return 0


if __name__ == "__main__":
    for _library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
    sys.exit(main())
