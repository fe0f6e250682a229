"""Predicts the motion of one person at any value of an input, from recordings of several people.

Two people at the same speed may differ more than one person at two speeds, in posture and in the swing of limbs. The
channels of a person at a value of the input, as a level u in [-1, 1], are modelled as

    y(u) = c + d u + f(u) + g + e

with a line c + d u and a Gaussian process f with the covariance exp(-(u - u')^2 / 2), the effect of the input on all
people; g, the offset of the person, with the variance MANNER; and e, the noise of a recording, with the variance NOISE.
The best linear unbiased prediction of all but e (universal kriging: Cressie 1993, section 3.4) is a weighted sum of the
recordings,

    w = k K^-1 + (b - k K^-1 B) (B' K^-1 B)^-1 B' K^-1

with K the covariance of the recordings, k that of the prediction with them, and rows (1, u) of each in B and b. The
weights are the same for every channel and frame. They add up to 1 and keep lines, and so the speed of a body.
"""

from collections.abc import Sequence

import numpy as np

from controller.learning.preparation.training_motion import Variant
from controller.motion.rotations import Array

MANNER, NOISE = 1.0, 0.1  # of the variance of f


def person_variants(
    person: str, variants: Sequence[Variant], people: Sequence[str], values: Sequence[float]
) -> list[Variant]:
    """The predicted motion of a person at `values` of the input; an unknown name gives the average person.

    `variants` are aligned recordings, at two different values at least, and `people` their persons' names.
    """
    known = np.array([variant.value for variant in variants])
    least, most = known.min(), known.max()
    levels, wanted = (2.0 * (at - least) / (most - least) - 1.0 for at in (known, np.asarray(values)))
    own = np.array(people)
    covariance = _alike(levels, levels) + MANNER * (own[:, None] == own) + NOISE * np.eye(len(own))
    inverse = np.linalg.inv(covariance)
    line, there = (np.column_stack([np.ones_like(at), at]) for at in (levels, wanted))
    weights = (_alike(wanted, levels) + MANNER * (own == person)) @ inverse
    weights += (there - weights @ line) @ np.linalg.solve(line.T @ inverse @ line, line.T @ inverse)
    frames = np.tensordot(weights, [variant.frames for variant in variants], 1)
    seconds = np.exp(weights @ np.log([variant.seconds for variant in variants]))
    return [Variant(*one) for one in zip(values, seconds.tolist(), frames, strict=True)]


def _alike(one: Array, other: Array) -> Array:
    """The covariance of f between levels (A,) and (B,), shape (A, B)."""
    return np.exp(-0.5 * np.square(one[:, None] - other))
