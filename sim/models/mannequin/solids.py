"""The mannequin's solids around each bone of a skeleton, and the masses of its parts.

A solid lies in the frame of its bone: w along the bone, u to the front (or up, for a bone that itself points ahead),
v across. Lengths are of a body 1.80 m tall and scale with the skeleton's own stature.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from controller.motion.anatomy import Anatomy, Part
from controller.motion.rest_pose import FOOT_SLOPE, LEG_PER_STATURE
from controller.motion.rotations import Array, cross, from_matrix
from controller.motion.skeleton import Skeleton

REFERENCE_STATURE = 1.80

# Mass of each part in percent of the body's, men (de Leva 1996, table 4); a limb's share is that of one side. The
# trunk is 43.46: its lower part is the root's, and the clavicles carry some of the upper.
PELVIS_MASS = 11.17
PART_MASS: dict[Part, float] = {
    "trunk": 26.29, "clavicle": 3.0, "head": 6.94, "upper arm": 2.71, "forearm": 1.62, "hand": 0.61,
    "thigh": 14.16, "shank": 4.33, "foot": 1.37,
}  # fmt: skip
BODY_MASS_INDEX = 24.0

# Where the mass of a limb's bone sits along it, and its radii of gyration across and along, in shares of its length
# (de Leva 1996, table 4, men).
LIMB_INERTIA: dict[Part, tuple[float, float, float]] = {
    "upper arm": (0.577, 0.277, 0.158),
    "forearm": (0.457, 0.270, 0.121),
    "thigh": (0.410, 0.329, 0.149),
    "shank": (0.446, 0.252, 0.103),
}

SMALLEST_MASS = 0.05

# Depth of the sole below the end of the foot's bone, m, and least depth below the ankle, under the shank's round end.
UNDER_BALL, ANKLE = 0.006, 0.046

Tone = Literal["body", "limb", "dark"]


@dataclass(frozen=True)
class Solid:
    """An ellipsoid, or a capsule whose length runs along the frame's third axis."""

    shape: Literal["ellipsoid", "capsule"]
    centre: Array  # shape (3,), in the frame of the bone's body, m
    axes: Array  # columns are the solid's own axes, shape (3, 3)
    size: Array  # half axes of the ellipsoid; radius, radius and half length of the capsule's straight part, m
    tone: Tone

    @property
    def volume(self) -> float:
        """m^3."""
        a, b, c = self.size
        if self.shape == "ellipsoid":
            return 4.0 / 3.0 * np.pi * a * b * c
        return np.pi * a * a * (4.0 / 3.0 * a + 2.0 * c)


def stature(skeleton: Skeleton, parts: Anatomy) -> float:
    """Height of a person with these thighs and shanks, or legs, m; 1.80 m without legs."""
    legs = [*parts.all("thigh"), *parts.all("shank")]
    leg = float(skeleton.length[legs].sum()) / 2.0 if len(legs) == 4 else skeleton.leg_length
    return leg / LEG_PER_STATURE if leg > 0.05 else REFERENCE_STATURE


def bone_frame(direction: Array) -> Array:
    """The axes (u, v, w) of a bone as columns, shape (3, 3): w along it, u to the front or else up."""
    front = np.array([1.0, 0.0, 0.0]) if abs(direction[0]) < 0.8 else np.array([0.0, 0.0, 1.0])
    u = front - (front @ direction) * direction
    u /= np.linalg.norm(u)
    return np.stack([u, cross(direction, u), direction], axis=1)


def pelvis_solids(skeleton: Skeleton, parts: Anatomy) -> list[Solid]:
    """What sits on the root itself."""
    s = stature(skeleton, parts) / REFERENCE_STATURE
    ends = skeleton.rest_direction * skeleton.length[:, None]
    hips = [bone for side in ("left", "right") if (bone := parts.first("hip", side)) is not None]
    width = max((abs(float(ends[hip, 1])) for hip in hips), default=0.09 * s)
    drop = min((float(ends[hip, 2]) for hip in hips), default=0.0)
    sideways = np.stack([np.eye(3)[0], np.eye(3)[2], np.eye(3)[1]], axis=1)
    return [
        Solid("capsule", np.array([0.0, 0.0, drop]), sideways, np.array([0.082 * s, 0.082 * s, width]), "body"),
        Solid("ellipsoid", np.array([0.0, 0.0, 0.045 * s]), np.eye(3), np.array([0.098, 0.142, 0.115]) * s, "body"),
    ]


