"""Walk choice: by trial, whether a robot that was not tuned walks on its own feet, and with how straight knees."""

import hashlib
from dataclasses import replace
from pathlib import Path

import msgspec
import mujoco
import numpy as np

from controller.deck.deck import Deck
from controller.library.motion_library import load_library
from controller.loop.safety.safety_envelope import SafetyEnvelope
from motiondeck_base.errors import MotiondeckError
from motiondeck_base.files import keep, read_kept
from motiondeck_base.progress import progress
from motiondeck_base.shipped import find_library, user_cache
from sim.models.robot_file import WalkSettings
from sim.physics.walk_trial import play_course, walk_trial
from sim.robots.robot import Robot, load_robot
from sim.robots.robot_digest import code_digest

LIBRARY, MOTION, SECONDS = "thesis15", "walk", 20.0
# Tried in this order: straight knees carry the weight with less torque, bent ones give more room for a catching step.
WALKS = (WalkSettings(bend=0.02, toe=0.4, heel=0.2), WalkSettings())


class WalkChoice(msgspec.Struct):
    """What a trial found."""

    walk: WalkSettings | None  # with which it stands; None without
    reason: str = ""  # why it cannot walk


def able_to_walk(robot: Robot, file: Path) -> Robot:
    """The robot of a file with settings with which it walks SECONDS; MotiondeckError, in one line, if there are none.

    A table [walk] in its file, by hand or by `tune-walk`, is taken as it is. The choice is kept in the user's cache
    until the robot or the code changes.
    """
    if robot.walk != WalkSettings():
        return robot
    model = np.empty(mujoco.mj_sizeModel(robot.model), np.uint8)
    mujoco.mj_saveModel(robot.model, None, model)
    limits = [part.tolist() for part in (robot.limits.lower, robot.limits.upper, robot.limits.velocity)]
    rest = msgspec.json.encode([limits, robot.rest.tolist(), robot.servo, WALKS, code_digest(Path(__file__))])
    kept = user_cache() / "walks" / f"{hashlib.sha256(model.tobytes() + rest).hexdigest()[:32]}.json"
    if (choice := read_kept(kept, WalkChoice)) is None:
        choice = choose_walk(file)
        keep(kept, msgspec.json.encode(choice))
    if choice.walk is None:
        raise MotiondeckError(choice.reason)
    return replace(robot, walk=choice.walk)


def choose_walk(file: Path) -> WalkChoice:
    """The first settings with which the robot of a file walks SECONDS without a push, or why there are none."""
    library = load_library(find_library(LIBRARY))
    robot, reason = load_robot(file, library.skeleton), ""
    with progress(f"trying whether {robot.name} walks", len(WALKS) + 1) as tick:
        course = play_course(robot, Deck(library, robot.retarget, MOTION).update, SECONDS, SafetyEnvelope)
        for walk in WALKS:
            tick()
            try:
                trial = walk_trial(robot, course, settings=walk)
            except MotiondeckError as error:
                reason = str(error)
                continue
            if trial.stood_s == course.seconds:
                return WalkChoice(walk)
            strained = f", with {trial.strained} at its torque limit" if trial.strained else ""
            reason = (
                f"robot '{robot.name}' cannot walk: in a trial it falls after {trial.stood_s:.1f} s{strained}. Try "
                "`motiondeck robot tune-walk`, or leave --walk; --root gantry carries it"
            )
    return WalkChoice(None, reason)
