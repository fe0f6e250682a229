"""Conceptors as logic: aperture, quota, AND, OR, NOT, similarity (Jaeger 2014, sections 3.8 - 3.14; eqs 3.9, 3.10 of
Deliallisi 2017).

A conceptor C is a symmetric matrix with eigenvalues in [0, 1]: how much of each direction of the state it lets through.
These functions take and give dense matrices of shape (N, N); playback does not need them.
"""

import numpy as np

from controller.motion.rotations import Array
from controller.networks.signals import square, time_series
from motiondeck_base.errors import MotiondeckError

SHARP = 1e-9  # below this an eigenvalue counts as 0, and above 1 minus this as 1: rounding leaves no exact ones


def correlation(states: Array) -> Array:
    """R = X X' / N of states (T, N), with the thesis's 1 / N (eq. 3.9), shape (N, N).

    MotiondeckError if the states are not of that shape, or a number is not finite.
    """
    states = time_series(states, "the states")
    return states.T @ states / states.shape[1]


def conceptor(correlations: Array, aperture: float = 10.0) -> Array:
    """C = R (R + alpha^-2 I)^-1 (eq. 3.10), eigenvalues in [0, 1); MotiondeckError for a bad aperture or shape of R."""
    correlations = square(correlations, "a correlation matrix")
    if not (np.isfinite(aperture) and aperture > 0.0):
        raise MotiondeckError(f"aperture {aperture} is not a positive number")
    values, vectors = np.linalg.eigh(_symmetric(correlations))
    values = np.maximum(values, 0.0)
    return _compose(values / (values + aperture**-2), vectors)


def adapt_aperture(c: Array, factor: float) -> Array:
    """phi(C, gamma) = C (C + gamma^-2 (I - C))^-1: the conceptor with its aperture multiplied by gamma in [0, inf].

    MotiondeckError if the factor is negative or not a number, or the conceptor is not square.
    """
    if not factor >= 0.0:
        raise MotiondeckError(f"aperture factor {factor} is not a number of at least 0")
    values, vectors = _eigen(c)
    if factor == 0.0:
        return _compose(np.where(values >= 1.0 - SHARP, 1.0, 0.0), vectors)
    if np.isinf(factor):
        return _compose(np.where(values <= SHARP, 0.0, 1.0), vectors)
    return _compose(values / (values + (1.0 - values) / factor**2), vectors)


def quota(c: Array) -> float:
    """The mean eigenvalue: the share of the reservoir's space that a conceptor claims."""
    c = square(c, "a conceptor")
    return float(np.trace(c) / len(c))


def negation(c: Array) -> Array:
    """NOT C = I - C: what C does not let through."""
    c = square(c, "a conceptor")
    return np.eye(len(c)) - c


def conjunction(c: Array, b: Array) -> Array:
    """C AND B = (C^-1 + B^-1 - I)^-1 on the directions that both know, nothing elsewhere (Jaeger 2014, section 3.9).

    MotiondeckError if they are not square matrices of one size.
    """
    c, b = _pair(c, b)
    # The directions that neither excludes: those orthogonal to both null spaces.
    excluded: Array = _null_projector(c) + _null_projector(b)
    values, vectors = np.linalg.eigh(_symmetric(excluded))
    shared = vectors[:, values < 1e-6]
    if shared.shape[1] == 0:
        return np.zeros_like(c)
    inside: Array = shared.T @ (_pseudo_inverse(c) + _pseudo_inverse(b) - np.eye(len(c))) @ shared
    inverse = np.asarray(np.linalg.inv(_symmetric(inside)), dtype=np.float64)
    return _symmetric(shared @ inverse @ shared.T)


def disjunction(c: Array, b: Array) -> Array:
    """C OR B = NOT (NOT C AND NOT B): what either lets through."""
    return negation(conjunction(negation(c), negation(b)))


def similarity(c: Array, b: Array) -> float:
    """|C^1/2 B^1/2|^2 / (|C| |B|) with Frobenius norms: 1 for equal ones, 0 where they share no direction.

    0 as well where one of them lets nothing through. MotiondeckError if they are not square matrices of one size.
    """
    c, b = _pair(c, b)
    sizes = float(np.linalg.norm(c) * np.linalg.norm(b))
    # |C^1/2 B^1/2|^2 = trace(C B)
    return float(np.sum(c * b)) / sizes if sizes > 0.0 else 0.0


def attenuation(c: Array, correlations: Array) -> float:
    """The share of a signal's energy that a conceptor takes away, E|x - C x|^2 / E|x|^2, for states of correlation R.

    Running free with a conceptor, the aperture at which this is least is a good one (Jaeger 2014, section 3.8.5).
    MotiondeckError if they are not square matrices of one size.
    """
    c, correlations = _pair(c, correlations)
    rest = np.eye(len(c)) - c
    energy = float(np.trace(correlations))
    return float(np.sum((rest @ correlations) * rest)) / energy if energy > 0.0 else 0.0


def _pair(first: Array, second: Array) -> tuple[Array, Array]:
    first = square(first, "the first conceptor")
    return first, square(second, "the second matrix", len(first))


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


def _compose(values: Array, vectors: Array) -> Array:
    return _symmetric((vectors * values) @ vectors.T)


def _eigen(c: Array) -> tuple[Array, Array]:
    values, vectors = np.linalg.eigh(_symmetric(square(c, "a conceptor")))
    return np.clip(values, 0.0, 1.0), vectors


def _pseudo_inverse(c: Array) -> Array:
    values, vectors = _eigen(c)
    return _compose(np.where(values > SHARP, 1.0 / np.maximum(values, SHARP), 0.0), vectors)


def _null_projector(c: Array) -> Array:
    values, vectors = _eigen(c)
    return _compose(np.where(values > SHARP, 0.0, 1.0), vectors)
