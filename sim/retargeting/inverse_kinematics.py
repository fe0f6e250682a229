"""Inverse kinematics: joint angles that match a human's limbs, by a small quadratic programme a tick.

Each limb is a vector v_k(q) between two points of the robot, and its goal g_k has the human's directions and the
lengths of the robot's segments. One step solves

    min over dq   sum_k w_k^2 |g_k - v_k - J_k dq|^2 + p |q + dq - rest|^2 + d |dq|^2
    such that     lower <= q + dq <= upper,   |q + dq - q_before| <= velocity * dt

(Gauss-Newton, damped; the inequalities as in Kanoun et al. 2011) with the solver DAQP (Arnström et al. 2022). The base
floats: dq has three more numbers, by which the pelvis tilts from the rotation that `RobotTrunk` proposes, so that
trunk, legs and standing feet share what hips or ankles cannot do, by their weights. Steps start from the last answer
and keep to the joints' speeds, so the answer never jumps to another branch; limbs that are off in the first pose are
tried from other angles. Standing feet have goals for the vector between them and for their toes (`planted_feet`). The
plane of a bent arm is a goal too: an upper arm that cannot follow would else twist for a small gain, and put the elbow
on the wrong side when the arm bends more.
"""

from math import cos, sin, sqrt

import daqp
import numpy as np

from controller.deck.interfaces import JointLimits
from controller.motion.rest_pose import FOOT_SLOPE
from controller.motion.rotations import Array, cross
from controller.motion.skeleton import Pose, Skeleton
from sim.retargeting.human_limbs import LIMBS
from sim.retargeting.human_stance import HumanStance
from sim.retargeting.limb_finder import FEET, HAND, PLANE, SIDES, TRUNK
from sim.retargeting.planted_feet import PlantedFeet
from sim.retargeting.robot_limbs import RobotLimbs
from sim.retargeting.robot_trunk import RobotTrunk, turned_by, vector_of
from sim.retargeting.stuck_limbs import StuckLimbs

# Weights of vectors as long as a leg. A hand may be in place on a mirrored arm, so both segments of an arm count as
# much as the whole, and each by its angle, however short it is.
WEIGHT = {
    "leg": 2.5, "thigh": 2.0, "arm": 2.0, "upper_arm": 2.0, "forearm": 2.0, "head": 1.5, "chest": 3.0, "trunk": 2.7,
}  # fmt: skip
# Soles are level with the human's. Toes share their direction with the plane of the knee: few ankles turn a foot. Nor
# do they tilt as far as on tiptoe: the weight falls with the tilt of the human's sole, down to this share.
WEIGHT |= {"foot_up": 2.5, "foot_ahead": 0.4}
TIPTOE = 0.2
# Weights of standing feet: distance along the floor, difference of height, additional weight of the toes.
APART, HIGHER, TURNED = 15.0, 3.0, 4.0
# The plane of an arm, times the sine of the human's bend: a straight arm has none.
WEIGHT |= {PLANE: 4.0, "upper_arm_start": 2.0, "thigh_start": 2.0}
# Weights of 1 rad away from rest, and of 1 rad in a step.
POSTURE = 3e-4
DAMPING = 3e-3

# The pelvis: weights of 1 rad of tilt, and of a turn under a rigid trunk; of 1 rad in a step; its speed, rad/s; rad.
LEVEL, TWIST, SLOW, TILT_SPEED, FARTHEST = 0.5, 3.0, 1.0, 6.0, 0.6

FAR, STEPS = 0.1, 2  # a tick has a second step if a joint went this far in the first one, rad
FIRST_STEPS, FIRST_REACH = 60, 0.3  # to the first pose: largest number of steps, and of rad in each
SETTLED = 1e-4  # rad
TRIES, TRY_STEPS = 16, 20  # of the first pose: other angles for limbs that are off, and steps from each

_CHEST = LIMBS.index("chest_ahead")


