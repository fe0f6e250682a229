"""Matching: which body of any robot is the left shank, read from the tree of its bodies and where its joints sit.

Looked at is the robot as its file has it (every joint at zero), whichever way it faces:

- Two limbs that reach lowest and part near the root are the legs. Which is the left one is told by their names, where
  they differ by an l and an r; otherwise the side to which the soles stick out is ahead.
- Of the rest, what reaches farthest to either side is an arm, and what reaches highest near the middle is the head.
- Along a limb the knee (elbow) is the joint with the most limb on both of its sides.
"""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's names come from compiled modules, which have no type stubs.)

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np

from controller.rotations import Array, conjugate, multiply, yaw
from motiondeck_base.errors import FileFormatError
from sim.models.surface import Surface

LEG = ("thigh", "shank", "foot")
ARM = ("upper_arm", "forearm", "hand")

# A joint belongs to the hip as long as it is at least this share of the leg above the knee away from the knee.
HIP_SHARE = 0.65
# And to the ankle if it is at least this share of the thigh below the knee, but not far ahead (toes).
ANKLE_SHARE = 0.4
TOES_SHARE = 0.15


@dataclass(frozen=True)
class BodyMatch:
    """What a robot's bodies are.

    Attributes:
        parts: part, such as "l_shank", to the name of its body; "pelvis" and "chest" and both legs are always there.
        root_rotation: the quaternion of the root body while the robot stands upright and faces x, shape (4,).
    """

    parts: dict[str, str]
    root_rotation: Array


def match(path: Path, model: mujoco.MjModel) -> BodyMatch:
    """Matches a robot's bodies to the parts of a body.

    Args:
        path: the model's file, for errors.
        model: with a free root, as `read_model` makes it.

    Raises:
        FileFormatError: if there are no two legs, or no feet to tell ahead from behind; name the parts by hand then.
    """
    return _Matcher(path, model).match()


