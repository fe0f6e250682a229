"""The bodies of a run on its page: the robot on its floor, its follower, the human, and the target of its servos."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import mujoco
import numpy as np
import viser

from controller.motion.rotations import Array
from controller.motion.skeleton import Pose
from motiondeck.page.body.drawn_model import DrawnModel
from motiondeck.page.body.live_marks import TargetPose
from motiondeck.page.ghost import Ghost
from motiondeck.page.scene import Scene
from motiondeck.page.web.page_state import PageDescription, PictureArrays
from motiondeck.page.web.private_page import PrivatePage

BESIDE = 0.6  # of the robot's height: so far aside a follower, or the human, is drawn


class View(NamedTuple):
    """What is drawn besides the robot, and how."""

    human: str  # where
    target: bool  # the pose that the servos are to reach
    network: bool
    steps: bool  # prints and contacts of the feet
    forces: bool  # of the floor on the body
    follows: bool  # whether the camera follows the robot


@dataclass(frozen=True)
class Bodies:
    """What one picture of a run shows, to all browsers or to one."""

    scene: Scene
    follower: DrawnModel | None
    ghost: Ghost | None
    target: TargetPose | None

    @classmethod
    def of(cls, page: PrivatePage, about: PageDescription, load: Callable[[str], mujoco.MjModel]) -> Self:
        """Those of a run, for all browsers."""
        scene, follower, ghost = Scene(page, load(about.model_file)), None, None
        if about.follower_file:
            follower = DrawnModel(page, load(about.follower_file), scene.height, " follower")
        if about.human is not None:
            drawn = DrawnModel(page, load(about.human.file), scene.height, " human")
            # The follower stands to the right of the robot, on the side that the panel does not cover.
            ghost = Ghost(drawn, about.human, (BESIDE if follower is not None else -BESIDE) * scene.height)
        target = TargetPose(page, lambda: load(about.model_file), scene.height) if "target" in about.shapes else None
        return cls(scene, follower, ghost, target)

    def twin(self, client: viser.ClientHandle) -> Self:
        """The same for one browser, which sees them in place of these; without a target."""
        follower, ghost = self.follower and self.follower.twin(client), self.ghost and self.ghost.twin(client)
        return replace(self, scene=self.scene.twin(client), follower=follower, ghost=ghost, target=None)

    def show(self, bodies: PictureArrays, view: View, centre: Array) -> None:
        """Draws what a picture has, as seen by someone at the centre (2,), m."""
        self.scene.show(bodies.qpos, centre)
        if self.follower is not None and bodies.follower is not None:
            qpos = bodies.follower.copy()
            qpos[:2] = bodies.qpos[:2] - [0.0, BESIDE * self.scene.height]
            self.follower.show(qpos, centre)
        if self.ghost is not None and bodies.human_root is not None and bodies.human_rotation is not None:
            pose = Pose(bodies.human_root, np.zeros(()), bodies.human_rotation, offsets=bodies.human_offsets)
            self.ghost.show(view.human, pose, bodies.qpos[:2], centre)
        if self.target is not None and bodies.target is not None:
            self.target.show(bodies.target, centre, visible=view.target)
