"""A robot's limbs as vectors between points of its bodies (`limb_finder`), with Jacobian, seen from the pelvis."""

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from pathlib import Path

import mujoco
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import Array, Flags
from sim.models.kinematic_tree import LedJoints, Scratch, UprightPelvis, below, followers, joints_above
from sim.models.limb_geometry import ACROSS
from sim.models.surface import Surface
from sim.retargeting.human_limbs import AHEAD, LEFT, LIMBS
from sim.retargeting.limb_finder import SIDES, LimbFinder, bodies_of_parts, without_legs
from sim.retargeting.robot_trunk import Waist


class RobotLimbs:
    """The limbs of one robot."""

    def __init__(
        self, path: Path, model: mujoco.MjModel, parts: Mapping[str, str], root_rotation: Array, joints: tuple[str, ...]
    ) -> None:
        """Args: the robot file, for errors; robot; part to body; rotation (4,) of a root that faces x; N played hinges.

        UnknownNameError if there is no such part or body. FileFormatError if a limb has no joint where it needs one.
        """
        self.model = model
        self.data = Scratch(model)  # MuJoCo's state at the last `place`
        self._parts, self.has_legs = bodies_of_parts(path, model, parts), not without_legs(parts)
        self.data.qpos[:] = model.qpos0
        self.data.qpos[:3] = 0.0
        for joint, (leader, curve) in followers(model).items():
            if leader == joint:
                self.data.qpos[model.jnt_qposadr[joint]] = curve[0]
        self._pelvis = UprightPelvis(model, self._parts["pelvis"], root_rotation)
        self._pelvis.place(self.data)
        self.surface = Surface.of(model)  # the robot's skin
        finder = LimbFinder(path, model, self.data, self._parts, self.surface)
        self.vectors, self.sole_ends = finder.find(), finder.sole_ends  # as of `LimbFinder`
        self.reach, self.segments = finder.reach, finder.segments  # as of `LimbFinder`
        self._chest_at_rest = self.data.xmat[self._parts["chest"]].reshape(3, 3).copy()

        index = [model.joint(name).id for name in joints]
        self._joint = np.array(index, np.int64)
        self._qpos = model.jnt_qposadr[self._joint]
        moves = np.array([np.isin(self._joint, joints_above(model, body)) for body in range(model.nbody)], dtype=float)
        # Seen from the pelvis, its own joints move all other bodies the other way.
        moves -= moves[self._parts["pelvis"]]
        led = {one: (leader, curve) for one, (leader, curve) in followers(model).items() if leader in index}
        self._placed = LedJoints.of(led)
        self._placed_leader = np.array([index.index(leader) for leader in self._placed.leader], np.int64)
        self._placed_qpos = model.jnt_qposadr[self._placed.follower]
        turns = moves[self._parts["chest"]]
        self.turns_chest = turns != 0.0  # whether the N joints move the chest, shape (N,)
        self._waist = turns[self.turns_chest, None] * self.data.xaxis[self._joint[self.turns_chest]]
        self.back = self._back_at_rest()
        self._hips = list(self._hips_at_rest(moves))
        self._moves = moves[self.vectors.body][:, :, None, :]
        self._difference = self._moves[1] - self._moves[0]
        self._cross = np.zeros((3, len(index), 3))
        swung = {
            joint: np.isin(self.vectors.body, hanging).astype(float) - float(self._parts["pelvis"] in hanging)
            for joint in led
            for hanging in [below(model, int(model.jnt_bodyid[joint]))]
        }
        swung = {joint: moves for joint, moves in swung.items() if moves.any()}
        self._swung = LedJoints.of({joint: led[joint] for joint in swung})
        self._swung_leader = [index.index(leader) for leader in self._swung.leader.tolist()]
        self._swung_moves = np.array([*swung.values()]).reshape(-1, 2, len(self.vectors.names))
        self._slides = model.jnt_type[self._swung.follower] == mujoco.mjtJoint.mjJNT_SLIDE

    def _back_at_rest(self) -> Array:
        """From the middle of the hips to the waist, and from there to that of the shoulders, shape (2, 3), m."""
        names, start = self.vectors.names, self.positions()[0]
        if not all(f"{side}_{part}" in names for side in SIDES for part in ("upper_arm", "thigh")):
            return np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        hips, shoulders = (
            0.5 * (start[names.index(f"r_{part}")] + start[names.index(f"l_{part}")]) for part in ("thigh", "upper_arm")
        )
        waist = self._joint[self.turns_chest]
        middle = self.data.xanchor[waist].mean(axis=0) if len(waist) else hips
        return np.array([middle - hips, shoulders - middle])

    def _hips_at_rest(self, moves: Array) -> Iterator[tuple[int, float, float]]:
        """Of each leg the joint that raises it: index, sense of its axis, and how far ahead the thigh hangs, rad."""
        for side in (side for side in SIDES if f"{side}_thigh" in self.vectors.names):
            thigh = self.vectors.names.index(f"{side}_thigh")
            x, _, z = self.vectors.rest[thigh]
            across = self.data.xaxis[self._joint, 1] * moves[int(self.vectors.body[0, thigh])]
            joint = int(np.argmax(np.abs(across)))
            if abs(across[joint]) > ACROSS:
                yield joint, float(across[joint]), float(np.arctan2(x, -z))

    def waist(self, limits: JointLimits, *, stiff: bool = False) -> Waist:
        """Its waist, with the limits of its N joints; `stiff` if it stays at rest."""
        turns = self.turns_chest & (not stiff)
        # Inverse kinematics, which moves the waist, tilts the pelvis itself.
        raised = [hangs + float(limits.upper[k] if sense < 0.0 else -limits.lower[k]) for k, sense, hangs in self._hips]
        hips = min(raised, default=inf) if stiff else inf
        below, above = self.back
        return Waist(self._waist[: turns.sum()], limits.lower[turns], limits.upper[turns], below, above, hips)

    @property
    def moved(self) -> Flags:
        """Whether the N joints move each of the K vectors, shape (K, N)."""
        return np.any(self._moves[:, :, 0] != 0.0, axis=0)

    def place(self, q: Array) -> None:
        """Puts the hinges at q (N,), rad."""
        self.data.qpos[self._qpos] = q
        if len(self._placed_qpos):
            self.data.qpos[self._placed_qpos] = self._placed.followed(q[self._placed_leader])
        if self._pelvis.below_a_waist:
            self._pelvis.place(self.data)
        else:
            mujoco.mj_kinematics(self.model, self.data)

    def chest_rotation(self) -> Array:
        """The rotation of the chest since the robot stood straight, shape (3, 3)."""
        return self.data.xmat[self._parts["chest"]].reshape(3, 3) @ self._chest_at_rest.T

    def positions(self) -> Array:
        """Start and end of the vectors, shape (2, K, 3), m."""
        body = self.vectors.body
        rotation = self.data.xmat[body].reshape(*body.shape, 3, 3)
        return self.data.xpos[body] + np.matmul(rotation, self.vectors.point[..., None])[..., 0]

    def feet_apart(self) -> Array:
        """The vector FEET, shape (3,), m."""
        (right, left), (start, end) = self.vectors.body[:, -1], self.vectors.point[:, -1]
        there = self.data.xpos[left] + self.data.xmat[left].reshape(3, 3) @ end
        return there - self.data.xpos[right] - self.data.xmat[right].reshape(3, 3) @ start

    def stand_on(self, rolled: Sequence[float]) -> None:
        """Sets the ends of the vector FEET on each sole, from 0, the heel, to 1, the ball."""
        for foot, share in enumerate(rolled):
            heel, ball = self.sole_ends[foot]
            self.vectors.point[foot, -1] = (1.0 - share) * heel + share * ball

    def jacobian(self, positions: Array) -> Array:
        """Jacobian of the vectors, shape (K, 3, N), m/rad."""
        axis, anchor = self.data.xaxis[self._joint], self.data.xanchor[self._joint]
        start, end = positions
        # a x p = S_a p for each axis a. A joint moves each end of a vector that hangs below it by a x (end - anchor).
        cross, count = self._cross, len(axis)
        cross[1, :, 0], cross[2, :, 0] = axis[:, 2], -axis[:, 1]
        cross[0, :, 1], cross[2, :, 1] = -axis[:, 2], axis[:, 0]
        cross[0, :, 2], cross[1, :, 2] = axis[:, 1], -axis[:, 0]
        swept = (positions.reshape(-1, 3) @ cross.reshape(-1, 3).T).reshape(2, len(end), 3, count)
        turn = self._moves[1] * swept[1]
        turn -= self._moves[0] * swept[0]
        turn -= self._difference * np.einsum("cnk,nk->cn", cross, anchor)
        if self._swung_leader:
            for leader, led in zip(self._swung_leader, self._turn_of_followers(start, end), strict=True):
                turn[:, :, leader] += led
        return turn

    def _turn_of_followers(self, start: Array, end: Array) -> Array:
        """Jacobian of the vectors for each following joint, by its leader, shape (F, K, 3), m/rad."""
        follower = self._swung.follower
        axis, anchor = self.data.xaxis[follower, None], self.data.xanchor[follower, None]
        at_start, at_end = self._swung_moves.transpose(1, 0, 2)[..., None]
        swept = np.cross(axis, at_end * (end - anchor) - at_start * (start - anchor))
        slid = (at_end - at_start) * axis
        slope = self._swung.slope(self.data.qpos[self._qpos[self._swung_leader]])
        return slope[:, None, None] * np.where(self._slides[:, None, None], slid, swept)


