"""Keeps feet that stand from sliding where a loop was closed.

What is eased out at a seam moves the hips against a foot that stands, while the path of the root stays: the foot
slides, by up to 40 mm in each round. The root is moved along the ground instead, as far as feet that stand move
otherwise than recorded. Limbs and heights stay as they are.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from controller.learning.preparation.loops import Seam
from controller.motion.encodings.bone_directions import FORWARD, LEFT, TURN_RATE
from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array

FEET = ("lfoo", "rfoo")
STILL, MOVES = 0.15, 0.4  # m/s: a foot slower than the first stands, one faster than the second does not
APART = 0.02  # m: feet nearer to each other than about this do not show a turn
GRADUAL = 0.12  # s, in which a foot is taken hold of, and let go
LOW, LIFTED = 0.04, 0.08  # m above the lowest place of a foot: it stands below the first, and not above the second


def pinned(encoding: Encoding, loop: Array, channels: Array, cut: Seam, rate: float) -> Array:
    """A loop (P, C) that was closed from a cut of channels (T, C), with feet that stand as still as recorded."""
    if not set(FEET) <= set(encoding.skeleton.bones):
        return loop
    before = channels[max(0, cut.start - 1)][None]
    recorded, _, height = _on_the_ground(encoding, np.concatenate([before, channels[cut.start : cut.end]]), rate)
    played, place, _ = _on_the_ground(encoding, np.concatenate([loop[-1:], loop]), rate)
    if cut.start == 0:
        recorded[0] = recorded[1]
    speed = np.linalg.norm(recorded, axis=-1)
    stands = _falling(speed, STILL, MOVES) * _falling(height - np.quantile(height, 0.05, axis=0), LOW, LIFTED)
    stands = uniform_filter1d(stands, max(1, round(GRADUAL * rate)), axis=0, mode="wrap")
    share = (stands / np.maximum(stands.sum(axis=1, keepdims=True), 1e-9))[..., None]
    slides = played - recorded
    # The rigid motion that is nearest to the feet's: that of their middle, and a turn about it if both stand.
    slide, middle = ((values * share).sum(axis=1, keepdims=True) for values in (slides, place))
    arm, off = place - middle, slides - slide
    weighed = stands * np.stack([arm[..., 0] * off[..., 1] - arm[..., 1] * off[..., 0], np.square(arm).sum(-1)])
    turns, inertia = weighed.sum(axis=-1)
    turn = stands.min(axis=1) * turns / (inertia + APART**2)
    out = loop.copy()
    stand = np.minimum(stands.sum(axis=1), 1.0)
    out[:, FORWARD] -= stand * (slide[:, 0, 0] + turn * middle[:, 0, 1])
    out[:, LEFT] -= stand * (slide[:, 0, 1] - turn * middle[:, 0, 0])
    out[:, TURN_RATE] -= stand * turn
    return out


def _on_the_ground(encoding: Encoding, channels: Array, rate: float) -> tuple[Array, Array, Array]:
    """Velocities, m/s, and places, m, of the feet from frame to frame, in the heading of the later one, and heights.

    Shapes (T - 1, 2, 2), twice, and (T - 1, 2).
    """
    features = 0.001 * joint_features(encoding, channels)
    joints = features[:, :-1].reshape(len(channels), -1, 3)
    feet = joints[:, [encoding.skeleton.index(foot) for foot in FEET]]
    turn = channels[1:, TURN_RATE, None] / rate
    x, y = feet[:-1, :, 0], feet[:-1, :, 1]
    cos, sin = np.cos(turn), np.sin(turn)
    earlier = np.stack([cos * x + sin * y, cos * y - sin * x], axis=-1)
    velocity = channels[1:, None, FORWARD : LEFT + 1] + rate * (feet[1:, :, :2] - earlier)
    return velocity, feet[1:, :, :2], feet[1:, :, 2] + features[1:, -1:]


def _falling(values: Array, least: float, most: float) -> Array:
    """1 below the least of two values, 0 above the most."""
    return np.clip((most - values) / (most - least), 0.0, 1.0)
