"""A robot beside the human whose motion it plays, in one model."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np

from controller.library.motion_library import load_library
from controller.motion.clip import Clip, poses_of
from controller.motion.rotations import Array
from controller.motion.skeleton import Pose, Skeleton
from motiondeck_base.shipped import find_library
from sim.models.formats.urdf_visuals import with_visuals
from sim.robots.catalogue import find_robot
from sim.robots.robot import load_robot

PREFIX = "robot/"
APART = 0.9  # heights of the human's root
# Sizes that a model may reserve; MuJoCo computes those it needs.
_USERS = ("actuator", "body", "cam", "geom", "jnt", "sensor", "site", "tendon")
_SIZES = ("memory", "nconmax", "njmax", "nstack", "nuserdata", *(f"nuser_{thing}" for thing in _USERS))


class SideBySide:
    """A mannequin of the robot's size on the left, the robot (with PREFIX in `model`) on the right, on one floor."""

    def __init__(self, skeleton: Skeleton, robot: Path, dt: float) -> None:
        """Loads the robot from its file, for poses of a skeleton dt seconds apart."""
        self.robot = load_robot(robot, skeleton, dt=dt)
        self.scale = self.robot.path_scale  # the size of the human shown over that of the skeleton
        self.human = load_robot(find_robot("mannequin"), replace(skeleton, length=skeleton.length * self.scale))
        spec, other = self.human.spec.copy(), with_visuals(self.robot.spec)[0].copy()
        for thing in [*other.worldbody.geoms, *other.worldbody.lights, *other.equalities]:
            other.delete(thing)
        for texture in [*other.textures]:
            if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
                other.delete(texture)
        self._apart = np.array([0.0, -APART * self.scale * skeleton.leg_length])
        # Nothing moves by physics here, it is drawn as the human is, and MuJoCo would warn of each difference.
        other.option, other.visual = spec.option, spec.visual
        for size in _SIZES:
            setattr(other, size, getattr(spec, size))
        spec.attach(other, prefix=PREFIX, frame=spec.worldbody.add_frame())
        self.model = spec.compile()
        self._qpos = np.zeros(self.model.nq)

    def qpos(self, pose: Pose, own_path: bool = False) -> Array:
        """The qpos (nq,) of both in a pose; overwritten by the next call."""
        # The robot is kept beside the human, or goes as far as its own steps carry it: then its feet do not slide.
        split = self.human.model.nq
        small = replace(pose, root_position=pose.root_position * self.scale)
        self.human.place(self.human.retarget(small), small, self._qpos[:split])
        limits = self.robot.limits
        self.robot.place(np.clip(self.robot.retarget(pose), limits.lower, limits.upper), pose, self._qpos[split:])
        self._qpos[split : split + 2] = self._apart + self._qpos[slice(split, split + 2) if own_path else slice(2)]
        return self._qpos


RATE = 60.0
MOMENTS = 8
TILE = (480, 440)  # pixels: large enough to see the knees


def shipped_walk(seconds: float) -> Clip:
    """The beginning of a walk that is shipped, at RATE."""
    from motiondeck.run.sampled_motions import as_clip

    return as_clip(load_library(find_library("thesis15")), "walk", seconds, RATE)


def draw_beside(clip: Clip, robot: Path, out: Path) -> None:
    """Two rows of moments of a clip: the human, and beside it the robot."""
    from motiondeck.pictures.video import contact_sheet

    both, every = SideBySide(clip.skeleton, robot, 1.0 / clip.rate), max(1, len(clip) // MOMENTS)
    row = [both.qpos(pose).copy() for pose in poses_of(clip)][every - 1 : every * MOMENTS : every]
    contact_sheet([(clip.name, both.model, row[:4]), ("", both.model, row[4:])], out, TILE)
