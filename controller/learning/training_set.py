"""The training set of a recipe: recordings on one body at one rate, cut, closed or brought to rest."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path

import msgspec
import numpy as np

from controller.learning.measures.recording_errors import RecordedPart, recorded_part
from controller.learning.measures.self_test import Judge
from controller.learning.preparation.cycles import aligned_cycles, person_variants
from controller.learning.preparation.loops import best_seam, close_loop, hold_end, in_place, pinned
from controller.learning.preparation.takes import read_takes
from controller.learning.preparation.training_motion import Lessons, MotionsOnDemand, TrainingMotion, Variant
from controller.learning.recipe import LibraryRecipe, MotionRecipe, find_recording
from controller.learning.trainers.trainer import trainer_of
from controller.motion.canonical.actors import Actor, actors_of, nearest_to_all
from controller.motion.canonical.canonical_body import carried, on_bones_of
from controller.motion.canonical.clip_edits import jumps, mirrored, resampled, span, spikes
from controller.motion.clip import Clip, ReadingOptions
from controller.motion.encodings.encoding import Encoding, encoding_of
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.encodings.normalisation import Normalisation
from controller.motion.formats.acclaim.amc import skeleton_of
from controller.motion.formats.reading import read_clip
from controller.motion.rotations import Array, dot
from controller.motion.skeleton import Skeleton
from controller.networks.storage import DrivingInput
from motiondeck_base.arrays_on_disk import on_disk, release
from motiondeck_base.errors import FileFormatError

SHORTEST_SECONDS = 0.4  # of a recording: two windows of the self-test
COMMON_RATE = 120.0  # Hz, of a library whose recordings have different rates

Progress = Callable[[str], None]
Reader = Callable[[MotionRecipe], Clip]
Recorded = Callable[[], RecordedPart | None]


@dataclass(frozen=True)
class LearnedPart:
    """The part of a recording that is learned, from `first` to `end`, s, of `recorded` s."""

    first: float
    end: float
    recorded: float
    body: Skeleton | None = None  # with the lengths that the recording's limbs have in it
    # Mean distance of joints, and largest angle of a bone, at a loop's seam before it is eased; None for a one-shot.
    seam_mm: float | None = None
    seam_degrees: float | None = None


@dataclass(frozen=True)
class TrainingSet:
    """The training frames of a recipe."""

    encoding: Encoding
    rate: float
    frames: dict[str, Array]  # of each motion, shape (T, channels), in the encoding's units
    loops: dict[str, bool]  # whether each motion is a loop
    before: dict[str, Array] = field(default_factory=dict[str, Array])  # recorded frames before `frames`, if any
    # Learned part of each recording; not for recordings learned as recorded.
    parts: dict[str, LearnedPart] = field(default_factory=dict[str, LearnedPart])
    # What was recorded, of motions that can be compared with it; made when it is asked for.
    recorded: dict[str, Recorded] = field(default_factory=dict[str, Recorded])
    least_range: float = 0.0  # of a channel, for its normalisation, in its unit
    holds: bool = True  # whether one-shots are taught to hold their end
    # Of motions with an input, the loop at each of its values, the first as in `frames`.
    variants: dict[str, list[Variant]] = field(default_factory=dict[str, list[Variant]])
    inputs: dict[str, str] = field(default_factory=dict[str, str])  # names of the inputs
    actors: list[Actor] = field(default_factory=list[Actor])  # of whom the body is chosen; none if a recipe names it

    def lessons(self) -> Lessons:
        """The normalised motions for a trainer, each made when it is asked for."""
        variants = [variant.frames for loops in self.variants.values() for variant in loops]
        ranges: list[Array] = []
        for one in chain(self.frames.values(), self.before.values(), variants):
            ranges.append(np.array([one.min(0), one.max(0)]))
            release()
        normalisation = Normalisation.fit(ranges, self.least_range)
        motions = MotionsOnDemand(list(self.frames), partial(self._motion, normalisation))
        return Lessons(motions, normalisation, self.rate, partial(joint_features, self.encoding))

    @property
    def judge(self) -> Judge:
        """Judges runs by the training frames."""
        return Judge(self.encoding, self.frames, self.loops, self.rate, holds=self.holds)

    def _motion(self, normalisation: Normalisation, name: str) -> TrainingMotion:
        scaled = normalisation.apply
        before = scaled(self.before[name]) if name in self.before else None
        variants = tuple(replace(one, frames=scaled(one.frames)) for one in self.variants.get(name, ()))
        return TrainingMotion(name, scaled(self.frames[name]), self.loops[name], before, self._driving(name), variants)

    def _driving(self, motion: str) -> DrivingInput | None:
        if motion not in self.variants:
            return None
        rising = sorted(self.variants[motion], key=lambda variant: variant.value)
        usual = self.variants[motion][0].value
        values, seconds = tuple(one.value for one in rising), tuple(one.seconds for one in rising)
        return DrivingInput(self.inputs[motion], values, seconds, usual)


def prepare(
    recipe: LibraryRecipe, data: Path, progress: Progress = lambda _: None, read: Reader | None = None
) -> TrainingSet:
    """Reads a recipe's recordings, carries them to one body and rate, and closes loops or holds ends.

    `progress` is called with each step, and `read`, if it is given, in place of reading the files. FileFormatError has
    a line for each recording that is missing, damaged or lacks frames of the recipe.
    """
    clips: dict[str, Clip] = {}
    read = read or _reader(data)
    problems: list[str] = []
    for motion in recipe.motions:
        progress(f"reading {motion.name}")
        try:
            clips[motion.name] = read(motion)
            cut(clips[motion.name], motion)
            release()
        except FileFormatError as error:
            problems.append(str(error))
    if problems:
        raise FileFormatError("\n".join(dict.fromkeys(problems)))
    rates = sorted({clip.rate for clip in clips.values()})
    rate = recipe.rate or (rates[0] if len(rates) == 1 else COMMON_RATE)
    if recipe.as_recorded and rates != [rate]:
        raise FileFormatError(f"recipe '{recipe.name}' learns as recorded, but its recordings have {rates} Hz")
    twist, trainer = recipe.encoding == "joint rotations", trainer_of(recipe.network)
    actors = [] if recipe.body or clips[recipe.motions[0].name].skeleton.is_rig else actors_of(clips)
    encoding = encoding_of(_body(recipe, data, clips, actors), twist=twist)
    loops = {motion.name: motion.plays == "loop" for motion in recipe.motions}
    inputs = {motion.name: motion.input for motion in recipe.motions if motion.input}
    least, holds = trainer.least_range, not recipe.as_recorded
    found = TrainingSet(encoding, rate, {}, loops, least_range=least, holds=holds, inputs=inputs, actors=actors)
    for motion in recipe.motions:
        name, clip = motion.name, clips[motion.name]
        if motion.input:
            takes = [clip, *(read_clip(find_recording(data, take)) for take in motion.takes)]
            alike = [carried(resampled(take, rate), encoding.skeleton) for take in takes]
            variants = aligned_cycles(encoding, alike, motion.values, rate)
            if motion.people:  # each value as done by the first of them
                values = list(dict.fromkeys(one.value for one in variants))
                variants = person_variants(motion.people[0], variants, motion.people, values)
            found.variants[name], found.frames[name] = variants, variants[0].frames
            found.parts[name] = LearnedPart(0.0, variants[0].seconds, clip.duration)
        elif recipe.as_recorded and not trainer.center_driven:
            own = cut(clip, motion)
            channels = encoding_of(own.skeleton, twist=twist).encode(own)
            washout = getattr(recipe.network, "washout", 0)
            if len(channels) < 2 * washout:
                raise FileFormatError(f"motion '{name}' is shorter than twice the washout of {washout} frames")
            found.before[name], found.frames[name] = map(on_disk, (channels[:washout], channels[washout:]))
        else:
            frames, part = to_learn(encoding, clip, motion, rate, recipe.loop_keeps)
            found.frames[name], found.parts[name] = on_disk(frames), part
            found.recorded[name] = partial(recorded_part, clip, part.first, part.end, loop=loops[name], body=part.body)
        release()
    return found


def _reader(data: Path) -> Reader:
    """Reads each recording once, however many motions it holds."""
    known: dict[bytes, Clip] = {}

    def read(motion: MotionRecipe) -> Clip:
        recording = msgspec.json.encode(msgspec.structs.replace(motion, name="", plays="loop", frames=None))
        if recording not in known:
            known[recording] = read_motion(data, motion)
        return known[recording]

    return read


def read_motion(data: Path, motion: MotionRecipe) -> Clip:
    """The recording of a motion, or its joined takes; mirrored if the recipe says so."""
    path, *takes = (find_recording(data, one) for one in (motion.file, *motion.takes))
    joins = takes and not motion.input
    clip = read_takes([path, *takes]) if joins else read_clip(path, reading_options(data, path, motion))
    return mirrored(clip) if motion.mirrored else clip


def reading_options(data: Path, path: Path, motion: MotionRecipe) -> ReadingOptions:
    """The reading options of a motion."""
    skeleton = skeleton_of(path, data) if motion.skeleton is None else find_recording(data, motion.skeleton)
    more = motion.person, motion.rate, motion.ground, motion.upper_body
    return ReadingOptions(skeleton, motion.unit, motion.up, motion.rename, *more)


def _body(recipe: LibraryRecipe, data: Path, clips: dict[str, Clip], actors: list[Actor]) -> Skeleton:
    if recipe.body:
        path = find_recording(data, recipe.body)
        motion = next((one for one in recipe.motions if one.file == recipe.body), MotionRecipe(name="", file=""))
        return read_clip(path, reading_options(data, path, motion)).skeleton
    return nearest_to_all(actors).body if actors else clips[recipe.motions[0].name].skeleton


def to_learn(
    encoding: Encoding, clip: Clip, motion: MotionRecipe, rate: float, loop_keeps: float
) -> tuple[Array, LearnedPart]:
    """The training frames (T, C) of a recording, a closed loop or a motion with a hold, and their part of it.

    The clip, already mirrored if wanted, is carried to the encoding's body and the rate, Hz; a loop keeps at least the
    share `loop_keeps` of its frames.
    """
    own = on_bones_of(resampled(cut(clip, motion), rate), encoding.skeleton)
    channels = encoding.encode(carried(own, encoding.skeleton))
    begin, recorded = (motion.frames or (0, 0))[0] / clip.rate, len(clip) / clip.rate
    if motion.plays == "once":
        part = LearnedPart(begin, begin + len(channels) / rate, recorded, own.skeleton)
        return hold_end(channels, encoding.velocities, rate), part
    features = joint_features(encoding, channels)
    seam = best_seam(in_place(features), rate, at_least=loop_keeps)
    off = seam_error(encoding, channels, features, (seam.start, seam.end))
    part = LearnedPart(begin + seam.start / rate, begin + seam.end / rate, recorded, own.skeleton, *off)
    loop = close_loop(channels, seam, encoding.velocities, rate)
    return pinned(encoding, loop, channels, seam, rate), part


def seam_error(encoding: Encoding, channels: Array, features: Array, ends: tuple[int, int]) -> tuple[float, float]:
    """Mean distance of joints, mm, and largest angle of a bone, degrees, between two frames of channels (T, C).

    `features` are the joint positions, shape (T, F), mm.
    """
    first, last = features[list(ends)]
    bones = encoding.directions(channels[list(ends)])
    turned = np.degrees(np.arccos(np.clip(dot(bones[0], bones[1]), -1.0, 1.0)))
    return float(np.sqrt(np.square(last - first).sum() / (len(first) / 3.0))), float(turned.max())


def cut(clip: Clip, motion: MotionRecipe) -> Clip:
    """The frames of a clip in a recipe; FileFormatError if they are not in it, too few, or with a jump or a spike."""
    first, end = motion.frames or (0, len(clip))
    if not 0 <= first < end <= len(clip):
        raise FileFormatError(f"motion '{motion.name}': frames {first} to {end} are not in a clip of {len(clip)}")
    shortest = int(np.ceil(SHORTEST_SECONDS * clip.rate))
    if end - first < shortest:
        raise FileFormatError(
            f"motion '{motion.name}': {end - first} frames are too few; {shortest} are the least at {clip.rate:g} Hz"
        )
    wanted = span(clip, first, end)
    for jump in jumps(wanted):
        at = first + jump
        far = float(np.linalg.norm(clip.root_position[at] - clip.root_position[at - 1]))
        raise FileFormatError(
            f"motion '{motion.name}': from frame {at - 1} to {at} the body jumps {far:.1f} m. "
            "Give it frames before or after that in the recipe."
        )
    for frame, bone in spikes(wanted):
        raise FileFormatError(
            f"motion '{motion.name}': in frame {first + frame} the end of bone '{clip.skeleton.bones[bone]}' is "
            "elsewhere for a moment. Give it frames before or after that in the recipe."
        )
    return wanted
