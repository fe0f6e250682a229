"""The figure's joints glow where a servo is hot, late, limp or lost: a translucent ball about the joint."""

from collections.abc import Sequence

import mujoco
import numpy as np
import viser
from numpy.typing import NDArray

from controller.motion.rotations import Array
from motiondeck.page.body.drawn_model import linear
from motiondeck.page.body.solids import sphere
from motiondeck.page.rig.servo_look import COLOURS, ServoLook
from motiondeck.page.web.private_page import PrivatePage

RADIUS = 0.08  # in heights of the robot; a knee's servos and brackets hide a smaller one
OPACITY = 0.55


class JointGlow:
    """Balls about the joints of a robot, of a height, m, that have something the matter, as far as it has them."""

    def __init__(self, page: PrivatePage, model: mujoco.MjModel, joints: Sequence[str], height: float) -> None:
        self._page, self._radius = page, RADIUS * height
        ids = {model.joint(index).name: index for index in range(model.njnt)}
        self._joints = [ids.get(name) for name in joints]
        self._shown: dict[int, str] = {}  # the level of each joint of the model that glows
        self.balls: viser.BatchedMeshHandle | None = None

    def mark(self, looks: Sequence[ServoLook], data: mujoco.MjData, centre: Array) -> None:
        """Lets those joints glow whose servos are not well, where `show` would have them."""
        wanted = {
            joint: look.level
            for joint, look in zip(self._joints, looks, strict=False)
            if joint is not None and look.level != "ok"
        }
        if wanted == self._shown:
            return
        self._shown = wanted
        if self.balls is not None:
            self.balls.remove()
            self.balls = None
        if (
            wanted
        ):  # copies of one mesh, as the robot's own shapes are, so that a browser moves them in the same picture
            self.balls = self._page.scene.add_batched_meshes_simple(
                "/glow",
                *sphere(10, 18),
                batched_wxyzs=self._turns(),
                batched_positions=self._places(data, centre),
                batched_scales=np.full(len(wanted), self._radius, dtype=np.float32),
                batched_colors=linear(np.array([COLOURS[level] for level in wanted.values()], dtype=np.uint8)),
                flat_shading=False,
                lod="off",
                cast_shadow=False,
                receive_shadow=False,
                opacity=OPACITY,
            )

    def show(self, data: mujoco.MjData, centre: Array) -> None:
        """Brings the balls to their joints, as seen by someone at the centre (2,), m."""
        if self.balls is not None:
            self._page.move_copies(self.balls, self._places(data, centre), self._turns())

    def _places(self, data: mujoco.MjData, centre: Array) -> NDArray[np.float32]:
        places = data.xanchor[[*self._shown]].astype(np.float32)
        places[:, :2] -= centre
        return places

    def _turns(self) -> NDArray[np.float32]:
        return np.tile(np.array([1.0, 0.0, 0.0, 0.0], dtype=np.float32), (len(self._shown), 1))