class InverseKinematics:
    """The retargeter from one skeleton to one robot by its `solver`."""

    def __init__(
        self,
        skeleton: Skeleton,
        limbs: RobotLimbs,
        limits: JointLimits,
        rest: Array,
        dt: float,
        stance: HumanStance | None = None,
        trunk: RobotTrunk | None = None,
    ) -> None:
        """As of `LimbSolver`, for a skeleton with its stance; FileFormatError if it lacks a limb."""
        self._trunk, self._stance = trunk or RobotTrunk(skeleton, limbs.waist(limits)), stance
        self.solver = LimbSolver(limbs, limits, rest, dt, tilts=limbs.has_legs)
        self._planted = None
        if stance is not None and stance.feet == 2 and FEET in limbs.vectors.names:
            leg = float(self._trunk.view.length[[LIMBS.index("r_thigh"), LIMBS.index("r_shank")]].sum())
            self._planted = PlantedFeet(stance, limbs, limbs.reach["r_leg"] / leg, dt)

    def reset(self) -> None:
        """Resets the last pose."""
        self.solver.reset()
        if self._planted is not None:
            self._planted.reset()

    def __call__(self, pose: Pose) -> Array:
        """Targets (N,), rad, within the robot's range and pace."""
        directions = self._trunk(pose)
        if self._stance is not None:
            self._stance(pose, "joints")
            directions = self._stance.flat(directions)
        if self._planted is not None:
            self._planted(pose, self.solver.q, self._trunk.pelvis)
        q = self.solver(directions, self._trunk.pelvis[2], self._planted)
        self._trunk.pelvis = self._trunk.pelvis @ self.solver.tilt
        if self._planted is not None:
            self._planted.root = self._trunk.pelvis
        return q


