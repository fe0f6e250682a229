"""What a motion is known by: how fast and how far legs, arms and trunk move.

Three numbers a part of the body: the frequency of the one center that explains most of it, the mean frequency of its
movement, and how far it moves. All are positive and compared by their logarithms (`motion_index`).
"""

from __future__ import annotations

import numpy as np

from controller.motion.anatomy import Part, anatomy
from controller.motion.encodings.encoding import Encoding
from controller.motion.rotations import Array
from motiondeck_base.errors import MotiondeckError

PARTS: dict[str, tuple[Part, ...]] = {
    "legs": ("hip", "thigh", "shank", "foot"),
    "arms": ("clavicle", "upper arm", "forearm", "hand"),
    "trunk": ("trunk", "neck", "head"),
}
NUMBERS_A_PART = 3

RATE = 30.0
SHORTEST_SECONDS = 0.4
CENTERS_TRIED = 80
FASTEST_HZ = 6.0
LEAST_TURNS, LEAST_HZ = 0.5, 0.2

# Where nothing moves there are no frequencies; this much, m, moves always.
STILL = 1e-4


def signature(encoding: Encoding, channels: Array, rate: float) -> Array:
    """The numbers of a motion of channels (T, C) at a rate in Hz, shape (9,): those of legs, arms and trunk in turn.

    Raises:
        MotiondeckError: if it lasts less than SHORTEST_SECONDS.
    """
    stride = max(1, round(rate / RATE))
    kept = channels[::stride]
    time = np.arange(len(kept)) * stride / rate
    if len(kept) < 2 or time[-1] < SHORTEST_SECONDS:
        raise MotiondeckError(
            f"a motion of {len(channels) / rate:.2f} s is too short to tell its frequencies. Give a longer one."
        )
    joints = encoding.skeleton.chain @ (encoding.directions(kept) * encoding.skeleton.length[:, None])
    body = anatomy(encoding.skeleton)
    numbers = []
    for part, kinds in PARTS.items():
        moving = joints[:, [bone for bone, kind in enumerate(body.part) if kind in kinds]].reshape(len(kept), -1)
        if part == "trunk":
            moving = np.column_stack([moving, encoding.height(kept)])
        numbers += _of_part(moving, time)
    return np.array(numbers)


def part_weights(weights: dict[str, float]) -> Array:
    """The weights of a signature's numbers, shape (9,), where parts count 1 by default.

    Raises:
        MotiondeckError: if there is no such part.
    """
    for part in weights:
        if part not in PARTS:
            raise MotiondeckError(f"there is no part '{part}'; parts are {', '.join(PARTS)}")
    return np.repeat([weights.get(part, 1.0) for part in PARTS], NUMBERS_A_PART)


def _of_part(moving: Array, time: Array) -> list[float]:
    """Best center and mean frequency, rad/s, and extent, m, of coordinates (T, F)."""
    centred = moving - moving.mean(0)
    clock = time - time.mean()
    steady = centred - np.multiply.outer(clock, clock @ centred / (clock @ clock))
    extent = float(np.sqrt(np.square(steady).mean())) if steady.size else 0.0
    slowest = max(LEAST_HZ, LEAST_TURNS / time[-1])
    grid = 2.0 * np.pi * np.geomspace(slowest, max(FASTEST_HZ, 2.0 * slowest), CENTERS_TRIED)
    if extent <= STILL:
        return [float(grid[0]), float(grid[0]), STILL]
    waves = np.exp(1j * np.multiply.outer(grid, time))
    best = float(grid[int(np.square(np.abs(waves @ steady)).sum(1).argmax())])
    power = np.square(np.abs(np.fft.rfft(steady * np.hanning(len(time))[:, None], axis=0))).sum(1)
    hertz = np.fft.rfftfreq(len(time), time[1])
    mean = 2.0 * np.pi * float(power @ hertz / power.sum())
    return [best, max(mean, float(grid[0])), extent]
