"""The floor of a recording, from where feet stand: low and slow.

A file may have no height (the hips stay at one), a floor elsewhere than at 0, a floor that slopes because the camera
did, or one that sinks or rises with time. What has no contact with a floor stays as it is.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from controller.motion.canonical.canonical_body import CANONICAL_BONES, to_canonical
from controller.motion.clip import Clip, Decision, runs
from controller.motion.rotations import Array, between, dot, multiply, normalise, rotate
from controller.motion.upper_body import RESTS
from motiondeck_base.errors import FileFormatError

LOW, SLOW, STANDS = 0.05, 0.3, 0.1  # m above the body's lowest joint, m/s, s: a foot that stands
PIECE = 0.5  # s: longer contacts are taken apart, and so show a floor that moves
SPEED_SECONDS = 0.05
FEWEST, SHARE = 2, 0.08  # contacts, and the least share of time with one
SOLE = 0.045  # legs: from the floor to the joint of the toes of a foot that stands
ANKLE = 0.09  # legs: to the ankle
AT_ZERO = (-0.04, 0.11)  # m: feet that stand this high stand on a floor at 0
NO_HEIGHT, BELOW = 0.05, 0.3  # legs: hips that stay within, with feet this far below 0
FIXED, RISES = 1e-4, 0.15  # m: hips that never rise above a floor from which the lowest foot does
SMOOTHED = 0.1  # s
# Of a floor that slopes or drifts: the fewest contacts, the least rise, m, the steepest slope, and what must remain of
# the contacts' deviations, which themselves are at most FLAT, m.
CONTACTS, LEAST_RISE, STEEPEST, REMAINS, FLAT = 4, 0.06, 0.27, 0.4, 0.015
LEAST_SLOPE = 0.026  # the floors of good recordings slope by up to 1.3 degrees
PERHAPS = 0.6  # of the contacts' deviations remain at most on a floor that may slope
STEADIER = 0.8  # by so much less must then vary how low the body comes, with any joint, in each second
STEPS = 0.1  # m: contacts whose heights differ by more are on steps, or the floor is not level
LEANS, RUNS = 6.5, 1.8  # degrees, m/s: a body that does not run round a curve seldom leans aside by more
WIDE = 0.5  # m: contacts that lie nearer to each other in a direction do not show a slope in it
LEVEL = 0.05  # m: contacts this far above the lowest are on the same floor
OVERRULE = "--ground none, or its height in the file, m"


@dataclass(frozen=True)
class Contacts:
    """K spans of time in which a foot stands."""

    at: Array  # middle, s, (K,)
    lasts: Array  # s, (K,)
    place: Array  # of the joint of the toes, mean, (K, 3), m
    climbs: Array  # speed upwards, m/s, (K,)


def contacts_of(joints: Array, rate: float) -> Contacts:
    """Where feet stand, from landmarks of the canonical body, root first, shape (T, 20, 3)."""
    found: list[tuple[float, float, Array, float]] = []
    width = max(1, round(SPEED_SECONDS * rate))
    lowest = joints[..., 2].min(axis=1)
    for toes in (joints[:, _index("lfoo")], joints[:, _index("rfoo")]):
        if len(toes) <= width:
            continue
        ahead = np.linalg.norm(toes[width:] - toes[:-width], axis=-1) * rate / width
        slow = np.concatenate([np.full(width // 2, np.inf), ahead, np.full(width - width // 2, np.inf)]) < SLOW
        for begin, until in runs(slow & (toes[:, 2] - lowest < LOW)):
            if until - begin < max(2.0, STANDS * rate):
                continue
            edges = np.linspace(begin, until, 1 + max(1, int((until - begin) / (PIECE * rate)))).astype(int)
            for first, end in pairwise(edges.tolist()):
                time = np.arange(first, end) / rate
                climbs = float(np.polyfit(time - time.mean(), toes[first:end, 2], 1)[0])
                found.append((float(time.mean()), (end - first) / rate, toes[first:end].mean(axis=0), climbs))
    at, lasts, place, climbs = (np.array([one[part] for one in found]) for part in range(4))
    return Contacts(at, lasts, place.reshape(-1, 3), climbs)


def grounded(clip: Clip, wanted: float | str) -> tuple[Clip, Decision]:
    """A clip of a body with legs on a floor at height 0; `wanted` is "auto", "none", or its height in the file, m."""

    def decision(decided: str, evidence: str, *, notable: bool = True) -> Decision:
        return Decision("ground", decided, evidence, OVERRULE, notable)

    if wanted == "none":
        return clip, decision("as in the file", "as given", notable=False)
    if isinstance(wanted, float | int):
        return _raised(clip, -float(wanted)), decision(f"at {wanted:g} m", "as given")
    try:
        own = to_canonical(clip)
    except FileFormatError:
        return clip, decision("as in the file", "it has no legs", notable=False)
    joints, leg = own.joints(), own.skeleton.leg_length
    hips = 0.5 * (joints[:, _index("lhip"), 2] + joints[:, _index("rhip"), 2])
    lowest = _lowest(joints, leg)
    if RESTS in clip.decisions:
        decided, evidence = "the feet of the legs that rest stand on it at all times", "they were not recorded"
        return _raised(clip, -_smoothed(lowest, clip.rate)), decision(decided, evidence)
    rises = min(float(np.ptp(hips)), float(np.ptp(clip.root_position[:, 2])))
    deep = np.median(lowest) < -BELOW * leg and abs(float(hips.mean())) < BELOW * leg
    if (deep and rises < NO_HEIGHT * leg) or (rises < FIXED and np.ptp(lowest) > RISES):
        evidence = f"the hips stay at {hips.mean():.2f} m, the lowest foot at {np.median(lowest):.2f} m"
        decided = "the lowest foot stands on it at all times, so what leaves the floor is lost"
        return _raised(clip, -_smoothed(lowest, clip.rate)), decision(decided, evidence)
    feet = contacts_of(joints, clip.rate)
    if len(feet.at) < FEWEST or feet.lasts.sum() < SHARE * clip.duration:
        evidence = "no foot stands" if not len(feet.at) else f"feet stand for {feet.lasts.sum():.2f} s only"
        return clip, decision("as in the file, not checked", evidence)
    levelled = _levelled(clip, feet)
    if levelled is not None:
        taken, decided, evidence = levelled
        again = to_canonical(taken).joints()
        if _unsteady(_lowest(again, leg), clip.rate) < STEADIER * _unsteady(lowest, clip.rate):
            height = _height(contacts_of(again, clip.rate)) - SOLE * leg
            return _raised(taken, -height), decision(decided, evidence)
    height = _height(feet)
    evidence = f"feet stand for {feet.lasts.sum():.1f} s, the lowest of them at {height:.3f} m"
    if AT_ZERO[0] < height < AT_ZERO[1]:
        doubt = _unlevel(joints, feet, clip.rate)
        decided = "at 0, but it may slope or drift, or there are steps" if doubt else "at 0"
        if not doubt and (len(feet.at) < CONTACTS or np.ptp(feet.place[:, :2], axis=0).max() < WIDE):
            # The same words for all, which a report says once.
            decided, doubt = "at 0, not checked for a slope", "feet stand too seldom, or in one place, to show one"
        return clip, decision(decided, doubt or evidence, notable=bool(doubt))
    height -= SOLE * leg
    return _raised(clip, -height), decision(f"at {height:.3f} m of the file", evidence)


def _unlevel(joints: Array, feet: Contacts, rate: float) -> str:
    """What says that the floor is not level though no slope or drift fits; empty if nothing does."""
    if np.ptp(feet.place[:, 2]) > STEPS:
        return f"feet stand at heights from {feet.place[:, 2].min():.2f} to {feet.place[:, 2].max():.2f} m"
    if len(feet.at) >= CONTACTS:
        height, weight = feet.place[:, 2], np.sqrt(feet.lasts)
        plane, slope = _fitted(feet.place[:, :2], height, weight, WIDE)
        before = _deviation(height - np.average(height, weights=weight**2), weight)
        if (steep := float(np.hypot(*slope))) > LEAST_SLOPE and _deviation(plane, weight) < PERHAPS * before:
            return f"feet stand as on a floor that slopes by {np.degrees(np.arctan(steep)):.1f} degrees"
    hips, ankles = (0.5 * (joints[:, _index("l" + end)] + joints[:, _index("r" + end)]) for end in ("hip", "ank"))
    across = normalise((joints[:, _index("lhip")] - joints[:, _index("rhip")]) * [1.0, 1.0, 0.0])
    line = joints[:, _index("neck")] - ankles
    leans = float(np.degrees(np.median(np.arctan2(dot(line, across), line[:, 2]))))
    speed = float(np.linalg.norm(hips[-1, :2] - hips[0, :2])) * rate / len(hips)
    if abs(leans) > LEANS and speed < RUNS:
        side = "left" if leans > 0.0 else "right"
        return f"the body leans by {abs(leans):.0f} degrees to the {side} most of the time"
    return ""


def _levelled(clip: Clip, feet: Contacts) -> tuple[Clip, str, str] | None:
    """The clip on a level floor, what was decided, and why; None if its floor is level."""
    count = len(feet.at)
    height = feet.place[:, 2]
    if count < CONTACTS or np.ptp(height) < LEAST_RISE:
        return None
    weight = np.sqrt(feet.lasts)
    before = _deviation(height - np.average(height, weights=weight**2), weight)
    plane, slope = _fitted(feet.place[:, :2], height, weight, WIDE)
    line, drift = _fitted(feet.at[:, None], height, weight)
    steep = float(np.hypot(*slope))
    climbs = float(np.average(feet.climbs, weights=feet.lasts))
    # A drifting floor takes standing feet along; on a slope they stand still.
    drifts = np.sign(climbs) == np.sign(drift[0]) and 0.5 * abs(drift[0]) < abs(climbs) < 2.0 * abs(drift[0])
    rise = float(abs(drift[0]) * np.ptp(feet.at)) if drifts else float(np.ptp(feet.place[:, :2] @ slope))
    after = _deviation(line if drifts else plane, weight)
    if rise < LEAST_RISE or after > REMAINS * before or after > FLAT:
        return None
    figures = f"{count} contacts deviate by {1000 * before:.0f} mm, and then by {1000 * after:.0f} mm"
    if drifts:
        time = np.arange(len(clip)) / clip.rate
        taken = _raised(clip, -drift[0] * (time - time[0]))
        return taken, f"it {'sinks' if drift[0] < 0 else 'rises'} by {1000 * abs(drift[0]):.0f} mm/s: levelled", figures
    if not LEAST_SLOPE < steep < STEEPEST:
        return None
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.hypot(steep, 1.0)
    turn = between(normal, np.array([0.0, 0.0, 1.0]))
    middle = np.average(feet.place, axis=0, weights=feet.lasts)
    position = middle + rotate(turn, clip.root_position - middle)
    rotation = multiply(np.broadcast_to(turn, clip.rotation.shape), clip.rotation)
    taken = replace(clip, root_position=position, rotation=rotation)
    return taken, f"it slopes by {np.degrees(np.arctan(steep)):.1f} degrees: levelled", figures


def _fitted(places: Array, height: Array, weight: Array, wide: float = 0.0) -> tuple[Array, Array]:
    """What remains of heights (K,) over a plane or a line through places (K, D), and its slope (D,)."""
    # There is no slope in directions in which the places extend less than `wide`.
    aside = places - np.average(places, axis=0, weights=weight**2)
    axes = np.linalg.svd(aside, full_matrices=False)[2]
    axes = axes[np.ptp(aside @ axes.T, axis=0) > wide]
    level = np.average(height, weights=weight**2)
    along = np.linalg.lstsq(aside @ axes.T * weight[:, None], (height - level) * weight, rcond=None)[0]
    slope = np.asarray(along @ axes, dtype=np.float64)
    return height - level - aside @ slope, slope


def _deviation(off: Array, weight: Array) -> float:
    return float(np.sqrt(np.average(np.square(off), weights=weight**2)))


def _height(feet: Contacts) -> float:
    """The median height of the contacts on the lowest floor that has a tenth of them."""
    order = np.argsort(feet.place[:, 2])
    height, until = feet.place[order, 2], np.cumsum(feet.lasts[order])
    same = height < height[np.searchsorted(until, 0.1 * until[-1])] + LEVEL
    until = until[same]
    return float(height[np.searchsorted(until, 0.5 * until[-1])])


def _lowest(joints: Array, leg: float) -> Array:
    """How far the lowest point of the body is above 0, (T,), m: soles below toes and ankles, else joints."""
    below = np.zeros(joints.shape[1])
    for side in "lr":
        below[_index(side + "foo")], below[_index(side + "ank")] = SOLE * leg, ANKLE * leg
    return (joints[..., 2] - below).min(axis=1)


def _unsteady(lowest: Array, rate: float) -> float:
    """The variation of the lowest height (T,) in each second, m."""
    pieces = np.array_split(lowest, max(2, round(len(lowest) / rate)))
    return float(np.ptp([piece.min() for piece in pieces]))


def _smoothed(values: Array, rate: float) -> Array:
    width = 2 * round(0.5 * SMOOTHED * rate) + 1
    return np.convolve(np.pad(values, width // 2, mode="edge"), np.ones(width) / width, "valid")


def _raised(clip: Clip, by: NDArray[np.float64] | float) -> Clip:
    position = clip.root_position.copy()
    position[:, 2] += by
    return replace(clip, root_position=position)


def _index(bone: str) -> int:
    return 1 + CANONICAL_BONES.index(bone)