class LimbSolver:
    """Joint angles of one robot for directions of its limbs."""

    def __init__(self, limbs: RobotLimbs, limits: JointLimits, rest: Array, dt: float, *, tilts: bool = False) -> None:
        """Args: limbs; limits of its N joints; rest (N,) of joints that no goal needs, rad; the tick, s.

        With `tilts` the pelvis gives way too.
        """
        self._goals = Goals(limbs)
        self.limbs, self._limits, self._rest = limbs, limits, rest
        self._step = limits.velocity * dt
        self.names = limbs.vectors.names  # of the goals, length K
        kinds = [name.split("_", 1)[1] if name[1] == "_" else name for name in self.names]
        kinds = [kind if kind in WEIGHT else kind.removesuffix("_ahead").removesuffix("_left") for kind in kinds]
        self._longest = max(limbs.reach.values())
        self._weight = np.array([WEIGHT.get(kind, 1.0) for kind in kinds])[:, None] / self._longest
        for k, kind in enumerate(kinds):
            if kind in ("upper_arm", "forearm", HAND):
                half = 0.5 * limbs.reach[f"{self.names[k][0]}_arm"]
                self._weight[k] *= half / max(limbs.vectors.length[k], 0.1 * half)
        self._has_feet = FEET in self.names  # the last one
        self._toes = [k for k, kind in enumerate(kinds) if kind == "foot_ahead"]
        self._soles = [k for k, kind in enumerate(kinds) if kind == "foot_up"]
        self._hold = np.zeros((3, 3))
        # The trunk does not bend for what an arm cannot reach: joints of the chest do not count for arms and head.
        along = np.outer(self._goals.on_chest, limbs.turns_chest)
        hands = [k for k, kind in enumerate(kinds) if kind == HAND]
        self._no_limbs = hands + [-1] * self._has_feet
        for k in hands:  # a hand turns in its wrist alone
            along[k] |= limbs.moved[self.names.index(f"{self.names[k][0]}_arm")]
        self._slope = self._weight[:, :, None] * ~along[:, None, :]
        # Arms and head do not tilt the pelvis either; points that hang from it turn with it.
        self._tilts = (self._goals.turns & ~self._goals.on_chest)[:, None]
        twist = 0.0 if "chest_ahead" in self.names else TWIST
        pelvis = np.array([LEVEL, LEVEL, LEVEL + twist]) if tilts else np.zeros(0)
        # Weights of rest, and those of small steps too.
        self._stays = np.concatenate([np.full(len(rest), POSTURE), pelvis])
        self._stay = self._stays + np.concatenate([np.full(len(rest), DAMPING), np.full(len(pelvis), SLOW)])
        self._tilting, self._tilt_step = tilts, TILT_SPEED * dt * tilts / STEPS
        self._no_rows = np.zeros((0, len(self._stays)))
        self._any_sense = np.zeros(len(self._stays), dtype=np.int32)
        vectors = limbs.vectors
        self.stuck = StuckLimbs(vectors.names, limbs.moved, vectors.length, rest, self._advance, dt)
        self.reset()

    def reset(self) -> None:
        """Resets: the next pose is reached from rest within one call."""
        self.q = np.clip(self._rest, self._limits.lower, self._limits.upper)  # the last answer, rad
        self.tilt = np.eye(3)  # of the pelvis beside the rotation from which its limbs are seen, shape (3, 3)
        self._started = False
        self.stuck.reset()
        self._count, self._square, self._worst = 0, np.zeros(len(self.names)), np.zeros(len(self.names))

    def __call__(self, directions: Array, up: Array, planted: PlantedFeet | None = None) -> Array:
        """Targets (N,), rad, for directions of the limbs (18, 3) and the vertical (3,), in the frame of the root."""
        lower, upper = self._limits.lower, self._limits.upper
        goals, q = self._goals(directions, up), self.q
        for row in self._soles:
            level = max(float(goals[row] @ up) / float(self.limbs.vectors.length[row]), 0.0)
            self._weight[row] = self._slope[row] = WEIGHT["foot_up"] * max(level * level, TIPTOE) / self._longest
        if planted is not None:
            self._plant(planted, goals)
        missed = self._square
        if not self._started:
            self._started = True
            q, missed = self._first(q, goals)
        else:
            lowest = np.maximum(lower, q - self._step)
            highest = np.minimum(upper, q + self._step)
            for _ in range(STEPS):
                before = q
                q, missed = self._advance(q, goals, lowest - q, highest - q, self._tilt_step)
                if np.abs(q - before).max() < FAR:
                    break
            q = self.stuck(q, missed, goals, lower, upper, lowest, highest)
        self.q = q
        self._count += 1
        self._square += missed
        np.maximum(self._worst, missed, out=self._worst)
        return q

    def _first(self, start: Array, goals: Array) -> tuple[Array, Array]:
        """The first pose and its squared misses; limbs that are off there are tried from other angles."""
        lower, upper = self._limits.lower, self._limits.upper
        q, missed = self._settled(start, goals, FIRST_STEPS, FIRST_REACH * self._tilting)
        chance = np.random.default_rng(0)
        for _ in range(TRIES):
            joints = self.stuck.of_limbs_off(missed)
            if not joints.any():
                break
            other = np.where(joints, lower + chance.random(len(q)) * (upper - lower), q)
            other, there = self._settled(other, goals, TRY_STEPS)
            q, missed = self.stuck.better_limbs(q, missed, other, there)
        return q, missed

    def _settled(self, q: Array, goals: Array, steps: int, tilts: float = 0.0) -> tuple[Array, Array]:
        lower, upper, missed = self._limits.lower, self._limits.upper, self._square
        for _ in range(steps):
            before = q
            low, high = np.maximum(lower - q, -FIRST_REACH), np.minimum(upper - q, FIRST_REACH)
            q, missed = self._advance(q, goals, low, high, tilts)
            if np.abs(q - before).max() < SETTLED:
                break
        return q, missed

    def _plant(self, planted: PlantedFeet, goals: Array) -> None:
        goals[-1] = planted.between
        weights = np.array([APART * planted.apart, APART * planted.apart, HIGHER * planted.higher])
        self._hold = (weights / self._longest)[:, None] * planted.root
        for row, share, ahead in zip(self._toes, planted.turned.tolist(), planted.ahead, strict=True):
            goals[row] += share * (ahead - goals[row])
            self._weight[row] = self._slope[row] = (WEIGHT["foot_ahead"] + TURNED * share) / self._longest

    def shortfall(self) -> dict[str, dict[str, float]]:
        """Error of each goal since the last reset: root mean square and worst, m, by its name."""
        rms = np.sqrt(self._square / max(self._count, 1))
        return {
            name: {"rms_m": float(rms[k]), "worst_m": float(np.sqrt(self._worst[k]))}
            for k, name in enumerate(self.names)
            if name != FEET and not name.endswith((PLANE, HAND))
        }

    def _advance(self, q: Array, goals: Array, low: Array, high: Array, tilts: float = 0.0) -> tuple[Array, Array]:
        """One step from q of at least low and at most high (N,), rad: the next q, and the squared misses (K,), m^2.

        The pelvis tilts on by at most `tilts`, rad, about each axis.
        """
        limbs, count = self.limbs, len(q)
        limbs.place(q)
        positions = limbs.positions()
        goals = self._goals.seen_from_root(goals, self.tilt, limbs.chest_rotation())
        off, slopes = goals - (positions[1] - positions[0]), np.empty((len(goals), 3, len(self._any_sense)))
        np.multiply(self._slope, limbs.jacobian(positions), out=slopes[:, :, :count])
        if self._tilting:
            x, y, z = (self._weight * self._tilts * goals).T
            turn = slopes[:, :, count:]
            turn[:, 0, 1], turn[:, 0, 2], turn[:, 1, 2] = z, -y, x
            turn[:, 1, 0], turn[:, 2, 0], turn[:, 2, 1] = -z, y, -x
            turn[:, [0, 1, 2], [0, 1, 2]] = 0.0
        if self._goals.planes:
            off[self._goals.planes] *= self._goals.bent[:, None]
            slopes[self._goals.planes] *= self._goals.bent[:, None, None]
        rows = self._weight * off
        if self._has_feet:
            hold = self._hold @ self.tilt
            rows[-1], slopes[-1] = hold @ off[-1], hold @ slopes[-1] / self._weight[-1]
        miss = rows.ravel()
        jacobian = slopes.reshape(len(miss), -1)
        hessian = jacobian.T @ jacobian
        slope = -miss @ jacobian
        hessian.flat[:: len(slope) + 1] += self._stay
        rest = q - self._rest
        if self._tilting:
            tilt = vector_of(self.tilt.tolist())
            low = np.concatenate([low, np.maximum(-tilts, -FARTHEST - tilt)])
            high = np.concatenate([high, np.minimum(tilts, FARTHEST - tilt)])
            rest = np.concatenate([rest, tilt])
        slope += self._stays * rest
        step, _, flag, _ = daqp.solve(hessian, slope, self._no_rows, high, np.minimum(low, high), self._any_sense)
        if flag < 1 or not np.isfinite(step).all():
            # The problem is strictly convex and its bounds never cross, so the pose has a NaN in it: hold.
            return q, np.zeros(len(self.names))
        step = np.minimum(np.maximum(step, low), high)
        left = (miss - jacobian @ step).reshape(-1, 3) / self._weight
        left[self._no_limbs] = 0.0
        if tilts:
            self.tilt = self.tilt @ turned_by(step[count:].tolist())
        return q + step[:count], np.einsum("ij,ij->i", left, left)


