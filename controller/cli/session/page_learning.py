"""Looks at a recording, or learns it, for the page: a process of its own, so that neither page nor deck waits for it.

The request is one JSON object on the command line; the answers are JSON lines on standard output: any number of steps,
then what was seen or learned, or why not and what to do.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import msgspec

from motiondeck_base.errors import MotiondeckError
from sim.view.learning.learning_process import Learned, LearningStep, LearnRequest, News, NotLearned, Seen

FIGURES = 8  # poses of a recording that are shown
_OFTEN = "Give a part without pauses or whole cycles of it, and learn it again."


def look(request: LearnRequest) -> Seen:
    """Reads a recording.

    Raises:
        MotiondeckError: if it cannot be read.
    """
    import numpy as np

    from controller.training.learn import examine

    motion, clip = examine(Path(request.file), "recording")
    first, end = motion.frames or (0, len(clip))
    joints = clip.joints()[np.linspace(0, len(clip) - 1, FIGURES).round().astype(int)]
    figures = (joints - joints[:, :1]).round(3).tolist()
    return Seen(clip.duration, (first / clip.rate, end / clip.rate), figures, clip.skeleton.parent.tolist())


def learn(request: LearnRequest) -> Learned | NotLearned:
    """Learns a recording as one more motion of a library, or of a library of its own where that takes no more.

    Raises:
        MotiondeckError: if it cannot be learned.
    """
    from controller.library.motion_library import load_library, save_library
    from controller.training.adding import add_motion
    from controller.training.learn import examine
    from controller.training.learn import learn as learn_library

    library, file = Path(request.library), Path(request.file)
    tell(LearningStep(f"reading {file.name}"))
    motion, clip = examine(file, request.name, within=request.within)
    deck = load_library(library)
    out = _free_name(f"{library.stem}-{request.name}")
    tell(LearningStep(f"learning {request.name} beside the {len(deck.network.motions)} motions of {deck.info.name}"))
    note = ""
    try:
        added = add_motion(deck, library, clip, motion)
        grown, verdict = added.library, added.verdict
        passed, reason = verdict.passed, verdict.reason
    except MotiondeckError as error:
        if request.name in deck.network.motions:
            raise
        note = f" It has a library of its own, because {error}"
        tell(LearningStep("learning it as a library of its own"))
        alone = learn_library([file], request.name)
        grown, passed, reason = alone.library, not alone.failed, alone.motions[0].remedy
        motion = msgspec.structs.replace(motion, name=alone.motions[0].name)
    if not passed:
        return NotLearned(f"{request.name} did not pass its self-test: {reason}. {_OFTEN}")
    save_library(grown, out)
    plays = "a loop" if motion.plays == "loop" else "a one-shot"
    return Learned(str(out.absolute()), motion.name, f"{motion.name} is {plays}, written to {out.name}.{note}")


def _free_name(stem: str) -> Path:
    """A file in this folder that does not exist yet."""
    number, out = 2, Path(f"{stem}.safetensors")
    while out.exists():
        number, out = number + 1, Path(f"{stem}-{number}.safetensors")
    return out


def tell(news: News) -> None:
    """Writes one line."""
    sys.stdout.buffer.write(msgspec.json.encode(news) + b"\n")
    sys.stdout.buffer.flush()


def main() -> int:
    """Carries out the request on the command line."""
    os.nice(3)  # the deck comes first
    try:
        request = msgspec.json.decode(sys.argv[1], type=LearnRequest)
        tell(learn(request) if request.name else look(request))
    except MotiondeckError as error:
        tell(NotLearned(str(error)))
    except Exception as error:  # whatever a recording brings about is told on the page
        tell(NotLearned(f"{type(error).__name__}: {error}"))
    return 0


if __name__ == "__main__":
    for _library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
    sys.exit(main())
