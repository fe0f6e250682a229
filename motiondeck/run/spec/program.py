"""What a run plays: the library with its first motion, timeline and length, and the rate at which it can be played.

A timeline is a script, "walk 4, jog 4, walk", or a file of any commands:

    motion = "walk"              # what is played first

    [[commands]]
    at = 4.0                     # s since play began
    say = "switch jog"           # a command as typed at the prompt
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from controller.library.motion_library import MotionLibrary, load_library
from controller.loop.clock import period_ns
from controller.motion.clip import Clip
from controller.motion.formats.reading import read_clip
from controller.wire.messages.command_table import BY_WORD, parse_command
from controller.wire.messages.commands import DeckCommand, Switch
from motiondeck.run.spec.run_spec import RunSpec
from motiondeck_base.errors import FileFormatError, MotiondeckError, UnknownNameError
from motiondeck_base.files import as_float
from motiondeck_base.shipped import find_library
from motiondeck_base.toml_file import read_toml


@dataclass(frozen=True)
class Timed:
    """A command and when it is given, s after the start."""

    at: float
    message: DeckCommand


class _Line(msgspec.Struct, forbid_unknown_fields=True):
    at: float
    say: str


class _File(msgspec.Struct, forbid_unknown_fields=True):
    motion: str
    commands: list[_Line] = []


def read_timeline(path: Path, motions: Sequence[str]) -> tuple[str, list[Timed]]:
    """The first motion of a timeline file, and its commands in the order of their times; it may name these motions.

    FileFormatError names the file, the command that is wrong, and what it should be.
    """
    file = read_toml(path, _File)
    with FileFormatError.placed(path):
        UnknownNameError.check("motion", file.motion, motions)
    timeline: list[Timed] = []
    for number, line in enumerate(file.commands, start=1):
        place = f"{path}, command {number}"
        if line.at < 0.0:
            raise FileFormatError(f"{place}: at = {line.at} is not a number of seconds from 0 on")
        with FileFormatError.placed(place):
            message = parse_command(line.say.split())
            message.row.check_use("script")
            for name in message.motions:
                UnknownNameError.check("motion", name, motions)
        timeline.append(Timed(line.at, message))
    return file.motion, sorted(timeline, key=lambda timed: timed.at)


def parse_script(text: str, motions: Sequence[str]) -> tuple[str, list[Timed], float | None]:
    """The first motion of a script, its switches, and its length in s, if its last part gives seconds.

    It is motions separated by commas, each but the last followed by its seconds; those of the last may be left out.
    MotiondeckError names the part that is wrong and what it should be.
    """
    timeline, at = list[Timed](), 0.0
    parts = [part.split() for part in text.split(",")]
    for place, words in enumerate(parts, start=1):
        last = place == len(parts)
        if words and words[0] not in motions and (words[0] in BY_WORD or Path(words[0]).suffix):
            raise MotiondeckError(
                f"script, part {place}: '{words[0]}' is no motion. Commands go into a timeline file, whose name ends "
                "in .toml (the page 'The deck', Timeline files)"
            )
        if not 1 <= len(words) <= 2:
            raise MotiondeckError(f"script, part {place}: '{' '.join(words)}' is not MOTION SECONDS, as in 'walk 4'")
        UnknownNameError.check("motion", words[0], motions, f"script, part {place}: ")
        if len(words) == 1 and not last:
            raise MotiondeckError(
                f"script, part {place}: give its seconds, as in '{words[0]} 4'; only the last part may go without"
            )
        timeline.append(Timed(at, Switch(words[0])))
        for word in words[1:]:
            if (seconds := as_float(word)) is None or not 0.0 < seconds < 1e6:
                raise MotiondeckError(f"script, part {place}: '{word}' is not a number of seconds above 0")
            at += seconds
    return parts[0][0], timeline[1:], at if at > timeline[-1].at else None


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
        first, timeline, length = "", list[Timed](), None
        if script is None:
            first = first_motion(library, motion)
        elif script.endswith(".toml"):
            first, timeline = read_timeline(Path(script), names)
        else:
            first, timeline, length = parse_script(script, names)
        return cls(library, file, first, timeline, spec.seconds if spec.seconds is not None else length)

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
        if motion.endswith((".xml", ".urdf")):
            raise MotiondeckError(f"{motion}: a robot's model; make a robot file: motiondeck robot calibrate {motion}")
        learned = Path(motion).with_suffix(".safetensors").name
        raise MotiondeckError(
            f"{motion}: a file, not a motion of {library.info.name}. Learn it: motiondeck learn {motion} --out "
            f"{learned}; then play it: motiondeck play {learned}"
        )
    if motion is not None:
        UnknownNameError.check("motion", motion, names, f"{library.info.name}: ")
    return motion or ("walk" if "walk" in names else names[0])