class Goals:
    """Goals of a robot's vectors for the limbs of a human."""

    def __init__(self, limbs: RobotLimbs) -> None:
        vectors, names = limbs.vectors, limbs.vectors.names
        self._mix = np.zeros((len(names), len(LIMBS)))
        for k, name in enumerate(names):
            side, part = name[0], name[2:]
            if part in ("leg", "arm"):
                for bone in ("thigh", "shank") if part == "leg" else ("upper_arm", "forearm"):
                    segment = f"{side}_{bone}"
                    self._mix[k, LIMBS.index(segment)] = limbs.segments[segment].length
            elif name in LIMBS:
                self._mix[k, LIMBS.index(name)] = vectors.length[k]
        # Whether they hang from the chest, shape (K,).
        self.on_chest = np.array(["arm" in name or name.startswith("head") for name in names])
        self._feet = [
            (names.index(f"{side}_foot_ahead"), *(LIMBS.index(f"{side}_{part}") for part in ("thigh", "shank", "foot")))
            for side in SIDES
            if f"{side}_foot_ahead" in names
        ]
        # The indices of normals to the plane of an arm.
        self.planes = [k for k, name in enumerate(names) if name.endswith(PLANE)]
        self.bent = np.zeros(len(self.planes))  # sine of the human's bend of these arms at the last call
        self._arms = [[LIMBS.index(f"{names[k][0]}_{part}") for part in ("upper_arm", "forearm")] for k in self.planes]
        self._trunk, (self._below, self._above) = names.index(TRUNK) if TRUNK in names else None, limbs.back
        self._length = vectors.length
        starts = np.array([name.endswith("_start") for name in names])
        self._held = np.where(starts[:, None], vectors.rest, 0.0)
        self._turned = np.flatnonzero(self.on_chest & starts)  # the goals that turn with the chest
        self.turns = ~starts  # whether they keep their directions when the pelvis tilts, shape (K,)

    def __call__(self, directions: Array, up: Array) -> Array:
        """The goals (K, 3), m, for directions (18, 3) and the vertical (3,); shoulders as the chest sees them."""
        goals = self._held + self._mix @ directions
        for k, thigh, shank, foot in self._feet:
            goals[k], goals[k + 1] = self._length[k] * sole(directions[thigh], directions[shank], directions[foot], up)
        for arm, (k, (upper, forearm)) in enumerate(zip(self.planes, self._arms, strict=True)):
            ux, uy, uz = directions[upper].tolist()
            fx, fy, fz = directions[forearm].tolist()
            x, y, z = uy * fz - uz * fy, uz * fx - ux * fz, ux * fy - uy * fx
            self.bent[arm] = bent = sqrt(x * x + y * y + z * z)
            longer = self._length[k] / max(bent, 1e-6)
            goals[k] = longer * x, longer * y, longer * z
        if self._trunk is not None:
            ahead, left = directions[_CHEST], directions[_CHEST + 1]
            x, y, z = self._above.tolist()
            goals[self._trunk] = self._below + x * ahead + y * left + z * cross(ahead, left)
        return goals

    def seen_from_root(self, goals: Array, tilt: Array, chest: Array) -> Array:
        """The goals (K, 3) of a robot whose pelvis is tilted and whose chest is turned, each by (3, 3)."""
        turned = goals @ tilt
        turned[~self.turns] = goals[~self.turns]
        turned[self._turned] = goals[self._turned] @ chest.T
        return turned


