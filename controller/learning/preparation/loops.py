"""Closes loops, without sliding feet, and brings one-shots to rest.

A periodic motion is cut where it is nearest to itself; the remaining mismatch in value and slope is shared by both
sides of the seam and eased out. A one-shot is eased into a hold at its end.

Channels that are velocities (of the path, of the heading) are noisy differences of frames. Their values at a seam are
means over SLOPE_SECONDS, and the corrections on both sides cancel: a loop turns as far as its recording.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from controller.motion.clip import between_frames
from controller.motion.encodings.bone_directions import FORWARD, LEFT, TURN_RATE
from controller.motion.encodings.encoding import Encoding
from controller.motion.encodings.motion_matching import joint_features
from controller.motion.rotations import Array

HOLD_SECONDS = 1.0  # at rest after a one-shot
EASE_SECONDS = 0.2  # of the end of a one-shot, in which it comes to rest
SEAM_SECONDS = 0.4  # on either side of a seam, in which the mismatch is eased out at the latest
SHARPEST = 0.03  # s, of tau
TINY = 1e-9  # in place of no acceleration
VELOCITY_SECONDS = 1.0 / 15.0  # weight of a mismatch in velocity
SLOPE_SECONDS = 1.0 / 15.0  # over which a slope is measured
ALIKE = 1e-6  # m: of seams with more similar mismatches the longest loop is taken
MOST_STARTS = 1200  # tried first; longer clips are searched with a stride, then around the best
FEET = ("lfoo", "rfoo")
STILL, MOVES = 0.15, 0.4  # m/s: a foot slower than the first stands, one faster than the second does not
APART = 0.02  # m: feet nearer to each other than about this do not show a turn
GRADUAL = 0.12  # s, in which a foot is taken hold of, and let go
LOW, LIFTED = 0.04, 0.08  # m above the lowest place of a foot: it stands below the first, and not above the second


@dataclass(frozen=True)
class Seam:
    """The cut of a clip into a loop."""

    start: int
    end: int  # the frame nearest to the start, which is left out
    mismatch: float  # of their features with velocities (root of the sum of squares)


def best_seam(features: Array, rate: float, *, at_least: float) -> Seam:
    """The seam with the least mismatch of joint positions (T, F) at a rate in Hz; the loop keeps a share `at_least`."""
    seen = with_velocities(features, rate)
    frames = len(features)
    shortest = max(2, int(at_least * frames))
    stride = max(1, -(-frames // MOST_STARTS))
    best = _best_of(seen, range(0, frames - shortest, stride), shortest, stride)
    if stride > 1:
        near = range(max(0, best.start - stride), min(frames - shortest, best.start + stride + 1))
        best = _best_of(seen, near, shortest, 1)
    return best


def in_place(features: Array) -> Array:
    """Joint positions (T, 3 B) above the ground; features (T, 3 B + 1) have them from the root, and its height last."""
    joints = features[:, : 3 * (features.shape[1] // 3)].copy()
    if joints.shape != features.shape:
        joints[:, 2::3] += features[:, -1:]
    return joints


def with_velocities(features: Array, rate: float) -> Array:
    """Features (T, F) at a rate in Hz, and their velocities times VELOCITY_SECONDS, shape (T, 2 F)."""
    return np.concatenate([features, VELOCITY_SECONDS * rate * slopes(features, rate)], axis=1)


def largest_omission(seen: Array, cut: Seam) -> float:
    """The largest distance from the loop of features with velocities (T, F) outside the cut."""
    stride = max(1, -(-len(seen) // MOST_STARTS))
    loop = seen[cut.start : cut.end : stride]
    square, farthest = np.square(loop).sum(1), 0.0
    for part in (seen[: cut.start : stride], seen[cut.end :: stride]):
        if len(part):
            apart = np.square(part).sum(1)[:, None] + square - 2.0 * part @ loop.T
            farthest = max(farthest, float(apart.min(1).max()))
    return float(np.sqrt(max(farthest, 0.0)))


def slopes(values: Array, rate: float) -> Array:
    """The change of values (T, C) a frame: differences over SLOPE_SECONDS, of second order at the ends too."""
    reach = _reach(rate)
    if len(values) <= 2 * reach:
        return np.gradient(values, axis=0)
    near, far = values[reach:], values[2 * reach :]
    central = far - values[: -2 * reach]
    first = (4.0 * near - 3.0 * values[:-reach])[:reach] - far[:reach]
    last = (3.0 * near - 4.0 * values[:-reach])[-reach:] + values[: -2 * reach][-reach:]
    return np.concatenate([first, central, last]) / (2.0 * reach)


def _reach(rate: float) -> int:
    return max(1, round(0.5 * SLOPE_SECONDS * rate))


def _best_of(seen: Array, starts: range, shortest: int, stride: int) -> Seam:
    """The best seam with one of the starts; of similar seams, that of the longest loop."""
    best, best_rank = Seam(0, len(seen) - 1, np.inf), (np.inf, 0)
    for start in starts:
        mismatch = np.sqrt(np.square(seen[start + shortest :: stride] - seen[start]).sum(1))
        steps = np.rint(mismatch / ALIKE)
        place = len(steps) - 1 - int(steps[::-1].argmin())
        length = shortest + stride * place
        if (rank := (float(steps[place]), -length)) < best_rank:
            best, best_rank = Seam(start, start + length, float(mismatch[place])), rank
    return best


def close_loop(channels: Array, cut: Seam, velocities: slice, rate: float) -> Array:
    """One period (P, C) of a clip (T, C) at a rate in Hz, whose frame 0 follows its last one.

    Half of a mismatch d in value and v in slope is removed on either side of the seam. Of all offsets e that do so, the
    one with the least integral of e^2 + tau^4 e''^2 solves e + tau^4 e'''' = 0. It is, with s = |t| / (sqrt(2) tau),

        e(t) = sign(t) d/2 exp(-s) cos s + v tau / sqrt(8) exp(-s) (sin s - cos s)

    and accelerates by at most 0.161 |d| / tau^2 + 0.354 |v| / tau. Each channel gets the tau with which that is the
    amplitude of its acceleration in the clip, so that a seam is eased as quickly as the motion itself swings.
    """
    loop = channels[cut.start : cut.end].copy()
    (value, slope), (end_value, end_slope) = (_course(channels, at, velocities, rate) for at in (cut.start, cut.end))
    apart, turned = end_value - value, rate * (end_slope - slope)
    usual = rate**2 * np.sqrt(2.0 * np.square(slopes(slopes(channels, rate), rate)).mean(0)) + TINY
    tau = (0.354 * np.abs(turned) + np.sqrt((0.354 * turned) ** 2 + 0.644 * usual * np.abs(apart))) / (2.0 * usual)
    tau[velocities] = np.inf
    softest = min(SEAM_SECONDS / 4.0, len(loop) / rate / 8.0)
    width = np.sqrt(2.0) * tau.clip(min(max(SHARPEST, 2.0 / rate), softest), softest)
    for frame, side in ((np.arange(len(loop)), 1.0), (np.arange(len(loop), 0, -1), -1.0)):
        s = frame[:, None] / rate / width
        bent = 0.25 * turned * width * (np.sin(s) - np.cos(s))
        loop += np.exp(-s) * (side * 0.5 * apart * np.cos(s) + bent)
    return loop


def eased_mm(places: Array, seam: Seam, rate: float) -> float:
    """How far joints (T, 3 B), mm, of a closed loop deviate from the recording near the seam: 95 % of them, mm."""
    off = close_loop(places, seam, slice(0), rate) - places[seam.start : seam.end]
    few = min(round(SEAM_SECONDS * rate), len(off) // 4)
    near = np.concatenate([off[:few], off[-few:]]).reshape(2 * few, -1, 3)
    return float(np.quantile(np.linalg.norm(near, axis=-1), 0.95))


def hold_end(channels: Array, velocities: slice, rate: float) -> Array:
    """A clip (T, C) at a rate in Hz that slows down onto its last frame, and holds it for a second.

    The last EASE_SECONDS take twice as long, at a pace of (1 - s)^2 (1 + 2 s) for a share s of that time; s - s^3 + s^4
    / 2 is its integral. So the body stays on recorded poses, and rests in the last of them.
    """
    last = len(channels) - 1
    ease = max(1, min(round(EASE_SECONDS * rate), last // 2))
    s = np.arange(1, 2 * ease + 1) / (2 * ease)
    beyond = 2.0 * channels[-1:] - channels[-2:-1]  # so that the curve does not slow down before its last frame
    stopping = between_frames(np.concatenate([channels, beyond]), last - ease + 2 * ease * (s - s**3 + 0.5 * s**4))
    stopping[:, velocities] *= ((1.0 - s) ** 2 * (1.0 + 2.0 * s))[:, None]
    held = np.repeat(stopping[-1:], round(HOLD_SECONDS * rate), axis=0)
    return np.concatenate([channels[: last - ease + 1], stopping, held])


def _course(channels: Array, frame: int, velocities: slice, rate: float) -> tuple[Array, Array]:
    """Value and slope (a frame) of channels (T, C) at a frame; of velocities their mean around it, and no slope.

    The slope is that of the parabola through the frames of SLOPE_SECONDS, at the ends of a clip through the last ones.
    """
    count = min(2 * _reach(rate) + 1, len(channels))
    first = min(max(0, frame - count // 2), len(channels) - count)
    around = channels[first : first + count]
    value, slope = channels[frame].copy(), np.polyfit(np.arange(count) + first - frame, around, 2)[1]
    value[velocities], slope[velocities] = around[:, velocities].mean(0), 0.0
    return value, slope


def pinned(encoding: Encoding, loop: Array, channels: Array, cut: Seam, rate: float) -> Array:
    """A loop (P, C) that was closed from a cut of channels (T, C), with feet that stand as still as recorded.

    What is eased out at a seam moves the hips against a foot that stands, while the path of the root stays: the foot
    slides, by up to 40 mm in each round. The root is moved along the ground instead, as far as feet that stand move
    otherwise than recorded. Limbs and heights stay as they are.
    """
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
