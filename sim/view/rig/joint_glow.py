"""The figure's joints glow where a servo is hot, late, limp or lost: a translucent ball about the joint."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from collections.abc import Sequence

import mujoco

from controller.rotations import Array
from sim.view.rig.servo_look import COLOURS, ServoLook
from sim.view.web.private_page import PrivatePage

RADIUS = 0.08  # in heights of the robot; a knee's servos and brackets hide a smaller one
OPACITY = 0.55


class JointGlow:
    """Balls about the joints of a robot that have something the matter.

    Args:
        page: where they are drawn.
        model: of the robot.
        joints: the name of each servo's joint; one that the model lacks does not glow.
        height: of the robot, m.
    """

    def __init__(self, page: PrivatePage, model: mujoco.MjModel, joints: Sequence[str], height: float) -> None:
        self._page, self._radius = page, RADIUS * height
        ids = {model.joint(index).name: index for index in range(model.njnt)}
        self._joints = [ids.get(name) for name in joints]
        self._balls = {}
        self._shown: dict[int, str] = {}

    def mark(self, looks: Sequence[ServoLook], data: mujoco.MjData, centre: Array) -> None:
        """Lets those joints glow whose servos are not well, where `show` would have them."""
        wanted = {place: look.level for place, look in enumerate(looks) if look.level != "ok"}
        if wanted == self._shown:
            return
        for place in self._shown.keys() - wanted.keys():
            self._balls.pop(place).remove()
        for place, level in wanted.items():
            if self._joints[place] is not None and self._shown.get(place) != level:
                self._balls[place] = self._page.scene.add_icosphere(
                    f"/glow/{place}",
                    radius=self._radius,
                    color=COLOURS[level],
                    opacity=OPACITY,
                    position=self._place(place, data, centre),
                    cast_shadow=False,
                    receive_shadow=False,
                )
        self._shown = {place: level for place, level in wanted.items() if place in self._balls}

    def show(self, data: mujoco.MjData, centre: Array) -> None:
        """Brings the balls to their joints, as seen by someone at the centre (2,), m."""
        for place, ball in self._balls.items():
            ball.position = self._place(place, data, centre)

    def _place(self, servo: int, data: mujoco.MjData, centre: Array) -> tuple[float, float, float]:
        x, y, z = data.xanchor[self._joints[servo]]
        return x - centre[0], y - centre[1], z