def sole(thigh: Array, shank: Array, foot: Array, up: Array) -> Array:
    """The axes of the sole, ahead and up, shape (2, 3), for directions of the leg and the vertical (3,).

    Sideways it is level under a standing leg, and follows a lying one.
    """
    tx, ty, tz = thigh.tolist()
    sx, sy, sz = shank.tolist()
    fx, fy, fz = foot.tolist()
    ux, uy, uz = up.tolist()
    # A leg faces across the plane of its bent knee and that of its foot; both contain the shank.
    upright = max(-(sx * ux + sy * uy + sz * uz), 0.0) ** 2
    ax, ay, az = 2.0 * tx + fx, 2.0 * ty + fy, 2.0 * tz + fz
    lying = 1.0 - upright + 1e-6
    lx = upright * (uy * fz - uz * fy) + lying * (ay * sz - az * sy)
    ly = upright * (uz * fx - ux * fz) + lying * (az * sx - ax * sz)
    lz = upright * (ux * fy - uy * fx) + lying * (ax * sy - ay * sx)
    along = lx * fx + ly * fy + lz * fz
    lx, ly, lz = lx - along * fx, ly - along * fy, lz - along * fz
    length = sqrt(lx * lx + ly * ly + lz * lz)
    lx, ly, lz = (lx / length, ly / length, lz / length) if length > 1e-6 else (0.0, 1.0, 0.0)
    x, y, z = fy * lz - fz * ly, fz * lx - fx * lz, fx * ly - fy * lx
    c, s = cos(FOOT_SLOPE), sin(FOOT_SLOPE)
    ahead, above = (c * fx + s * x, c * fy + s * y, c * fz + s * z), (c * x - s * fx, c * y - s * fy, c * z - s * fz)
    return np.array([ahead, above])
