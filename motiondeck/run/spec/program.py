"""What a run plays: the library with its first motion, timeline and length, and the rate at which it can be played."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.clock import period_ns
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip
from controller.wire.messages.commands import Switch
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck.run.spec.script import Timed, parse_script, read_timeline
from motiondeck_base.errors import MotiondeckError, UnknownNameError
from motiondeck_base.shipped import find_library

TIMED_FRAMES = 100
_TIMED_AT_ONCE = 20  # the quickest of these batches counts: others were disturbed


@dataclass(frozen=True)
class Program:
    """What a run plays."""

    source: MotionLibrary | Clip
    file: Path | None  # of the library; None for a motion of joints
    first: str  # the motion to begin with
    timeline: list[Timed]  # what is commanded when
    seconds: float | None

    @classmethod
    def of(cls, spec: RunSpec) -> Program:
        """Loads what a spec names; MotiondeckError if that is impossible; it says what to do."""
        spec.check()
        named, motion = spec.library, spec.motion
        if motion is not None and Path(motion).is_file():
            if Path(motion).suffix == ".safetensors":
                named, motion = motion, None
            elif spec.rig is not None and Path(motion).suffix:
                return cls._of_clip(spec, Path(motion))
        file = find_library(str(named))
        library = load_library(file)
        names, script = library.network.motions, str(spec.script) if spec.script is not None else None
        if script is None:
            return cls(library, file, first_motion(library, motion), [], spec.seconds)
        if script.endswith(".toml"):
            first, timeline = read_timeline(Path(script), names)
            return cls(library, file, first, timeline, spec.seconds)
        cues, length = parse_script(script, names)
        timeline = [Timed(cue.at, Switch(cue.motion)) for cue in cues[1:]]
        return cls(library, file, cues[0].motion, timeline, spec.seconds if spec.seconds is not None else length)

    @classmethod
    def _of_clip(cls, spec: RunSpec, file: Path) -> Program:
        """A motion of the rig's joints, which is played once, as it is."""
        clip = read_clip(file)
        if not clip.skeleton.is_rig:
            raise MotiondeckError(f"{file} shows a human body. Learn it first: motiondeck learn {file}")
        for name in ("show", "lock_to", "recognize", "recognizer"):
            if getattr(spec, name):
                raise MotiondeckError(
                    f"{file}: --{name.replace('_', '-')} is for a library, and this is one clip. Learn it: "
                    f"motiondeck learn {file} --out {file.with_suffix('.safetensors').name}"
                )
        return cls(clip, None, clip.name, [], spec.seconds)


def frame_seconds(library: MotionLibrary, motion: str, clock: Callable[[], float] = time.thread_time) -> float:
    """What a frame of a library's network costs, in s of a clock; nothing that plays is changed."""
    network = library.network.twin()
    network.cue(motion, 0)
    frame = np.empty(network.channels)
    batches: list[float] = []
    for _ in range(TIMED_FRAMES // _TIMED_AT_ONCE):
        began = clock()
        for _ in range(_TIMED_AT_ONCE):
            network.advance(frame)
        batches.append((clock() - began) / _TIMED_AT_ONCE)
    return min(batches)


def checked_rate(
    library: MotionLibrary, motion: str, rate: float, *, lower: bool = False, cost: float | None = None
) -> float:
    """The rate at which a library is played: as wanted, unless its network needs more than half of a period for a tick.

    The motion is timed unless the cost of a frame, s, is given; a tick has as many frames as fall into it at the
    recorded tempo. RateError if no loop runs at this rate. Where it is too much for the network, `lower` takes the rate
    that the network can hold; else a MotiondeckError names it.
    """
    period_ns(rate)  # refuses a rate at which no loop runs
    cost = frame_seconds(library, motion) if cost is None else cost
    recorded = library.info.rate
    needs = cost * math.ceil(recorded / rate)
    if needs <= 0.5 / rate:
        return rate
    said = f"the network of {library.info.name} needs {1e3 * needs:.2f} ms of the {1e3 / rate:.2f} ms of a tick"
    held = math.floor(0.5 / cost)
    if held < recorded:
        raise MotiondeckError(f"{said}; on this machine it is too large to be played live at any rate: make a film")
    if lower:
        return float(held)
    raise MotiondeckError(f"{said}, and half of it is the most; it can hold --rate {held} (or give --lower-rate)")


def first_motion(library: MotionLibrary, motion: str | None) -> str:
    """What a library plays first: the given motion, else `walk`, else its first; UnknownNameError names the nearest."""
    names = library.network.motions
    if motion is not None and motion not in names and Path(motion).is_file():
        learned = Path(motion).with_suffix(".safetensors").name
        raise MotiondeckError(
            f"{motion}: a file, not a motion of {library.info.name}. Learn it: motiondeck learn {motion} --out "
            f"{learned}; then play it: motiondeck play {learned}"
        )
    if motion is not None and motion not in names:
        raise UnknownNameError.among("motion", motion, names)
    return motion or ("walk" if "walk" in names else names[0])
