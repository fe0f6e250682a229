"""Features of a clip for recognition, comparable between people.

Recorded angles are not: they flip between equivalent triples and depend on the placement of markers. Joint positions
relative to the root in the heading frame are; see docs/recognition.md for the figures.
"""

import contextlib
from collections.abc import Sequence
from typing import Literal, Self

import msgspec
import numpy as np

from controller.motion.canonical.canonical_body import is_canonical, to_canonical
from controller.motion.clip import Clip
from controller.motion.rotations import Array, conjugate, multiply, normalise, rotate, to_rotation_vector, yaw
from motiondeck_base.errors import FileFormatError, MotiondeckError

# Fourteen joints, each named after the bone that ends there.
JOINTS = tuple(side + bone for bone in ("femur", "tibia", "foot", "humerus", "radius", "wrist") for side in "lr")
JOINTS = (*JOINTS, "thorax", "head")
# The same joints of the canonical body, which every recording of a human has.
_ENDS = {"femur": "kne", "tibia": "ank", "foot": "foo", "humerus": "elb", "radius": "wri", "wrist": "han"}
CANONICAL = {side + bone: side + end for bone, end in _ENDS.items() for side in "lr"}
CANONICAL |= {"thorax": "neck", "head": "head"}

# Units of the features, in which swing and speed of an arm have equal weight.
POSITION_UNIT = 0.3  # m
VELOCITY_UNIT = 2.25  # m/s
ANGLE_UNIT = 0.5  # rad


class FeatureRecipe(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Parameters of features."""

    kind: Literal["positions", "rotations"] = "positions"  # of joints, or of bones relative to parents (vectors)
    # Names of the bones that end there; by default JOINTS if the skeleton has them, else all.
    joints: tuple[str, ...] = ()
    heading: bool = True  # whether positions are in the heading frame
    height: bool = False  # whether the height of the root is a channel
    velocity: bool = True  # whether the velocity of each channel is one too
    rate: float = 30.0  # frames per second, Hz

    def __post_init__(self) -> None:
        if not (np.isfinite(self.rate) and 1.0 <= self.rate <= 1000.0):
            raise MotiondeckError(f"a feature rate of {self.rate:g} Hz is not between 1 and 1000")

    def for_clips(self, clips: Sequence[Clip]) -> Self:
        """With the joints for recordings of several kinds: their own if they share them, else the canonical ones."""
        bones = [clip.skeleton.bones for clip in clips]
        shared = all(set(JOINTS) <= set(own) for own in bones) or all(set(own) == set(bones[0]) for own in bones)
        others = joints_of(bones[0]) if shared else tuple(CANONICAL[joint] for joint in JOINTS)
        return msgspec.structs.replace(self, joints=self.joints or others)


def joints_of(bones: tuple[str, ...]) -> tuple[str, ...]:
    """The default joints."""
    return JOINTS if set(JOINTS) <= set(bones) else bones


def features(clip: Clip, recipe: FeatureRecipe, stretch: float = 1.0) -> Array:
    """The features of a clip, shape (frames at the recipe's rate, channels); MotiondeckError if it lacks a joint.

    A clip that lacks the recipe's joints is converted to the canonical body, which has the same ones. `stretch` is a
    factor on the duration of the motion.
    """
    base = resampled(still_features(clip, recipe), clip.rate / stretch, recipe.rate)
    return with_velocity(base, recipe.rate) if recipe.velocity else base


def still_features(clip: Clip, recipe: FeatureRecipe) -> Array:
    """The features without velocities of each frame of a clip, shape (T, channels); see `features`."""
    joints = recipe.joints or joints_of(clip.skeleton.bones)
    if not set(joints) <= set(clip.skeleton.bones):
        with contextlib.suppress(FileFormatError):
            own, canonical = to_canonical(clip), tuple(CANONICAL.get(joint, joint) for joint in joints)
            if set(canonical) <= set(own.skeleton.bones):
                clip, joints = own, canonical
    missing = [joint for joint in joints if joint not in clip.skeleton.bones]
    if missing:
        raise MotiondeckError(
            f"{clip.source or clip.name}: skeleton '{clip.skeleton.name}' has no bone {', '.join(missing[:4])}, which "
            f"the features need (it has: {', '.join(clip.skeleton.bones[:6])}, ...). Train with this kind of skeleton."
        )
    index = [clip.skeleton.index(joint) for joint in joints]
    if recipe.kind == "positions":
        base = _positions(clip, index, recipe.heading) / POSITION_UNIT
    else:
        parent, bones = clip.skeleton.parent[index] + 1, np.array(index) + 1
        local = multiply(conjugate(clip.rotation[:, parent]), clip.rotation[:, bones])
        base = to_rotation_vector(normalise(local)).reshape(len(clip), -1) / ANGLE_UNIT
    if recipe.height:
        base = np.column_stack([base, clip.root_position[:, 2] / POSITION_UNIT])
    return base


def with_velocity(base: Array, rate: float) -> Array:
    """Channels and their velocities, shape (T, 2 C); the first frame's velocity repeats the second's."""
    if len(base) < 2:
        return np.concatenate([base, np.zeros_like(base)], axis=1)
    velocity = np.diff(base, axis=0, prepend=base[:1]) * (rate * POSITION_UNIT / VELOCITY_UNIT)
    velocity[0] = velocity[1]
    return np.concatenate([base, velocity], axis=1)


def resampled(frames: Array, rate: float, wanted: float) -> Array:
    """Frames (T, C) at one rate, linearly interpolated at another; the first frame stays."""
    at = np.arange(int(np.floor((len(frames) - 1) * wanted / rate + 1e-9)) + 1) * (rate / wanted)
    low = np.minimum(at.astype(np.int64), len(frames) - 1)
    high = np.minimum(low + 1, len(frames) - 1)
    share = (at - low)[:, None]
    return (1.0 - share) * frames[low] + share * frames[high]


def _positions(clip: Clip, index: list[int], heading: bool) -> Array:
    joints = clip.joints()
    root = joints[:, :1]
    if is_canonical(clip.skeleton):  # its root may lie anywhere in the pelvis
        root = joints[:, [1 + clip.skeleton.index(hip) for hip in ("lhip", "rhip")]].mean(axis=1, keepdims=True)
    seen = joints[:, 1:][:, index] - root
    if heading:
        seen = rotate(conjugate(yaw(clip.heading()))[:, None], seen)
    return seen.reshape(len(clip), -1)
