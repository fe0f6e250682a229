"""Matching: the parts of any robot's body, from the tree of its bodies and the axes of its hinges.

With every joint at zero, for any heading and any axis up:

- Two limbs of hinges that stand on the floor, point down and part near the root are the legs; they part at the pelvis.
  The left one follows from the names, if they differ by left and right; otherwise from soles that stick out ahead, or
  without ankles from the bend of the knees.
- Of the rest, the limb that reaches farthest to either side is an arm, and the highest one near the middle is the head.
- `standing_body` divides the limbs.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np

from controller.motion.rotations import IDENTITY, Array, conjugate, from_rotation_vector, multiply, yaw
from motiondeck_base.errors import FileFormatError
from sim.models.ball_joints import unplayed_balls
from sim.models.kinematic_tree import below, hinges_at, hinges_between, path_to
from sim.robots.standing_body import ARM, LEG, STANDS, RobotLimb, StandingBody, can_bend

# Least length of a leg, in heights of the robot, and least cosine of its angle to the vertical.
LEG_SHARE, DOWN = 0.25, 0.5
# Largest distance from the middle of a clavicle's joint, and of a head, in heights of the robot.
CLAVICLE_SHARE, HEAD_SHARE = 0.03, 0.06
_ARM_WORDS, _LEG_WORDS = ("shoulder", "elbow", "forearm"), ("leg", "hip", "thigh", "knee", "shin", "ankle", "foot")
EYES = 0.5  # share of the head below which a moving body above the neck is an eye
ALIKE = 0.02  # relative difference of equally long limbs

# Turns of the file's root to each axis up: z, y, x, -y, -x, -z.
_QUARTER = 0.5 * np.pi
_TURNS = ((0, 0, 0), (_QUARTER, 0, 0), (0, -_QUARTER, 0), (-_QUARTER, 0, 0), (0, _QUARTER, 0), (np.pi, 0, 0))
# Left and right in English, German and Dutch, French, Spanish, Italian, Portuguese, Japanese, Chinese, Korean, Russian,
# Czech, Polish, Hungarian, Swedish, Turkish; the longer of two words in one another first.
SIDES = (
    *(("left", "right"), ("links", "rechts"), ("gauche", "droite"), ("izquierda", "derecha"), ("izq", "der")),
    *(("sinistra", "destra"), ("sx", "dx"), ("esquerda", "direita"), ("hidari", "migi"), ("zuo", "you"), ("左", "右")),
    *(("왼", "오른"), ("лев", "прав"), ("lev", "prav"), ("lew", "praw"), ("bal", "jobb"), ("vänster", "höger")),
    *(("sol", "sağ"), ("sol", "sag")),
    ("l", "r"),
)

SHORT = 3  # letters of a word that may be part of another one


@dataclass(frozen=True)
class BodyMatch:
    """The parts of a robot."""

    # Part, such as "l_shank", to the name of its body; always with "pelvis", "chest" and both legs.
    parts: dict[str, str]
    root_rotation: Array  # the quaternion of the root body that stands upright and faces x, shape (4,)
    doubts: tuple[str, ...] = ()  # uncertain decisions, a line each
    rivals: dict[str, list[tuple[str, ...]]] = field(default_factory=dict)  # of "leg" and "arm": `rival_bends`


def match(path: Path, model: mujoco.MjModel, bends: Collection[str] = ()) -> BodyMatch:
    """Matches the bodies of a model with a free root; `path` is for errors, `bends` are known knees and elbows.

    FileFormatError, which lists the limbs found, without two legs, on wheels, or if ahead and behind are unclear.
    """
    refusal: FileFormatError | None = None
    found: dict[float, BodyMatch] = {}
    for turn in _TURNS:
        matcher = _Matcher(path, model, from_rotation_vector(np.array(turn, dtype=float)), bends)
        try:
            here = matcher.match()
        except FileFormatError as error:
            refusal = refusal or error
            if isinstance(error, _StandsOtherwise) and not any(turn):
                break  # stood on its side, its legs or arms could pass for a human's
            continue
        # A robot turned upright must have arms too, as arms may pass for legs; arms equal to its legs make a quadruped.
        if not any(turn) or (matcher.leg_share and not matcher.limbs_alike):
            found.setdefault(matcher.leg_share, here)
            if matcher.leg_share > 1.0:
                break  # with arms longer than its legs it may stand on its hands
    if found:
        return found[max(found)]
    assert refusal is not None
    matcher = _Matcher(path, model, IDENTITY, bends)
    if not (arms := matcher.named_arms()):
        raise refusal
    return matcher.upper_body(arms)


class _StandsOtherwise(FileFormatError):
    """A robot that stands on more than two limbs, or on wheels."""


class _Matcher(StandingBody):
    """Matches a robot turned one way."""

    leg_share = 0.0  # length of its legs over its arms; 0 without arms; set by `match`
    limbs_alike = False  # whether arms and legs are equal in length and hinges; set by `match`

    def __init__(self, path: Path, model: mujoco.MjModel, turn: Array, bends: Collection[str]) -> None:
        super().__init__(model, turn)
        self.path, self.bends = path, bends
        self.doubts: list[str] = []

    def match(self) -> BodyMatch:
        wheels = [self.name(body) for body in self.ends if self.is_wheel(body)]
        if wheels:
            raise _StandsOtherwise(self._refusal(f"it stands on wheels ({', '.join(wheels[:4])})"))
        legs = self._legs()
        pelvis = self.common(*legs)
        ahead = self._ahead(legs, pelvis)
        left = np.array([-ahead[1], ahead[0], 0.0])
        legs = sorted(legs, key=lambda end: float(self.tip(end) @ left))  # right, left
        # Where nothing turns between them, the root is the pelvis.
        own = hinges_between(self.model, self.root, pelvis) if pelvis != self.root else []
        parts = {"pelvis": self.name(pelvis if own else self.root)}
        stands = [self.limb(end, pelvis) for end in legs]
        parts |= self.limb_bodies(LEG, dict(zip("rl", stands, strict=True)), ahead, self.bends)
        rivals = {"leg": self.rival_bends(dict(zip("rl", stands, strict=True)))}

        branches = {self.branch(leg, pelvis) for leg in legs}
        rest = [e for e in self.ends if self.branch(e, pelvis) not in branches]
        centre = self.data.xpos[legs].mean(axis=0)
        chest, shoulders = pelvis, float(self.data.xpos[pelvis, 2])
        arms = self._arms(rest, centre, left)
        if arms:
            chest = self._chest([*arms.values()], left)
            limbs = {side: self._beside(self.limb(end, chest), left) for side, end in arms.items()}
            parts |= self.limb_bodies(ARM, limbs, ahead, self.bends)
            rivals["arm"] = self.rival_bends(limbs)
            self.leg_share = max(map(self.length, stands)) / max(map(self.length, limbs.values()))
            hinges = {len(limb.joints) for limb in (*stands, *limbs.values())}
            self.limbs_alike = len(hinges) == 1 and abs(self.leg_share - 1.0) < ALIKE
            branches = {self.branch(arm, chest) for arm in arms.values()}
            rest = [e for e in rest if self.branch(e, chest) not in branches]
            shoulders = max(float(self.data.xanchor[limb.joints[0], 2]) for limb in limbs.values())
        parts["chest"] = self.name(chest)
        return self._matched(parts, self._head(rest, chest, centre, left, shoulders), ahead, rivals)

    def _matched(
        self, parts: dict[str, str], head: int | None, ahead: Array, rivals: dict[str, list[tuple[str, ...]]]
    ) -> BodyMatch:
        parts |= {"head": self.name(head)} if head is not None else {}
        upright = multiply(conjugate(yaw(float(np.arctan2(ahead[1], ahead[0])))), self.data.xquat[self.root])
        return BodyMatch(parts, upright, tuple(self.doubts), rivals)

    def named_arms(self) -> dict[str, int]:
        """The ends of two arms of a robot without legs, "r" and "l"; empty without."""
        # Their names tell left from right. No other limb stands but wheels, and arms that do so are called arms.
        wheels = [end for end in self.ends if self.is_wheel(end)]
        limbs = [end for end in self.ends if end not in wheels]
        standing = {end for end in limbs if self.lowest(end) < self.floor + STANDS * self.tall}
        found: dict[str, int] = {}
        longest = 0.0
        for pair in combinations(limbs, 2):
            first_is_left = is_left(*map(self.name, pair))
            arms = [self.limb(end, self.common(*pair)) for end in pair]
            stands = not wheels and bool(standing)
            if stands and (standing - {*pair} or not all(map(self._called_arm, arms))):
                continue
            bends = all(can_bend(self.model, arm.joints) for arm in arms)
            if first_is_left is not None and bends and min(map(self.length, arms)) > longest:
                longest = min(map(self.length, arms))
                found = dict(zip("lr" if first_is_left else "rl", pair, strict=True))
        return found

    def upper_body(self, arms: dict[str, int]) -> BodyMatch:
        """The parts of a robot without legs; its root is the pelvis."""
        chest = self.common(*arms.values())
        starts = {side: self.data.xanchor[self.limb(end, chest).joints[0]] for side, end in arms.items()}
        left = (starts["l"] - starts["r"]) * (1.0, 1.0, 0.0)
        left /= max(float(np.linalg.norm(left)), 1e-9)
        ahead = np.array([left[1], -left[0], 0.0])
        limbs = {side: self._beside(self.limb(end, chest), left) for side, end in arms.items()}
        parts = {"pelvis": self.name(self.root), "chest": self.name(chest)}
        parts |= self.limb_bodies(ARM, limbs, ahead, self.bends)
        branches = {self.branch(arm, chest) for arm in arms.values()}
        rest = [end for end in self.ends if self.branch(end, chest) not in branches]
        centre, shoulders = 0.5 * (starts["l"] + starts["r"]), max(float(at[2]) for at in starts.values())
        head = self._head(rest, chest, centre * (1.0, 1.0, 0.0), left, shoulders)
        return self._matched(parts, head, ahead, {"arm": self.rival_bends(limbs)})

    def _legs(self) -> list[int]:
        """The ends of the two limbs that stand on the floor."""
        standing = [end for end in self.ends if self.lowest(end) < self.floor + STANDS * self.tall]
        pairs = [two for two in combinations(standing, 2) if all(self._is_leg(e, self.common(*two)) for e in two)]
        if not pairs:
            raise FileFormatError(self._refusal("no two limbs of two or more hinges each point down to the floor"))
        # The rods and toes of one leg part late; the legs part first.
        first = min(len(path_to(self.model, self.common(*pair))) for pair in pairs)
        legs = [pair for pair in pairs if len(path_to(self.model, self.common(*pair))) == first]
        pelvis = self.common(*legs[0])
        branches: dict[int, list[int]] = {}
        for end in {end for pair in pairs for end in pair}:
            branches.setdefault(self.branch(end, pelvis), []).append(end)
        if len(branches) > 2:
            raise _StandsOtherwise(self._refusal(f"{len(branches)} limbs stand on the floor"))
        if all(self._called_arm(self.limb(ends[0], pelvis)) for ends in branches.values()):
            raise FileFormatError(self._refusal("by their names the two limbs that reach lowest are arms"))
        # Of the rods and the foot of one leg the foot reaches lowest.
        return [min(ends, key=self.lowest) for ends in branches.values()]

    def _is_leg(self, end: int, pelvis: int) -> bool:
        limb = self.limb(end, pelvis)
        if not can_bend(self.model, limb.joints):
            return False
        way = self.sole(end) - self.data.xanchor[limb.joints[0]]
        length = float(np.linalg.norm(way))
        return length >= LEG_SHARE * self.tall and -way[2] >= DOWN * length

    def _arms(self, rest: list[int], centre: Array, left: Array) -> dict[str, int]:
        """The ends of the right and the left arm, "r" and "l", as far as it has them."""
        across = {e: float((self.tip(e) - centre) @ left) for e in rest}
        found = {side: max(rest, key=lambda e: sign * across[e]) for side, sign in (("r", -1.0), ("l", 1.0)) if rest}
        far = CLAVICLE_SHARE * self.tall
        found = {side: end for side, end in found.items() if (across[end] if side == "l" else -across[end]) >= far}
        chest = self._chest([*found.values()], left) if found else self.root
        if chest in found.values():
            return {}  # a trunk that ends at its waist
        # Of the fingers of a hand, one at the end of the most joints.
        arms = {
            side: max(
                (e for e in rest if self.branch(e, chest) == self.branch(arm, chest)),
                key=lambda e: (len(self.limb(e, chest).joints), float(np.linalg.norm(self.tip(e)))),
            )
            for side, arm in found.items()
        }
        stiff = {arm for arm in arms.values() if not can_bend(self.model, self.limb(arm, chest).joints)}
        return self._arms([e for e in rest if e not in stiff], centre, left) if stiff else arms

    def _chest(self, arms: list[int], left: Array) -> int:
        """Where two arms part; of one arm, the last body that moves with its hinges near the middle of the body."""
        if len(arms) > 1:
            return self.common(*arms)
        path, chest = path_to(self.model, arms[0]), self.root
        for body in path[path.index(self.root) + 1 :]:
            if hinges_at(self.model, body):
                if self._is_beside(hinges_at(self.model, body)[0], left):
                    break
                chest = body
        return chest

    def _head(self, rest: list[int], chest: int, centre: Array, left: Array, shoulders: float) -> int | None:
        def out(end: int) -> Array:
            mine = self.points[self.surface.body == end]
            return (mine.mean(axis=0) if len(mine) else self.data.xpos[end]) - centre

        below_chest = set(below(self.model, chest)) - {chest}
        high = {e: out(e) for e in rest if e in below_chest}
        near = HEAD_SHARE * self.tall
        middle = [e for e, at in high.items() if abs(at @ left) < near and at[2] + centre[2] > shoulders]
        if not middle:
            return None
        path = path_to(self.model, max(middle, key=lambda e: float(high[e][2])))
        above = [body for body in path[path.index(chest) + 1 :] if hinges_at(self.model, body)]
        size = {body: self.size(body) for body in above}
        return next(body for body in reversed(above) if size[body] >= EYES * max(size.values()))

    def _ahead(self, legs: list[int], pelvis: int) -> Array:
        """The horizontal direction across the line between the legs that is ahead."""
        hips = np.array([self.data.xanchor[self.limb(leg, pelvis).joints[0]] for leg in legs])
        line = hips[1] - hips[0]
        line[2] = 0.0
        across = np.array([line[1], -line[0], 0.0]) / max(float(np.linalg.norm(line)), 1e-9)
        reach, seen, folding = 0.0, True, True
        for leg in legs:
            limb = self.limb(leg, pelvis)
            knee = self.possible_bends(limb, limb)[0]
            ankle = self.end_joint(limb, knee)
            ahead = self.front_direction(limb, knee) @ across if ankle is None else 0.0
            last, seen = (limb.joints[-1], False) if ankle is None else (ankle, seen)
            mine = np.isin(self.surface.body, below(self.model, int(self.model.jnt_bodyid[last])))
            folding = folding and (ahead != 0.0 or ankle is not None)
            if ahead:
                reach += ahead
            elif mine.any():
                ends = (self.points[mine] - self.data.xanchor[last]) @ across
                reach += float(ends.max() + ends.min())
        names = [self.name(leg) for leg in legs]
        second_is_left = is_left(names[1], names[0])
        if second_is_left is None and abs(reach) < 0.01 * self.tall:
            raise FileFormatError(
                f"{self.path}: neither the names of its legs ('{names[0]}', '{names[1]}') nor its feet tell left from "
                "right. Name the bodies of the left leg with an l where the right one has an r."
            )
        by_names = across if second_is_left else -across
        if second_is_left is None:
            if not folding:
                self.doubts.append("no name, foot or knee tells ahead from behind: see it walk with --picture")
            return across * np.sign(reach)
        if seen and (by_names @ across) * reach < -0.05 * self.tall:
            self.doubts.append(f"its feet stick out behind if '{names[0]}' and '{names[1]}' are on the sides they name")
        return by_names

    def _beside(self, limb: RobotLimb, left: Array) -> RobotLimb:
        """An arm without its clavicle."""
        first = next((k for k, joint in enumerate(limb.joints) if self._is_beside(joint, left)), 0)
        return RobotLimb(limb.joints[first:], limb.tip) if can_bend(self.model, limb.joints[first:]) else limb

    def _called_arm(self, limb: RobotLimb) -> bool:
        """Whether the names of a limb's joints and bodies are an arm's, and none a leg's."""
        bodies = (int(self.model.jnt_bodyid[joint]) for joint in limb.joints)
        names = [self.model.joint(joint).name for joint in limb.joints] + [self.name(body) for body in bodies]
        words = " ".join(names).lower()
        return any(word in words for word in _ARM_WORDS) and not any(word in words for word in _LEG_WORDS)

    def _is_beside(self, joint: int, left: Array) -> bool:
        away = float((self.data.xanchor[joint] - self.data.xpos[self.root]) @ left)
        return abs(away) >= CLAVICLE_SHARE * self.tall

    def _refusal(self, why: str) -> str:
        """The message for a robot that is no humanoid, with its limbs."""
        limbs: dict[int, int] = {}
        for end in self.ends:
            alone = (b for b in path_to(self.model, end) if sum(e in below(self.model, b) for e in self.ends) == 1)
            branch = next(alone, end)
            limbs[branch] = sum(len(hinges_at(self.model, b)) for b in below(self.model, branch))
        words = [f"'{self.model.body(b).name}' ({count} hinge{'s' * (count > 1)})" for b, count in limbs.items()]
        listed = ", ".join(words[:6]) + (f" and {len(words) - 6} more" if len(words) > 6 else "")
        remedy = unplayed_balls(self.model)
        remedy = remedy or ". If it is one, write a robot file by hand and name its bodies under [parts]"
        return f"{self.path}: this is not a humanoid with two legs: {why}; its limbs are {listed or 'none'}{remedy}."


def is_left(name: str, other: str) -> bool | None:
    """Whether the first of two names that differ by a word for left and right is the left one; None if unclear."""
    # One of the words may be missing, as in "foot" and "foot_left"; numbers do not count.
    name, other = (re.sub(r"\d+", "", one.lower()) for one in (name, other))
    for left, right in SIDES:
        for at in range(len(name)):
            if name.startswith(left, at) and name[:at] + right + name[at + len(left) :] == other:
                return True
            if name.startswith(right, at) and name[:at] + left + name[at + len(right) :] == other:
                return False
    words = [(word, word == left) for left, right in SIDES for word in (left, right) if len(word) > SHORT]
    for word, side in words:
        if word in name and _bare(name.replace(word, "", 1)) == _bare(other):
            return side
        if word in other and _bare(other.replace(word, "", 1)) == _bare(name):
            return not side
    return None


def _bare(name: str) -> str:
    return re.sub(r"[\W_]+", "", name)
