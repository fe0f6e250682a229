"""Actors: whose bodies recordings show, and the one body of a library.

Limbs are rigid, so recordings of one actor agree in their lengths, whatever the actor does; other bones of the
canonical body span joints and differ by a few mm between takes. The body of an actor has the median of each bone over
all takes that have it. The body of a library is that of the actor nearest to those of all its recordings.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from controller.motion.canonical.canonical_body import CANONICAL_BONES, carried, landmarks_of, leg, to_canonical
from controller.motion.canonical.clip_edits import thinned
from controller.motion.clip import Clip
from controller.motion.rotations import Array, by_blocks, normalise
from controller.motion.skeleton import Skeleton
from motiondeck_base.arrays_on_disk import release

SAME_ACTOR = 0.008  # m: by the lengths of limbs, takes of an actor from markers differ by 3 mm, two actors by 17
SHARE = 0.95
RATE = 30.0  # Hz, at which wrists are looked at
_RIGID = [CANONICAL_BONES.index(side + end) for end in ("hip", "kne", "ank", "elb", "wri") for side in "lr"]
_HANDS = [1 + CANONICAL_BONES.index(side + "wri") for side in "lr"]
_HIPS = [1 + CANONICAL_BONES.index(side + "hip") for side in "lr"]


@dataclass(frozen=True, eq=False)
class Actor:
    """A person with some motions, named after the first of their skeletons."""

    name: str
    motions: tuple[str, ...]
    body: Skeleton  # canonical
    limbs: Array  # lengths of the limbs of one take, m


def actors_of(clips: Mapping[str, Clip]) -> list[Actor]:
    """The actors of recordings, by motion, sorted by name; FileFormatError without two legs."""
    takes = sorted(((clip.skeleton.name, motion, clip) for motion, clip in clips.items()), key=lambda take: take[:2])
    alike: list[list[tuple[str, Skeleton, list[str]]]] = []  # motion, canonical body and what it lacks, by actor
    bodies = {id(clip): to_canonical(clip).skeleton for clip in {id(clip): clip for clip in clips.values()}.values()}
    for _, motion, clip in takes:
        body = bodies[id(clip)]
        lacking = [] if clip.skeleton is body else landmarks_of(clip.skeleton).lacking
        for known in alike:
            if np.abs(body.length[_RIGID] - known[0][1].length[_RIGID]).max() < SAME_ACTOR:
                known.append((motion, body, lacking))
                break
        else:
            alike.append([(motion, body, lacking)])
    return [_actor(known) for known in alike]


def _actor(takes: list[tuple[str, Skeleton, list[str]]]) -> Actor:
    bodies = [body for _, body, _ in takes]
    length = np.array([body.length for body in bodies])
    known = np.array([[bone not in lacking for bone in CANONICAL_BONES] for _, _, lacking in takes])
    known[:, ~known.any(axis=0)] = True
    median = [float(np.median(length[known[:, bone], bone])) for bone in range(len(CANONICAL_BONES))]
    rest = normalise(np.median([body.rest_direction for body in bodies], axis=0))
    first = bodies[0]
    motions = tuple(motion for motion, _, _ in takes)
    return Actor(first.name, motions, replace(first, length=np.array(median), rest_direction=rest), length[0, _RIGID])


def nearest_to_all(actors: list[Actor]) -> Actor:
    """The actor whose limbs differ least from those of all motions."""

    def apart(one: Actor) -> float:
        return sum(len(other.motions) * float(np.abs(one.limbs - other.limbs).max()) for other in actors)

    return min(actors, key=lambda one: (round(apart(one), 6), one.name))


def hands_off(clip: Clip, body: Skeleton) -> float:
    """How far wrists are off on another body, mm: 95 % of the frames, seen from the hips, scaled by the leg."""
    own = to_canonical(thinned(clip, RATE))
    ratio = leg(own.skeleton) / leg(body)

    def off(root: Array, rotation: Array) -> Array:
        release()
        part = replace(own, root_position=root, rotation=rotation)
        apart = part.joints() - ratio * carried(part, body).joints()
        return np.linalg.norm(apart[:, _HANDS] - apart[:, _HIPS].mean(axis=1, keepdims=True), axis=-1).max(axis=1)

    return 1000.0 * float(np.quantile(by_blocks(off, own.root_position, own.rotation), SHARE))
