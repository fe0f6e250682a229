"""Bakes a library for a robot: carries its motions to the robot's joints beforehand, and learns them there."""

from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.deck.motion_generator import MotionGenerator
from controller.deck.routes import Routes
from controller.learning.fit import fit_prepared
from controller.learning.preparation.loops import Seam, close_loop
from controller.learning.recipe import MotionRecipe, recipe_of
from controller.learning.trainers.phase_echo_state import PhaseEchoStateRecipe
from controller.learning.trainers.trainer import trainer_of
from controller.learning.training_set import TrainingSet
from controller.library.motion_library import BakedFrom, MotionInfo, MotionLibrary, load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from controller.motion.clip import Clip
from controller.motion.encodings.robot_joints import RobotJoints
from controller.motion.rotations import Array
from controller.motion.skeleton import walk_path
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import digest_of
from sim.robots.joint_motion import retargeted
from sim.robots.robot import RobotLoader
from sim.robots.robot_digest import robot_digest

ROUNDS = 3  # of a loop that are carried; a robot that goes round settles in the first ones, and the last is learned
# The nearest kind and the quickest; robots' joints move less smoothly than limbs, which have pieces of 1.5 s.
NETWORK = PhaseEchoStateRecipe(piece_seconds=0.5)


def bake(library_file: Path, robot_file: Path, progress: Callable[[str], None] = lambda _: None) -> MotionLibrary:
    """The library in the joints of the robot, with a phase-driven echo-state network.

    MotiondeckError if a file cannot be used, or a motion has an input besides its phase.
    """
    library, loader = load_library(library_file), RobotLoader(robot_file)
    if library.skeleton.is_rig:
        raise MotiondeckError(f"{library_file}: its motions are joints already; they are played as they are")
    if loader.file.kind == "mannequin":
        raise MotiondeckError(f"{robot_file}: a mannequin has the human's own joints; there is nothing to bake")
    if driven := [motion.name for motion in library.info.motions if motion.input is not None]:
        raise MotiondeckError(f"{library_file}: {driven[0]} has an input besides its phase; it is carried live only")
    frames: dict[str, Array] = {}
    encoding: RobotJoints | None = None
    for motion in library.info.motions:
        progress(f"carrying {motion.name}")
        encoding, frames[motion.name] = _carried(library, motion, loader)
    assert encoding is not None, "a library has a motion"
    loops = {motion.name: motion.plays == "loop" for motion in library.info.motions}
    own = recipe_of(library.info.recipe, library_file)
    motions = [MotionRecipe(name=one.name, file=one.source, plays=one.plays) for one in library.info.motions]
    name = library.info.name
    recipe = msgspec.structs.replace(own, name=name, network=NETWORK, motions=motions, as_recorded=False)
    least = trainer_of(recipe.network).least_range
    baked = fit_prepared(recipe, TrainingSet(encoding, library.info.rate, frames, loops, least_range=least), progress)
    origin = BakedFrom(
        robot=robot_file.stem,
        robot_digest=robot_digest(robot_file),
        library=name,
        library_digest=digest_of(library_file),
        leaps={one: dict(others) for one, others in Routes.of(library).leaps.items()},
    )
    return MotionLibrary(msgspec.structs.replace(baked.info, baked=origin), baked.network, baked.encoding)


def _carried(library: MotionLibrary, motion: MotionInfo, loader: RobotLoader) -> tuple[RobotJoints, Array]:
    """A motion of a library on a robot: the frames (T, C), a loop closed, or a one-shot with its hold."""
    rate, count, loop = library.info.rate, motion.frames, motion.plays == "loop"
    length = ROUNDS * count + 1 if loop else count
    played = MotionGenerator(library, motion.name).frames(length / rate, rate)
    pose = walk_path(library.encoding.decode(played), 1.0 / rate)
    body = library.skeleton.with_offsets(library.offsets(motion.name))
    clip = Clip(motion.name, body, rate, pose.root_position, pose.rotation)
    robot, footed = (loader(body, None, 1.0 / rate) for _ in range(2))
    encoding, heading = RobotJoints.for_joints(robot.joints), pose.heading
    angles = _within(robot.limits, 1.0 / rate, retargeted(robot, clip).angles)
    root = retargeted(footed, clip, angles).root
    if not loop:  # what a first frame comes from is not known
        angles, root, heading = (np.concatenate([values[:1], values]) for values in (angles, root, heading))
    channels = encoding.encode_path(angles, root, heading, rate)
    if not loop:
        return encoding, channels
    # The frames of the last round, which the first of the next one follows; frame 0 of `channels` is the second played.
    last = Seam((ROUNDS - 1) * count - 1, ROUNDS * count - 1, 0.0)
    return encoding, close_loop(channels, last, encoding.velocities, rate)


def _within(limits: JointLimits, dt: float, angles: Array) -> Array:
    """Angles (T, J), rad, within the limits of joints: the mean of what these leave forwards and backwards in time.

    So a joint that cannot follow is neither late nor early: it starts before the motion does.
    """
    ways: list[Array] = []
    for way in (angles, angles[::-1]):
        envelope = SafetyEnvelope(limits, dt)
        envelope.start(way[0])
        ways.append(np.array([envelope(row).copy() for row in way]))
    return 0.5 * (ways[0] + ways[1][::-1])
