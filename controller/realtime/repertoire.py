"""What the deck knows of the motions of a library: where each can be entered and left, and how briskly it turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controller.evaluation.matching import joint_features
from controller.realtime.transition import Briskness
from controller.rotations import Array
from controller.training.library import MotionLibrary

ENTRY_SHARE = 0.1
HELD_M = 0.02
LEAST_ACCELERATION = 2.0  # m/s^2; less is standing still


@dataclass(frozen=True)
class Motion:
    """One motion of a repertoire.

    Attributes:
        name: what it is called.
        loop: whether it goes on for ever.
        places, velocities: joint positions in the heading frame and their rates at the anchors where it may be entered,
            shape (A, F), m and m/s.
        exits: the same positions where it may be left: anywhere in a loop, else its last pose, shape (E, F), m.
        spacing: from anchor to anchor, s.
        seconds: how long a loop's round takes, or how long it takes until only the last pose is held.
        briskness: the largest acceleration of any joint in the world, and the largest speed of each.
    """

    name: str
    loop: bool
    places: Array
    velocities: Array
    exits: Array
    spacing: float
    seconds: float
    briskness: Briskness


def read_repertoire(library: MotionLibrary) -> dict[str, Motion]:
    """The motions of a library by name; one that happens once may be entered at its beginning only."""
    repertoire = {}
    for info in library.info.motions:
        frames = library.network.anchors(info.name)
        spacing = info.frames / len(frames) / library.info.rate
        loop = info.plays == "loop"
        places = 1e-3 * joint_features(library.encoding, frames)
        velocities = _rate(places, spacing, loop=loop)
        moving = len(frames) if loop else _moving(places)
        entries = moving if loop else max(1, int(ENTRY_SHARE * moving))
        repertoire[info.name] = Motion(
            name=info.name,
            loop=loop,
            places=places[:entries],
            velocities=velocities[:entries],
            exits=places if loop else places[-1:],
            spacing=spacing,
            seconds=moving * spacing,
            briskness=_briskness(places, library.encoding.decode(frames).velocity, spacing),
        )
    return repertoire


def _moving(places: Array) -> int:
    """How many frames it takes until only the last pose is held."""
    away = np.abs(places - places[-1]).max(1) > HELD_M
    return int(np.flatnonzero(away)[-1]) + 1 if away.any() else len(places)


def _rate(values: Array, spacing: float, *, loop: bool) -> Array:
    """Central differences along the first axis, round the corner for loops."""
    if loop:
        return (np.roll(values, -1, axis=0) - np.roll(values, 1, axis=0)) / (2.0 * spacing)
    return np.gradient(values, spacing, axis=0)


def _briskness(places: Array, velocity: Array, spacing: float) -> Briskness:
    """Peaks over places (A, F) and the root's velocity along the ground (A, 2) at the anchors."""
    count = len(places)
    joints = np.concatenate([np.zeros((count, 1, 3)), places[:, :-1].reshape(count, -1, 3)], axis=1)
    speed = np.linalg.norm(np.diff(joints, axis=0), axis=-1).max(0) / spacing
    acceleration = np.diff(joints, n=2, axis=0) / spacing**2
    acceleration[..., :2] += np.diff(velocity, axis=0)[1:, None] / spacing
    acceleration[..., 2] += np.diff(places[:, -1], n=2)[:, None] / spacing**2
    return Briskness(max(float(np.linalg.norm(acceleration, axis=-1).max()), LEAST_ACCELERATION), speed)