def bone_solids(skeleton: Skeleton, parts: Anatomy, bone: int) -> list[Solid]:
    """What sits on a bone; at least one solid, however short the bone."""
    s = stature(skeleton, parts) / REFERENCE_STATURE
    length = max(float(skeleton.length[bone]), 0.01 * s)
    axes = bone_frame(skeleton.rest_direction[bone])
    part = parts.part[bone]

    def ellipsoid(along: float, u: float, v: float, w: float, front: float = 0.0, tone: Tone = "limb") -> Solid:
        centre = along * axes[:, 2] + front * s * axes[:, 0]
        return Solid("ellipsoid", centre, axes, np.array([u * s, v * s, w]), tone)

    def capsule(radius: float, start: float = 0.0, end: float = length, tone: Tone = "limb") -> Solid:
        centre = 0.5 * (start + end) * axes[:, 2]
        half = max(0.5 * (end - start), 0.0)
        return Solid("capsule", centre, axes, np.array([radius * s, radius * s, half]), tone)

    def ball(radius: float) -> Solid:
        return ellipsoid(0.0, radius, radius, radius * s, tone="dark")

    match part:
        case "trunk":
            return [_torso(skeleton, parts, bone, axes, s)]
        case "neck":
            return [capsule(0.052, tone="body")]
        case "head":
            return _head(length, axes, s, bare_neck="neck" not in parts.part)
        case "clavicle":
            return [capsule(0.052, 0.30 * length, length - 0.01 * s, tone="body")]
        case "upper arm":
            return [ball(0.054), capsule(0.040), ellipsoid(0.45 * length, 0.049, 0.047, 0.45 * length)]
        case "forearm":
            return [ball(0.043), capsule(0.030), ellipsoid(0.32 * length, 0.043, 0.039, 0.38 * length)]
        case "hand":
            return _hand(skeleton, parts, bone, length, axes, s)
        case "hip":
            return [capsule(0.070, 0.6 * length, tone="body")]
        case "thigh":
            return [capsule(0.055, 0.03 * s), ellipsoid(0.36 * length, 0.084, 0.080, 0.46 * length, front=0.006)]
        case "shank":
            return [ball(0.059), capsule(0.039), ellipsoid(0.33 * length, 0.056, 0.050, 0.36 * length, front=-0.012)]
        case "foot":
            return _foot(skeleton, parts, bone, length, s)
        case _:
            return [capsule(0.035)]


def masses(skeleton: Skeleton, parts: Anatomy) -> Array:
    """The mass of the root and of each bone, shape (1 + B,), kg; a part's share is split over its bones by length."""
    share = np.zeros(1 + len(skeleton))
    share[0] = PELVIS_MASS
    for part, percent in PART_MASS.items():
        for side in ("left", "middle", "right"):
            bones = parts.all(part, side)
            if bones:
                length = skeleton.length[bones] + 1e-3
                share[np.array(bones) + 1] = percent * length / length.sum()
    total = BODY_MASS_INDEX * stature(skeleton, parts) ** 2
    return np.maximum(share / 100.0 * total, SMALLEST_MASS)


def limb_inertia(skeleton: Skeleton, parts: Anatomy, bone: int, mass: float) -> tuple[Array, Array, Array] | None:
    """Inertia of a limb's bone; None for others, whose solids have it.

    Centre of mass from the start of the bone (3,), m; quaternion of the principal axes; moments (3,), kg m^2.
    """
    length = float(skeleton.length[bone])
    share = LIMB_INERTIA.get(parts.part[bone])
    if share is None or length < 0.05:
        return None
    centre, across, along = share
    moments = mass * length**2 * np.array([across**2, across**2, along**2])
    direction = skeleton.rest_direction[bone]
    return centre * length * direction, from_matrix(bone_frame(direction)), moments


