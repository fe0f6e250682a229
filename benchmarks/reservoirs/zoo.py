"""How many recordings of a folder are read, carried, learned, played.

Every recording below DIR is learned by `learn`, in libraries of 8 to 16 motions of one source each (the folder that
the files lie in), so that no setting is tuned to a few clips. Counted are the recordings that are

- read: the file was understood;
- carried: on the body of its library every bone points where the recorded joints lie, to CARRIED_DEGREES;
- learned: as long and moving enough to be a motion, and in a library whose self-test it passed;
- played: the library, played from the motion's beginning, is where the recording is, to PLAYED_MM on average, away
  from a loop's seam, which is eased.
"""

import time
from collections import defaultdict
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from joblib import delayed

from benchmarks import command
from controller.deck.motion_generator import MotionGenerator
from controller.learning.learn import LearnedLibrary, LearnedMotion, learn
from controller.learning.measures.self_test import distances
from controller.learning.preparation.loops import SEAM_SECONDS
from controller.library.motion_library import MotionLibrary
from controller.motion.canonical.canonical_body import CANONICAL_BONES, carried, landmarks_of
from controller.motion.canonical.clip_edits import resampled
from controller.motion.clip import Clip, ReadingOptions
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.reading import read_clip, recordings_in
from controller.motion.rotations import rotate
from motiondeck.cli.common.options import JobsOption
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.jobs import Jobs, spread

LARGEST = 16
CARRIED_DEGREES, PLAYED_MM = 1.0, 10.0


@dataclass
class Source:
    """What became of the recordings of one source.

    Attributes:
        files, read, carried, learned, played: how many.
        errors: of those that were played, how far joints are from the recording on average, mm.
        problems: a line for each recording that was not played.
    """

    files: int
    read: int = 0
    carried: int = 0
    learned: int = 0
    played: int = 0
    errors: list[float] = field(default_factory=list[float])
    problems: list[str] = field(default_factory=list[str])

    def with_(self, other: "Source") -> "Source":
        """These recordings and others."""
        return Source(*(getattr(self, one.name) + getattr(other, one.name) for one in fields(self)))


def libraries_of(files: list[Path]) -> list[list[Path]]:
    """Files in groups of nearly one size, at most LARGEST each."""
    return [part.tolist() for part in np.array_split(np.array(files, dtype=object), -(-len(files) // LARGEST))]


def carried_degrees(clip: Clip, body: Clip) -> float:
    """By how much a bone of a carried clip points past the recorded joints at most, degrees; far landmarks only.

    Args:
        clip: as recorded.
        body: the same on a canonical body.
    """
    marks, joints, skeleton = landmarks_of(clip.skeleton), clip.joints(), body.skeleton
    worst = 0.0
    for bone, name in enumerate(CANONICAL_BONES):
        parent = skeleton.parent[bone]
        above = skeleton.bones[parent] if parent >= 0 else ""
        if name not in marks.joint or (above not in marks.joint and parent >= 0) or "back" in (name, above):
            continue
        hips = joints[:, [marks.joint["lhip"], marks.joint["rhip"]]].mean(1)
        line = joints[:, marks.joint[name]] - (joints[:, marks.joint[above]] if parent >= 0 else hips)
        length = np.linalg.norm(line, axis=-1)
        pointing = rotate(body.rotation[:, 1 + bone], skeleton.rest_direction[bone])
        across = np.linalg.norm(np.cross(line, pointing), axis=-1)
        angle = np.degrees(np.arctan2(across, (line * pointing).sum(-1)))
        worst = max(worst, float(angle[length > 1e-3].max(initial=0.0)))
    return worst


def played_mm(library: MotionLibrary, motion: LearnedMotion, body: Clip) -> float:
    """How far joints are from the recording on average while the library plays a motion, seen from the root, mm.

    Args:
        library: what plays.
        motion: which recording, and which part of it was learned.
        body: the recording on the library's body.
    """
    assert motion.part is not None
    rate, encoding = library.info.rate, library.encoding
    recorded = joint_features(encoding, encoding.encode(resampled(body, rate)))
    loop = motion.plays == "loop"
    # A player begins a one-shot with the frame after its first one.
    first = round(motion.part.first * rate) + (0 if loop else 1)
    eased = round(SEAM_SECONDS * rate) if loop else 0
    frames = min(round(motion.seconds * rate), len(recorded) - first)
    shown = joint_features(encoding, MotionGenerator(library, motion.name).frames(frames / rate, rate))
    off = distances(shown, recorded[first : first + frames])
    return float(off[eased : max(eased + 1, frames - eased)].mean())


def look(file: Path, found: Source, learned: dict[Path, tuple[LearnedLibrary, LearnedMotion]]) -> None:
    """Follows one recording as far as it comes."""
    try:
        clip = read_clip(file, ReadingOptions(skeleton_of(file, file.parent.parent)))
    except MotiondeckError as error:
        found.problems.append(f"not read: {error}")
        return
    found.read += 1
    if file not in learned:
        found.problems.append(f"{file.name}: not learned with the others of its source")
        return
    library, motion = learned[file]
    try:
        body = carried(clip, library.library.skeleton)
    except MotiondeckError as error:
        found.problems.append(f"not carried: {error}")
        return
    degrees = carried_degrees(clip, body)
    if degrees > CARRIED_DEGREES:
        found.problems.append(f"{file.name}: not carried, {degrees:.1f} degrees off")
    found.carried += degrees <= CARRIED_DEGREES
    if not motion.passed:
        found.problems.append(f"{file.name}: not learned, {motion.remedy}")
        return
    found.learned += 1
    error = played_mm(library.library, motion, body)
    found.errors.append(error)
    found.played += error <= PLAYED_MM
    if error > PLAYED_MM:
        found.problems.append(f"{file.name}: not played, {error:.1f} mm off")


def look_at(part: list[Path]) -> Source:
    """Learns recordings as one library, and follows each as far as it comes."""
    found = Source(len(part))
    learned: dict[Path, tuple[LearnedLibrary, LearnedMotion]] = {}
    try:
        library = learn(part, "zoo", seeds=[0])
        learned = {motion.file.absolute(): (library, motion) for motion in library.motions}
    except MotiondeckError as error:
        found.problems.append(str(error))
    for file in part:
        look(file.absolute(), found, learned)
    return found


def main(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder that holds the recordings.")],
    jobs: JobsOption = "1",
) -> None:
    """Learn every recording of a folder in libraries of 8 to 16, and print what became of them per source."""
    where = Jobs.parse(jobs)
    sources: dict[Path, list[Path]] = defaultdict(list)
    for file in recordings_in([folder], convertible=True):
        sources[file.parent].append(file)
    print(f"{'source':36} files   read   carried   learned   played   off, mm: median   largest   seconds")
    for source, files in sources.items():
        begin, found = time.monotonic(), Source(0)
        for part in spread((delayed(look_at)(part) for part in libraries_of(files)), where):
            found = found.with_(part)
        median, largest = (float(f(found.errors)) if found.errors else np.nan for f in (np.median, np.max))
        print(
            f"{source.relative_to(folder).as_posix()[-36:]:36} {found.files:5} {found.read:6} {found.carried:9} "
            f"{found.learned:9} {found.played:8} {median:17.2f} {largest:9.2f} {time.monotonic() - begin:9.1f}"
        )
        for problem in found.problems:
            print(f"  {problem}")


if __name__ == "__main__":
    command.run("zoo", main)
