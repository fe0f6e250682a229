"""How servos look on the page: a level (ok, warn, bad, off) with words, and a glow about joints that are not well."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import viser
from numpy.typing import NDArray

from controller.motion.rotations import Array
from hardware.rig.supervision.servo_states import ServoStates
from motiondeck.page.body.drawn_model import linear
from motiondeck.page.body.solids import sphere
from motiondeck.page.web.page_state import RigDescription
from motiondeck.page.web.private_page import PrivatePage

LATE, LATE_FOR = 0.15, 0.5  # rad that a joint may be behind its goal, and for how long, s, before it counts as late

_WARNINGS = ("was cut off", "has a low supply voltage", "is getting hot", "gives way", "does not follow")
_LEVELS = dict.fromkeys((*_WARNINGS, "is late"), "warn") | {"is off on command": "off", "ok": "ok"}
COLOURS = {"ok": (43, 138, 62), "warn": (247, 103, 7), "bad": (194, 37, 120), "off": (134, 142, 150)}


@dataclass(frozen=True)
class ServoLook:
    """The status of one servo."""

    level: str  # ok, warn, bad or off
    words: str


class ServoLooks:
    """Judges the servos of a rig."""

    def __init__(self, rig: RigDescription) -> None:
        self._words = rig.conditions
        self._on_time = np.full(len(rig.servos), -np.inf)  # when each was last near its goal, s

    def of(self, servos: ServoStates, now: float) -> list[ServoLook]:
        """The look of each servo at a time, s; none before the first answer of the rig."""
        conditions = servos.conditions
        if not np.isfinite(conditions).all():
            return []
        near = np.abs(servos.goals - servos.positions) < LATE
        self._on_time[near | np.isinf(self._on_time)] = now
        late = now - self._on_time > LATE_FOR
        well = np.where(late, "is late", "ok").tolist()
        said = [self._words[int(place)] if place else word for place, word in zip(conditions, well, strict=True)]
        return [ServoLook(_LEVELS.get(words, "bad"), words) for words in said]


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
        if wanted:  # copies of one mesh, as the robot's shapes are: a browser moves them in the same picture
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