def limb_directions(limbs: RobotLimbs) -> Array:
    """Directions of a robot's limbs seen from its pelvis, as of LimbView, shape (18, 3); zero for missing limbs."""
    start, end = limbs.positions()
    vector = dict(zip(limbs.vectors.names, end - start, strict=True))
    chest = limbs.chest_rotation()
    found: dict[str, Array] = {axis: vector[axis] for axis in ("head_ahead", "head_left") if axis in vector}
    for side in SIDES:
        for whole, first, second in (("leg", "thigh", "shank"), ("arm", "upper_arm", "forearm")):
            if f"{side}_{whole}" in vector:
                found[f"{side}_{first}"] = vector[f"{side}_{first}"]
                found[f"{side}_{second}"] = vector[f"{side}_{whole}"] - vector[f"{side}_{first}"]
        if f"{side}_foot_ahead" in vector:
            ahead, above = vector[f"{side}_foot_ahead"], vector[f"{side}_foot_up"]
            found[f"{side}_foot"] = np.cos(FOOT_SLOPE) * ahead - np.sin(FOOT_SLOPE) * above
    found |= {"chest_ahead": chest[:, 0], "chest_left": chest[:, 1], "pelvis_ahead": AHEAD, "pelvis_left": LEFT}
    directions = np.array([found.get(name, np.zeros(3)) for name in LIMBS])
    return directions / np.maximum(np.linalg.norm(directions, axis=1), 1e-9)[:, None]