def _torso(skeleton: Skeleton, parts: Anatomy, bone: int, axes: Array, s: float) -> Solid:
    """A slice of the trunk: broad at the hips, slim at the waist, broadest at the chest."""
    trunk = parts.all("trunk")
    before = skeleton.length[[b for b in trunk if b < bone]].sum()
    total = max(float(skeleton.length[trunk].sum()), 1e-6)
    length = float(skeleton.length[bone])
    middle = (before + 0.5 * length) / total
    depth = np.interp(middle, [0.0, 0.3, 0.75, 1.0], [0.098, 0.095, 0.112, 0.090])
    width = np.interp(middle, [0.0, 0.3, 0.75, 1.0], [0.138, 0.132, 0.166, 0.140])
    size = np.array([depth * s, width * s, 0.62 * length + 0.040 * s])
    # An upright bone's frame has u ahead and v = w x u to the left, so depth and width stay where they belong.
    return Solid("ellipsoid", 0.46 * length * axes[:, 2], axes, size, "body")


def _head(length: float, axes: Array, s: float, bare_neck: bool) -> list[Solid]:
    u, w = axes[:, 0], axes[:, 2]
    centre = max(length - 0.015 * s, 0.10 * s) * w + 0.012 * s * u
    solids = [
        Solid("ellipsoid", centre, axes, np.array([0.098, 0.080, 0.118]) * s, "body"),
        Solid("ellipsoid", centre + 0.036 * s * u + 0.012 * s * w, axes, np.array([0.068, 0.068, 0.042]) * s, "dark"),
    ]
    if bare_neck:
        half = 0.35 * length
        solids.append(Solid("capsule", half * w, axes, np.array([0.050 * s, 0.050 * s, half]), "body"))
    return solids


def _hand(skeleton: Skeleton, parts: Anatomy, bone: int, length: float, axes: Array, s: float) -> list[Solid]:
    """A flat palm; a hand recorded as one short bone gets its fingers too."""
    alone = len(parts.all("hand", parts.side[bone])) == 1
    reach = max(length, 0.17 * s) if alone else length + 0.02 * s
    u, v, w = axes.T
    palm = Solid("ellipsoid", 0.5 * reach * w, axes, np.array([0.040 * s, 0.019 * s, 0.54 * reach]), "limb")
    wrist = Solid("ellipsoid", np.zeros(3), axes, np.full(3, 0.033 * s), "dark")
    if not alone:
        return [palm]
    cos, sin = np.cos(0.6), np.sin(0.6)
    tilted = np.stack([u, v, w], axis=1) @ np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    thumb = 0.06 * s * w + 0.038 * s * u
    return [wrist, palm, Solid("capsule", thumb, tilted, np.array([0.013, 0.013, 0.022]) * s, "limb")]


def _foot(skeleton: Skeleton, parts: Anatomy, bone: int, length: float, s: float) -> list[Solid]:
    """Heel, instep and ball of a foot whose sole is flat when the bone slopes down as in standing; or its toes."""
    ankle = parts.first("foot", parts.side[bone])
    up, across, along = bone_frame(skeleton.rest_direction[ankle]).T
    cos, sin = np.cos(FOOT_SLOPE), np.sin(FOOT_SLOPE)
    ahead, above = cos * along + sin * up, cos * up - sin * along
    axes = np.stack([above, across, ahead], axis=1)
    reach, drop = cos * length, sin * float(skeleton.length[ankle])
    # How far the sole is below the joint: below the ankle, or below the ball of the foot, where the toes begin.
    under = max(drop + UNDER_BALL * s, ANKLE * s) - (0.0 if bone == ankle else drop)

    def lump(forward: float, thick: float, wide: float, long: float) -> Solid:
        centre = forward * ahead + (thick * s - under) * above
        return Solid("ellipsoid", centre, axes, np.array([thick * s, wide * s, long]), "limb")

    if bone != ankle:
        # Level with the sole: a foot that stood on its toes would tip over them.
        return [lump(0.5 * length, 0.020, 0.042, 0.65 * length)]
    return [
        Solid("ellipsoid", np.zeros(3), axes, np.full(3, 0.044 * s), "dark"),
        lump(-0.022 * s, 0.036, 0.036, 0.046 * s),
        lump(0.42 * reach, 0.036, 0.042, 0.62 * reach + 0.02 * s),
        lump(reach + 0.012 * s, 0.022, 0.046, 0.062 * s),
    ]