class _Matcher:
    def __init__(self, path: Path, model: mujoco.MjModel) -> None:
        self.path, self.model = path, model
        self.data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self.data)
        self.root = int(model.jnt_bodyid[0])
        self.surface = Surface.of(model)
        points = self.surface.positions(self.data)
        self.points = points
        self.tall = float(np.ptp(points[:, 2])) if len(points) else 1.0
        self.leaves = [body for body in self._below(self.root) if body != self.root and self._is_leaf(body)]

    def match(self) -> BodyMatch:
        legs = self._legs()
        pelvis = self._common(*legs)
        rest = [
            leaf for leaf in self.leaves if not any(self._limb(leaf, pelvis) == self._limb(g, pelvis) for g in legs)
        ]
        ahead = self._ahead(legs, pelvis)
        left = np.array([-ahead[1], ahead[0], 0.0])
        centre = self._place(legs).mean(axis=0)
        legs = sorted(legs, key=lambda leaf: float(self._tip(leaf) @ left))  # right, left
        parts = {"pelvis": self._name(self.root)}
        for side, leg in zip("rl", legs, strict=True):
            parts |= self._divided(side, LEG, self._limb_path(leg, pelvis), ahead)

        across = {leaf: float((self._tip(leaf) - centre) @ left) for leaf in rest}
        arms = [min(across, key=lambda f: across[f]), max(across, key=lambda f: across[f])] if across else []
        if len(arms) == 2 and across[arms[0]] < -0.03 * self.tall and across[arms[1]] > 0.03 * self.tall:
            chest = self._common(*arms)
            for side, arm in zip("rl", arms, strict=True):
                parts |= self._divided(side, ARM, self._limb_path(self._longest(arm, chest), chest), ahead)
            rest = [f for f in rest if not any(self._limb(f, chest) == self._limb(a, chest) for a in arms)]
            shoulders = max(float(self._anchor(self._limb_path(arm, chest)[0])[2]) for arm in arms)
        else:
            chest, shoulders = pelvis, float(self.data.xpos[pelvis, 2])
        parts["chest"] = self._name(chest)
        high = {leaf: self._middle(leaf) - centre for leaf in rest}
        middle = [f for f, at in high.items() if abs(at @ left) < 0.06 * self.tall and at[2] + centre[2] > shoulders]
        if middle:
            head = max(middle, key=lambda leaf: float(high[leaf][2]))
            jointed = [body for body in self._path(head) if self._hinges(body)]
            if jointed and jointed[-1] in self._below(chest) and jointed[-1] != chest:
                parts["head"] = self._name(jointed[-1])
        facing = float(np.arctan2(ahead[1], ahead[0]))
        return BodyMatch(parts, multiply(conjugate(yaw(facing)), self.data.xquat[self.root]))

    def _legs(self) -> list[int]:
        """The two leaves that reach lowest, side by side and apart from the root on."""
        low = sorted(self.leaves, key=lambda leaf: float(self._tip(leaf)[2]))
        floor = float(self._tip(low[0])[2]) if low else 0.0
        candidates = [leaf for leaf in low if self._tip(leaf)[2] < floor + 0.12 * self.tall]
        pairs = [
            (a, b)
            for a, b in combinations(candidates, 2)
            if len(self._hinged(self._limb_path(a, self._common(a, b)))) > 1
            and len(self._hinged(self._limb_path(b, self._common(a, b)))) > 1
        ]
        if not pairs:
            raise FileFormatError(
                f"{self.path}: no two legs were found in it, so it cannot be matched by itself. Write a robot file by "
                "hand and name its bodies under [parts]."
            )
        # Toes and pads of one foot part late; the legs part first.
        return list(max(pairs, key=lambda pair: -len(self._path(self._common(*pair)))))

    def _ahead(self, legs: list[int], pelvis: int) -> Array:
        """The horizontal direction across the line between the legs that is ahead."""
        hips = np.array([self._anchor(self._hinged(self._limb_path(leg, pelvis))[0]) for leg in legs])
        line = hips[1] - hips[0]
        line[2] = 0.0
        across = np.array([line[1], -line[0], 0.0]) / max(float(np.linalg.norm(line)), 1e-9)
        second_is_left = _is_left(self._name(legs[1]), self._name(legs[0]))
        if second_is_left is not None:
            return across if second_is_left else -across
        reach = 0.0
        for leg in legs:
            path = self._limb_path(leg, pelvis)
            _, _, end = self._joints_of(path)
            ankle = self._anchor(end) if end is not None else self._anchor(self._hinged(path)[-1])
            foot = self.points[np.isin(self.surface.body, self._below(end or path[-1]))]
            if len(foot):
                ends = (foot - ankle) @ across
                reach += float(ends.max() + ends.min())
        if abs(reach) < 0.01 * self.tall:
            raise FileFormatError(
                f"{self.path}: neither the names of its legs ('{self._name(legs[0])}', '{self._name(legs[1])}') nor "
                "its feet tell left from right. Name the bodies of the left leg with an l where the right one has an r."
            )
        return across * np.sign(reach)

    def _divided(self, side: str, names: tuple[str, str, str], path: list[int], ahead: Array) -> dict[str, str]:
        """The bodies of a limb's three parts; without a joint at the ankle (wrist) only the first two."""
        first, middle, end = self._joints_of(path if names is LEG else self._beside(path, ahead))
        parts = {f"{side}_{names[0]}": self._name(first), f"{side}_{names[1]}": self._name(middle)}
        if end is not None:
            following = self._hinged(path)[self._hinged(path).index(end) :]
            if names is LEG:
                # The foot is what the last joint of the ankle moves; toes lie ahead of it.
                span = float(np.linalg.norm(self._anchor(end) - self._anchor(middle)))
                for body in following[1:]:
                    if (self._anchor(body) - self._anchor(end)) @ ahead < TOES_SHARE * span:
                        end = body
            else:
                # The hand is what the last joint near the wrist moves; fingers follow.
                span = float(np.linalg.norm(self._anchor(end) - self._anchor(middle)))
                for body in following[1:]:
                    if np.linalg.norm(self._anchor(body) - self._anchor(end)) < 0.3 * span:
                        end = body
            parts[f"{side}_{names[2]}"] = self._name(end)
        return parts

    def _beside(self, path: list[int], ahead: Array) -> list[int]:
        """The part of an arm that does not start near the middle of the body, as a clavicle does."""
        left = np.array([-ahead[1], ahead[0], 0.0])
        centre = self._anchor(self.root)
        out = {body: abs(float((self._anchor(body) - centre) @ left)) for body in self._hinged(path)}
        first = next((body for body in out if out[body] >= 0.03 * self.tall), path[0])
        return path[path.index(first) :] if len(self._hinged(path[path.index(first) :])) > 1 else path

    def _joints_of(self, path: list[int]) -> tuple[int, int, int | None]:
        """The bodies whose joints are the hip, the knee and the ankle of a limb."""
        hinged = self._hinged(path)
        at = [self._anchor(body) for body in hinged] + [self._tip(path[-1])]
        count = len(hinged)

        def apart(i: int, j: int) -> float:
            return float(np.linalg.norm(at[i] - at[j]))

        knee = max(
            range(1, count),
            key=lambda j: min(max(apart(i, j) for i in range(j)), max(apart(j, k) for k in range(j + 1, count + 1))),
        )
        most = max(apart(i, knee) for i in range(knee))
        hip = max(i for i in range(knee) if apart(i, knee) >= HIP_SHARE * most)
        beyond = [k for k in range(knee + 1, count) if apart(knee, k) >= ANKLE_SHARE * apart(hip, knee)]
        return hinged[hip], hinged[knee], hinged[beyond[0]] if beyond else None

    def _longest(self, leaf: int, above: int) -> int:
        """Of the leaves of a limb that forks (fingers) the one at the end of the most joints."""
        same = [f for f in self.leaves if self._limb(f, above) == self._limb(leaf, above)]
        return max(same, key=lambda f: (len(self._hinged(self._path(f))), float(self._reach(f, above))))

    def _reach(self, leaf: int, above: int) -> float:
        return float(np.linalg.norm(self._tip(leaf) - self.data.xpos[above]))

    def _tip(self, leaf: int) -> Array:
        """The end of a limb: of the last body's surface the point farthest from its joint."""
        mine = self.points[self.surface.body == leaf]
        start = self._anchor(leaf)
        if not len(mine):
            return self.data.xpos[leaf]
        return mine[np.argmax(np.linalg.norm(mine - start, axis=1))]

    def _middle(self, leaf: int) -> Array:
        """The middle of the last body of a limb."""
        mine = self.points[self.surface.body == leaf]
        return mine.mean(axis=0) if len(mine) else self.data.xpos[leaf]

    def _place(self, bodies: list[int]) -> Array:
        return self.data.xpos[bodies]

    def _is_leaf(self, body: int) -> bool:
        return not np.any(self.model.body_parentid == body)

    def _below(self, body: int) -> list[int]:
        """A body and all that hangs from it."""
        return [other for other in range(1, self.model.nbody) if body in self._path(other)]

    def _path(self, body: int) -> list[int]:
        """From the root to a body."""
        path = [body]
        while path[0] not in (self.root, 0):
            path.insert(0, int(self.model.body_parentid[path[0]]))
        return path

    def _common(self, a: int, b: int) -> int:
        """The body at which the ways to two bodies part."""
        return [x for x, y in zip(self._path(a), self._path(b), strict=False) if x == y][-1]

    def _limb(self, leaf: int, above: int) -> int | None:
        """The child of a body on the way to a leaf."""
        path = self._path(leaf)
        return path[path.index(above) + 1] if above in path[:-1] else None

    def _limb_path(self, leaf: int, above: int) -> list[int]:
        path = self._path(leaf)
        return path[path.index(above) + 1 :]

    def _hinges(self, body: int) -> list[int]:
        mine = np.flatnonzero(self.model.jnt_bodyid == body)
        return [int(joint) for joint in mine if self.model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE]

    def _hinged(self, path: list[int]) -> list[int]:
        return [body for body in path if self._hinges(body)]

    def _anchor(self, body: int) -> Array:
        """Where the first hinge of a body sits, or the body itself."""
        hinges = self._hinges(body)
        return self.data.xanchor[hinges[0]] if hinges else self.data.xpos[body]

    def _name(self, body: int) -> str:
        name = self.model.body(body).name
        if not name:
            raise FileFormatError(f"{self.path}: a body that the motion needs has no name; give each body one")
        return name


def _is_left(name: str, other: str) -> bool | None:
    """Whether of two names that differ by l and r (left and right) only the first is the left one; None if unclear."""
    name, other = name.lower(), other.lower()
    for left, right in (("left", "right"), ("l", "r")):
        for at in range(len(name)):
            if name.startswith(left, at) and name[:at] + right + name[at + len(left) :] == other:
                return True
            if name.startswith(right, at) and name[:at] + left + name[at + len(right) :] == other:
                return False
    return None
